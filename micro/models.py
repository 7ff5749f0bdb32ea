"""The micro models by name, and what they have in common."""

from __future__ import annotations

from typing import Any, Protocol, Self

from numpy.typing import ArrayLike

from geometry import Partition, PatchGrid, Surface, find_asperities
from geometry.errors import InputError
from micro.asperity_models import MODELS, asperity_model
from micro.half_space import HalfSpaceModel
from micro.plane import RigidPlane
from micro.regions.islands import IslandModel
from micro.response import Pressed, Response
from micro.summits.scaled_model import ScaledModel

MODEL_NAMES = (*MODELS, "islands", "half-space")
"""Names of all micro models, the cheapest kinds first."""


class MicroModel(Protocol):
    """A rough surface on an elastic half-space, pressed by a rigid plane."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def contact_modulus(self) -> float:
        """E* [MPa]."""

    @property
    def datum(self) -> float:
        """Height z_M that the approach counts from [mm]."""

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]."""

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch alone, with its approach counted alike, and its patch.

        Args:
            patches: Patches of the surface.
            index: Flat index of the patch.
        """

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        tilt: tuple[float, float] = (0.0, 0.0),
    ) -> Response:
        """Solve along approaches.

        Args:
            approaches: Rigid approaches at the centre of the rectangle, shape (m,) [mm].
            patches: Patches that results are summed over.
            mean_heights: Mean heights of the patches, shape (N,) [mm].
            tilt: Slopes (tx, ty) of the approach.

        Raises:
            InputError: When the arguments do not fit the surface.
            NotConverged: When the contact conditions cannot be met.
        """

    def press(
        self,
        plane: RigidPlane,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve under one plane, which may be tilted and sag.

        Args:
            plane: The plane, which turns about the centre of the surface's rectangle.
            patches: Patches that results are summed over.
            mean_heights: Mean heights of the patches, shape (N,) [mm].
            start: What this model returned under a plane nearby; None starts from nothing.

        Returns:
            The response and where to start the next plane from.

        Raises:
            InputError: When the arguments do not fit the surface.
            NotConverged: When the contact conditions cannot be met.
        """


def micro_model(
    name: str,
    surface: Surface,
    *,
    contact_modulus: float,
    solver: str = "active-set",
    curvature: str = "summit",
    border: str = "ignore",
) -> MicroModel:
    """Make a micro model of a surface whose border is free, as that of a block's top is.

    Args:
        name: A name in `MODEL_NAMES`.
        surface: The surface.
        contact_modulus: E* [MPa].
        solver: Solver of the interacting asperity models.
        curvature: Where asperity models take the curvature, a name in `CURVATURES`.
        border: What they make of maxima on the border, a name in `BORDERS`.

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
    return asperity_model(name, asperities, contact_modulus=contact_modulus, solver=solver)
