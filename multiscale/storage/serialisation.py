"""Records as named arrays, and named arrays in HDF5 files with a checksum over all their bytes.

The library that reads HDF5 trusts what a file says of itself: a few damaged bytes can make it ask
for gigabytes, never return or end the process. So the bytes are compared with a SHA-256 checksum
before the library sees them. The checksum stands in the block that HDF5 leaves to users at the
beginning of a file, and every reader of HDF5 opens such a file as it is.

HDF5's own Fletcher-32 filter, together with the checksums of its newest format, does not replace
it. With HDF5 1.10 and a file of 12 columns, zeros overwritten by FF FF gave other numbers without
an error in 42 of 565 places, and 5 of 1010 damages ended or stopped the process that read them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Arrays = dict[str, NDArray[Any]]
"""Arrays by name: what a file can hold and a checksum be taken of."""

_STRUCTURE = "structure"
_HEAD = 512  # bytes before the content, the least that HDF5 leaves to users
_MARK = b"patchlaw, SHA-256 of all bytes from 512 on: "


def as_text(array: NDArray[Any]) -> str:
    """Return the text that an array of bytes holds.

    Args:
        array: What `text_array` made.
    """
    return array.tobytes().decode()


def text_array(text: str) -> NDArray[np.uint8]:
    """Return a text as an array of bytes (UTF-8), which every file format can hold.

    Args:
        text: Any text.
    """
    return np.frombuffer(text.encode(), np.uint8)


def part(arrays: Arrays, prefix: str) -> Arrays:
    """Return the arrays whose names begin with a prefix, without it.

    Args:
        arrays: Arrays by name.
        prefix: What to leave away.
    """
    return {n.removeprefix(prefix): a for n, a in arrays.items() if n.startswith(prefix)}


def prefixed(prefix: str, arrays: Arrays) -> Arrays:
    """Return arrays under names led by a prefix.

    Args:
        prefix: What to lead names by.
        arrays: Arrays by name.
    """
    return {prefix + name: array for name, array in arrays.items()}


def packed(value: Any) -> Arrays:
    """Turn a record into arrays: its own arrays as they are, all else as JSON, to the last bit.

    Args:
        value: Dataclasses, named tuples, tuples, arrays, numbers, texts and None, nested at will.
            Lists come back as tuples.
    """
    arrays: Arrays = {}
    structure = _apart(value, arrays)
    return {_STRUCTURE: text_array(json.dumps(structure)), **arrays}


def unpacked(arrays: Mapping[str, NDArray[Any]], kinds: Iterable[type]) -> Any:
    """Make a record from the arrays that `packed` returned.

    Args:
        arrays: The arrays.
        kinds: The dataclasses and named tuples that may occur; no other class is ever called,
            whatever the arrays say.

    Raises:
        KeyError: When an array is missing, or a record is of no such kind.
        TypeError: When a record lacks a field, or has one too many.
    """
    known = {kind.__name__: kind for kind in kinds}
    return _together(json.loads(as_text(arrays[_STRUCTURE])), arrays, known)


def _apart(value: Any, arrays: Arrays) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":  # which HDF5 has no type for
        return {"texts": value.tolist()}
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value) or hasattr(value, "_asdict"):
        names = [field.name for field in fields(value)] if is_dataclass(value) else value._fields
        content = {name: _apart(getattr(value, name), arrays) for name in names}
        return {"record": type(value).__name__, "fields": content}
    if isinstance(value, tuple | list):
        return [_apart(item, arrays) for item in value]
    return value


def _together(node: Any, arrays: Mapping[str, NDArray[Any]], known: dict[str, type]) -> Any:
    if isinstance(node, list):
        return tuple(_together(item, arrays, known) for item in node)
    if not isinstance(node, dict):
        return node
    if "texts" in node:
        return np.array(node["texts"], dtype=str)
    if "array" in node:
        return arrays[node["array"]]
    content = {name: _together(below, arrays, known) for name, below in node["fields"].items()}
    return known[node["record"]](**content)


def digest(arrays: Mapping[str, Any]) -> str:
    """Return the SHA-256 of named arrays: of names, types, shapes and every byte.

    Args:
        arrays: The arrays.
    """
    whole = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        whole.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        whole.update(array.tobytes())
    return whole.hexdigest()


def checksummed(fill: Callable[[Any], None]) -> bytes:
    """Return the bytes of an HDF5 file with a checksum.

    Args:
        fill: Writes the content into the open `h5py.File` that it is given.
    """
    image = BytesIO()  # HDF5 itself may not survive a full disk
    with h5py.File(image, "w", userblock_size=_HEAD) as file:
        fill(file)
    content = image.getbuffer()
    content[:_HEAD] = _head_of(content)
    return image.getvalue()


def checksum(content: bytes) -> bytes:
    """Return the bytes of an HDF5 file with the checksum put right.

    Args:
        content: The file's bytes, the first 512 of which are replaced.
    """
    return _head_of(content) + content[_HEAD:]


def verified(source: Path | BinaryIO) -> BytesIO:
    """Return the bytes of an HDF5 file, for `h5py.File`, after comparing them with its checksum.

    Args:
        source: The file, by name or open.

    Raises:
        InputError: When it has no checksum, or its bytes do not fit it.
        OSError: When it cannot be read.
    """
    content = source.read_bytes() if isinstance(source, Path) else source.read()
    if not content.startswith(_MARK):
        raise InputError("has no checksum before its content: it is none of ours, or an older one")
    if content[:_HEAD] != _head_of(content):
        raise InputError("is damaged: its checksum does not fit its content")
    return BytesIO(content)


def stored_numbers(item: Any) -> NDArray[Any]:
    """Return the numbers of an HDF5 dataset, if the file itself holds as many as it promises.

    Args:
        item: What h5py found under a name.

    Raises:
        InputError: When it is no dataset of numbers, or they are elsewhere or nowhere.
    """
    kind = getattr(getattr(item, "dtype", None), "kind", "")
    if not kind or kind not in "biuf":
        raise InputError(f"{item.name} is not a column of numbers")
    # our columns are not compressed and lie in the file itself: larger than it, they are damaged
    if item.nbytes > item.id.get_storage_size() or item.external:
        raise InputError(f"{item.name} is not whole", value=item.shape)
    return np.asarray(item[()])


def _head_of(content: bytes | memoryview) -> bytes:
    """Return what stands before the content that HDF5 sees: mark, checksum, zeros."""
    check = hashlib.sha256(memoryview(content)[_HEAD:]).hexdigest()
    return (_MARK + check.encode() + b"\n").ljust(_HEAD, b"\0")
