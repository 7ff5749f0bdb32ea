"""Files that stand under their names whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from support.errors import NotWritten


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
    # processes of several nodes may write the same file of a cache
    partial = path.with_name(f".{path.stem}.partial-{uuid4().hex}{path.suffix}")
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


def write_bytes(path: Path, content: bytes) -> Path:
    """Write bytes.

    Args:
        path: File to write.
        content: Its content.
    """
    return write_whole(path, lambda partial: partial.write_bytes(content))
