"""The model `islands`: connected regions of the surface above the plane as Hertz contacts.

No asperities are looked for. The plane cuts the surface at its approach; every connected region
above it, also one that the border cuts or that holds several summits, is a contact with the
volume and moments of the region (`micro.islands.shapes`). The contacts press each other
down: the displacement u_k of peak k by the forces of the other islands lowers the surface about it,
so that the region is what rises above z_M − δ + u_k. Regions and displacements are found in turn
until they agree (`micro.islands.passes`).

Volume and moments see the surface on the scale of the contact. Against half-space solutions on
20 surfaces of the paper's Sets 1 and 2 with 256 × 256 cells the force is within 3 % (root mean
square; 9 % at most) and the area within 5 % (14 %) from 0.1 to 5 % of contact area. Beyond 8 %
regions grow together across the surface and stand for no ellipse: every result says whether it
lies within this range (`IslandState.warning`, `Response.warnings`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Control, Partition, PatchGrid, Surface
from geometry.rigid_plane import PlaneLevers, RigidPlane
from micro.checks import checked_approaches, checked_means, whole_patch
from micro.closed_forms.hertz import checked_modulus
from micro.compliance.body_modes import BodyModes
from micro.islands.contact import IslandContact
from micro.islands.passes import Settled, settle
from micro.islands.patch_sums import IslandSums
from micro.islands.shapes import total_force
from micro.islands.state import IslandState
from micro.islands.volumes import Relief
from micro.pairs.body_points import BodyPoints
from micro.plane_on_peaks import Peaks
from micro.response import Pressed, Response

Array = NDArray[np.float64]

_LEVEL = (0.0, 0.0)
_MOST_KEPT = 2**20
_FIRST = 0.1  # of the surface's heights: a plane to start from where none is known
_TURN = 1e-4
_MOST_CUTS = 8
_MARGIN = 1.2  # keeps the samples that give small caps their shape


class _Cut(NamedTuple):
    relief: Relief
    plane: RigidPlane
    settled: Settled


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandModel:
    """Contact of a surface by its regions above the plane.

    The border ends the surface, also a periodic one. A first approach divides the surface into
    catchments (0.1 s for 256 × 256 cells); with it every further one takes milliseconds.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        highest: Height z_M that the approach counts from [mm]; the surface's own when not given.
        body: What a finite body with its sides adds to the half-space, between the centres of the
            islands and the peaks; a half-space when not given.

    Raises:
        InputError: When the modulus is not positive.
    """

    surface: Surface
    contact_modulus: float
    highest: float | None = None
    body: BodyModes | None = None

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
        return replace(self, surface=piece, highest=self.reference_height, body=None), whole_patch(
            piece
        )

    def solve(self, approach: float, *, tilt: tuple[float, float] = _LEVEL) -> IslandState:
        """Solve the contact at one approach of the plane.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).

        Raises:
            InputError: When the approach or the tilt is not finite.
            NotConverged: When islands and displacements do not agree to 1e-6.
        """
        plane = RigidPlane.above(self.surface, approach, tilt)
        given = Control(approach=approach, tilt=tilt)
        return self._state(self._settled(self._relief(plane), plane, given))

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        tilt: tuple[float, float] = _LEVEL,
    ) -> Response:
        """Solve at approaches, each from nothing, so that none depends on another.

        See `MicroModel.respond`. A patch gets the share of an island that lies in it, weighted in
        force with the pressure that Hertz's theory would put on each height above the plane, in
        area with 1 on the upper half; as a contact an island counts where its highest peak lies.
        Against half-space pressures on 4 × 4 patches this misplaces a tenth of the mean patch
        force.
        """
        planes = [
            RigidPlane.above(self.surface, approach, tilt)
            for approach in checked_approaches(approaches)
        ]
        means = checked_means(mean_heights, patches)
        relief = self._relief(max(planes, key=lambda plane: plane.approach))
        rows = []
        for plane in planes:
            given = Control(approach=plane.approach, tilt=tilt)
            rows.append(self._row(self._settled(relief, plane, given), patches, means))
        return Response.of(rows, self.name, self.contact_modulus, patches)

    def press(
        self,
        control: Control,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`.

        Islands are found anew at every load step: the start tells the plane alone. A plane that
        turns leans on the catchments of the slopes before, peak by peak, until it turns no more
        than by 1e-4 of the deepest contact.
        """
        means = checked_means(mean_heights, patches)
        found = self._pressed(control, start)
        rows = [self._row(found, patches, means)]
        response = Response.of(rows, self.name, self.contact_modulus, patches)
        return Pressed(response, found.plane, found.plane)

    def _pressed(self, control: Control, near: RigidPlane | None) -> _Cut:
        """Find the plane, and what the catchments under its slopes are."""
        approach = _FIRST * float(np.ptp(self.surface.heights))
        if near is not None:
            approach = near.approach
        if control.approach is not None:
            approach = control.approach
        turned = control.tilt or (_LEVEL if near is None else near.tilt)
        plane = RigidPlane.above(self.surface, approach, turned)
        if not self._is_kept and (control.force or control.tilt is None):
            # every peak is known, but not what lies below a floor: first where the plane may come
            peaks = self._peaks(self._relief(plane), plane)
            plane = self._deeper(RigidPlane.moved(self.surface, peaks.first_plane(control, near)))
        for _ in range(_MOST_CUTS):
            found = self._settled(self._relief(plane), plane, control, near)
            turn = np.hypot(*np.subtract(found.plane.tilt, plane.tilt)) * 0.5
            deepest = float(found.settled.islands.depth.max(initial=0.0))
            reached = self._is_kept or found.plane.approach <= plane.approach
            if turn * np.hypot(*self.surface.lengths) <= _TURN * deepest and reached:
                break
            near = found.plane
            plane = self._deeper(near)
        return found

    def _deeper(self, plane: RigidPlane) -> RigidPlane:
        return replace(plane, approach=plane.approach + (_MARGIN - 1.0) * abs(plane.approach))

    def _peaks(self, relief: Relief, leant: RigidPlane) -> Peaks:
        """Return the peaks of catchments under the slopes of a plane."""
        levers = PlaneLevers.at(relief.x, relief.y, self.surface.lengths)
        return Peaks(
            levers=levers,
            depth=self.reference_height - relief.z + levers.matrix[:, 1:] @ leant.tilt,
            force=lambda over: self.contact_modulus * total_force(relief, over),
        )

    def _settled(
        self,
        relief: Relief,
        leant: RigidPlane,
        control: Control,
        near: RigidPlane | None = None,
    ) -> _Cut:
        """Solve on catchments under the slopes of one plane, for another."""
        peaks = self._peaks(relief, leant)
        motion = peaks.first_plane(control, near)
        level = self.reference_height - motion[0] - peaks.lever[:, 1:] @ (motion[1:] - leant.tilt)
        body = None
        if self.body is not None:
            body = BodyPoints.at(self.body, relief.x, relief.y, self.contact_modulus)
        contact = IslandContact(
            relief=relief,
            peaks=peaks,
            control=control,
            level=level,
            motion=motion,
            contact_modulus=self.contact_modulus,
            body=body,
        )
        settled = settle(relief, level, motion, contact.answer)
        return _Cut(relief, RigidPlane.moved(self.surface, settled.motion), settled)

    def _row(self, found: _Cut, patches: Partition, means: Array) -> dict[str, Any]:
        sums = IslandSums(
            relief=found.relief,
            lengths=self.surface.lengths,
            highest=self.reference_height,
            patches=patches,
            mean_heights=means,
            contact_modulus=self.contact_modulus,
            body=self.body,
        )
        return sums.row(found.plane, found.settled, self._state(found))

    def _relief(self, plane: RigidPlane) -> Relief:
        """Return the catchments that a plane and all above it need."""
        surface, level = self.surface, plane.tilt == _LEVEL
        if level and self._is_kept:
            return self._whole
        lean = None
        if not level:
            # apart from the heights, which may continue where a lean does not
            heights = plane.at(surface.x[:, None], surface.y) - plane.approach
            lean = replace(surface, heights=heights, periodic=False)
        floor = self.reference_height - _MARGIN * max(plane.approach, 0.0)
        return Relief.of(surface, lean=lean, floor=-np.inf if self._is_kept else floor)

    @property
    def _is_kept(self) -> bool:
        return self.surface.heights.size <= _MOST_KEPT

    @cached_property
    def _whole(self) -> Relief:
        return Relief.of(self.surface, ceiling=self.surface.highest)

    def _state(self, cut: _Cut) -> IslandState:
        settled = cut.settled
        found = settled.islands
        return IslandState(
            approach=cut.plane.approach,
            x=found.x,
            y=found.y,
            angle=found.angle,
            indentation=found.depth,
            semi_axes=found.semi_axes,
            contact_area=np.pi * found.semi_axes.prod(axis=1),
            force=self.contact_modulus * found.force,
            merged=int(np.count_nonzero(found.member >= 0)) - len(found),
            nominal_area=self.surface.area,
            iterations=settled.iterations,
            residual=settled.residual,
        )
