"""Heights from instruments' formats, through the optional package SurfaceTopography."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]


def read_instrument(file: Path) -> tuple[Array, tuple[float, float]]:
    """Read the default channel of an instrument's file.

    Args:
        file: The file.

    Returns:
        Heights, shape (nx, ny) [mm], not a number where the instrument saw none, and the sides
        (Lx, Ly) [mm].

    Raises:
        InputError: When SurfaceTopography is not installed or cannot read the file, or the file
            is a profile or does not state its unit.
    """
    try:
        library = importlib.import_module("SurfaceTopography")
    except ImportError:
        raise InputError(
            f"the format {file.suffix or 'without suffix'} is not known here; instruments' formats "
            "need the extra patchlaw[instruments]",
            allowed=".npy, .txt, .dat, .csv, .xyz",
        ) from None
    try:
        topography = library.read_topography(str(file))
    except Exception as error:  # its readers raise errors of many families
        lines = str(error).splitlines()  # many when it tried all its readers in vain
        reason = lines[0] if len(lines) == 1 else type(error).__name__
        raise InputError(f"SurfaceTopography cannot read it: {reason}") from None
    if topography.dim != 2:
        raise InputError("the file holds a profile, not a surface", value=topography.dim)
    if not topography.unit:
        raise InputError("the file does not state the unit of its lengths")
    topography = topography.to_unit("mm")
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=np.float64), np.nan)
    length_x, length_y = topography.physical_sizes
    return heights, (float(length_x), float(length_y))
