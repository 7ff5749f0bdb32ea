"""Keeps values in files of which no byte is believed before it is checked.

A file is a sequence of records, each of one value: numbers, texts, bytes, arrays, dataclasses and
named tuples, lists and dictionaries of them, to the last bit. A record begins with a line of its
SHA-256 and its size in bytes; a line of JSON and the bytes of its arrays follow. A file of one
record is replaced whole; others grow at their end, where what a killed process left of its last
record counts for nothing.

A file of HDF5 has its checksum in the block that HDF5 leaves to users at the beginning of a file,
and every reader of HDF5 opens it as it is. The library that reads HDF5 trusts what a file says of
itself: a few damaged bytes can make it ask for gigabytes, never return or end the process. HDF5's
own Fletcher-32 filter, together with the checksums of its newest format, does not replace the
checksum: with HDF5 1.10 and a file of 12 columns, half of them zeros, two zero bytes overwritten by
FF FF gave other numbers without an error in 106 of 300 places, and 52 of 700 damages ended the
process.

The checksum finds damage, not malice: whoever may write a file can write its checksum too.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.support.errors import InputError
from patchlaw.support.files import read_bytes, write_bytes, written

_HEAD = re.compile(rb"([0-9a-f]{64}) (\d{1,18})\n")
_LONGEST_HEAD = 84  # bytes
_STORED = "biufcSU"  # kinds of arrays whose bytes are their values
_PLAIN = (float, int, str)  # what JSON knows, and most of a value
_KIND = "="  # key of JSON objects that stand for what JSON does not know
_HDF5_MARK = b"patchlaw, SHA-256 of all bytes from 512 on: "

HDF5_HEAD = 512
"""Bytes before the content of an HDF5 file, the least that it leaves to users."""


def sealed(value: Any) -> bytes:
    """Return the bytes of a record.

    Args:
        value: Its value.

    Raises:
        TypeError: When a part of the value is of a kind that is not stored.
    """
    body = _body(value)
    return f"{_checksum(body)} {len(body)}\n".encode() + body


def unsealed(content: bytes, kinds: Iterable[type] = ()) -> Iterator[tuple[Any, int]]:
    """Yield the value of each record of a file, and where it ends; not an unfinished last one.

    Lists in dataclasses and named tuples come back as tuples, all other sequences as lists.

    Args:
        content: The whole file.
        kinds: The dataclasses and named tuples that may occur; no other class is ever called,
            whatever the file says.

    Raises:
        InputError: When bytes are not those that were written, or a value is of another kind.
    """
    place, known = 0, {kind.__name__: kind for kind in kinds}
    while place < len(content):
        head = _HEAD.match(content, place)
        if head is None:
            rest = content[place:]
            if len(rest) < _LONGEST_HEAD and b"\n" not in rest:
                return  # the head itself is not whole
            raise _damaged()
        end = head.end() + int(head[2])
        if end > len(content):
            return
        body = content[head.end() : end]
        if _checksum(body) != head[1].decode():
            raise _damaged()
        place = end
        yield _value(body, known), place


def read_record(content: bytes, kinds: Iterable[type] = ()) -> Any:
    """Return the value of a file that is replaced whole.

    Args:
        content: The file.
        kinds: The classes that may occur, see `unsealed`.

    Raises:
        InputError: When bytes are not those that were written, or a value is of another kind.
    """
    for value, end in unsealed(content, kinds):
        if end == len(content):
            return value
        break
    raise _damaged()


def write_record(path: Path, value: Any) -> Path:
    """Replace a file by one record, whole or not at all.

    Args:
        path: The file.
        value: Its value.

    Raises:
        NotWritten: When the system refuses.
    """
    return write_bytes(path, sealed(value))


def append(path: Path, value: Any, end: int) -> int:
    """Write a record behind others, and remove what stood there.

    Args:
        path: The file; without records it is made, in a folder that is there.
        value: The value of the record.
        end: Where the last of the others ends.

    Returns:
        Where it ends.

    Raises:
        NotWritten: When the system refuses; the others are there still.
    """
    content = sealed(value)
    with written(path):
        linked = path.is_symlink() or (path.is_file() and path.stat().st_nlink > 1)
        kept = read_bytes(path)[:end] if linked and end else b""
    if linked:  # whose other name is not to grow with it
        write_bytes(path, kept)
    with written(path), path.open("r+b" if end else "w+b") as file:
        file.seek(end)
        file.truncate()
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    return end + len(content)


def begins_as_record(path: Path) -> bool:
    """Tell whether a file begins as those of this module do, whose content is not read.

    Args:
        path: The file.

    Raises:
        OSError: When it cannot be read.
    """
    with path.open("rb") as file:
        return _HEAD.match(file.read(_LONGEST_HEAD)) is not None


def fingerprint(value: Any) -> str:
    """Return the SHA-256 of a value: of all its names, numbers, types, shapes and bytes.

    Args:
        value: What a record can hold.

    Raises:
        TypeError: When a part of it is of a kind that is not stored.
    """
    return _checksum(_body(value))


def checksum_hdf5(content: bytes) -> bytes:
    """Return the bytes of an HDF5 file with the checksum put right.

    Args:
        content: The file's bytes, with 512 before its content, which are replaced.
    """
    return _hdf5_head(content) + content[HDF5_HEAD:]


def check_hdf5(content: bytes) -> None:
    """Compare the bytes of an HDF5 file with the checksum before its content.

    Args:
        content: The file.

    Raises:
        InputError: When it has no checksum, or its bytes do not fit it.
    """
    if not content.startswith(_HDF5_MARK):
        raise InputError("has no checksum before its content: it is none of ours, or an older one")
    if content[:HDF5_HEAD] != _hdf5_head(content):
        raise InputError("is damaged: its checksum does not fit its content")


def _body(value: Any) -> bytes:
    """Return the line of JSON of a value, and the bytes of its arrays."""
    arrays: list[NDArray[Any]] = []
    line = json.dumps({"value": _apart(value, arrays)}).encode() + b"\n"
    return b"".join([line, *(array.tobytes() for array in arrays)])


def _apart(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """Return a value as JSON; its arrays are added to a list, in the order of their places."""
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, bytes):
        return _apart(np.frombuffer(value, np.uint8), arrays) | {_KIND: "bytes"}
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _STORED:
            raise TypeError(f"an array of {value.dtype} cannot be stored")
        arrays.append(value)
        return {_KIND: "array", "type": value.dtype.str, "shape": value.shape}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {name: _apart(part, arrays) for name, part in value.items()}
    names = getattr(value, "_fields", None)
    if is_dataclass(value):
        names = [field.name for field in fields(value)]
    if names is not None:
        kept = {name: _apart(getattr(value, name), arrays) for name in names}
        return {_KIND: type(value).__name__, **kept}
    if isinstance(value, tuple | list):
        return [_apart(part, arrays) for part in value]
    return value


def _value(body: bytes, known: Mapping[str, Callable[..., Any]]) -> Any:
    """Return the value of a record whose bytes have been checked."""
    end = body.index(b"\n") + 1
    line = body[:end]

    def made(node: dict[str, Any]) -> Any:
        nonlocal end
        kind = node.pop(_KIND, None)
        if kind is None:
            return node
        if kind not in ("array", "bytes"):
            return known[kind](**{name: _with_tuples(part) for name, part in node.items()})
        array = np.frombuffer(body, node["type"], count=prod(node["shape"]), offset=end)
        end += array.nbytes
        return array.tobytes() if kind == "bytes" else array.reshape(node["shape"]).copy()

    try:
        return json.loads(line, object_hook=made)["value"]
    except (KeyError, TypeError):  # another layout, a class that is gone, or a field of it
        raise InputError("was written by another patchlaw") from None


def _with_tuples(value: Any) -> Any:
    """Return a value read from JSON with its lists as tuples."""
    return tuple(map(_with_tuples, value)) if isinstance(value, list) else value


def _hdf5_head(content: bytes) -> bytes:
    """Return what stands before the content that HDF5 sees: mark, checksum, zeros."""
    checksum = _checksum(memoryview(content)[HDF5_HEAD:])
    return (_HDF5_MARK + checksum.encode() + b"\n").ljust(HDF5_HEAD, b"\0")


def _checksum(content: bytes | memoryview) -> str:
    return hashlib.sha256(content).hexdigest()


def _damaged() -> InputError:
    return InputError("is damaged: its bytes do not fit their checksum")
