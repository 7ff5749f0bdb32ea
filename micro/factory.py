"""The micro models by name."""

from __future__ import annotations

from geometry import Surface, find_asperities
from geometry.errors import InputError
from geometry.rigid_plane import RigidPlane
from micro.asperities.contacts import Equilibrium
from micro.asperities.model import MODELS, AsperityModel
from micro.asperities.scaled_model import ScaledModel
from micro.half_space.model import HalfSpaceModel
from micro.interaction.contact_problem import Solution
from micro.islands.model import IslandModel
from micro.model import MicroModel

MODEL_NAMES = (*MODELS, "islands", "half-space")
"""Names of all micro models, the cheapest kinds first."""

START_KINDS: tuple[type, ...] = (RigidPlane, Equilibrium, Solution)
"""Records that `Pressed.start` may consist of, besides arrays and tuples."""


def micro_model(
    name: str,
    surface: Surface,
    *,
    contact_modulus: float,
    solver: str = "active-set",
    curvature: str = "summit",
    border: str = "ignore",
) -> MicroModel:
    """Return the micro model of a surface whose border is free, as that of a block's top is.

    Args:
        name: A name in `MODEL_NAMES`.
        surface: The surface.
        contact_modulus: E* [MPa].
        solver: Solver of the interacting asperity models.
        curvature: Where asperity models take the curvature, a name in `CURVATURES`.
        border: How asperity models treat maxima on the border, a name in `BORDERS`.

    Raises:
        InputError: When there is no such model, option or solver, or the modulus is not positive.
    """
    if name == "half-space":
        return HalfSpaceModel(surface=surface, contact_modulus=contact_modulus)
    if name == "islands":
        return IslandModel(surface=surface, contact_modulus=contact_modulus)
    if name not in MODELS:
        raise InputError("unknown micro model", value=name, allowed=", ".join(MODEL_NAMES))
    if (curvature, border) != ("summit", "ignore"):
        return ScaledModel(
            kind=name,
            surface=surface,
            contact_modulus=contact_modulus,
            curvature=curvature,
            border=border,
            solver=solver,
        )
    asperities = find_asperities(surface, periodic=False)
    return AsperityModel(name, asperities, contact_modulus=contact_modulus, solver=solver)
