"""Arrays and their checks, a cache of small ones, and the memory that input has to fit into."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from patchlaw.support.errors import InputError

Array: TypeAlias = NDArray[np.float64]
"""Real numbers."""

Flags: TypeAlias = NDArray[np.bool_]
"""Truth values."""

Indices: TypeAlias = NDArray[np.intp]
"""Indices into other arrays."""

Counts: TypeAlias = NDArray[np.int64]
"""Whole numbers: of things, or those that files give to nodes."""

Locals: TypeAlias = NDArray[np.int32]
"""Rank-local numbers of cells, facets and nodes, as dolfinx has them."""


P = ParamSpec("P")
T = TypeVar("T")


def cached_where_small(
    is_small: Callable[P, bool], *, most: int
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Return a decorator that caches the results of a function for some of its arguments.

    Args:
        is_small: Tells from the arguments, which are hashable, whether the result is cached.
        most: Results that are cached, those used last. They must not be changed.
    """

    def decorated(make: Callable[P, T]) -> Callable[P, T]:
        cached = lru_cache(maxsize=most)(make)

        @wraps(make)
        def made(*args: P.args, **kwargs: P.kwargs) -> T:
            return (cached if is_small(*args, **kwargs) else make)(*args, **kwargs)  # type: ignore[arg-type]

        made.cache_clear, made.cache_info = cached.cache_clear, cached.cache_info  # type: ignore[attr-defined]
        return made

    return decorated


SMALLEST, LARGEST = 1e-15, 1e15
"""Range of lengths whose squares and products stay within double precision [mm]."""

PROGRAM = 1.0e9
"""Address space of the program with all its libraries; 0.88 GB were measured on two cores [B]."""


def check_file(path: Path, file: str | None = None) -> None:
    """Refuse what is no regular file: pipes and devices may never end.

    Args:
        path: Its name.
        file: What the error calls it; nothing when not given.

    Raises:
        InputError: When there is nothing of this name, or a folder, or the user may not read it.
    """
    with reading(path, file):
        if not path.is_file():
            problem = "is no regular file" if path.exists() else "there is no such file"
            problem = "is a folder" if path.is_dir() else problem
            raise InputError(problem, allowed="a file" if path.is_dir() else None, file=file)
        if not os.access(path, os.R_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


@contextmanager
def reading(path: Path, file: str | None = None) -> Iterator[None]:
    """Turn an error of the system while a file of a user is read into one that names the file.

    Args:
        path: The file.
        file: What the error calls it; its name when not given.

    Raises:
        InputError: When the system raised an error.
    """
    try:
        yield
    except OSError as error:
        name = file or str(error.filename or path)
        raise InputError(f"cannot be read: {error.strerror or error}", file=name) from None


def is_level(heights: Array, among: Array | None = None) -> bool:
    """Tell whether heights differ by rounding alone.

    Args:
        heights: Heights [mm]; those that are not finite do not count.
        among: The heights that they were computed from [mm], those that are finite; by default
            they themselves.
    """
    finite = heights[np.isfinite(heights)]
    if not finite.size:
        return False
    size = float(np.abs(finite if among is None else among[np.isfinite(among)]).max())
    # halves, as the range of heights near the largest number would overflow
    return float(np.ptp(0.5 * finite)) <= 32.0 * float(np.finfo(float).eps) * size


def check_scale(heights: Array) -> None:
    """Refuse roughness so fine that squares of its curvatures leave double precision.

    Args:
        heights: Heights [mm]; those that are not finite are ignored.

    Raises:
        InputError: When they are not level, but differ by less than `SMALLEST`.
    """
    finite = heights[np.isfinite(heights)]
    if not finite.size or is_level(finite):
        return
    range_ = 2.0 * float(np.ptp(0.5 * finite))
    if range_ < SMALLEST:
        raise InputError(
            "the heights differ by less than any roughness",
            value=range_,
            allowed=f"equal heights, or differences of at least {SMALLEST:g} mm",
        )


def real_array(value: Any) -> Array:
    """Return real numbers in double precision; what is masked becomes not a number.

    All arrays of users enter by this way: numpy drops masks and units of others in silence.

    Args:
        value: Numbers, an array of any memory order and byte order, or a masked one; they are
            copied only where they have to be.

    Raises:
        InputError: When it has a unit, or is complex, logical, ragged, or of objects.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value  # 20 µs less, which laws of users are asked for at every closure
    allowed = "whole or floating-point numbers"
    for unit in (getattr(value, "units", None), getattr(value, "unit", None)):
        if unit is not None:  # of pint, astropy or xarray
            raise InputError(f"an array with the unit '{unit}'", allowed=f"{allowed} without one")
    try:
        array = np.ma.asarray(value)
    except ValueError:
        raise InputError("not an array of numbers: its rows differ", allowed=allowed) from None
    if array.dtype.kind not in "iuf":
        kind = str(array.dtype)
        raise InputError("not an array of real numbers", value=kind, allowed=allowed)
    with np.errstate(over="ignore", invalid="ignore"):  # long doubles may become infinite
        return np.asarray(array.astype(np.float64, copy=False).filled(np.nan))


def frozen_array(value: Any) -> Array:
    """Return a contiguous, read-only float64 copy of real numbers, see `real_array`."""
    array = np.array(real_array(value), order="C")
    array.setflags(write=False)
    return array


def address_space() -> float:
    """Return the address space that this process may fill with data [B].

    That is its limit (``ulimit -v``), less what the program takes itself; infinite without one.
    """
    with suppress(ImportError):  # Windows has none
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        return math.inf if limit == resource.RLIM_INFINITY else limit - PROGRAM
    return math.inf


def physical_memory() -> float:
    """Return the memory of this node [B]; infinite where the system does not say it."""
    with suppress(AttributeError, ValueError):
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return math.inf


def process_memory() -> float:
    """Return the memory that this process may fill with data: the machine's, or less [B]."""
    return min(physical_memory(), address_space())
