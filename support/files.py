"""Files that stand under their names whole or not at all, checked records, files that are ours.

No byte of a record is believed before it is checked. Its file is a sequence of records, each of one
value: numbers, texts, bytes, arrays, dataclasses and named tuples, lists and dictionaries of them,
to the last bit. A record begins with a line of its SHA-256 and its size in bytes; a line of JSON
and the bytes of its arrays follow. A file of one record is replaced whole; others grow at their
end, where what a killed process left of its last record counts for nothing.

A file of HDF5 has its checksum in the block that HDF5 leaves to users at the beginning of a file,
and every reader of HDF5 opens it as it is. The library that reads HDF5 trusts what a file says of
itself: a few damaged bytes can make it ask for gigabytes, never return or end the process. HDF5's
own Fletcher-32 filter, together with the checksums of its newest format, does not replace the
checksum: with HDF5 1.10 and a file of 12 columns, half of them zeros, two zero bytes overwritten by
FF FF gave other numbers without an error in 106 of 300 places, and 52 of 700 damages ended the
process.

The checksum finds damage, not malice: whoever may write a file can write its checksum too.

All other files in a folder of results are the user's, and stay. A list in the folder has a line for
every time that files were written: their names before, and what identifies their contents after. A
file is patchlaw's where its content is one of those listed, or where a process was killed while it
wrote. Processes that share a folder append to one list.
"""

from __future__ import annotations

import csv
import errno
import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from hashlib import sha256
from io import BytesIO, StringIO
from math import prod
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from patchlaw.support.errors import InputError, NotWritten

PARTIAL_FOLDER = ".fields.partial-files"
"""Folder of files that are not complete and that others write."""
_PARTIAL = re.compile(r"\..*\.partial-[0-9a-f]{32}(\.\w+)?")
_FORMULA = re.compile(r"[=@\t\r]|[+-](?!\s*[\d.]+(e[+-]?\d+)?\s*[^\W\d]*$)", re.IGNORECASE)
"""Begin of a text that spreadsheets take for a formula; negative numbers, with a unit, are none."""


@contextmanager
def written(path: Path) -> Iterator[None]:
    """Turn an error of the system while a file is written into one that names the file.

    Args:
        path: The file.

    Raises:
        NotWritten: When the system raised an error.
    """
    try:
        yield
    except OSError as error:
        raise NotWritten(f"{path}: cannot be written: {error.strerror or error}") from error


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a file; a pipe or device in its place is not waited for.

    Args:
        path: The file.

    Raises:
        OSError: When it cannot be read, or is no regular file.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "is no file", str(path))
    return path.read_bytes()


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file under a temporary name beside it and rename it when it is complete.

    Args:
        path: Final name; its folder is made when missing.
        content: What the file is to hold.

    Returns:
        The final name.

    Raises:
        NotWritten: When the system refuses; whatever stood under the final name stands there still.
    """
    # processes of several nodes may write the same file of a cache
    partial = path.with_name(f".{path.stem}.partial-{uuid4().hex}{path.suffix}")
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_bytes(content)
            with partial.open("r+b") as file:  # Windows flushes none that is only read
                os.fsync(file.fileno())  # lest a crash of the machine leave the name without data
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text as UTF-8; bytes of names that are none become escapes.

    Args:
        path: File to write.
        text: Its content.
    """
    return write_bytes(path, text.encode(errors="backslashreplace"))


