"""The half-space model: a rough surface cell by cell, without assumptions on its asperities.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Control, Partition, PatchGrid, Surface
from geometry.plausibility import check_slopes
from micro.compliance.body_modes import BodyModes
from micro.compliance.free_sides import FreeSides
from micro.compliance.grid_compliance import Compliance
from micro.compliance.slopes_of_bodies import SlopeTerm
from micro.half_space.plane_contact import LEVEL, HalfSpaceState, PlaneContact
from micro.model import (
    Pressed,
    Response,
    Stiffness,
    checked_approaches,
    checked_patches,
    whole_patch,
)
from support.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HalfSpaceModel:
    """A surface on an elastic half-space, pressed by a rigid plane.

    Pressure is uniform on every cell; contact conditions hold at the cell centres.
    `HalfSpaceModel(surface, contact_modulus=4000.0).solve(8e-3).force` is a whole example.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        periodic: Whether surface and pressures continue periodically. The mean displacement of
            a periodic half-space is not determined: displacements, and so the approach, count
            from the mean of the displaced surface.
        tolerance: Largest residual of a solution (see `HalfSpaceState`), which bounds the error of
            the force. On a random surface of 256² cells the force erred by 5e-10 with 1e-8, and by
            1e-13 with 1e-10.
        highest: Height z_M that the approach counts from [mm], such as that of the surface that
            this one was resampled from; the surface's own when not given.
        sides: Free sides of the surface's rectangle, which soften the half-space near them; none
            when not given.
        body: What a finite body adds to the half-space and its sides; a half-space when not given.
        slopes: What the finite slopes of the surface add; the theory of small slopes when not
            given.
        hardness: Hardness of the softer body, the largest pressure [MPa]; contacts are elastic
            when not given. Where cells bear it, what overlap is left is plastic depth: `press`
            starts from the depth of its start, all else from the surface as it is.

    Raises:
        InputError: When modulus, tolerance or hardness are not positive, a periodic model has a
            surface that is not periodic or has free sides, the free sides are not those of the
            surface, or this is steeper than any.

    Source:
        Polonsky & Keer 1999, doi 10.1016/S0043-1648(99)00113-1.
    """

    surface: Surface
    _: KW_ONLY
    contact_modulus: float
    periodic: bool = False
    tolerance: float = 1e-8
    highest: float | None = None
    sides: FreeSides | None = None
    body: BodyModes | None = None
    slopes: SlopeTerm | None = None
    hardness: float | None = None

    def __post_init__(self) -> None:
        for what in ("contact_modulus", "tolerance"):
            value = getattr(self, what)
            if not (np.isfinite(value) and value > 0.0):
                problem = f"the {what.replace('_', ' ')} must be positive and finite"
                raise InputError(problem, value=value, allowed="> 0")
        if self.hardness is not None and not self.hardness > 0.0:
            raise InputError("the hardness must be positive", value=self.hardness, allowed="> 0")
        if self.highest is None:  # otherwise it is part of a surface, or one resampled
            check_slopes(self.surface)
        source, lengths, sides = self.surface.source, self.surface.lengths, self.sides
        if self.periodic and not self.surface.periodic:
            raise InputError("a periodic half-space needs a periodic surface", value=source)
        if self.periodic and sides is not None:
            raise InputError("a periodic half-space has no free sides", value=sides)
        if sides is not None and not np.allclose(sides.lengths, lengths, rtol=1e-9, atol=0.0):
            problem = "the free sides are not those of the surface"
            raise InputError(problem, value=sides.lengths, allowed=f"{lengths} mm")

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
        return self.reference_height - float(self.surface.heights.max())

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch cut out along its borders; see `MicroModel.of_patch`.

        Its cells fill the patch: where its borders run through the surface's cells, they are a
        little smaller than those. The patch has a half-space of its own.
        """
        piece = self.surface.piece(*patches.bounds(index))
        alone: dict[str, Any] = {"periodic": False, "sides": None, "body": None, "slopes": None}
        model = replace(self, surface=piece, highest=self.reference_height, **alone)
        return model, whole_patch(piece)

    def resampled(self, grid: tuple[int, int]) -> Self:
        """Return the model on other cells of the same surface, between its free sides and body.

        The approach counts from the same height. Finite slopes belong to the cells of a surface and
        are left out.

        Args:
            grid: Cells in x and y.
        """
        surface = self.surface.on_grid(grid)
        return replace(self, surface=surface, highest=self.reference_height, slopes=None)

    def solve(
        self,
        approach: float,
        *,
        tilt: tuple[float, float] = LEVEL,
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
        tilt: tuple[float, float] | None = LEVEL,
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
        known = (None, None) if start is None else (start.pressure, start.plane)
        return self._contact.equilibrium(control, *known)

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = LEVEL,
    ) -> Response:
        """Solve along approaches; see `MicroModel.respond`.

        Each solution starts from the two before it, extrapolated in the approach. A cell that
        straddles a border of patches is shared by area.
        """
        patches, means = checked_patches(self.surface, patches, mean_heights)
        given = checked_approaches(approaches)
        rows: dict[int, dict[str, Any]] = {}
        before = last = None
        for index in np.argsort(given, kind="stable"):
            approach = float(given[index])
            start = None if last is None else last.pressure
            if last is not None and before is not None and last.approach > before.approach:
                ahead = (approach - last.approach) / (last.approach - before.approach)
                start = np.maximum(last.pressure + ahead * (last.pressure - before.pressure), 0.0)
            control = Control(approach=approach, tilt=tilt)
            before, last = last, self._contact.equilibrium(control, start)
            rows[int(index)] = last.row(patches, means)
        ordered = [rows[index] for index in range(len(given))]
        return Response.of(ordered, self.name, self.contact_modulus, patches)

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        patches, means = checked_patches(self.surface, patches, mean_heights)
        pressure, plane, *depth = start or (None, None)
        contact = replace(self._contact, depth=depth[0]) if depth else self._contact
        state = contact.equilibrium(control, pressure, plane)
        rows = [state.row(patches, means)]
        response = Response.of(rows, self.name, self.contact_modulus, patches)
        depth = [] if state.plastic_depth is None else [state.plastic_depth]
        return Pressed(response, state.plane, (state.pressure, state.plane, *depth), state)

    @staticmethod
    def guess(start: Any) -> Any:
        """Return what `press` starts from, without the plastic depth that loads before left."""
        return start and start[:2]

    def stiffness(self, state: HalfSpaceState, *, turns: bool) -> Stiffness:
        """Return dF/dδ of a solution; see `MicroModel.stiffness` and `HalfSpaceState.stiffness`."""
        return state.stiffness(turns=turns)

    @cached_property
    def _contact(self) -> PlaneContact:
        return PlaneContact(
            surface=self.surface,
            reference_height=self.reference_height,
            compliance=Compliance(
                periodic=self.periodic,
                modulus=self.contact_modulus,
                sides=self.sides,
                body=self.body,
                slopes=self.slopes,
            ),
            tolerance=self.tolerance,
            hardness=self.hardness,
        )
