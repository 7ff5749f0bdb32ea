"""Keeps facts and arrays in files of which no byte is believed before it is checked.

A file is a sequence of records. Each begins with a line of its SHA-256 and its size in bytes; a
line of JSON and the bytes of its arrays follow. The checksum covers these and the checksum of the
record before, so that a record cannot be changed, exchanged, repeated or left out without the next
one telling. A file of one record is replaced whole; others grow at their end, where what a killed
process left of its last record counts for nothing.

The checksum finds damage, not malice: whoever may write a file can write its checksum too.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from support.errors import InputError
from support.whole_files import write_bytes, written

Arrays = dict[str, NDArray[Any]]
"""Arrays by name."""

_HEAD = re.compile(rb"([0-9a-f]{64}) (\d{1,18})\n")
_LONGEST_HEAD = 84  # bytes
_KINDS = "biufcSU"  # of arrays whose bytes are their values


class Record(NamedTuple):
    """One record of a file.

    Attributes:
        facts: What JSON can hold.
        arrays: Arrays by name.
    """

    facts: Any
    arrays: Mapping[str, NDArray[Any]] = {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A place between two records of a file, and what stands before it.

    Attributes:
        records: Number of records before it.
        size: Their bytes.
        checksum: Checksum of the last of them; empty at the beginning of the file.
    """

    records: int = 0
    size: int = 0
    checksum: str = ""


START = Mark()
"""The beginning of a file."""


def sealed(records: Iterable[Record], mark: Mark = START) -> tuple[bytes, Mark]:
    """Return the bytes of records that follow others, and the mark behind them.

    Args:
        records: The records.
        mark: Where they begin.
    """
    parts = []
    for facts, arrays in records:
        stored = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        for name, array in stored.items():
            if array.dtype.kind not in _KINDS:
                raise TypeError(f"array {name} of {array.dtype} cannot be stored")
        shapes = {name: [array.dtype.str, *array.shape] for name, array in stored.items()}
        line = json.dumps([facts, shapes], default=np.generic.item).encode() + b"\n"
        body = b"".join([line, *(array.tobytes() for array in stored.values())])
        checksum = _checksum(mark.checksum, body)
        head = f"{checksum} {len(body)}\n".encode()
        parts += [head, body]
        size = mark.size + len(head) + len(body)
        mark = Mark(records=mark.records + 1, size=size, checksum=checksum)
    return b"".join(parts), mark


def unsealed(content: bytes, mark: Mark = START) -> Iterator[tuple[Record, Mark]]:
    """Yield the records of a file, and the mark behind each; an unfinished last one is left out.

    Args:
        content: The whole file.
        mark: The place to begin at.

    Raises:
        InputError: When bytes are not those that were written.
    """
    while mark.size < len(content):
        head = _HEAD.match(content, mark.size)
        if head is None:
            if b"\n" not in content[mark.size : mark.size + _LONGEST_HEAD] and (
                len(content) - mark.size < _LONGEST_HEAD
            ):
                return  # the head itself is not whole
            raise _damaged(mark)
        end = head.end() + int(head[2])
        if end > len(content):
            return
        body, checksum = content[head.end() : end], head[1].decode()
        if _checksum(mark.checksum, body) != checksum:
            raise _damaged(mark)
        mark = Mark(records=mark.records + 1, size=end, checksum=checksum)
        yield _record(body), mark


def end_of(content: bytes) -> Mark:
    """Return the mark behind the last whole record of a file.

    Args:
        content: The file.

    Raises:
        InputError: When bytes are not those that were written.
    """
    mark = START
    for _, behind in unsealed(content):
        mark = behind
    return mark


def read_record(content: bytes) -> Record:
    """Return the record of a file that is replaced whole.

    Args:
        content: The file.

    Raises:
        InputError: When bytes are not those that were written.
    """
    for record, mark in unsealed(content):
        if mark.size == len(content):
            return record
        break
    raise _damaged(START)


def write_record(path: Path, facts: Any, arrays: Mapping[str, NDArray[Any]] | None = None) -> Path:
    """Replace a file by one record, whole or not at all.

    Args:
        path: The file.
        facts: What JSON can hold.
        arrays: Arrays by name.

    Raises:
        NotWritten: When the system refuses.
    """
    return write_bytes(path, sealed([Record(facts, arrays or {})])[0])


def append(path: Path, records: Iterable[Record], mark: Mark) -> Mark:
    """Write records at a place of a file, and remove what stood behind it.

    Args:
        path: The file; at its beginning it is made, in a folder that is there.
        records: The records.
        mark: The place.

    Returns:
        The mark behind them.

    Raises:
        NotWritten: When the system refuses; what stood before the mark is there still.
    """
    content, after = sealed(records, mark)
    with written(path), path.open("r+b" if mark.size else "w+b") as file:
        file.seek(mark.size)
        file.truncate()
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    return after


def _record(body: bytes) -> Record:
    """Return the record whose bytes have been checked."""
    end = body.index(b"\n") + 1
    facts, shapes = json.loads(body[:end])
    arrays = {}
    for name, (kind, *shape) in shapes.items():
        array = np.frombuffer(body, kind, count=int(np.prod(shape, dtype=np.int64)), offset=end)
        arrays[name] = array.reshape(shape).copy()  # aligned, and writable as it was
        end += array.nbytes
    return Record(facts, arrays)


def _checksum(before: str, body: bytes) -> str:
    whole = hashlib.sha256(before.encode())
    whole.update(body)
    return whole.hexdigest()


def _damaged(mark: Mark) -> InputError:
    where = f" after record {mark.records}" * (mark.records > 0)
    return InputError(f"is damaged{where}: its bytes do not fit their checksum")
