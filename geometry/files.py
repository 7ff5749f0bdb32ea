"""Surfaces from files: numpy arrays, text matrices, point lists, instrument formats."""

from __future__ import annotations

import io
import math
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from geometry.checks import (
    LARGEST,
    cell_counts,
    check_scale,
    is_level,
    positive_lengths,
    process_memory,
)
from geometry.errors import InputError
from geometry.instruments import read_instrument
from geometry.missing import filled
from geometry.surface import Surface

Array = NDArray[np.float64]
Content = tuple[Array, tuple[float, float] | None]

BYTES_PER_HEIGHT = 100
"""Memory that surface, spline and spectrum take per height, roughly [B]."""

_BYTES_PER_CHARACTER = 8
"""Memory that a text takes per character while it is read, roughly [B]."""
_PLACE_TOLERANCE = 0.01
"""Distance of a point from its place on a regular grid that is accepted [cells]."""


def read_surface(
    path: str | os.PathLike[str],
    *,
    lengths: tuple[float, float] | None = None,
    grid: tuple[int, int] | None = None,
    periodic: bool = False,
    missing: Literal["refuse", "fill"] = "refuse",
) -> Surface:
    """Read heights at cell centres from a file, whose suffix tells its format.

    * ``.npy``: an array with index [ix, iy];
    * ``.txt``, ``.dat``, ``.csv``: a matrix whose row index is ix, columns separated by white
      space, commas or semicolons, comments after ``#``;
    * ``.xyz``: columns x, y, z of the points of a regular grid in any order [mm];
    * any other: an instrument's format, through the optional package SurfaceTopography.

    Args:
        path: The file.
        lengths: Sides (Lx, Ly) [mm]. Needed for arrays and matrices; overrides what a point list
            or an instrument's file says.
        grid: Numbers of heights (nx, ny) that the file must have; any when not given.
        periodic: Whether the heights continue periodically.
        missing: What to do with heights that are not a number: refuse the file, or fill them, see
            `geometry.missing.filled`; the surface's source then says how many they were.

    Returns:
        The surface, with heights in mm.

    Raises:
        InputError: When the file is missing, unreadable or does not fit, naming the file.
    """
    file = Path(path)
    try:
        if not _is_file(file):  # pipes and devices are refused too: they may never end
            raise InputError("there is no such file")
        heights, found = _READERS.get(file.suffix.lower(), read_instrument)(file)
        sides = lengths if lengths is not None else found
        if sides is None:
            raise InputError(
                "the file has no lengths, they must be given", allowed="lengths (Lx, Ly) in mm"
            )
        sides, source = positive_lengths(sides, "the surface"), str(file)
        gaps = _gaps(heights)
        if len(gaps) and missing == "fill":
            nx, ny = heights.shape
            heights, share = filled(heights, (sides[0] / nx, sides[1] / ny))
            source += f", {share:.3g} of the heights missing and filled by a membrane"
        elif len(gaps):
            first = tuple(int(index) for index in gaps[0])
            raise InputError(
                f"{len(gaps)} of {heights.size} heights are not finite, the first at index {first}",
                value=float("nan"),
                allowed="finite heights in mm; missing = 'fill' closes gaps by a membrane",
            )
        check_scale(heights)
        if is_level(heights) and 0.0 < np.ptp(heights) < np.inf:
            heights = np.full_like(heights, heights.mean())
            source += ", level but for rounding"
        surface = Surface(heights=heights, lengths=sides, periodic=periodic, source=source)
        if grid is not None and surface.grid != cell_counts(grid, "the grid of the surface"):
            raise InputError(
                "the file's number of heights differs from the grid that was asked for",
                value=surface.grid,
                allowed=f"{tuple(grid)}",
            )
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=str(file)) from None
    except InputError as error:
        raise error.located(file=str(file)) from None
    return surface


def _gaps(heights: Array) -> NDArray[np.intp]:
    """Return the indices of missing heights of what may be a surface, shape (n, 2)."""
    if heights.ndim != 2 or heights.dtype.kind != "f":  # refused as a surface, if it is none
        return np.empty((0, 2), dtype=np.intp)
    return np.argwhere(np.isnan(heights))


def _is_file(file: Path) -> bool:
    try:
        return file.is_file()
    except OSError:  # a name longer than any, a folder that may not be entered
        return False


def _read_array(file: Path) -> Content:
    """Return the array of a ``.npy`` file, after all that its header states has been checked."""
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
        _check_memory(count * BYTES_PER_HEIGHT)
        flat = np.fromfile(stream, dtype=dtype, count=count)
    return flat.reshape(shape, order="F" if transposed else "C"), None


def _array_header(stream: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, whether it is in Fortran's order, and type of a ``.npy`` file."""
    form = np.lib.format
    readers = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
    try:
        return readers[form.read_magic(stream)](stream)
    except KeyError:
        raise InputError("not a numpy array of a known version", allowed="1.0, 2.0") from None
    except Exception as error:  # whatever the parser of the header meets
        raise InputError(f"not a readable numpy array: {_first_line(error)}") from None


def _check_memory(needed: float) -> None:
    memory = process_memory()
    if needed > memory:
        raise InputError(
            f"the heights need about {needed / 1e9:.3g} GB of memory",
            allowed=f"what fits into {memory / 1e9:.3g} GB",
        )


def _read_matrix(file: Path) -> Content:
    return _load_text(file), None


def _read_points(file: Path) -> Content:
    points = _load_text(file)
    if points.shape[1] != 3:
        raise InputError(
            "a point list needs three columns x, y, z",
            value=points.shape[1],
            allowed="3 columns",
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
    return heights, (heights.shape[0] * dx, heights.shape[1] * dy)


_READERS: dict[str, Callable[[Path], Content]] = {
    ".npy": _read_array,
    ".txt": _read_matrix,
    ".dat": _read_matrix,
    ".csv": _read_matrix,
    ".xyz": _read_points,
}


def _load_text(file: Path) -> Array:
    """Return a matrix of numbers, whichever of the usual separators the text has."""
    _check_memory(file.stat().st_size * _BYTES_PER_CHARACTER)
    try:
        text = file.read_text(encoding="utf-8-sig")
        rows = (line.partition("#")[0].strip() for line in text.splitlines())
        first = next((row for row in rows if row), "")
        # One separator for all rows: a decimal comma is an error then, not another column.
        separator = next((sign for sign in ";," if sign in first), None)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # an empty file is reported below
            matrix = np.loadtxt(io.StringIO(text), delimiter=separator, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"not a matrix of numbers: {_first_line(error)}") from None
    if matrix.size == 0:
        raise InputError("the file is empty")
    _check_memory(matrix.size * BYTES_PER_HEIGHT)
    return matrix


def _places(coordinate: Array, axis: str) -> tuple[NDArray[np.intp], float]:
    """Return the index of every coordinate on an even division, and the division's step [mm]."""
    lowest, span = coordinate.min(), float(np.ptp(coordinate))
    gaps = np.diff(np.sort(coordinate))
    if not span:
        raise InputError(f"all points have the same {axis}, they are not a surface")
    count = round(span / float(np.median(gaps[gaps > 0.3 * gaps.max()])))  # without rounding noise
    step = span / count
    place = (coordinate - lowest) / step
    index = np.rint(place).astype(np.intp)
    if np.max(np.abs(place - index)) > _PLACE_TOLERANCE:
        raise InputError(f"the points are not evenly spaced along {axis}")
    return index, step


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
