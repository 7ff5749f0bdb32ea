"""Rows of a benchmark as lines of JSON, of which `published_times.py` makes tables."""

import json
from pathlib import Path


def keep(file: str | None, **row) -> None:
    """Append a row to a file, if there is one."""
    if file is not None:
        with Path(file).open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(row) + "\n")


def kept(file: str) -> list[dict]:
    """Return all rows of a file."""
    return [json.loads(line) for line in Path(file).read_text(encoding="utf-8").splitlines()]
