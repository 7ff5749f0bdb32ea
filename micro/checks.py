"""Checks of the arguments that all micro models share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Partition, PatchGrid, Surface
from geometry.errors import InputError

Array = NDArray[np.float64]


def whole_patch(surface: Surface) -> PatchGrid:
    """Return the single patch that a surface's rectangle is."""
    return PatchGrid(grid=(1, 1), lengths=surface.lengths)


def checked_approaches(approaches: ArrayLike) -> Array:
    """Return approaches as an array of shape (m,) [mm].

    Raises:
        InputError: When they are no finite, non-empty list of numbers.
    """
    allowed = "a number or a list of finite numbers in mm"
    try:
        given = np.atleast_1d(np.asarray(approaches, float))
    except (TypeError, ValueError):
        raise InputError(
            "the approaches are no numbers", value=approaches, allowed=allowed
        ) from None
    if given.size == 0:
        raise InputError("a response needs at least one approach", value=[])
    if given.ndim != 1:
        raise InputError("the approaches are no list", value=given.shape, allowed=allowed)
    if not np.isfinite(given).all():
        first = float(given[~np.isfinite(given)][0])
        raise InputError("the approach must be finite", value=first, allowed="mm")
    return given


def checked_means(mean_heights: ArrayLike, patches: Partition) -> Array:
    """Return the mean heights of patches as an array.

    Raises:
        InputError: When there is not one finite number for every patch.
    """
    allowed = f"shape ({patches.count},)"
    try:
        means = np.asarray(mean_heights, float)
    except (TypeError, ValueError):
        raise InputError(
            "the mean heights are no numbers", value=mean_heights, allowed=allowed
        ) from None
    if means.shape != (patches.count,):
        raise InputError(
            "every patch needs one mean height",
            value=means.shape,
            allowed=allowed,
        )
    if not np.isfinite(means).all():
        raise InputError("a mean height is not finite", value=means.tolist(), allowed="mm")
    return means
