"""Contact and friction that see each other: pressures and tractions in turn until they agree.

Pressures displace the surface sideways, which shears the contact, and tractions displace it across,
which changes the pressures. Both displacements are those of `micro.friction.tangential_grid`. Each
problem is solved for what the other one displaced; the displacements across are extrapolated from
the last few passes.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from geometry import Control
from geometry.contact_state import ContactState, ShearState
from micro.complementarity.slope_iteration import AndersonMixing
from micro.friction.friction_model import FrictionModel
from micro.half_space.model import HalfSpaceModel
from support.errors import NotConverged

TOLERANCE = 1e-6
"""Change of the displacements across by a further pass, over the largest displacement."""
_MOST_PASSES = 30


def press_coupled(
    normal: HalfSpaceModel,
    friction: FrictionModel,
    control: Control,
    before: ShearState | None,
    **options: Any,
) -> tuple[ContactState, ShearState]:
    """Solve one load step of a contact whose pressures and tractions see each other.

    Args:
        normal: The normal contact.
        friction: Friction on its cells.
        control: What is prescribed of the plane, with its shear.
        before: The shear at the load step before; None where nothing has touched yet.
        options: What else `HalfSpaceModel.press` takes.

    Returns:
        The contact, and its shear.

    Raises:
        NotConverged: When one of them is not found, or they do not agree.

    Source:
        The alternation is that of Kalker, Three-Dimensional Elastic Bodies in Rolling Contact
        (1990), section 4.3.1 (Panagiotopoulos' process).
    """
    assert control.shear is not None
    grid = normal.surface.grid
    cross, mixing, products, change = friction.cross(grid), AndersonMixing(), 0, np.inf
    displaced = np.zeros(grid)
    if cross is not None and before is not None:
        displaced = cross.across(before.traction)
    for _ in range(_MOST_PASSES):
        state = normal.press(control, displaced=displaced, **options)
        shear = friction.advance(before, state.pressures, control.shear)
        products += state.iterations + shear.products
        if cross is None or not shear.closed.any():
            break
        across = cross.across(shear.traction)
        moved = state.displacement
        assert moved is not None
        change = float(np.abs(across - displaced)[shear.closed].max() / np.abs(moved).max())
        if change <= TOLERANCE:
            break
        displaced = mixing.next(displaced, -displaced, across, np.ones(grid, bool))
        options["start"] = replace(state.guess, plastic_depth=state.earlier_depth)
    else:
        raise NotConverged(
            f"pressures and tractions together (their displacements still change by {change:.1e})",
            reason="they do not agree",
            iterations=products,
            remedy="take smaller load steps, or set friction.coupled = false",
        )
    return replace(state, iterations=products - shear.products), shear
