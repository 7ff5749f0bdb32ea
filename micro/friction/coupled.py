"""Contact and friction that see each other: pressures and tractions in turn until they agree.

Pressures displace the surface sideways, which shears the contact, and tractions displace it across,
which changes the pressures. Both displacements are those of `micro.friction.tangential_grid`. Where
cells slip they wear, which lowers the surface: the depth of a load step is that of the pressures
and slips at its end, an implicit Euler step as in `micro.wear`. Each problem is solved for what the
other one displaced and wore off; displacements are extrapolated from the last few passes.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from patchlaw.geometry import Control, ShearState
from patchlaw.geometry.contact_state import ContactState, sum_of
from patchlaw.micro.complementarity.slope_iteration import AndersonMixing
from patchlaw.micro.friction.friction_model import FrictionModel, TractionRates
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.micro.half_space.read_off import rates_of_pressures
from patchlaw.support import Array, NotConverged

TOLERANCE = 1e-6
"""Change of the displacements across by a further pass, over the largest displacement, at least;
the tolerance of the friction where that is larger."""
_MOST_PASSES = 120
_MIXING: dict[str, Any] = {"memory": 60, "noise": np.inf, "dependent": 1e-4}
"""Mixing of the displacements across. Where friction holds far more than pressures pull, a pass
changes them by several times what they are off. Spheres and rough surfaces went all of 8 load steps
up to μ β = 5; with the mixing of finite slopes, which leaves out such changes, 7 of 14 did not
converge, from μ β = 1.5 on."""
_RATES = 1e-5
"""Part of the shift that displacements and their further changes leave in the stiffness, whose
error is of their size."""


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
        The contact, and its shear. What the step has worn off is exactly k/μ of the energy that it
        lost, cell by cell.

    Raises:
        NotConverged: When one of them is not found, or they do not agree.

    Source:
        The alternation is that of Kalker, Three-Dimensional Elastic Bodies in Rolling Contact
        (1990), section 4.3.1 (Panagiotopoulos' process).
    """
    assert control.shear is not None
    grid, mixing, products = normal.surface.grid, AndersonMixing(**_MIXING), 0
    cross, first = friction.cross(grid) if friction.coupled else None, options.get("start")
    depth, worn = (None, None) if first is None else (first.plastic_depth, first.worn_depth)
    normal = wearing = normal if worn is None else normal.worn(worn)
    heat, shear = 0.0 if before is None else before.heat, before
    displaced = across = np.zeros(grid)  # by tractions
    if cross is not None and before is not None:
        displaced = cross.across(before.traction)
    for _ in range(_MOST_PASSES):
        state = wearing.press(control, displaced=displaced if friction.coupled else None, **options)
        shear = friction.advance(before, state.pressures, control.shear, near=shear)
        products += state.iterations + shear.products
        if cross is not None and shear.closed.any():
            across = cross.across(shear.traction)
        off = friction.worn_by(shear.heat - heat)  # in the step
        change = _disagreement(state, np.where(shear.closed, across - displaced, 0.0), off, worn)
        if change <= max(TOLERANCE, friction.tolerance):
            state = replace(state, worn_depth=sum_of(worn, off) if friction.wear else worn)
            return replace(state, iterations=products - shear.products), shear
        displaced = mixing.next(displaced, -displaced, across, np.ones(grid, bool))
        if friction.wear:
            wearing = normal.wearing(
                np.divide(off, state.pressures, out=np.zeros(grid), where=shear.closed)
            )
        options["start"] = replace(state.guess, plastic_depth=depth, worn_depth=worn)
    raise NotConverged(
        f"pressures and tractions together (their displacements still change by {change:.1e})",
        reason="they do not agree",
        iterations=products,
        remedy="take smaller load steps"
        + ", or set friction.coupled = false" * friction.coupled
        + ", or a smaller coefficient of wear" * bool(friction.wear),
    )


def _disagreement(state: ContactState, across: Array, off: Array, worn: Array | None) -> float:
    """Return what a further pass changes, over the largest displacement.

    Args:
        state: The contact, of what had worn off by the pass before.
        across: Change of the displacements across by tractions, shape (nx, ny) [mm].
        off: What the tractions wear off in the step, likewise.
        worn: What had worn off before it, likewise; None for nothing.
    """
    seen = sum_of(state.worn_depth, None if worn is None else -worn)
    unseen = np.abs(off - (0.0 if seen is None else seen))
    moved = float(np.abs(state.displacement).max())  # type: ignore[arg-type]
    return float(np.maximum(np.abs(across), unseen).max()) / max(moved, float(np.finfo(float).tiny))


def coupled_stiffness(
    normal: HalfSpaceModel,
    friction: FrictionModel,
    control: Control,
    state: ContactState,
    shear: ShearState,
) -> tuple[float, int]:
    """Return the slope of the shear force of a coupled contact; see `FrictionModel.stiffness`.

    Pressures change with the shift, under what else is prescribed of the plane. Their rates and
    those of the tractions are found in turn.

    Args:
        normal: The normal contact.
        friction: Friction on its cells.
        control: What the load step prescribed of the plane.
        state: The contact at its end.
        shear: Its shear.

    Returns:
        The derivative along the last change of the shift [N/mm], NaN where it is not found or cells
        yield, and the products of the compliances.
    """
    cross = friction.cross(normal.surface.grid) if friction.coupled else None
    if cross is None or not shear.closed.any():
        return friction.stiffness(shear)
    if state.yielding is not None and state.yielding.any():
        return np.nan, 0
    found, mixing, products = TractionRates(friction, shear), AndersonMixing(**_MIXING), 0
    every, moved = np.ones(normal.surface.grid, bool), np.zeros(normal.surface.grid)
    for _ in range(_MOST_PASSES):
        rates, used = rates_of_pressures(normal, state, control.free, moved, _RATES)
        products += used
        way = found.ahead - found.on_cells(cross.sideways(rates))
        bound = friction.coefficient * found.on_cells(rates)
        value = found.solve(way, _RATES, bound)
        if not np.isfinite(value):
            break
        across = cross.across(found.on_grid(found.rate))
        if float(np.abs(across - moved)[shear.closed].max()) <= _RATES:
            along = float(np.vdot(found.rate, found.ahead))
            return along * friction.cell, products + found.products
        moved = mixing.next(moved, -moved, across, every)
    return np.nan, products + found.products
