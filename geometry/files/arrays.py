"""Heights from numpy's files, of which nothing is believed before it is checked."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from geometry.files.content import BYTES_PER_HEIGHT, FileContent, check_memory
from support.errors import InputError


def read_array(file: Path) -> FileContent:
    """Read the array of a ``.npy`` file, index [ix, iy]; pickled objects are never loaded.

    Args:
        file: The file.

    Raises:
        InputError: When the file is no whole array of real numbers, or too large.
    """
    with file.open("rb") as stream:
        shape, transposed, dtype = _array_header(stream)
        count = math.prod(shape)
        if dtype.kind not in "biuf":  # pickled objects among them
            raise InputError("the heights are not an array of real numbers", value=str(dtype))
        if len(shape) != 2 or min(shape) < 0:
            raise InputError("not a two-dimensional array", value=shape, allowed="(nx, ny)")
        size = os.fstat(stream.fileno()).st_size - stream.tell()
        if size < count * dtype.itemsize:
            raise InputError(
                f"not a whole numpy array: it has {size} bytes of the {count * dtype.itemsize} "
                "that its header promises"
            )
        check_memory(count * BYTES_PER_HEIGHT)
        flat = np.fromfile(stream, dtype=dtype, count=count)
    return FileContent(heights=flat.reshape(shape, order="F" if transposed else "C"))


def _array_header(stream: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, whether it is in Fortran's order, and type of a ``.npy`` file."""
    form = np.lib.format
    readers = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
    try:
        return readers[form.read_magic(stream)](stream)
    except KeyError:
        raise InputError("not a numpy array of a known version", allowed="1.0, 2.0") from None
    except Exception as error:  # whatever the parser of the header meets
        raise InputError(f"not a readable numpy array: {first_line(error)}") from None


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, or its name where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
