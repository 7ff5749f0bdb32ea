"""The half-space model: a rough surface cell by cell, without assumptions on its asperities.

Theory: docs/theory.md, sections 3 and 4.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property, partial
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface
from patchlaw.geometry.contact_state import ContactState, Start, sum_of
from patchlaw.geometry.patches import field_means
from patchlaw.geometry.statistics import check_slopes
from patchlaw.micro.boundary_elements.body_modes import BodyModes
from patchlaw.micro.boundary_elements.compliance_matrix import FewCells
from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes
from patchlaw.micro.boundary_elements.free_sides import FreeSides
from patchlaw.micro.boundary_elements.grid_compliance import BodyTerm, Compliance
from patchlaw.micro.boundary_elements.side_cells import SideTerm
from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures, Motions
from patchlaw.micro.complementarity.slope_iteration import BeyondFullContactError, solve_contact
from patchlaw.micro.complementarity.solver import touches_few_cells
from patchlaw.micro.half_space.read_off import (
    CellLoad,
    check_plane,
    no_gap_left,
    raised_by_slopes,
    stiffness,
    sums_of,
    unloading_stiffness,
)
from patchlaw.micro.model import NormalStiffness, checked_patches
from patchlaw.support import Array, Flags, Indices, InputError, blas_threads, on_rows
from patchlaw.support.arguments import (
    Heights,
    Limits,
    Positive,
    PositivePressure,
    check_fields,
    checked,
)

_REST, _LEAST_REST = 500.0, 1e-7
"""Rest of pressures that finite slopes leave out in part, over the tolerance, and at least; see
`FewCells`. With a tolerance of 5e-7 and a rest of 3e-3 forces erred by 5e-6."""
_ROUNDING = 1e-14
"""Pressures over the largest one that are rounding. A plane that is free to turn about the line of
two cells under it may or may not rest on a third one, with nothing: no area of contact."""
_SHORT_OF_YIELDING, _MOST_SHORT = 100.0, 1e-3
"""Residuals of a solution, and share of the hardness at most, by which cells that yield may bear
less than it: loaded again as far as before they reach it from below, to 17 residuals of 1e-8 and
74 of 1e-5 at most, on 48² to 192² cells."""
_QUICK_CELLS = 2**14
"""Cells of a period on which a solution from one nearby takes milliseconds."""


@dataclass(frozen=True, eq=False)
class HalfSpaceModel:
    """A surface on an elastic half-space, pressed by a rigid plane.

    Pressure is uniform on every cell; contact conditions hold at the cell centres.
    `HalfSpaceModel(surface, contact_modulus=4000.0).press(Control(approach=8e-3)).force` is a whole
    example.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        periodic: Whether surface and pressures continue periodically. The mean displacement of
            a periodic half-space is not determined: displacements, and so the approach, count
            from the mean of the displaced surface, with finite slopes from the flat body's. With
            these the plane goes back shortly before full contact as the force rises, since a
            surface in full contact is stiffer than a smooth body of its volume: an approach then
            has the smaller of two forces.
        tolerance: Largest residual of a solution, which bounds the error of the force: the force
            is exact for a surface whose heights differ from these by at most the residual times the
            largest interference. On a random surface of 256² cells the force erred by 5e-10 with
            1e-8, and by 1e-13 with 1e-10.
        highest: Height z_M that the approach counts from [mm], such as that of the surface that
            this one was resampled from; the surface's own when not given.
        sides: Free sides of the surface's rectangle, which soften the half-space near them; none
            when not given.
        body: What a finite body adds to the half-space and its sides; a half-space when not given.
        slopes: What the finite slopes of the surface add, or those of each of two bodies, on the
            cells of the surface; the theory of small slopes when not given.
        hardness: Hardness of the softer body, the largest pressure [MPa]; contacts are elastic
            when not given. The interference left where cells carry it is plastic depth.
        few: Flat indices of the few cells that can touch, those first that touch first, see
            `quick_up_to`; not known when not given.
        sums_alone: Whether a contact of these cells is known by its pressures and sums alone,
            without displacements, gaps and energy.
        wear: Depth that wears off in a load per contact pressure, the coefficient of wear times the
            slid distance [mm/MPa]. A cell is lower by it, and by all that has worn off before.

    Raises:
        InputError: When modulus, tolerance or hardness are not positive, a periodic model has a
            surface that is not periodic or has free sides, the free sides are not those of the
            surface, or its rms gradient exceeds 2.

    Source:
        Polonsky & Keer 1999, doi 10.1016/S0043-1648(99)00113-1. Wear: Archard 1953,
        doi 10.1063/1.1721448, by implicit Euler steps.
    """

    surface: Surface
    _: KW_ONLY
    contact_modulus: PositivePressure
    periodic: bool = False
    tolerance: Annotated[float, Positive] = 1e-8
    highest: float | None = None
    sides: FreeSides | None = None
    body: BodyModes | None = None
    slopes: tuple[FiniteSlopes, ...] = ()
    hardness: PositivePressure | None = None
    few: Indices | None = None
    sums_alone: bool = False
    wear: Annotated[float, Limits(ge=0)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        if self.highest is None:  # otherwise it is part of a surface, or one resampled
            check_slopes(self.surface)
        lengths, sides = self.surface.lengths, self.sides
        if self.periodic and not self.surface.periodic:
            raise InputError("a periodic half-space needs a periodic surface")
        if self.periodic and sides is not None:
            raise InputError("a periodic half-space has no free sides", value=sides)
        if sides is not None and not np.allclose(sides.lengths, lengths, rtol=1e-9, atol=0.0):
            problem = "the free sides are not those of the surface"
            raise InputError(problem, value=sides.lengths, allowed=f"{lengths} mm")

    @property
    def name(self) -> str:
        """Name of the model."""
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
        alone: dict[str, Any] = {"periodic": False, "slopes": ()}
        alone |= dict.fromkeys(("sides", "body", "few"))
        model = replace(self, surface=piece, highest=self.reference_height, **alone)
        return model, PatchGrid(grid=(1, 1), lengths=piece.lengths)

    @checked
    def resampled(self, grid: tuple[Heights, Heights]) -> Self:
        """Return the model on other cells of the same surface, between its free sides and body.

        The approach counts from the same height. Finite slopes belong to the cells of a surface and
        are left out.

        Args:
            grid: Cells in x and y.
        """
        surface = self.surface.on_grid(grid)
        return replace(self, surface=surface, highest=self.reference_height, slopes=(), few=None)

    @checked
    def solve(
        self, approach: float, *, tilt: tuple[float, float] = (0.0, 0.0), start: Start | None = None
    ) -> ContactState:
        """Solve the contact at one approach of the plane: short for `press`.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).
            start: What the solution may start from, see `ContactState.guess`.
        """
        return self.press(Control(approach=approach, tilt=tilt), start=start)

    @checked
    def solve_force(
        self,
        force: float,
        *,
        tilt: tuple[float, float] | None = (0.0, 0.0),
        start: Start | None = None,
    ) -> ContactState:
        """Solve the contact under one normal force: short for `press`.

        Args:
            force: Normal force, ≥ 0 [N]; beyond full contact of a periodic surface too.
            tilt: Slopes (tx, ty) of the plane, kept while it finds its height; None lets it turn.
            start: What the solution may start from, see `ContactState.guess`.
        """
        return self.press(Control(force=force, tilt=tilt), start=start)

    @checked
    def press(
        self,
        control: Control,
        *,
        patches: PatchGrid | None = None,
        mean_heights: ArrayLike | None = None,
        start: Start | None = None,
        displaced: Array | None = None,
    ) -> ContactState:
        """Solve the contact and the free motions of the plane as one; see `MicroModel.press`.

        Pressure, area and displacement of a cell that straddles a border of patches are shared by
        area; force and area outside of all patches count for the nearest. The surface is lower by
        the plastic and worn depth of the start.

        Args:
            control: What is prescribed.
            patches: Partition that results are summed over.
            mean_heights: Mean height of each patch, shape (N,) [mm].
            start: What the solution may start from.
            displaced: What other loads than pressures displace the surface by, into the body, shape
                (nx, ny) [mm]; nothing when not given.

        Raises:
            InputError: Also when a periodic surface is pressed to an approach in full contact, by a
                tilted plane or, with finite slopes, by a mean pressure of Young's modulus.
        """
        patches, heights = checked_patches(self.surface, patches, mean_heights)
        self._check_fits(start, displaced)
        load = CellLoad(control, start, start, displaced)
        if control.force == 0.0:
            near = (0.0, 0.0) if start is None else start.plane.tilt
            touch = self._first_touch(control.tilt or near, load.lowered)
            load = load._replace(control=touch, start=None)
        solved, plane = self.pressures_under(load)
        return self._contact(solved, plane, load, patches, heights)

    def _contact(
        self,
        solved: ContactPressures,
        plane: RigidPlane,
        load: CellLoad,
        patches: PatchGrid,
        heights: Array,
    ) -> ContactState:
        """Return the contact by the pressures of a solution: sums, fields, and what it leaves.

        Args:
            solved: The solution.
            plane: Its plane.
            load: What presses.
            patches: As for `press`.
            heights: Mean heights, as for `press`.
        """
        surface, before, displaced = self.surface, load.before, load.displaced
        cell, energy, work = surface.spacing[0] * surface.spacing[1], np.nan, 0.0
        warning, by_slopes = "", solved.by_slopes
        depth, worn = (None, None) if before is None else (before.plastic_depth, before.worn_depth)
        (pressure, yielding), displacement, gap, left = self._borne(solved), None, None, None
        means = self._means_alone(pressure, solved.by_slopes, patches, displaced)
        if by_slopes is not None and ((by_slopes < 0.0) & (pressure > 0.0)).any():
            below = self.interference(plane, load.lowered)
            warning = raised_by_slopes(pressure, yielding, by_slopes, below)
        if means is None:
            worn = sum_of(worn, self._worn_off(pressure))
            interference = self.interference(plane, sum_of(depth, worn))
            displacement, gap = self._fields(solved, pressure, interference, displaced)
            energy = 0.5 * float(np.vdot(pressure, displacement)) * cell
            means = field_means(displacement, surface.lengths, patches)
        if self.hardness is not None:
            assert gap is not None
            anew = np.where(yielding, np.maximum(-gap, 0.0), 0.0)
            gap += anew
            left = anew if depth is None else depth + anew
            work = self.hardness * float(left.sum()) * cell
        return ContactState(
            plane=plane,
            patches=patches,
            **sums_of(self, pressure, plane, patches),
            **self._separations(plane, patches, heights, means, sum_of(worn, left)),
            iterations=solved.iterations,
            residual=solved.residual,
            gap=gap,
            displacement=displacement,
            yielding=yielding,
            plastic_depth=left,
            earlier_depth=depth,
            worn_depth=worn,
            elastic_energy=energy,
            plastic_work=work,
            by_slopes=by_slopes,
            displaced=displaced,
            warning=warning,
        )

    def _borne(self, solved: ContactPressures) -> tuple[Array, Flags]:
        """Return pressures without what is rounding, and which of them are the hardness."""
        pressure = solved.pressure.copy()
        pressure[pressure <= _ROUNDING * pressure.max()] = 0.0
        short = min(_SHORT_OF_YIELDING * self.tolerance, _MOST_SHORT)
        return pressure, pressure >= (1.0 - short) * (self.hardness or np.inf)

    def _separations(
        self,
        plane: RigidPlane,
        patches: PatchGrid,
        heights: Array,
        means: Array,
        lowered: Array | None,
    ) -> dict[str, Any]:
        """Return mean displacements and gaps of patches, by the names that `ContactState` has."""
        gaps = self.reference_height - heights - plane.means(patches) + means
        if lowered is not None:
            gaps += field_means(lowered, self.surface.lengths, patches)
        mean = float(np.average(gaps, weights=patches.areas))
        return {"mean_separation": mean, "patch_displacement": means, "patch_separation": gaps}

    def _fields(
        self, solved: ContactPressures, pressure: Array, below: Array, displaced: Array | None
    ) -> tuple[Array, Array]:
        """Return displacements and gaps of the cells by pressures [mm].

        Args:
            solved: The solution.
            pressure: Its pressures.
            below: Interference of the plane and the heights that the load leaves; overwritten.
            displaced: As for `press`.
        """
        if solved.gap is not None and solved.by_slopes is None:  # as its residual is about them
            below += solved.gap
            return below, solved.gap
        grid = self.compliance.on_grid(pressure.shape, self.surface.spacing)
        displacement = grid.displacement(pressure)
        if solved.by_slopes is not None:
            displacement += solved.by_slopes
        worn = self._worn_off(pressure)
        if worn is not None:  # which the compliance of the load has as well
            displacement -= worn
        if displaced is not None:
            displacement += displaced
        return displacement, np.subtract(displacement, below, out=below)

    def _check_fits(self, start: Start | None, displaced: Array | None) -> None:
        """Refuse a solution to start from, or displacements, of other cells."""
        grid = self.surface.grid
        if start is not None and start.values.shape != grid:
            problem, allowed = "the solution to start from is of another grid", f"{grid}"
            raise InputError(problem, value=start.values.shape, allowed=allowed)
        if displaced is not None and not (displaced.shape == grid and np.isfinite(displaced).all()):
            problem, allowed = "is no displacement of every cell", f"finite, shape {grid}"
            raise InputError(problem, key="displaced", value=displaced, allowed=allowed)

    def quick_up_to(
        self, control: Control, error: float = 0.0, *, sums_alone: bool = False
    ) -> Self | None:
        """Return the model for many loads, where few cells touch; see `MicroModel.quick_up_to`.

        Its finite slopes remember the pressures of earlier solutions.
        """
        if self.periodic:
            return self if self.surface.heights.size <= _QUICK_CELLS else None
        if control.approach is None or control.tilt is None:
            return None
        interference = self.interference(
            RigidPlane.moved(self.surface, control.prescribed(np.zeros(3)))
        )
        if not touches_few_cells(self.problem(interference, control.free, control.loads)):
            return None
        count = np.count_nonzero(interference > 0.0)
        return replace(
            self,
            tolerance=max(self.tolerance, error),
            few=np.argsort(-interference, axis=None, kind="stable")[:count],
            sums_alone=sums_alone and self.hardness is None,
        )

    @property
    def learnt(self) -> list[list[Array]]:
        """What finite slopes of few cells remember; a model that is set to it does the same."""
        few = self._few_cells
        return [] if few is None else few.learnt

    def relearn(self, learnt: list[list[Array]]) -> None:
        """Remember what the finite slopes of an equal model did, see `learnt`."""
        if (few := self._few_cells) is not None:
            few.relearn(learnt)

    @property
    def _few_cells(self) -> FewCells | None:
        return self.compliance.few_cells(self.surface.grid, self.surface.spacing)

    def interference(self, plane: RigidPlane, depth: Array | None = None) -> Array:
        """Return the interference δ(x, y) − (z_M − z) of the plane and the surface without load.

        Args:
            plane: The plane.
            depth: What the heights are lower by, shape (nx, ny) [mm]; None: nothing.

        Returns:
            The interference, shape (nx, ny) [mm]; negative where there is a gap.
        """
        surface, highest = self.surface, self.reference_height
        found = np.empty(surface.grid)

        def work(rows: slice) -> None:
            below = highest - surface.heights[rows]
            if depth is not None:
                below += depth[rows]
            np.subtract(plane.at(surface.x[rows, None], surface.y), below, out=found[rows])

        on_rows(work, surface.grid)
        return found

    def stiffness(self, state: ContactState, *, turns: bool = False) -> NormalStiffness:
        """Return −dF/dū and dF/dδ as the load goes on; see `MicroModel.stiffness`."""
        return stiffness(self, state, turns=turns)

    def unloading_stiffness(self, state: ContactState, *, turns: bool = False) -> NormalStiffness:
        """Return −dF/dū and dF/dδ of unloading: all contacts, those that yield too, are elastic.

        Args:
            state: A solution of this model.
            turns: Whether the plane turns so that its moments stay.
        """
        return unloading_stiffness(self, state, turns=turns)

    @cached_property
    def compliance(self) -> Compliance:
        """The elastic body."""
        terms: list[BodyTerm] = (
            [] if self.sides is None else [SideTerm(self.sides, self.contact_modulus)]
        )
        terms += [] if self.body is None else [self.body]
        return Compliance(
            periodic=self.periodic,
            modulus=self.contact_modulus,
            terms=terms,
            slopes=self.slopes,
            few=self.few,
            rest=max(_REST * self.tolerance, _LEAST_REST),
            own=self.wear,
        )

    def with_slopes(self, slopes: tuple[FiniteSlopes, ...]) -> Self:
        """Return the model with other finite slopes, on the same elastic body.

        Args:
            slopes: What finite slopes add.
        """
        model = replace(self, slopes=slopes)
        vars(model)["compliance"] = self.compliance.with_slopes(slopes)
        return model

    def wearing(self, slip_wear: Array) -> Self:
        """Return the model of a load in which cells slip and wear, on the same elastic body.

        Args:
            slip_wear: Depth that wears off per contact pressure, shape (nx, ny) [mm/MPa].
        """
        model = replace(self, few=None, sums_alone=False)
        vars(model)["compliance"] = self.compliance.with_own(slip_wear)
        return model

    @property
    def _wears(self) -> bool:
        return self.wear > 0.0 or self.compliance.own_of_cells is not None

    def _worn_off(self, pressure: Array) -> Array | None:
        """Return the depth that pressures wear off in the load [mm]; None where nothing wears."""
        by_slip = self.compliance.own_of_cells
        worn = None if by_slip is None else by_slip * pressure
        return sum_of(self.wear * pressure if self.wear else None, worn)

    def worn(self, depth: Array) -> Self:
        """Return the model of other loads of the surface once it has worn.

        Its finite slopes are those of the worn surface, the first one of two. The heights are as
        they were made: what a load starts from has what they are lower by.

        Args:
            depth: The depth that has worn off, shape (nx, ny) [mm].
        """
        if not self.slopes:
            return self
        return self.with_slopes((self.slopes[0].lowered(depth), *self.slopes[1:]))

    def pressures_under(
        self, load: CellLoad, *, tolerance: float = 0.0
    ) -> tuple[ContactPressures, RigidPlane]:
        """Return the solution of a contact problem without its sums: pressures and the plane.

        Args:
            load: What presses.
            tolerance: Largest residual, where it is larger than the model's.
        """
        control, start, _, displaced = load
        motion = control.prescribed(np.zeros(3))
        plane = RigidPlane.moved(self.surface, motion)
        interference = self.interference(plane, load.lowered)
        if displaced is not None:
            interference = interference - displaced
        if self.periodic:
            bounded = self.hardness is not None or self._wears
            mean, area = float(interference.mean()), self.surface.area
            check_plane(control, mean, area, self.slopes, bounded)
        problem, first = self.problem(interference, control.free, control.loads), None
        if start is not None:
            motion_there = np.array([start.plane.approach])
            first = ContactPressures(start.values, motion_there, by_slopes=start.by_slopes)
            if displaced is None:
                first = first._replace(nearby=partial(self._nearby, start))
        problem = replace(problem, tolerance=max(tolerance, self.tolerance))
        try:
            with blas_threads(1):  # all cores are taken by threads of ours
                solved = solve_contact(problem, first)
        except BeyondFullContactError as error:
            assert control.approach is not None
            raise no_gap_left(control.approach, error.beyond) from None
        motion[control.free] = problem.motions.unit * solved.motion
        return solved, RigidPlane.moved(self.surface, motion) if control.free.any() else plane

    def _nearby(self, start: Start) -> tuple[tuple[Array, Array], ...]:
        """Return what finite slopes add at solutions, and at which interferences; as pairs."""
        return tuple(
            (self.interference(one.plane) - one.by_slopes, one.by_slopes)
            for one in start.nearby or (start,)
            if one.by_slopes is not None and one.lowered is None
        )

    def _means_alone(
        self, pressure: Array, by_slopes: Array | None, patches: PatchGrid, displaced: Array | None
    ) -> Array | None:
        """Return mean displacements of patches, (N,) [mm], where they are known without fields."""
        if not self.sums_alone or self._wears or displaced is not None:
            return None
        lengths = self.surface.lengths
        means = self.compliance.patch_means(pressure, lengths, patches)
        if means is None or by_slopes is None:
            return means
        return means + field_means(by_slopes, lengths, patches)

    def problem(self, interference: Array, free: Flags, loads: Array) -> CellProblem:
        """Return the contact problem of a plane.

        Args:
            interference: Interference at zero free motions, shape (nx, ny) [mm].
            free: Which of approach and slopes are free, shape (3,).
            loads: Force and first moments, shape (3,) [N, N mm]; those of free motions count.
        """
        surface, (lx, ly) = self.surface, self.surface.lengths
        cell = surface.spacing[0] * surface.spacing[1]
        motions = Motions.of_plane(
            surface.x - 0.5 * lx,
            surface.y - 0.5 * ly,
            free,
            loads / cell,
            half=0.5 * float(np.hypot(lx, ly)),
        )
        return CellProblem(
            compliance=self.compliance,
            spacing=surface.spacing,
            interference=interference,
            motions=motions,
            tolerance=self.tolerance,
            hardness=np.inf if self.hardness is None else self.hardness,
        )

    def _first_touch(self, tilt: tuple[float, float], depth: Array | None) -> Control:
        """Return the approach at which a plane of given slopes first touches."""

        def over(approach: float) -> float:
            plane = RigidPlane.above(self.surface, approach, tilt)
            return float(self.interference(plane, depth).max())

        approach = -over(0.0)
        while (rounding := over(approach)) > 0.0:  # of a tilted plane, which would press
            approach = min(approach - rounding, float(np.nextafter(approach, -np.inf)))
        return Control(approach=approach, tilt=tilt)
