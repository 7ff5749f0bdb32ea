"""The load steps of a run under way, in a file that only grows: a line of JSON for each.

A checkpoint says how many bytes of it belong to it, with their SHA-256. What a killed run wrote
behind them does not count, and is overwritten when the run goes on.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from geometry.errors import InputError
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.storage import write_bytes, written

_COLUMNS = [one.name for one in fields(LoadStep) if one.name != "patches"]
_PATCH_COLUMNS = [one.name for one in fields(PatchState)]
_NUMBERS = "<f8"


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMark:
    """How far a log belongs to a checkpoint.

    Attributes:
        steps: Load steps up to there.
        size: Bytes up to there.
        sha256: SHA-256 of these bytes.
    """

    steps: int = 0
    size: int = 0
    sha256: str = field(default_factory=lambda: hashlib.sha256().hexdigest())


class StepLog:
    """Writes load steps to a file, each once.

    Args:
        path: The file.

    Attributes:
        mark: How far it is written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.mark = path, LogMark()
        self._hash = hashlib.sha256()

    def write(self, steps: Sequence[LoadStep]) -> None:
        """Write those load steps that are not in the file yet.

        Args:
            steps: All load steps so far. Where the file has gone, or is another run's, all are
                written again.

        Raises:
            NotWritten: When the file cannot be written; what was in it counts as before.
        """
        here = self.path.stat().st_size if self.path.is_file() else 0
        whole = not self.mark.steps or here < self.mark.size
        before = LogMark() if whole else self.mark
        lines = b"".join(map(_line, steps[before.steps :]))
        digest = hashlib.sha256() if whole else self._hash.copy()
        digest.update(lines)
        if whole and lines:
            write_bytes(self.path, lines)
        elif lines:
            self._append(lines)
        self._hash = digest
        self.mark = LogMark(
            steps=len(steps), size=before.size + len(lines), sha256=digest.hexdigest()
        )

    def _append(self, lines: bytes) -> None:
        with written(self.path), self.path.open("r+b") as file:
            file.seek(self.mark.size)
            file.truncate()  # what an interrupted write left
            file.write(lines)
            file.flush()
            os.fsync(file.fileno())


def read_steps(path: Path, mark: LogMark) -> tuple[LoadStep, ...]:
    """Read the load steps of a log.

    Args:
        path: The file.
        mark: How far it is to be read.

    Raises:
        InputError: When bytes are missing, or are not those that were written.
    """
    if not mark.size:
        return ()
    content = b""
    if path.stat().st_size >= mark.size:
        with path.open("rb") as file:
            content = file.read(mark.size)
    if hashlib.sha256(content).hexdigest() != mark.sha256:
        raise InputError(f"is damaged: {path.name} beside it does not have the bytes it had")
    return tuple(map(_load_step, content.splitlines()))


def _line(step: LoadStep) -> bytes:
    """Return a load step as a line; arrays of patches as numbers in base 64."""
    values = {name: getattr(step, name) for name in _COLUMNS}
    values["patches"] = {
        name: base64.b64encode(np.asarray(column, _NUMBERS).tobytes()).decode()
        for name in _PATCH_COLUMNS
        if (column := getattr(step.patches, name)) is not None
    }
    return json.dumps(values, default=np.generic.item).encode() + b"\n"


def _load_step(line: bytes) -> LoadStep:
    values = json.loads(line)
    patches = {
        name: np.frombuffer(base64.b64decode(text), _NUMBERS)
        for name, text in values.pop("patches").items()
    }
    known = {name: _tuples(value) for name, value in values.items()}
    return LoadStep(**known, patches=PatchState(**patches))


def _tuples(value: Any) -> Any:
    """Return a value read from JSON with its lists as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