def csv_text(header: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as a text; numbers keep all their digits (Python's shortest exact form).

    Args:
        header: Names of the columns.
        rows: Their values; an unknown value, None or NaN, leaves its cell empty.
    """
    text = StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows([cell(value) for value in row] for row in rows)
    return text.getvalue()


def remove(path: Path) -> None:
    """Remove a file, or a folder written by ADIOS2, if it is there; leave all other folders.

    Args:
        path: Its name.

    Raises:
        NotWritten: When the system refuses, as where a folder has the name of a file.
    """
    with written(path):
        if path.suffix == ".bp" and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def remove_partial(folder: Path) -> None:
    """Remove the half-written files of runs that were killed, which have names of `write_bytes`.

    Args:
        folder: Folder of results; no other run may be writing there.
    """
    for path in folder.glob(".*.partial-*"):
        if path.name == PARTIAL_FOLDER and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        elif _PARTIAL.fullmatch(path.name) and not path.is_dir():
            path.unlink(missing_ok=True)


def plain(value: Any) -> Any:
    """Return numpy's scalars as Python's own, whose text is the same on every numpy release."""
    return value.item() if getattr(value, "ndim", 1) == 0 else value


def cell(value: Any) -> Any:
    """Return what stands in a cell: nothing for NaN, and nothing that a spreadsheet computes.

    Args:
        value: A number, a text, or None.
    """
    value = plain(value)
    if isinstance(value, str) and _FORMULA.match(value):
        return f"'{value}"
    return None if value != value else value


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


def hdf5_bytes(opened: Callable[..., Any], fill: Callable[[Any], None]) -> bytes:
    """Return the bytes of an HDF5 file with a checksum before its content.

    Args:
        opened: Opens a file in memory: `h5py.File`.
        fill: Writes the content into the open file that it is given.
    """
    image = BytesIO()  # HDF5 itself may not survive a full disk
    with opened(image, "w", userblock_size=HDF5_HEAD) as file:
        fill(file)
    return checksum_hdf5(image.getvalue())


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


LIST = ".patchlaw-files"
"""Name of the list."""

_END = 2**16
"""Bytes at both ends of a file that identify it, with its size: fields may take gigabytes."""

REPLACED = "another folder, or --overwrite"
"""What is allowed instead of a folder with files of others, where a command takes the option."""


class OwnFiles:
    """The files that patchlaw wrote to a folder.

    Args:
        folder: The folder, which need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._list = folder, folder / LIST

    def refuse_others(
        self,
        names: Iterable[str],
        inputs: Iterable[Path] = (),
        *,
        overwrite: bool = False,
        allowed: str = REPLACED,
        key: str = "--out",
    ) -> None:
        """Refuse to write where files of the same names are not patchlaw's, or are read.

        Args:
            names: Names of the files that may be written, within the folder.
            inputs: Files that are read, which nothing may replace.
            overwrite: Whether the user gave up the files of others.
            allowed: What the error says is allowed.
            key: What the error calls the folder.

        Raises:
            InputError: When there is such a file.
        """
        there, inputs = [name for name in names if os.path.lexists(self._folder / name)], [*inputs]
        others = [] if overwrite else self._others(there)
        for name in there:
            path = self._folder / name
            if any(_are_same(path, one) for one in inputs):
                problem, instead = f"results would replace {name}, which is read", "another folder"
            elif name in others:
                problem, instead = f"holds {name}, which is no result of patchlaw", allowed
            else:
                continue
            raise InputError(problem, key=key, value=str(self._folder), allowed=instead)

    def remove(self, names: Iterable[str]) -> None:
        """Remove those of some files that patchlaw wrote.

        Args:
            names: Their names, within the folder.

        Raises:
            NotWritten: When the system refuses.
        """
        there = [name for name in names if os.path.lexists(self._folder / name)]
        for name in set(there) - set(self._others(there)):
            remove(self._folder / name)

    @contextmanager
    def writing(self, names: Iterable[str]) -> Iterator[None]:
        """List files as patchlaw's that are written meanwhile.

        Args:
            names: Names of all files that may be written; those that are not stay what they are.

        Raises:
            NotWritten: When the list cannot be written.
        """
        names = [*names]
        others = {name: _content(self._folder / name) for name in self._others(names)}
        self._append({name: None for name in names if name not in others})
        yield
        now = {name: _content(self._folder / name) for name in names}
        self._append({name: now[name] for name in names if now[name] != others.get(name, None)})

    def _others(self, names: Iterable[str]) -> list[str]:
        """Return those of some names that are files which patchlaw did not write."""
        listed = self._listed()
        return [name for name in names if not self._is_own(name, listed)]

    def _is_own(self, name: str, listed: Mapping[str, list[str | None]]) -> bool:
        path = self._folder / name
        if path.is_symlink() or not path.exists():  # of a link, what it points to is not touched
            return True
        contents = listed.get(name) or [""]
        if contents[-1] is None or _content(path) in contents:
            return True
        with suppress(OSError):
            return path.is_file() and begins_as_record(path)
        return False

    def _listed(self) -> dict[str, list[str | None]]:
        """Return the contents of every name that were written."""
        with suppress(OSError):
            found: dict[str, list[str | None]] = {}
            for line in read_bytes(self._list).splitlines():
                with suppress(ValueError, AttributeError):  # a line that was cut short
                    for name, content in json.loads(line).items():
                        found.setdefault(name, []).append(content)
            return found
        return {}

    def _append(self, contents: Mapping[str, Any]) -> None:
        with written(self._list):
            self._folder.mkdir(parents=True, exist_ok=True)
            if self._list.is_symlink():
                self._list.unlink()
            with self._list.open("ab") as file:  # behind what other processes wrote, in one piece
                file.write(b"\n" + json.dumps(contents).encode() + b"\n")


def _content(path: Path) -> str:
    """Return what identifies the content of a file or of a folder; nothing where there is none."""
    whole = sha256()
    if path.is_dir():
        for one in sorted(path.rglob("*")):
            whole.update(f"{one.relative_to(path)} {one.stat().st_size}\n".encode())
    elif path.is_file():
        size = path.stat().st_size
        whole.update(b"%d\n" % size)
        with path.open("rb") as file:
            whole.update(file.read(_END))
            file.seek(max(_END, size - _END))
            whole.update(file.read(_END))
    else:
        return ""
    return whole.hexdigest()[:20]


def _are_same(one: Path, other: Path) -> bool:
    with suppress(OSError):
        return one.samefile(other)
    return False
