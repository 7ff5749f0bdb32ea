"""The protocol of all micro models, load steps along approaches, and checks that models share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry import Asperities, Control, PatchGrid, Surface, patch_means
from patchlaw.geometry.contact_state import ContactState, Start
from patchlaw.support import Array, InputError, real_array


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

    def press(
        self,
        control: Control,
        *,
        patches: PatchGrid | None = None,
        mean_heights: ArrayLike | None = None,
        start: Start | None = None,
    ) -> ContactState:
        """Solve the contacts and the free motions of the plane.

        Args:
            control: What is prescribed of the plane: approach or force, tilt or no moment.
            patches: N patches within the surface's rectangle that results are summed over; the
                whole rectangle as one patch when not given.
            mean_heights: Mean heights of the surface on the patches, shape (N,) [mm]; the
                surface's own when not given.
            start: What a solution of this model at another load left behind: its ``guess``, or its
                ``start`` for a surface that keeps its plastic depth. Without it the solution starts
                from no contact.

        Returns:
            The contact, with a warning where the load lies outside the range of validity. The
            separation of a patch is the mean gap between the plane and the *displaced* surface;
            the paper's eq. 9 leaves the displacement out. Without force the plane is that of first
            touch, under the tilt of the start where the tilt is free.

        Raises:
            InputError: When a contact lies outside the patches, or patches, mean heights or start
                do not fit the surface.
            NotConverged: When the contact conditions or the prescribed loads cannot be met.
        """

    def quick_up_to(
        self, control: Control, error: float = 0.0, *, sums_alone: bool = False
    ) -> Self | None:
        """Return the model for many loads, each solved in milliseconds from one nearby.

        Args:
            control: The largest of these loads.
            error: Error of the force that does no harm, over the force.
            sums_alone: Whether solutions need no displacements of single points, which take long.

        Returns:
            The model, or one that remembers more; None where a solution may take long.
        """

    def stiffness(self, state: ContactState, *, turns: bool) -> NormalStiffness:
        """Return the stiffnesses of the interface and of the approach as the load goes on.

        Args:
            state: A solution of this model.
            turns: Whether the plane turns without moment; otherwise its slopes stay.
        """


LEAST_CLOSING = 1e-4
"""Way that the mean gap closes by over that of the plane below which the stiffness of an interface
is not known: linear solutions of cells leave 4e-5 of it, laws know it to about as much."""


class NormalStiffness(NamedTuple):
    """How the normal force changes as the load goes on.

    Attributes:
        interface: −dF/dū, ū the mean gap: what the rough interface itself gives way by, whatever
            lies around it [N/mm]; None where nothing gives it, as all here.
        approach: dF/dδ, δ the approach of the plane, with the bodies that it displaces [N/mm].
        iterations: Iterations that they took.
        scatter: Error of both, relative to them, by the single cells that begin to touch or to
            yield on an increment; 0 from a linear solution.

    Theory:
        docs/theory.md, section 4.
    """

    interface: float | None = None
    approach: float | None = None
    iterations: int = 0
    scatter: float = 0.0


class Stiffness(NamedTuple):
    """How the shear force changes with the shift.

    Attributes:
        value: The derivative [N/mm]; None where nothing gives it.
        iterations: Iterations that it took.
    """

    value: float | None
    iterations: int


def press_along(
    model: MicroModel,
    approaches: ArrayLike,
    *,
    patches: PatchGrid | None = None,
    mean_heights: ArrayLike | None = None,
    tilt: tuple[float, float] | None = (0.0, 0.0),
    known: Mapping[float, Start] | None = None,
) -> list[ContactState]:
    """Press to approaches, one after the other, each from the solutions next to it.

    Args:
        model: The micro model.
        approaches: Rigid approaches δ in any order, shape (m,) [mm].
        patches: As for `MicroModel.press`.
        mean_heights: As for `MicroModel.press`.
        tilt: Slopes of the plane; None lets it turn.
        known: What other approaches may be started from, see `ContactState.guess`.

    Returns:
        A state for each approach, in their order.

    Raises:
        InputError: When the approaches are no list of finite numbers, or as for
            `MicroModel.press`.
        NotConverged: When the contact conditions cannot be met.
    """
    wanted = np.atleast_1d(real_array(approaches))
    if wanted.ndim != 1:
        raise InputError("the approaches are no list", value=wanted.shape, allowed="numbers in mm")
    starts, states = dict(known or {}), {}
    for approach in sorted(set(wanted.tolist())):
        states[approach] = model.press(
            Control(approach=approach, tilt=tilt),
            patches=patches,
            mean_heights=mean_heights,
            start=_nearby(approach, starts),
        )
        starts[approach] = states[approach].guess
    return [states[approach] for approach in wanted.tolist()]


def _nearby(approach: float, starts: Mapping[float, Start]) -> Start | None:
    """Return what to start from at an approach, by the two solutions nearest to it."""
    near = sorted(starts, key=lambda each: abs(each - approach))[:2]
    if len(near) < 2:
        return starts[near[0]] if near else None
    first, second = near
    return starts[first].towards(starts[second], (approach - first) / (second - first))


def checked_patches(
    rough: Surface | Asperities,
    patches: PatchGrid | None = None,
    mean_heights: ArrayLike | None = None,
) -> tuple[PatchGrid, Array]:
    """Return patches and their mean heights, by default those of the whole surface.

    Args:
        rough: The surface, or its asperities, which know its mean height but not a patch's.
        patches: The N patches; one, the whole rectangle, when not given.
        mean_heights: Their mean heights, shape (N,) [mm]; the surface's own when not given.

    Raises:
        InputError: When there is not one finite number for every patch, or only asperities are
            known and the patches have no mean heights.
    """
    whole = patches is None
    patches = PatchGrid(grid=(1, 1), lengths=rough.lengths) if patches is None else patches
    if mean_heights is None and isinstance(rough, Surface):
        return patches, patch_means(rough, patches)
    if mean_heights is None and not whole:
        raise InputError(
            "asperities do not know the mean heights of patches",
            allowed="mean_heights, or no patches",
        )
    mean_heights = [rough.mean_height] if mean_heights is None else mean_heights
    means = real_array(mean_heights)
    if means.shape != (patches.count,) or not np.isfinite(means).all():
        problem, allowed = "every patch needs one finite mean height", f"{patches.count}, in mm"
        raise InputError(problem, key="mean_heights", value=means.tolist(), allowed=allowed)
    return patches, means
