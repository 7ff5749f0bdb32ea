"""Planes over a periodic surface for which there is no contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from patchlaw.geometry import Control
from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError


def check_plane(
    control: Control,
    interference: Array,
    area: float,
    slopes: Sequence[FiniteSlopes],
    hardness: float | None,
) -> None:
    """Refuse a plane that is not level, an approach beyond full contact, a force beyond all.

    Args:
        control: What is prescribed.
        interference: Interference at zero free motions, shape (nx, ny) [mm].
        area: Area of the period [mm²].
        slopes: What finite slopes of the bodies add.
        hardness: Largest pressure [MPa], or None.

    Raises:
        InputError: When there is no such contact.
    """
    if control.tilt is None or any(control.tilt):
        problem, value = "a plane over a periodic surface must be level", control.tilt or "free"
        raise InputError(problem, value=value, allowed="tilt (0, 0)")
    mean = float(interference.mean())
    # under a hardness no approach closes all gaps, and finite slopes change the last one
    bounded = hardness is None and not slopes
    if control.approach is not None and mean >= 0.0 and bounded:
        raise no_gap_left(control.approach, mean)
    young = min((one.material.young_modulus for one in slopes), default=np.inf)
    mean = 0.0 if control.force is None else control.force / area
    if mean >= young:
        problem = "finite slopes end where the mean pressure is the Young's modulus"
        raise InputError(problem, value=control.force, allowed=f"a pressure < {young:.6g} MPa")


def no_gap_left(approach: float, beyond: float) -> InputError:
    """Return the error on an approach at which no gap is left.

    Args:
        approach: The approach [mm].
        beyond: How far it is beyond the last one with a gap [mm].
    """
    allowed = f"< {approach - beyond:.6g} mm; beyond it give the force"
    problem = "a periodic surface has no gap left at this approach"
    return InputError(problem, value=approach, allowed=allowed)
