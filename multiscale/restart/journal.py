"""Appends the load steps since the last checkpoint to a file, each record checksummed."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.loading.stepper import LoadPosition
from multiscale.storage.serialisation import (
    Arrays,
    as_text,
    packed,
    part,
    prefixed,
    text_array,
    unpacked,
)
from multiscale.storage.whole_files import written

_CHECK, _LENGTH = 32, 8  # bytes of a record's checksum, and of its length


class Journal:
    """Load steps of one run, one record each, in a file that only grows until it is begun anew.

    A record is on its way to the disk when `append` returns: the process may be killed, and only a
    crash of the whole machine loses what the system had not written yet. A torn last record is
    known by its checksum.

    Args:
        path: The file.
        run: Name of the run.
    """

    def __init__(self, path: Path, run: str) -> None:
        self._path, self._run = path, run
        self._file: BinaryIO | None = None

    @property
    def stands(self) -> bool:
        """Whether the file is begun, and still the one of that name."""
        if self._file is None:
            return False
        try:
            return os.path.samestat(os.stat(self._path), os.fstat(self._file.fileno()))
        except OSError:
            return False

    def begin(self) -> None:
        """Begin anew with an empty file.

        Raises:
            NotWritten: When it cannot be written.
        """
        with written(self._path):
            self.close()
            self._file = self._path.open("wb", buffering=0)

    def append(self, step: LoadStep, position: LoadPosition, state: Arrays) -> None:
        """Append a load step, and what is needed to go on after it.

        Args:
            step: The load step.
            position: Where the load programme has come to.
            state: What the coupling's next load step starts from.

        Raises:
            NotWritten: When it cannot be written; whole.
        """
        content = {"run": text_array(self._run)}
        content |= prefixed("step/", packed((step, position))) | prefixed("state/", state)
        record = _record(content)
        with written(self._path):
            if self._file is None or self._file.write(record) != len(record):
                raise OSError("the file took a part of the record only")

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


def journalled(path: Path, run: str) -> Iterator[tuple[LoadStep, LoadPosition, Arrays]]:
    """Yield the load steps in a journal, up to a torn record or one of another run.

    Args:
        path: The file; it may be missing.
        run: Name of the run.
    """
    data = memoryview(path.read_bytes()) if path.is_file() else memoryview(b"")
    while len(data) > _CHECK + _LENGTH:
        length = int.from_bytes(data[_CHECK : _CHECK + _LENGTH], "little")
        content = data[_CHECK + _LENGTH : _CHECK + _LENGTH + length]
        if hashlib.sha256(content).digest() != bytes(data[:_CHECK]):
            return
        arrays = _arrays(bytes(content))
        if as_text(arrays["run"]) != run:
            return
        step, position = unpacked(part(arrays, "step/"), (LoadStep, PatchState, LoadPosition))
        yield step, position, part(arrays, "state/")
        data = data[_CHECK + _LENGTH + length :]


def _record(arrays: Arrays) -> bytes:
    """Return arrays one behind the other, led by checksum, length and a line that lists them."""
    listed = [(name, array.dtype.str, array.shape) for name, array in arrays.items()]
    parts = [json.dumps(listed).encode(), b"\n", *(array.tobytes() for array in arrays.values())]
    content = b"".join(parts)
    check = hashlib.sha256(content).digest()
    return b"".join((check, len(content).to_bytes(_LENGTH, "little"), content))


def _arrays(content: bytes) -> Arrays:
    at, arrays = content.index(b"\n") + 1, {}
    for name, kind, shape in json.loads(content[:at]):
        count = math.prod(shape)
        array = np.frombuffer(content, np.dtype(kind), count, at).reshape(shape).copy()
        arrays[name], at = array, at + array.nbytes
    return arrays
