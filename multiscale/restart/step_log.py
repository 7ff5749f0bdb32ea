"""The load steps of a run under way, in a checked file that only grows: a record for each.

A checkpoint says which records belong to it. What a killed run wrote behind them does not count,
and is overwritten when the run goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from multiscale.loading.load_step import LoadStep, PatchState
from support.checked_store import START, Mark, Record, append, unsealed
from support.errors import InputError

_COLUMNS = [one.name for one in fields(LoadStep) if one.name != "patches"]
_PATCH_COLUMNS = [one.name for one in fields(PatchState)]


class StepLog:
    """Writes load steps to a file, each once.

    Args:
        path: The file.

    Attributes:
        mark: How far it is written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.mark = path, START

    def write(self, steps: Sequence[LoadStep]) -> None:
        """Write those load steps that are not in the file yet.

        Args:
            steps: All load steps so far. Where the file has gone, or is another run's, all are
                written again.

        Raises:
            NotWritten: When the file cannot be written; what was in it counts as before.
        """
        here = self.path.stat().st_size if self.path.is_file() else 0
        mark = self.mark if here >= self.mark.size else START
        if new := steps[mark.records :]:
            self.mark = append(self.path, map(_record, new), mark)


def read_steps(path: Path, mark: Mark) -> tuple[LoadStep, ...]:
    """Read the load steps of a log.

    Args:
        path: The file.
        mark: How far it is to be read.

    Raises:
        InputError: When bytes are missing, or are not those that were written.
    """
    if mark == START:
        return ()
    found = []
    try:
        for record, here in unsealed(path.read_bytes()[: mark.size]):
            found.append(_load_step(record))
            if here == mark:
                return tuple(found)
    except InputError:
        pass
    raise InputError(f"is damaged: {path.name} beside it does not have the bytes it had")


def _record(step: LoadStep) -> Record:
    columns = {name: getattr(step.patches, name) for name in _PATCH_COLUMNS}
    return Record(
        {name: getattr(step, name) for name in _COLUMNS},
        {name: column for name, column in columns.items() if column is not None},
    )


def _load_step(record: Record) -> LoadStep:
    known = {name: _tuples(value) for name, value in record.facts.items()}
    return LoadStep(**known, patches=PatchState(**record.arrays))


def _tuples(value: Any) -> Any:
    """Return a value read from JSON with its lists as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
