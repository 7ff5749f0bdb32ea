"""The half-space model: a rough surface cell by cell, without assumptions on its asperities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Control, Partition, PatchGrid, Surface
from geometry.errors import InputError
from geometry.rigid_plane import RigidPlane
from micro.checks import checked_approaches, checked_means, whole_patch
from micro.compliance.elastic_grid import BodyTerm, ElasticGrids, SurfaceTerm
from micro.compliance.free_sides import FreeSides
from micro.contact.pressing import Pressing
from micro.contact.problem import Pressures
from micro.contact.rigid_motions import Motions
from micro.half_space.patch_sums import CellSums
from micro.half_space.state import HalfSpaceState
from micro.response import Pressed, Response

Array = NDArray[np.float64]

_LEVEL = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpaceModel:
    """A surface on an elastic half-space, pressed by a rigid plane.

    Pressure is uniform on every cell; contact conditions hold at the cell centres.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        periodic: Whether surface and pressures continue periodically. The mean displacement of
            a periodic half-space is not determined: displacements, and so the approach, count
            from the mean of the displaced surface.
        tolerance: Largest residual of a solution (see `HalfSpaceState`), which bounds the error of
            the force; on a random surface of 256² cells the force erred by 5e-10 with 1e-8, and by
            1e-13 with 1e-10.
        highest: Height z_M that the approach counts from [mm], such as that of the surface that
            this one was resampled from; the surface's own when not given.
        sides: Free sides of the surface's rectangle, which yield beyond the half-space; none when
            not given.
        body: What a finite body adds to the half-space and its sides; a half-space when not given.
        slopes: What the finite slopes of the surface add; the theory of small slopes when not
            given.
        upper: Upper bound of the pressures [MPa]; none when not given.

    Raises:
        InputError: When the modulus, the tolerance or the bound is not positive, a periodic model
            is asked of a surface that is not, or with free sides, or these are not the surface's.

    Source:
        Polonsky & Keer 1999, doi 10.1016/S0043-1648(99)00113-1.
    """

    surface: Surface
    contact_modulus: float
    periodic: bool = False
    tolerance: float = 1e-8
    highest: float | None = None
    sides: FreeSides | None = None
    body: BodyTerm | None = None
    slopes: SurfaceTerm | None = None
    upper: float = np.inf

    def __post_init__(self) -> None:
        for what in ("contact_modulus", "tolerance"):
            value = getattr(self, what)
            if not (np.isfinite(value) and value > 0.0):
                problem = f"the {what.replace('_', ' ')} must be positive and finite"
                raise InputError(problem, value=value, allowed="> 0")
        if not self.upper > 0.0:
            raise InputError(
                "the upper bound of the pressures must be positive", value=self.upper, allowed="> 0"
            )
        if self.periodic and not self.surface.periodic:
            raise InputError(
                "a periodic half-space needs a periodic surface", value=self.surface.source
            )
        self._check_sides()

    def _check_sides(self) -> None:
        if self.sides is None:
            return
        if self.periodic:
            raise InputError("a periodic half-space has no free sides", value=self.sides)
        if not np.allclose(self.sides.lengths, self.surface.lengths, rtol=1e-9, atol=0.0):
            raise InputError(
                "the free sides are not those of the surface",
                value=self.sides.lengths,
                allowed=f"{self.surface.lengths} mm",
            )

    @property
    def name(self) -> str:
        """Name of the model in a response."""
        return "half-space-periodic" if self.periodic else "half-space"

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.surface.highest if self.highest is None else self.highest

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact of a cell's centre [mm]."""
        return -float(self._required(self._plane(0.0, _LEVEL)).max())

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch cut out along its borders; see `MicroModel.of_patch`.

        Its cells fill the patch: where its borders run through the surface's cells, they are a
        little smaller than those. The patch has a half-space of its own.
        """
        piece = self.surface.piece(*patches.bounds(index))
        model = replace(
            self,
            surface=piece,
            highest=self.reference_height,
            periodic=False,
            sides=None,
            body=None,
            slopes=None,
        )
        return model, whole_patch(piece)

    def solve(
        self,
        approach: float,
        *,
        tilt: tuple[float, float] = _LEVEL,
        start: HalfSpaceState | None = None,
    ) -> HalfSpaceState:
        """Solve the contact at one approach of the plane.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).
            start: A solution nearby to start from; by default coarse grids give the start.

        Raises:
            InputError: When the approach or the tilt is not finite, or a periodic surface is
                pressed to full contact or by a tilted plane.
            NotConverged: When the contact conditions cannot be met to the tolerance.
        """
        return self.equilibrium(Control(approach=approach, tilt=tilt), start=start)

    def solve_force(
        self,
        force: float,
        *,
        tilt: tuple[float, float] | None = _LEVEL,
        start: HalfSpaceState | None = None,
    ) -> HalfSpaceState:
        """Solve the contact under a given normal force.

        Args:
            force: Normal force, ≥ 0 [N]; beyond full contact of a periodic surface too.
            tilt: Slopes (tx, ty) of the plane, kept while it finds its height; None lets it turn.
            start: A solution nearby to start from; by default coarse grids give the start.

        Returns:
            The solution; without force that of first touch of a cell.

        Raises:
            InputError: When the force is negative or not finite, or as for `solve`.
            NotConverged: When the contact conditions cannot be met to the tolerance.
        """
        return self.equilibrium(Control(force=force, tilt=tilt), start=start)

    def equilibrium(
        self, control: Control, *, start: HalfSpaceState | None = None
    ) -> HalfSpaceState:
        """Solve the contact and the motions of the plane that are free, as one problem.

        Args:
            control: What is prescribed of the plane: approach or force, tilt or no moment.
            start: A solution nearby to start from; by default coarse grids give the start.

        Returns:
            The solution. Without force it is that of first touch of a cell, under the tilt of the
            start where the tilt is free.

        Raises:
            InputError: When a periodic surface is pressed to full contact or by a tilted plane.
            NotConverged: When the contact conditions cannot be met to the tolerance.
        """
        pressure = None if start is None else self._started(start.pressure)
        tilt = _LEVEL if start is None else start.plane.tilt
        near = None if start is None else start.plane.approach
        return self._solved(control, pressure, tilt, near)

    def _solved(
        self,
        control: Control,
        start: Array | None,
        tilt: tuple[float, float],
        near: float | None,
    ) -> HalfSpaceState:
        tilt = tilt if control.tilt is None else control.tilt
        if control.force == 0.0:
            level = self._required(self._plane(0.0, tilt))
            return self._pressed(self._plane(-float(level.max()), tilt), None)
        if control.tilt is None:
            return self._turned(control, start)
        if control.approach is not None:
            return self._pressed(self._plane(control.approach, tilt), start)
        level = self._required(self._plane(0.0, tilt))
        known = None
        if start is not None and start.any() and near is not None:
            known = Pressures(start, np.array([near]), 0.0, 0, 0)
        found = self._pressing.by_force(level, self._total(control), known)
        return self._state(self._plane(float(found.motion[0]), tilt), found)

    def _turned(self, control: Control, start: Array | None) -> HalfSpaceState:
        """Solve with a plane that may turn about the middle."""
        if self.periodic:
            raise InputError("a plane cannot turn on a periodic surface", value="tilt free")
        half = 0.5 * float(np.hypot(*self.surface.lengths))
        x, y = (
            (centres - 0.5 * length) / half
            for centres, length in zip(
                (self.surface.x, self.surface.y), self.surface.lengths, strict=True
            )
        )
        required = self._required(self._plane(control.approach or 0.0, _LEVEL))
        total = None if control.force is None else self._total(control)
        known = None if start is None else Pressures(start, np.zeros(3), 0.0, 0, 0)
        found = self._pressing.by_turning(required, Motions.turning(x, y, total), known)
        approach = control.approach if control.force is None else float(found.motion[0])
        return self._state(
            self._plane(float(approach or 0.0), _slopes(found.motion[-2:], half)), found
        )

    def _total(self, control: Control) -> float:
        dx, dy = self.surface.spacing
        return (control.force or 0.0) / (self.contact_modulus * dx * dy)

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        tilt: tuple[float, float] = _LEVEL,
    ) -> Response:
        """Solve along approaches; see `MicroModel.respond`.

        Each starts from the two solutions before it, extrapolated. A cell that straddles a border
        of patches is shared by area.
        """
        sums = self._sums(patches, mean_heights)
        given = checked_approaches(approaches)
        order = np.argsort(given, kind="stable")
        path = self._along([self._plane(given[index], tilt) for index in order])
        rows = {int(index): sums.row(*step) for index, step in zip(order, path, strict=True)}
        ordered = [rows[index] for index in range(len(given))]
        return Response.of(ordered, self.name, self.contact_modulus, patches)

    def press(
        self,
        control: Control,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        sums = self._sums(patches, mean_heights)
        pressure, tilt, near = None, _LEVEL, None
        if start is not None:
            pressure, tilt, near = self._started(start[0]), start[1].tilt, start[1].approach
        state = self._solved(control, pressure, tilt, near)
        rows = [sums.row(state.plane, state)]
        response = Response.of(rows, self.name, self.contact_modulus, patches)
        return Pressed(response, state.plane, (state.pressure, state.plane))

    def _sums(self, patches: Partition, mean_heights: ArrayLike) -> CellSums:
        means = checked_means(mean_heights, patches)
        return CellSums(
            surface=self.surface, patches=patches, mean_heights=means, highest=self.reference_height
        )

    def _along(self, planes: list[RigidPlane]) -> Iterator[tuple[RigidPlane, HalfSpaceState]]:
        """Solve at rising approaches; pressures are extrapolated in the approach."""
        before = last = None
        for plane in planes:
            first = None
            if last is not None:
                first = last.pressure / self.contact_modulus
                if before is not None and last.approach > before.approach:
                    ahead = (plane.approach - last.approach) / (last.approach - before.approach)
                    change = last.pressure - before.pressure
                    first = np.maximum(first + ahead * change / self.contact_modulus, 0.0)
            before, last = last, self._pressed(plane, first)
            yield plane, last

    def _started(self, pressure: Array) -> Array:
        if pressure.shape != self.surface.grid:
            raise InputError(
                "the solution to start from is of another grid",
                value=pressure.shape,
                allowed=f"{self.surface.grid}",
            )
        return np.asarray(np.divide(pressure, self.contact_modulus))

    def _pressed(self, plane: RigidPlane, start: Array | None) -> HalfSpaceState:
        required = self._required(plane)
        if self.periodic and required.mean() >= 0.0:
            raise InputError(
                "a periodic surface has no gap left at this approach",
                value=plane.approach,
                allowed=f"< {plane.approach - required.mean():.6g} mm; beyond it give the force",
            )
        known = None if start is None else Pressures(start, np.zeros(0), 0.0, 0, 0)
        return self._state(plane, self._pressing.by_approach(required, known))

    def _plane(self, approach: float, tilt: tuple[float, float]) -> RigidPlane:
        self._check_tilt(tilt)
        return RigidPlane.above(self.surface, approach, tilt)

    def _check_tilt(self, tilt: tuple[float, float]) -> None:
        if self.periodic and any(tilt):
            raise InputError(
                "a tilted plane does not continue periodically", value=tilt, allowed="(0, 0)"
            )

    def _required(self, plane: RigidPlane) -> Array:
        surface = self.surface
        below = self.reference_height - surface.heights
        return np.asarray(plane.at(surface.x[:, None], surface.y) - below)

    def _state(self, plane: RigidPlane, found: Pressures) -> HalfSpaceState:
        return HalfSpaceState(
            plane=plane,
            required=self._required(plane),
            pressure=found.pressure * self.contact_modulus,
            contact_modulus=self.contact_modulus,
            spacing=self.surface.spacing,
            periodic=self.periodic,
            residual=found.residual,
            iterations=found.iterations,
            grids=self._pressing.grids,
        )

    @cached_property
    def _pressing(self) -> Pressing:
        grids = ElasticGrids(
            periodic=self.periodic,
            modulus=self.contact_modulus,
            sides=self.sides,
            body=self.body,
            slopes=self.slopes,
        )
        return Pressing(
            grids=grids,
            spacing=self.surface.spacing,
            tolerance=self.tolerance,
            upper=self.upper / self.contact_modulus,
        )


def _slopes(turn: Array, half: float) -> tuple[float, float]:
    return float(turn[0]) / half, float(turn[1]) / half
