"""What all micro models have in common."""

from __future__ import annotations

from typing import Any, Protocol, Self

from numpy.typing import ArrayLike

from geometry import Control, Partition, PatchGrid
from micro.response import Pressed, Response


class MicroModel(Protocol):
    """A rough surface on an elastic body, pressed by a rigid plane."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def contact_modulus(self) -> float:
        """E* [MPa]."""

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]."""

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch alone, on its own half-space.

        It is meant for level planes: what a tilted one turns about is the middle of the rectangle
        that is left, the patch's for some models and the whole for others.

        Args:
            patches: Patches of the surface.
            index: Flat index of the patch.

        Returns:
            The model, whose approach counts from the whole surface's highest point, and its patch.
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
            approaches: Rigid approaches δ at the centre of the rectangle in any order, shape (m,)
                [mm].
            patches: Patches within the surface's rectangle that results are summed over.
            mean_heights: Mean heights of the surface on the patches, shape (N,) [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).

        Returns:
            The response, in the order of ``approaches``, with a warning for each of them that
            lies outside the range of validity.

        Raises:
            InputError: When the approaches are not a finite, non-empty list, a contact lies
                outside the patches, or patches or mean heights do not fit the surface.
            NotConverged: When the contact conditions cannot be met.
        """

    def press(
        self,
        control: Control,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step: contacts and the free motions of the plane.

        Args:
            control: What is prescribed of the plane: approach or force, tilt or no moment.
            patches: Patches that results are summed over.
            mean_heights: Mean heights of the patches, shape (N,) [mm].
            start: What this model returned at a load step nearby; None starts from nothing.

        Returns:
            The response, of one row, the plane, and where to start the next load step from.

        Raises:
            InputError: When the arguments do not fit the surface.
            NotConverged: When the contact conditions or the prescribed loads cannot be met.
        """
