"""Keeps the cases of a sweep that are done, so that the next call goes on from them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

from geometry.errors import InputError
from multiscale.storage import written


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """What a case came to.

    Attributes:
        case: Name of the case, see `cases.Case`.
        rows: The rows of its ``history.csv``: a value for every column.
        notes: Remarks of the run on its own approximations.
        failure: Why the case ended early; empty when it did not.
    """

    case: str
    rows: Sequence[Sequence[Any]]
    notes: Sequence[str] = ()
    failure: str = ""


class Journal:
    """Files with a line for every case that is done; every process appends to its own.

    Any number of processes and of jobs may so work on one sweep without waiting for each other.

    Args:
        folder: Folder of the files; made with the first case. None stores nothing.
        scene: Text that identifies the scene that all cases start from.
    """

    def __init__(self, folder: Path | None, scene: str) -> None:
        self._folder, self._header = folder, {"scene": scene}

    def files(self) -> list[Path]:
        """Return the files that are there, in the order of their names."""
        return sorted(self._folder.glob("*.jsonl")) if self._folder else []

    def read(self, paths: Iterable[Path]) -> Iterator[CaseResult]:
        """Yield the cases that are done, from some of the files.

        Raises:
            InputError: When they are cases of another scene.
        """
        for path in paths:
            with path.open("rb") as file:
                # A process that was killed leaves its last line without an end.
                contents = (json.loads(line) for line in file if line.endswith(b"\n"))
                if next(contents, self._header) != self._header:
                    raise InputError(
                        "holds the cases of another scene", key="--out",
                        value=str(path.parent.parent), allowed="another folder, or --overwrite",
                    )  # fmt: skip
                yield from (CaseResult(**content) for content in contents)

    @contextmanager
    def appending(self, process: str) -> Iterator[Callable[[CaseResult], None]]:
        """Open the file of a process.

        Args:
            process: Name of the process, different for all that work on the sweep.

        Yields:
            The function that stores a result.
        """
        if self._folder is None:
            yield lambda result: None
            return
        path = self._folder / f"{process}.jsonl"
        with written(path):
            self._folder.mkdir(parents=True, exist_ok=True)
            with path.open("ab") as file:
                whole = path.read_bytes().rfind(b"\n") + 1
                file.truncate(whole)
                if not whole:
                    file.write(_line(self._header))
                yield lambda result: _append(file, result)


def _append(file: BinaryIO, result: CaseResult) -> None:
    file.write(_line(asdict(result)))
    file.flush()


def _line(content: dict[str, Any]) -> bytes:
    return json.dumps(content).encode() + b"\n"
