"""Writes files whole or not at all."""

from __future__ import annotations

import csv
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from geometry.errors import NotWritten


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


def write_whole(path: Path, write: Callable[[Path], object]) -> Path:
    """Write a file under a temporary name beside it and rename it when it is complete.

    Args:
        path: Final name; its folder is made when missing.
        write: Writes the file whose name it is given; the suffix is that of the final name.

    Returns:
        The final name.

    Raises:
        NotWritten: When the system refuses; whatever stood under the final name stands there still.
    """
    partial = path.with_name(f".{path.stem}.partial-{os.getpid()}{path.suffix}")
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            write(partial)
            with partial.open("rb") as file:
                os.fsync(file.fileno())  # lest a crash of the machine leave the name without data
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    return path


def remove_partial(folder: Path) -> None:
    """Remove the half-written files of runs that were killed.

    Args:
        folder: Folder of results; no other run may be writing there.
    """
    for path in folder.glob(".*.partial-*"):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def remove(path: Path) -> None:
    """Remove a file, or a folder written by ADIOS2, if it is there; leave all other folders.

    Args:
        path: Its name.
    """
    if path.suffix == ".bp" and path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def write_json(path: Path, content: dict[str, Any]) -> Path:
    """Write a dictionary as indented JSON.

    Args:
        path: File to write.
        content: What JSON can hold; everything else is written as its text.
    """
    return write_text(path, json.dumps(content, indent=2, default=str) + "\n")


def write_bytes(path: Path, content: bytes) -> Path:
    """Write bytes.

    Args:
        path: File to write.
        content: Its content.
    """
    return write_whole(path, lambda partial: partial.write_bytes(content))


def write_text(path: Path, text: str) -> Path:
    """Write a text as UTF-8.

    Args:
        path: File to write.
        text: Its content.
    """
    return write_whole(path, lambda partial: partial.write_text(text, encoding="utf-8"))


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> Path:
    """Write rows; numbers keep all their digits (Python's shortest exact form).

    Args:
        path: File to write.
        header: Names of the columns.
        rows: Their values; an unknown value, None or NaN, leaves its cell empty.
    """

    def write(partial: Path) -> None:
        with partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows([_plain(value) for value in row] for row in rows)

    return write_whole(path, write)


def _plain(value: Any) -> Any:
    """Return what stands in a cell: numpy's scalars as Python's own, nothing for NaN.

    The text of Python's numbers is the same on every numpy release.
    """
    plain = value.item() if hasattr(value, "item") else value
    return None if plain != plain else plain
