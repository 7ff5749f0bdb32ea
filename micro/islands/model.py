"""The model `islands`: connected regions of the surface above the plane as Hertz contacts.

No asperities are looked for. The plane cuts the surface at its approach. Every connected region
above it, also one that the border cuts or that holds several summits, is a contact with the
volume and moments of the region (`micro.islands.shapes`). The contacts press each other down: the
displacement u_k of peak k by the forces of the other islands lowers the surface about it, so that
the region is what rises above z_M − δ + u_k. Regions and displacements are found in turn until
they agree (`micro.islands.equilibrium`).

Volume and moments describe the surface on the scale of the contact. Against half-space solutions on
20 surfaces of the paper's Sets 1 and 2 with 256 × 256 cells the force is within 3 % (root mean
square; 9 % at most) and the area within 5 % (14 %) from 0.1 to 5 % of contact area. Beyond 8 %
regions grow together across the surface and stand for no ellipse. Every result says whether it
lies within this range (`Response.warnings`).

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from geometry import Control, Partition, PatchGrid, Surface
from geometry.rigid_plane import PlaneLevers, RigidPlane
from micro.interaction.contact_model import LEVEL, ContactModel, ContactState, first_guess
from micro.interaction.hertz_pairs import BodyPoints
from micro.interaction.plane_on_peaks import Peaks
from micro.islands.equilibrium import IslandContact, IslandEquilibrium
from micro.islands.shapes import Islands, island_shares, total_force
from micro.islands.watersheds import MOST_WHOLE, Watersheds, needed_depth
from micro.model import whole_patch

Array = NDArray[np.float64]

LARGEST_AREA_FRACTION = 0.08
"""Contact area fraction up to which the model is within its stated error."""

GROWN_AREA_FRACTION = 0.04
"""The same where one island holds more than `LARGEST_SHARE` of the contact area."""

LARGEST_SHARE = 0.5

_FIRST = 0.1  # of the range of heights: the approach to start from where none is known
_TURN = 1e-4  # largest turn of the plane, of the deepest contact
_MOST_CUTS = 8


class IslandCaps(NamedTuple):
    """The regions that islands stand for.

    Attributes:
        watersheds: The watersheds of n peaks.
        islands: The m islands.
        height: Heights of the peaks above their own levels, negative below, shape (n,) [mm].
    """

    watersheds: Watersheds
    islands: Islands
    height: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandModel(ContactModel):
    """Contact of a surface by its regions above the plane; see `ContactModel` for further fields.

    The border ends the surface, also a periodic one. A first approach divides the surface into
    watersheds (0.1 s for 256 × 256 cells); with these every further one takes milliseconds.

    Args:
        surface: The surface.
        highest: Height z_M that the approach counts from [mm]; the surface's own when not given.
        most_whole: Largest number of cells of a surface whose watersheds are found as a whole;
            see `needed_depth`.
    """

    surface: Surface
    highest: float | None = None
    most_whole: int = MOST_WHOLE

    @property
    def name(self) -> str:
        """Name of the model."""
        return "islands"

    @property
    def rough(self) -> Surface:
        """The surface."""
        return self.surface

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.surface.highest if self.highest is None else self.highest

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]."""
        return self.reference_height - self.surface.highest

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch cut out along its borders; see `MicroModel.of_patch`."""
        piece = self.surface.piece(*patches.bounds(index))
        alone = replace(self, surface=piece, highest=self.reference_height, body=None)
        return alone, whole_patch(piece)

    def equilibrium(self, control: Control, start: RigidPlane | None = None) -> ContactState:
        """Solve for islands and plane; see `ContactModel.equilibrium`.

        Islands are found again at every load step, so the start is a plane only. A plane that turns
        is solved for on the watersheds of its slopes before, until a turn moves no point by more
        than 1e-4 of the deepest contact.
        """
        near = start
        unknown = _FIRST * float(np.ptp(self.surface.heights))
        plane = first_guess(self.surface, control, near, approach=unknown)
        if np.isfinite(self._depth(plane)) and control.free.any():
            # Watersheds of any depth have all peaks, which suffice to estimate the plane.
            peaks = self._peaks(self._watersheds(plane), plane)
            plane = RigidPlane.moved(self.surface, peaks.first_plane(control, near))
        for _ in range(_MOST_CUTS):
            before, watersheds = plane, self._watersheds(plane)
            found = self._found(watersheds, before, control, near)
            near = plane = RigidPlane.moved(self.surface, found.motion)
            turn = 0.5 * np.hypot(*np.subtract(plane.tilt, before.tilt))
            deepest = float(found.islands.depth.max(initial=0.0))
            deep_enough = self._depth(plane) <= self._depth(before)
            if turn * np.hypot(*self.surface.lengths) <= _TURN * deepest and deep_enough:
                break
        islands = found.islands
        return ContactState(
            plane=plane,
            contacts=replace(islands, force=self.contact_modulus * islands.force),
            summits=np.stack([watersheds.x[islands.top], watersheds.y[islands.top]], axis=1),
            iterations=found.iterations,
            residual=found.residual,
            overlapping_contacts=int(np.count_nonzero(islands.member >= 0)) - len(islands),
            start=plane,
            shape=IslandCaps(watersheds, islands, found.height),
        )

    def patch_loads(self, state: ContactState, patches: Partition) -> tuple[Array, Array]:
        """Return the forces and contact areas of patches; see `ContactModel.patch_loads`.

        A patch gets the share of an island that lies in it (`island_shares`). Against half-space
        pressures on 4 × 4 patches this misplaces a tenth of the mean patch force.
        """
        watersheds, islands, height = state.shape
        force, area = island_shares(patches, watersheds, islands, height, self.surface.lengths)
        return self.contact_modulus * islands.force @ force, islands.area @ area

    def warning(self, state: ContactState, area_fraction: float) -> str:
        """Return why islands have grown too large; see `ContactModel.warning`.

        Outside of the range is a contact area above 8 % of the nominal one, or above 4 % with more
        than half of it in one island. The regions then grow together across the surface, and the
        force may be tens of per cent low and the area as much too large.
        """
        area = state.contacts.area
        share = float(area.max(initial=0.0) / (area.sum() or 1.0))
        grown = area_fraction > GROWN_AREA_FRACTION and share > LARGEST_SHARE
        if area_fraction <= LARGEST_AREA_FRACTION and not grown:
            return ""
        return (
            f"at an approach of {state.plane.approach:.4g} mm the islands cover"
            f" {area_fraction:.1%} of the surface, the largest {share:.0%} of it: they grow"
            f" together, and the model islands stands for up to {LARGEST_AREA_FRACTION:.0%}"
            f" ({GROWN_AREA_FRACTION:.0%} when one holds more than half)"
        )

    def _found(
        self, watersheds: Watersheds, cut: RigidPlane, control: Control, near: RigidPlane | None
    ) -> IslandEquilibrium:
        """Solve on watersheds that were found under the slopes of one plane, for another."""
        peaks = self._peaks(watersheds, cut)
        motion = peaks.first_plane(control, near)
        body = None
        if self.body is not None:
            body = BodyPoints.at(self.body, watersheds.x, watersheds.y)
        contact = IslandContact(
            watersheds=watersheds,
            peaks=peaks,
            control=control,
            level=self.reference_height - motion[0] - peaks.lever[:, 1:] @ (motion[1:] - cut.tilt),
            motion=motion,
            contact_modulus=self.contact_modulus,
            body=body,
        )
        return contact.equilibrium()

    def _peaks(self, watersheds: Watersheds, cut: RigidPlane) -> Peaks:
        """Return the peaks of watersheds that were found under the slopes of a plane."""
        levers = PlaneLevers.at(watersheds.x, watersheds.y, self.surface.lengths)
        return Peaks(
            levers=levers,
            depth=self.reference_height - watersheds.z + levers.matrix[:, 1:] @ cut.tilt,
            force=lambda over: self.contact_modulus * total_force(watersheds, over),
        )

    def _depth(self, plane: RigidPlane) -> float:
        return needed_depth(self.surface, plane.approach, self.most_whole)

    def _watersheds(self, plane: RigidPlane) -> Watersheds:
        """Return the watersheds that a plane and all above it need; the last are cached."""
        surface, level = self.surface, plane.tilt == LEVEL
        key = (*plane.tilt, self._depth(plane))
        if key not in self._cache:
            offset = None
            if not level:
                # The heights may be periodic; what a tilt adds to them is not.
                heights = plane.at(surface.x[:, None], surface.y) - plane.approach
                offset = replace(surface, heights=heights, periodic=False)
            self._cache.clear()
            self._cache[key] = Watersheds.of(
                surface,
                tilt_offset=offset,
                floor=self.reference_height - self._depth(plane),
                ceiling=surface.highest if level else np.inf,
            )
        return self._cache[key]

    @cached_property
    def _cache(self) -> dict[tuple[float, ...], Watersheds]:
        return {}
