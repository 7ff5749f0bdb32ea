"""Heights from text: matrices, exported images that state their size and unit, point lists."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry.checks import LARGEST
from geometry.errors import InputError
from geometry.files.arrays import first_line
from geometry.files.content import (
    BYTES_PER_HEIGHT,
    LENGTH_UNITS,
    FileContent,
    check_memory,
    length_unit,
)

Array = NDArray[np.float64]

_BYTES_PER_CHARACTER = 8
"""Memory that a text takes per character while it is read, roughly [B]."""
_PLACE_TOLERANCE = 0.01
"""Distance of a point from its place on a regular grid that is accepted [cells]."""
_START = 4096
"""Bytes at the start of a file that tell text from other formats."""

_SIZE = re.compile(r"#[^:：]*[:：]\s*([0-9.,eE+-]+)\s*(\S+)\s*")
_VALUE_UNIT = re.compile(r"#\s*Value units\s*[:：]\s*(\S+)\s*", re.IGNORECASE)
_WORD = re.compile(r"#[^:：]*[:：]\s*(\S+)\s*")
_FOREIGN = re.compile(r"#\s*File Format\s*=")


def is_plain(file: Path) -> bool:
    """Tell whether a file is text that begins with numbers, after comments that begin with ``#``.

    Args:
        file: The file.
    """
    with file.open("rb") as stream:
        start = stream.read(_START)
    if b"\0" in start and not start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return False
    lines = [line.strip() for line in start.decode("utf-8-sig", "replace").splitlines()]
    if any(_FOREIGN.match(line) for line in lines):  # of SPIP, whose comments scale the heights
        return False
    first = next((line for line in lines if line and not line.startswith("#")), "0")
    return bool(re.match(r"[-+.0-9]|nan|inf", first, re.IGNORECASE))


def read_text(file: Path) -> FileContent:
    """Read a matrix of heights, or a list of points in three columns.

    The row index of a matrix is ix. White space, commas or semicolons separate its columns, and
    comments follow ``#``. Where comments state width, height and unit, as Gwyddion's export does,
    it is an image: a row runs along x.

    Args:
        file: The file; points where it has three columns.

    Raises:
        InputError: When it is no matrix of numbers, a profile, or points of no regular grid.
    """
    matrix, comments = _load_text(file)
    stated = next((found[1] for line in comments if (found := _VALUE_UNIT.fullmatch(line))), None)
    sizes = [found for line in comments if (found := _SIZE.fullmatch(line))]
    if file.suffix.lower() == ".xyz" or (matrix.shape[1] == 3 and not sizes):
        return _points(matrix)
    if min(matrix.shape) < 3:
        rows, columns = matrix.shape
        raise InputError(
            f"{rows} rows of {columns} numbers are a profile, not a surface",
            allowed="a matrix of heights, or three columns x, y, z",
        )
    if len(sizes) != 2 or any(size[2] not in {*LENGTH_UNITS, "µm", "μm"} for size in sizes):
        return FileContent(heights=matrix, unit=stated and length_unit(stated))
    after = comments[comments.index(sizes[1].string) + 1 :]
    unit = stated or next((found[1] for line in after if (found := _WORD.fullmatch(line))), None)
    x, y = (float(size[1].replace(",", ".")) * LENGTH_UNITS[length_unit(size[2])] for size in sizes)
    return FileContent(heights=matrix.T.copy(), lengths=(x, y), unit=unit and length_unit(unit))


def _points(points: Array) -> FileContent:
    """Return the heights of points x, y, z of a regular grid in any order."""
    if points.shape[1] != 3:
        raise InputError(
            "a point list needs three columns x, y, z",
            value=points.shape[1],
            allowed="3 columns; a list of x, z is a profile, not a surface",
        )
    if not np.all(np.abs(points[:, :2]) <= LARGEST):
        raise InputError(f"some coordinates x, y are not finite, or beyond {LARGEST:g} mm")
    (ix, dx), (iy, dy) = _places(points[:, 0], "x"), _places(points[:, 1], "y")
    nx, ny = int(ix.max()) + 1, int(iy.max()) + 1
    taken, times = np.unique(ix * ny + iy, return_counts=True)
    if taken.size != nx * ny or np.any(times != 1):
        raise InputError(
            f"the points do not fill a regular grid of {nx} × {ny}: "
            f"{nx * ny - taken.size} places are empty, "
            f"{np.count_nonzero(times > 1)} taken more than once"
        )
    heights = np.empty((nx, ny))
    heights[ix, iy] = points[:, 2]
    return FileContent(heights=heights, lengths=(nx * dx, ny * dy))


def _places(coordinate: Array, axis: str) -> tuple[NDArray[np.intp], float]:
    """Return the index of every coordinate on an even division, and the division's step [mm]."""
    lowest, span = coordinate.min(), float(np.ptp(coordinate))
    gaps = np.diff(np.sort(coordinate))
    if not span:
        raise InputError(f"all points have the same {axis}, they are a profile, not a surface")
    count = round(span / float(np.median(gaps[gaps > 0.3 * gaps.max()])))  # without rounding noise
    step = span / count
    place = (coordinate - lowest) / step
    index = np.rint(place).astype(np.intp)
    if np.max(np.abs(place - index)) > _PLACE_TOLERANCE:
        raise InputError(f"the points are not evenly spaced along {axis}")
    return index, step


def _load_text(file: Path) -> tuple[Array, list[str]]:
    """Return a matrix of numbers, whichever of the usual separators it has, and the comments."""
    check_memory(file.stat().st_size * _BYTES_PER_CHARACTER)
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
        comments = [line.strip() for line in lines if line.lstrip().startswith("#")]
        rows = [row for line in lines if (row := line.partition("#")[0].strip())]
        first = rows[0] if rows else ""
        # One separator for all rows: a decimal comma is an error then, not another column.
        separator = next((sign for sign in ";," if sign in first), None)
        if separator and all(row.endswith(separator) for row in rows):
            rows = [row[:-1] for row in rows]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # an empty file is reported below
            matrix = np.loadtxt(io.StringIO("\n".join(rows)), delimiter=separator, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"not a matrix of numbers: {first_line(error)}") from None
    if matrix.size == 0:
        raise InputError("the file is empty")
    check_memory(matrix.size * BYTES_PER_HEIGHT)
    return matrix, comments
