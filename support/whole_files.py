"""Files that stand under their names whole, or not at all."""

from __future__ import annotations

import csv
import errno
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any
from uuid import uuid4

from patchlaw.support.errors import NotWritten

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
            with partial.open("rb") as file:
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
