"""The model `islands`: connected regions of the surface above the plane as Hertz contacts.

No asperities are looked for. The plane cuts the surface at its approach; every connected region
above it, also one that the border cuts or that holds several summits, is a contact with the
volume and moments of the region (`micro.regions.island_shapes`). The contacts press each other
down: the displacement u_k of peak k by the forces of the other islands lowers the surface about it,
so that the region is what rises above z_M − δ + u_k. Regions and displacements are found in turn
until they agree (`micro.regions.island_passes`).

Volume and moments see the surface on the scale of the contact. Against half-space solutions on
20 surfaces of the paper's Sets 1 and 2 with 256 × 256 cells the force is within 3 % (root mean
square; 9 % at most) and the area within 5 % (14 %) from 0.1 to 5 % of contact area. Beyond 8 %
regions grow together across the surface and stand for no ellipse: every result says whether it
lies within this range (`IslandState.warning`, `Response.warnings`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Control, Partition, PatchGrid, Surface
from micro.curve import checked_approaches, checked_means, whole_patch
from micro.hertz import checked_modulus
from micro.plane import RigidPlane
from micro.plane_equilibrium import Held, Peaks, balanced, contact_stiffness
from micro.regions.island_passes import Settled, settle
from micro.regions.island_state import IslandState
from micro.regions.island_sums import IslandSums
from micro.regions.relief import Relief
from micro.response import Pressed, Response

Array = NDArray[np.float64]

_LEVEL = (0.0, 0.0)
_MOST_KEPT = 2**20
_MARGIN = 1.2  # keeps the samples that give small caps their shape


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandModel:
    """Contact of a surface by its regions above the plane.

    The border ends the surface, also a periodic one. A first approach divides the surface into
    catchments (0.1 s for 256 × 256 cells); with it every further one takes milliseconds.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        highest: Height z_M that the approach counts from [mm]; the surface's own when not given.

    Raises:
        InputError: When the modulus is not positive.
    """

    surface: Surface
    contact_modulus: float
    highest: float | None = None

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)

    @property
    def name(self) -> str:
        """Name of the model."""
        return "islands"

    @property
    def datum(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.surface.highest if self.highest is None else self.highest

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]."""
        return self.datum - self.surface.highest

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch cut out along its borders; see `MicroModel.of_patch`."""
        piece = self.surface.piece(*patches.bounds(index))
        return replace(self, surface=piece, highest=self.datum), whole_patch(piece)

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
        return self._state(plane, self._settled(self._relief(plane), plane))

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
        return self._response(planes, patches, mean_heights)

    def press(
        self,
        control: Control,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`.

        Islands are found anew under every plane; the start tells the plane alone.
        """
        tilt = control.tilt or _LEVEL  # peaks are those that such a plane can touch
        whole = self._relief(RigidPlane.above(self.surface, 0.0, tilt))
        middle, half = 0.5 * np.asarray(self.surface.lengths), 0.5 * np.hypot(*self.surface.lengths)
        lever = np.stack([np.ones(len(whole)), whole.x - middle[0], whole.y - middle[1]], axis=1)
        force = np.full(len(whole), self.contact_modulus * np.sqrt(half))
        below = self.datum - whole.z + lever[:, 1:] @ np.asarray(tilt)
        peaks = Peaks(lever=lever, below=below, force=force, half=half)

        def evaluate(motion: Array) -> tuple[Held, RigidPlane]:
            plane = RigidPlane.above(self.surface, motion[0], (motion[1], motion[2]))
            state = self._state(plane, self._settled(self._relief(plane), plane))
            lever = np.stack(
                [np.ones(len(state.x)), state.x - middle[0], state.y - middle[1]], axis=1
            )
            rate = 1.5 * state.force / state.indentation
            apart = np.hypot(state.x[:, None] - state.x, state.y[:, None] - state.y)
            np.fill_diagonal(apart, np.inf)
            coupling = rate / (np.pi * self.contact_modulus) / np.maximum(apart, 1e-3 * half)
            return Held(lever.T @ state.force, contact_stiffness(lever, rate, coupling)), plane

        _, plane = balanced(evaluate, control, peaks.first_plane(control, start), half)
        return Pressed(self._response([plane], patches, mean_heights), plane, plane)

    def _response(
        self, planes: list[RigidPlane], patches: Partition, mean_heights: ArrayLike
    ) -> Response:
        """Solve under planes that differ in their approach alone."""
        means = checked_means(mean_heights, patches)
        sums = IslandSums(
            relief=self._relief(max(planes, key=lambda plane: plane.approach)),
            lengths=self.surface.lengths,
            highest=self.datum,
            patches=patches,
            mean_heights=means,
            contact_modulus=self.contact_modulus,
        )
        rows = []
        for plane in planes:
            settled = self._settled(sums.relief, plane)
            rows.append(sums.row(plane, settled, self._state(plane, settled)))
        return Response.of(rows, self.name, self.contact_modulus, patches)

    def _settled(self, relief: Relief, plane: RigidPlane) -> Settled:
        return settle(relief, self.datum - plane.approach)

    def _relief(self, plane: RigidPlane) -> Relief:
        """Return the catchments that a plane and all above it need."""
        surface, small = self.surface, self.surface.heights.size <= _MOST_KEPT
        lean = None
        level = plane.tilt == _LEVEL
        if level and small:
            return self._whole
        if not level:
            # apart from the heights, which may continue where a lean does not
            heights = plane.at(surface.x[:, None], surface.y) - plane.approach
            lean = replace(surface, heights=heights, periodic=False)
        floor = self.datum - _MARGIN * max(plane.approach, 0.0)
        return Relief.of(surface, lean=lean, floor=-np.inf if small else floor)

    @cached_property
    def _whole(self) -> Relief:
        return Relief.of(self.surface, ceiling=self.surface.highest)

    def _state(self, plane: RigidPlane, settled: Settled) -> IslandState:
        found = settled.islands
        return IslandState(
            approach=plane.approach,
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
