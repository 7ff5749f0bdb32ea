"""Writes a history as tables."""

from __future__ import annotations

from pathlib import Path

from multiscale.results.history import COLUMNS, PATCH_COLUMNS, History
from multiscale.storage.whole_files import write_csv


def write_tables(folder: Path, history: History) -> list[Path]:
    """Write ``history.csv`` and ``patches.csv``, and of a reference ``reference.csv``.

    Args:
        folder: Where to; made when missing.
        history: The load steps.

    Returns:
        The files.
    """
    files = [
        write_csv(folder / "history.csv", COLUMNS, history.rows()),
        write_csv(folder / "patches.csv", PATCH_COLUMNS, history.patch_rows()),
    ]
    record = history.reference
    if record is not None:
        rows = record.rows(history.steps)
        files.append(write_csv(folder / "reference.csv", record.columns, rows))
    return files
