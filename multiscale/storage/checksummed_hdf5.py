"""Seals HDF5 files: a checksum over all bytes stands before them and is verified first.

The library that reads HDF5 believes what a file says of itself: a few damaged bytes can make it
ask for gigabytes, or end the process. The checksum stands in the block that HDF5 leaves to users
at the begin of a file, so that every reader of HDF5 opens a sealed file as it is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from geometry.errors import InputError

_ROOM = 512  # bytes, the least that HDF5 leaves to users
_MARK = b"patchlaw, SHA-256 of all bytes from 512 on: "


def checksummed(fill: Callable[[Any], None]) -> bytes:
    """Return the bytes of a sealed HDF5 file.

    Args:
        fill: Writes the content into the open `h5py.File` that it is given.
    """
    image = BytesIO()  # HDF5 itself may not survive a full disk
    with h5py.File(image, "w", userblock_size=_ROOM) as file:
        fill(file)
    content = image.getbuffer()
    content[:_ROOM] = _head(content)
    return image.getvalue()


def checksum(content: bytes) -> bytes:
    """Return the bytes of an HDF5 file with the checksum that fits them.

    Args:
        content: The file's bytes, with room for the checksum.
    """
    return _head(content) + content[_ROOM:]


def verified(source: Path | BinaryIO) -> BytesIO:
    """Return the bytes of a sealed HDF5 file, found whole, for `h5py.File`.

    Args:
        source: The file, by name or open.

    Raises:
        InputError: When it has no seal, or its bytes do not fit it.
        OSError: When it cannot be read.
    """
    content = source.read_bytes() if isinstance(source, Path) else source.read()
    if not content.startswith(_MARK):
        raise InputError("has no checksum before its content: it is none of ours, or an older one")
    if content[:_ROOM] != _head(content):
        raise InputError("is damaged: its checksum does not fit its content")
    return BytesIO(content)


def _head(content: bytes | memoryview) -> bytes:
    """Return what stands before the content that HDF5 sees: mark, checksum, zeros."""
    check = hashlib.sha256(memoryview(content)[_ROOM:]).hexdigest()
    return (_MARK + check.encode() + b"\n").ljust(_ROOM, b"\0")
