"""The protocol of all micro models, and the checks of the arguments that they share."""

from __future__ import annotations

from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, PatchGrid, Surface, patch_means
from geometry.errors import InputError
from micro.response import Pressed, Response

Array = NDArray[np.float64]


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

        It is meant for level planes. A tilted plane turns about the middle of the rectangle that
        is left; for some models that is the patch, for others the whole surface.

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
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = (0.0, 0.0),
    ) -> Response:
        """Solve along approaches.

        Args:
            approaches: Rigid approaches δ at the centre of the rectangle in any order, shape (m,)
                [mm].
            patches: N patches within the surface's rectangle that results are summed over; the
                whole rectangle as one patch when not given.
            mean_heights: Mean heights of the surface on the patches, shape (N,) [mm]; the
                surface's own when not given.
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
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step: contacts and the free motions of the plane.

        Args:
            control: What is prescribed of the plane: approach or force, tilt or no moment.
            patches: Patches that results are summed over, as for `respond`.
            mean_heights: Mean heights of the patches, shape (N,) [mm], as for `respond`.
            start: What this model returned at a load step nearby; without it the solution starts
                from no contact.

        Returns:
            The response, of one row, the plane, and where to start the next load step from.

        Raises:
            InputError: When the arguments do not fit the surface.
            NotConverged: When the contact conditions or the prescribed loads cannot be met.
        """


def whole_patch(rough: Surface | Asperities) -> PatchGrid:
    """Return the single patch that a surface's rectangle is."""
    return PatchGrid(grid=(1, 1), lengths=rough.lengths)


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


def checked_patches(
    rough: Surface | Asperities,
    patches: Partition | None = None,
    mean_heights: ArrayLike | None = None,
) -> tuple[Partition, Array]:
    """Return patches and their mean heights, by default those of the whole surface.

    Args:
        rough: The surface, or its asperities, which know its mean height but not a patch's.
        patches: The N patches; one, the whole rectangle, when not given.
        mean_heights: Their mean heights, shape (N,) [mm]; the surface's own when not given.

    Raises:
        InputError: When there is not one finite number for every patch, or only asperities are
            known and the patches have no mean heights.
    """
    given, patches = patches, whole_patch(rough) if patches is None else patches
    if mean_heights is None and isinstance(rough, Surface):
        return patches, patch_means(rough, patches)
    if mean_heights is None and given is not None:
        raise InputError(
            "asperities do not know the mean heights of patches",
            allowed="mean_heights, or no patches",
        )
    mean_heights = [rough.mean_height] if mean_heights is None else mean_heights
    allowed = f"shape ({patches.count},)"
    try:
        means = np.asarray(mean_heights, float)
    except (TypeError, ValueError):
        raise InputError(
            "the mean heights are no numbers", value=mean_heights, allowed=allowed
        ) from None
    if means.shape != (patches.count,):
        raise InputError("every patch needs one mean height", value=means.shape, allowed=allowed)
    if not np.isfinite(means).all():
        raise InputError("a mean height is not finite", value=means.tolist(), allowed="mm")
    return patches, means
