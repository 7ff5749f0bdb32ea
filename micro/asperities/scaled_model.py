"""The four asperity models with curvature at the scale of the contact and border asperities.

The paper's models are 6 to 11 % low in force and 10 to 23 % low in area between 1 and 10 % of
contact area. The two options remove most of that. Against half-space solutions on 20 surfaces of
Sets 1 and 2 the elliptic, interacting model with both is within 1 to 2.5 % in force (root mean
square; 6 % at most) from 0.3 to 10 % of contact area, and within 7 % in area. Its force is
3 to 7 % low without border asperities and 4 to 8 % low without fitted curvature.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from geometry import Asperities, Control, PatchGrid, Surface
from geometry.errors import NotConverged
from geometry.rigid_plane import RigidPlane
from micro.asperities.contact_scale import ScaledAsperities
from micro.asperities.contacts import AsperityContacts, Equilibrium
from micro.asperities.model import SummitModel, checked_name
from micro.interaction.contact_model import ContactState, first_guess
from micro.islands.equilibrium import Relaxation
from micro.islands.watersheds import MOST_WHOLE, needed_depth

Array = NDArray[np.float64]

CURVATURES = ("summit", "contact")
"""Where the curvature is taken: at the very summit, as in the paper, or over 1.4 contact radii."""

BORDERS = ("ignore", "include")
"""What becomes of maxima on the border of the surface; the paper ignores them."""

_TOLERANCE = 1e-9  # so that a load comes back on the way down as it was on the way up
_ROUNDING = 64.0 * np.finfo(float).eps


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledModel(SummitModel):
    """One of the four asperity models on the asperities of a surface, fitted to the load.

    The caps that give the curvature are those above level planes, also under a tilt. See
    `SummitModel` for further fields.

    Args:
        surface: The surface; its border ends it, also when it is periodic.
        curvature: A name in `CURVATURES`.
        border: A name in `BORDERS`. The radii of border asperities are always fitted.
        within: Patches, and the flat index of the one whose summits the model consists of; all
            summits when not given.
        most_whole: Largest number of cells of a surface whose watersheds are found as a whole;
            see `needed_depth`.
        most_iterations: Number of times that the curvatures may be fitted to the contacts.

    Raises:
        InputError: When a name is unknown or the modulus not positive.
    """

    surface: Surface
    curvature: str = "contact"
    border: str = "include"
    within: tuple[PatchGrid, int] | None = None
    most_whole: int = MOST_WHOLE
    most_iterations: int = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_name(self.curvature, CURVATURES, "scale of the curvature")
        checked_name(self.border, BORDERS, "treatment of the border")

    @property
    def name(self) -> str:
        """Name of the model with its options."""
        return f"{self.kind}, curvature {self.curvature}, border {self.border}"

    @property
    def rough(self) -> Surface:
        """The surface."""
        return self.surface

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]; infinite without asperities."""
        return self.touch_of(self.asperities)

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`."""
        return replace(self, within=(patches, index), body=None), patches.single(index)

    @cached_property
    def asperities(self) -> Asperities:
        """The asperities, with the radii of their smallest contacts."""
        return self._scaled(self._depth(RigidPlane.above(self.surface, 0.0))).summits

    def equilibrium(self, control: Control, start: Equilibrium | None = None) -> ContactState:
        """Fit curvatures and solve for contacts and plane until all agree.

        See `ContactModel.equilibrium`.

        Raises:
            NotConverged: When contacts and curvatures do not agree to 1e-9 of the largest
                interference, the contact conditions cannot be met, or no plane is in equilibrium.
        """
        near = None if start is None else start.plane
        plane = first_guess(self.surface, control, near, approach=0.0)
        while True:
            depth = self._depth(plane)
            scaled = self._scaled(depth)
            contacts, found = self._fitted(scaled, control, start)
            plane = found.plane
            if self._depth(plane) <= depth:
                return self.state_of(contacts, found, scaled.summits)

    def _fitted(
        self, scaled: ScaledAsperities, control: Control, start: Equilibrium | None
    ) -> tuple[AsperityContacts, Equilibrium]:
        """Fit the curvatures to the contacts and solve for the contacts until both agree."""
        summits, found = scaled.summits, start
        if found is None or len(found.solution.indentation) != len(summits):
            found = None
        if found is not None and found.solution.indentation.any():
            own = found.solution.indentation
        else:
            plane = self.contacts_of(summits).first_plane(control, found)
            own = np.maximum(summits.interference(plane), 0.0)
        rounding = _ROUNDING * float(np.abs(summits.z).max(initial=0.0))
        relaxed, spent = Relaxation(), 0
        for _ in range(self.most_iterations):
            contacts = self.contacts_of(scaled.at(own))
            found = contacts.equilibrium(control, found)
            spent += max(found.solution.iterations, 1)
            change = found.solution.indentation - own
            scale = float(summits.interference(found.plane).max(initial=0.0)) or 1.0
            if np.abs(change).max(initial=0.0) <= max(_TOLERANCE * scale, rounding):
                solution = found.solution._replace(iterations=spent)
                return contacts, found._replace(solution=solution)
            own = np.maximum(relaxed.next(own, change), 0.0)
        raise NotConverged(
            f"the fit of curvatures to contacts at {control}",
            reason="MAX_ITERATIONS",
            iterations=spent,
            remedy="lower load.approach, or take the curvature at the summits",
        )

    def _depth(self, plane: RigidPlane) -> float:
        """Return how deep the watersheds under a plane must be, at its nearest corner."""
        x, y = np.meshgrid(*[(0.0, length) for length in self.surface.lengths])
        return needed_depth(self.surface, float(plane.at(x, y).max()), self.most_whole)

    def _scaled(self, depth: float) -> ScaledAsperities:
        """Return the asperities with watersheds of some depth; the last are cached."""
        if depth not in self._cache:
            floor = self.surface.highest - depth
            found = ScaledAsperities.of(
                self.surface, curvature=self.curvature, border=self.border, floor=floor
            )
            if self.within is not None:
                patches, index = self.within
                found = found.subset(patches.index_of(found.summits.x, found.summits.y) == index)
            self._cache.clear()
            self._cache[depth] = found
        return self._cache[depth]

    @cached_property
    def _cache(self) -> dict[float, ScaledAsperities]:
        return {}
