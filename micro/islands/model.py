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
lies within this range (`IslandState.warning`, `Response.warnings`).

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Control, Partition, PatchGrid, Surface
from geometry.rigid_plane import PlaneLevers, RigidPlane
from micro.closed_forms.hertz import checked_modulus
from micro.compliance.body_modes import BodyModes
from micro.interaction.body_points import BodyPoints
from micro.islands.equilibrium import IslandContact, IslandEquilibrium
from micro.islands.patch_shares import island_shares
from micro.islands.shapes import IslandState, total_force
from micro.islands.watersheds import Watersheds
from micro.model import checked_approaches, checked_patches, whole_patch
from micro.patch_sums import EllipticContacts, PatchSums
from micro.plane_on_peaks import Peaks
from micro.response import Pressed, Response

Array = NDArray[np.float64]

_LEVEL = (0.0, 0.0)
_FIRST = 0.1  # of the range of heights: the approach to start from where none is known
_TURN = 1e-4  # largest turn of the plane, of the deepest contact
_MOST_CUTS = 8
_MARGIN = 1.2  # depth of the watersheds that are found, in units of the approach


class _Found(NamedTuple):
    """Islands in equilibrium with a plane, and the watersheds that they are regions of."""

    watersheds: Watersheds
    plane: RigidPlane
    equilibrium: IslandEquilibrium


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandModel:
    """Contact of a surface by its regions above the plane.

    The border ends the surface, also a periodic one. A first approach divides the surface into
    watersheds (0.1 s for 256 × 256 cells); with these every further one takes milliseconds.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        highest: Height z_M that the approach counts from [mm]; the surface's own when not given.
        body: What a finite body with its sides adds to the half-space, between the centres of the
            islands and the peaks; a half-space when not given.
        most_cached: Largest number of cells of a surface whose watersheds are found once and
            cached. Those of a larger surface are found again for every plane, only as deep as
            needed.

    Raises:
        InputError: When the modulus is not positive.
    """

    surface: Surface
    contact_modulus: float
    highest: float | None = None
    body: BodyModes | None = None
    most_cached: int = 2**20

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)

    @property
    def name(self) -> str:
        """Name of the model."""
        return "islands"

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

    def solve(self, approach: float, *, tilt: tuple[float, float] = _LEVEL) -> IslandState:
        """Solve the contact at one approach of the plane.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).

        Raises:
            InputError: When the approach or the tilt is not finite, or the interaction of the
                islands does not fit into the memory.
            NotConverged: When islands and displacements do not agree to 1e-6.
        """
        plane = RigidPlane.above(self.surface, approach, tilt)
        given = Control(approach=approach, tilt=tilt)
        return self._state(self._found(self._watersheds(plane), plane, given))

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = _LEVEL,
    ) -> Response:
        """Solve at approaches, none of which depends on another; see `MicroModel.respond`.

        A patch gets the share of an island that lies in it (`micro.islands.patch_shares`); as a
        contact an island counts where its highest peak lies. Against half-space pressures on 4 × 4
        patches this misplaces a tenth of the mean patch force.
        """
        planes = [
            RigidPlane.above(self.surface, approach, tilt)
            for approach in checked_approaches(approaches)
        ]
        sums = PatchSums(self, *checked_patches(self.surface, patches, mean_heights))
        watersheds = self._watersheds(max(planes, key=lambda plane: plane.approach))
        rows = []
        for plane in planes:
            given = Control(approach=plane.approach, tilt=tilt)
            rows.append(self._row(self._found(watersheds, plane, given), sums))
        return sums.response(rows)

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`.

        Islands are found again at every load step, so the start is a plane only. A plane that turns
        is solved for on the watersheds of its slopes before, until a turn moves no point by more
        than 1e-4 of the deepest contact.
        """
        sums = PatchSums(self, *checked_patches(self.surface, patches, mean_heights))
        found = self._pressed(control, start)
        response = sums.response([self._row(found, sums)])
        return Pressed(response, found.plane, found.plane)

    def _pressed(self, control: Control, near: RigidPlane | None) -> _Found:
        """Find the islands, the plane, and the watersheds under its slopes."""
        approach = _FIRST * float(np.ptp(self.surface.heights))
        if near is not None:
            approach = near.approach
        if control.approach is not None:
            approach = control.approach
        turned = control.tilt or (_LEVEL if near is None else near.tilt)
        plane = RigidPlane.above(self.surface, approach, turned)
        if not self._is_cached and (control.force or control.tilt is None):
            # Watersheds above a floor have all peaks, which suffice to estimate the plane.
            peaks = self._peaks(self._watersheds(plane), plane)
            plane = self._deeper(RigidPlane.moved(self.surface, peaks.first_plane(control, near)))
        for _ in range(_MOST_CUTS):
            found = self._found(self._watersheds(plane), plane, control, near)
            turn = np.hypot(*np.subtract(found.plane.tilt, plane.tilt)) * 0.5
            deepest = float(found.equilibrium.islands.depth.max(initial=0.0))
            deep_enough = self._is_cached or found.plane.approach <= plane.approach
            if turn * np.hypot(*self.surface.lengths) <= _TURN * deepest and deep_enough:
                break
            near = found.plane
            plane = self._deeper(near)
        return found

    def _deeper(self, plane: RigidPlane) -> RigidPlane:
        return replace(plane, approach=plane.approach + (_MARGIN - 1.0) * abs(plane.approach))

    def _peaks(self, watersheds: Watersheds, tilted: RigidPlane) -> Peaks:
        """Return the peaks of watersheds that were found under the slopes of a plane."""
        levers = PlaneLevers.at(watersheds.x, watersheds.y, self.surface.lengths)
        return Peaks(
            levers=levers,
            depth=self.reference_height - watersheds.z + levers.matrix[:, 1:] @ tilted.tilt,
            force=lambda over: self.contact_modulus * total_force(watersheds, over),
        )

    def _found(
        self,
        watersheds: Watersheds,
        tilted: RigidPlane,
        control: Control,
        near: RigidPlane | None = None,
    ) -> _Found:
        """Solve on watersheds that were found under the slopes of one plane, for another."""
        peaks = self._peaks(watersheds, tilted)
        motion = peaks.first_plane(control, near)
        slopes = peaks.lever[:, 1:] @ (motion[1:] - tilted.tilt)
        body = None
        if self.body is not None:
            body = BodyPoints.at(self.body, watersheds.x, watersheds.y, self.contact_modulus)
        contact = IslandContact(
            watersheds=watersheds,
            peaks=peaks,
            control=control,
            level=self.reference_height - motion[0] - slopes,
            motion=motion,
            contact_modulus=self.contact_modulus,
            body=body,
        )
        found = contact.equilibrium()
        return _Found(watersheds, RigidPlane.moved(self.surface, found.motion), found)

    def _watersheds(self, plane: RigidPlane) -> Watersheds:
        """Return the watersheds that a plane and all above it need."""
        surface, level = self.surface, plane.tilt == _LEVEL
        if level and self._is_cached:
            return self._whole
        offset = None
        if not level:
            # The heights may be periodic; what a tilt adds to them is not.
            heights = plane.at(surface.x[:, None], surface.y) - plane.approach
            offset = replace(surface, heights=heights, periodic=False)
        floor = self.reference_height - _MARGIN * max(plane.approach, 0.0)
        return Watersheds.of(
            surface, tilt_offset=offset, floor=-np.inf if self._is_cached else floor
        )

    @property
    def _is_cached(self) -> bool:
        return self.surface.heights.size <= self.most_cached

    @cached_property
    def _whole(self) -> Watersheds:
        return Watersheds.of(self.surface, ceiling=self.surface.highest)

    def _state(self, found: _Found) -> IslandState:
        equilibrium = found.equilibrium
        islands = equilibrium.islands
        return IslandState(
            approach=found.plane.approach,
            x=islands.x,
            y=islands.y,
            angle=islands.angle,
            indentation=islands.depth,
            semi_axes=islands.semi_axes,
            contact_area=np.pi * islands.semi_axes.prod(axis=1),
            force=self.contact_modulus * islands.force,
            merged=int(np.count_nonzero(islands.member >= 0)) - len(islands),
            nominal_area=self.surface.area,
            iterations=equilibrium.iterations,
            residual=equilibrium.residual,
        )

    def _row(self, found: _Found, sums: PatchSums) -> dict[str, Any]:
        """Return the fields of a response for one plane."""
        state, sheds, patches = self._state(found), found.watersheds, sums.patches
        top = found.equilibrium.islands.top
        owner = patches.index_of(sheds.x[top], sheds.y[top])
        force, area = island_shares(patches, sheds, found.equilibrium, self.surface.lengths)
        contacts = EllipticContacts(
            position=np.stack([state.x, state.y], axis=1),
            angle=state.angle,
            semi_axes=state.semi_axes,
            area=state.contact_area,
            force=state.force,
        )
        return sums.row(
            found.plane,
            contacts,
            owner,
            patch_force=state.force @ force,
            patch_contact_area=state.contact_area @ area,
            iterations=state.iterations,
            residual=state.residual,
            overlapping_contacts=state.merged,
            warning=state.warning,
        )
