"""Turns records of arrays and plain numbers into a flat dictionary of arrays, and back."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Arrays = dict[str, NDArray[Any]]
"""Arrays by name: what a file can hold and a checksum be taken of."""

_STRUCTURE = "structure"


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
    # ours are neither packed nor spread over files: a small file promises no large array
    if item.nbytes > item.id.get_storage_size() or item.external:
        raise InputError(f"{item.name} is not whole", value=item.shape)
    return np.asarray(item[()])


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
    """Take a record apart: its arrays as they are, all else as JSON; exact to the last bit.

    Args:
        value: Dataclasses, named tuples, tuples, arrays, numbers, texts and None, nested at will.
            Lists come back as tuples.
    """
    arrays: Arrays = {}
    structure = _apart(value, arrays)
    return {_STRUCTURE: text_array(json.dumps(structure)), **arrays}


def unpacked(arrays: Mapping[str, NDArray[Any]], kinds: Iterable[type]) -> Any:
    """Put a record together again.

    Args:
        arrays: What `packed` gave.
        kinds: The dataclasses and named tuples that may occur; nothing else is ever made, whatever
            the arrays say.

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
        content = {name: _apart(getattr(value, name), arrays) for name in _names(value)}
        return {"record": type(value).__name__, "fields": content}
    if isinstance(value, tuple | list):
        return [_apart(item, arrays) for item in value]
    return value


def _names(value: Any) -> Iterable[str]:
    if is_dataclass(value):
        return [field.name for field in fields(value)]
    return list(value._fields)


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
