"""What slopes that are not small change in the force of a half-space model."""

from __future__ import annotations

from dataclasses import replace

from geometry import Surface
from geometry.errors import InputError
from micro.closed_forms.boussinesq import HalfSpace
from micro.compliance.finite_slopes import FiniteSlopes, coarse_grid
from micro.compliance.side_stresses import side_stresses
from micro.half_space.model import HalfSpaceModel
from micro.half_space.state import HalfSpaceState

_PASSES = 2
"""Solutions with slopes, each with the displacement of the one before: the force then changes by
less than 1e-4."""


def finite_slope_effect(
    model: HalfSpaceModel,
    approach: float,
    *,
    poisson_ratio: float,
    tilt: tuple[float, float] = (0.0, 0.0),
) -> float:
    """Return the relative change of the force by finite slopes; negative is less.

    Free sides of the model, which yield more where slopes are steep, are taken into account.

    Args:
        model: The surface on a half-space.
        approach: Approach at the middle of the surface [mm].
        poisson_ratio: ν of the half-space.
        tilt: Slopes of the plane.

    Raises:
        InputError: When ν is out of range or nothing touches.
        NotConverged: When a contact problem does not converge.
    """
    slopes = _slopes(model, poisson_ratio)
    small = model.solve(approach, tilt=tilt)
    if small.force <= 0.0:
        raise InputError("no contact at this approach", value=approach, allowed="more")
    found = small
    for _ in range(_PASSES):
        found = _lowered(model, slopes, found).solve(approach, tilt=tilt, start=found)
    return found.force / small.force - 1.0


def _slopes(model: HalfSpaceModel, poisson_ratio: float) -> FiniteSlopes:
    surface, sides = model.surface, model.sides
    modulus = model.contact_modulus * (1.0 - poisson_ratio**2)
    beside = []
    if sides is not None:
        cx, cy = coarse_grid(surface)
        beside = [side_stresses(sides, (surface.lengths[0] / cx, surface.lengths[1] / cy))]
    half_space = HalfSpace(young_modulus=modulus, poisson_ratio=poisson_ratio)
    return FiniteSlopes(surface, half_space, periodic=model.periodic, beside=beside)


def _lowered(model: HalfSpaceModel, slopes: FiniteSlopes, state: HalfSpaceState) -> HalfSpaceModel:
    """Return the model with its surface lowered by what slopes displace it."""
    surface = model.surface
    heights = surface.heights - slopes.displacement(state.pressure)
    lower = Surface(heights=heights, lengths=surface.lengths, periodic=surface.periodic)
    return replace(model, surface=lower, highest=model.reference_height)
