"""Shift of a plane under a prescribed shear force, where friction transmits it.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geometry.rigid_plane import Control
from geometry.sliders import SliderResponse
from support.arrays import Array
from support.errors import NotConverged

_MOST_STEPS = 100
_FARTHEST = 4.0
"""Largest step to the shift, in shifts that all springs could stick over."""
_SHORTER = 0.0, 1e-3, 1e-2, 0.1, 1.0, 4.0
"""Parts of the stiffness of springs that all stick, which shorten steps to the shift."""
_ENOUGH = 1e-12
"""Residual of a prescribed shear force, relative to the largest that friction transmits."""


def find_shift(
    respond: Callable[[Array], SliderResponse],
    total: Callable[[Array], Array],
    shift: Array,
    control: Control,
    most: float,
) -> tuple[Array, SliderResponse]:
    """Find the shift under which the shear stresses have the prescribed sum.

    That is the minimum of a convex function of the shift. Newton's steps are shortened towards
    those on springs that all stick, which are stiffer than any others.

    Args:
        respond: Returns the shear stresses of this rank's samples under a shift, shape (2,) [mm].
        total: Returns integrals over the face of values of samples, shapes (n, k) to (k,).
        shift: The shift to start from, shape (2,) [mm].
        control: What is prescribed: a shear force.
        most: The largest shear force that friction transmits [N].

    Returns:
        The shift, and the shear stresses under it.

    Raises:
        NotConverged: When the contact does not transmit the force.

    Note:
        Collective.
    """
    assert control.shear is not None and control.shear.force is not None
    force, found = np.array(control.shear.force), respond(shift)
    off = total(found.stress) - force
    for _ in range(_MOST_STEPS):
        if np.hypot(*off) <= _ENOUGH * most:
            return shift, found
        resistance = total(found.by_slip.reshape(-1, 4)).reshape(2, 2)
        stiffest = float(total(found.sticking[:, None])[0])
        for share in _SHORTER:
            matrix = resistance + share * stiffest * np.eye(2)
            move = -np.linalg.lstsq(matrix, off, rcond=1e-13)[0]
            move *= min(1.0, _FARTHEST * most / (stiffest * float(np.hypot(*move)) or np.inf))
            tried = respond(shift + move)
            left = total(tried.stress) - force
            if left @ move < 0.0 or np.hypot(*left) < np.hypot(*off):
                break
        else:
            if np.hypot(*off) <= 1e3 * _ENOUGH * most:  # rounding
                return shift, found
            break
        shift, found, off = shift + move, tried, left
    raise NotConverged(
        f"the sliding of the plane at {control}",
        reason="SLIDES" if np.hypot(*force) >= most else "NO_SHIFT",
        iterations=0,
        remedy="take a smaller shear force, a larger force, or prescribe the shift",
    )
