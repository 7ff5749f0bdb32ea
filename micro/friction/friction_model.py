"""Friction of a rough surface on a half-space: shear step by step, under given pressures.

Pressures come from the normal contact, which shear leaves as it is: exactly so for like
half-spaces, and by Goodman's assumption for others (`micro.friction.tangential_grid`), unless both
are solved in turn (`micro.friction.coupled`). A load step follows the slip of the one before. Cells
that touch anew begin without traction: before they touched, they followed the body that they are
on.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Annotated, Any

import numpy as np

from patchlaw.geometry import MaterialPair, ShearControl, ShearState
from patchlaw.micro.boundary_elements.body_modes import TractionModes, TractionsOnCells
from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.complementarity.cell_problem import Box, box_around
from patchlaw.micro.friction.stick_slip import (
    FreeTractions,
    TractionProblem,
    across,
    solve_tractions,
)
from patchlaw.micro.friction.tangential_grid import CrossCompliance, Pair, TangentialGrid
from patchlaw.support import Array, Flags, InputError, Limits, Positive, blas_threads, check_fields

_RESIDUAL, _FORCING = 3e-4, 1e-2
"""Largest error of displacements in the stiffness, relative to the shift, and part of the present
one that a solution leaves; the error of the stiffness is the square."""
_MOST_SETS, _MOST_ITERATIONS = 40, 100
_MOST_CROSSES = 2
"""Grids whose cross compliance is kept: that of the contact, and a coarser or finer one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionModel:
    """Coulomb friction between a rough surface and a plane that shifts along it, cell by cell.

    `FrictionModel(materials=pair, coefficient=0.3, spacing=surface.spacing)` and then
    `model.advance(None, pressures, ShearControl(shift=(1e-3, 0.0)))`, whose result is the first
    argument of the next load step.

    Args:
        materials: The two bodies, the other one rigid where it has no material.
        coefficient: Coefficient of friction μ.
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether tractions continue periodically. The mean displacement of a periodic
            half-space is not determined: shifts count from the mean of the displaced surface.
        tolerance: Largest residual of a solution: it is exact for a shift that varies from cell to
            cell by no more than this part.
        body: What a finite body adds to the half-space; a half-space when not given.
        coupled: Whether pressures displace the surface sideways, and tractions across; otherwise
            both are neglected.
        wear: Depth that wears off per pressure and distance that a cell slips [mm²/N]; nothing
            when 0.

    Raises:
        InputError: When coefficient or tolerance are not positive, or the wear is below 0.
    """

    materials: MaterialPair
    coefficient: Annotated[float, Positive]
    spacing: tuple[float, float]
    periodic: bool = False
    tolerance: Annotated[float, Positive] = 1e-6
    body: TractionModes | None = None
    coupled: bool = False
    wear: Annotated[float, Limits(ge=0)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def in_turn(self) -> bool:
        """Whether shear changes the pressures, so that both are solved in turn."""
        return self.coupled or self.wear > 0.0

    def worn_by(self, heat: Array) -> Array:
        """Return the depth that wears off where friction takes up energy [mm].

        Cells slip under the traction μ p alone: the depth k ∫ p |ds| is k/μ of what that takes.

        Args:
            heat: Energy per area [N/mm].
        """
        return self.wear / self.coefficient * heat

    def advance(
        self,
        before: ShearState | None,
        pressure: Array,
        control: ShearControl,
        near: ShearState | None = None,
    ) -> ShearState:
        """Return the shear at the next load step.

        Args:
            before: The shear at the load step before; None where nothing has touched yet.
            pressure: Contact pressures at this load step, shape (nx, ny) [MPa].
            control: What it prescribes of the plane.
            near: A shear whose tractions are near to those there; None: that before.

        Raises:
            InputError: When the pressures are not of the cells of the state before.
            NotConverged: When the tractions are not found, or the contact slides under a prescribed
                force.
        """
        before = ShearState.none(pressure.shape) if before is None else before  # type: ignore[arg-type]
        if before.bound.shape != pressure.shape:
            problem, allowed = "the state before has other cells", f"{pressure.shape}"
            raise InputError(problem, value=before.bound.shape, allowed=allowed)
        step = _Step(self, before, self.coefficient * pressure)
        with blas_threads(1):  # all cores are taken by threads of ours
            return step.solved(control, before if near is None else near)

    def stiffness(self, state: ShearState) -> tuple[float, int]:
        """Return the slope of the shear force where the shift goes on as it changed last.

        Pressures stay as they are.

        Args:
            state: A state of this model.

        Returns:
            The derivative along the last change of the shift, before the first along x [N/mm], NaN
            where the iteration does not converge, and the products of the tangential compliance.
        """
        if not state.closed.any():
            return 0.0, 0
        with blas_threads(1):
            found = TractionRates(self, state)
            along = found.solve(found.ahead, _RESIDUAL)
        return along * self.cell, found.products

    def energy(self, state: ShearState) -> float:
        """Return the elastic energy ½ ∫ q·u dA of the tractions [N mm]."""
        box = self.box(state.closed)
        moved = self.grid(box).displacement(state.traction[:, *box])
        return 0.5 * float(np.vdot(state.traction[:, *box], moved)) * self.cell

    def box(self, cells: Flags) -> Box:
        """Return the box of cells that products are made on: around some, or a whole period."""
        return box_around(cells | self.periodic | ~cells.any())

    def grid(self, box: Box) -> TangentialGrid:
        """Return the tangential compliance of the cells of a box."""
        counts = box[0].stop - box[0].start, box[1].stop - box[1].start
        return TangentialGrid(
            counts,
            self.spacing,
            poisson_ratio=self.materials.tangential_poisson_ratio,
            periodic=self.periodic,
            modulus=self.materials.contact_modulus,
            body=_on_cells(self.body, box, self.spacing),
        )

    def cross(self, grid: tuple[int, int]) -> CrossCompliance | None:
        """Return what couples pressures and tractions on all cells; None where nothing does.

        Args:
            grid: Numbers of cells (nx, ny) of the surface.
        """
        if self.body is None and self.materials.dundurs_beta == 0.0:
            return None
        return self._cross(grid)

    @cached_property
    def _cross(self) -> Callable[[tuple[int, int]], CrossCompliance]:
        """Function from numbers of cells to the cross compliance on them, cached."""
        given = self.spacing, self.materials, self.periodic, self.body
        # not of a method: what refers to its owner stays until Python looks for such cycles
        return lru_cache(maxsize=_MOST_CROSSES)(partial(_cross_on, *given))

    def __getstate__(self) -> dict[str, Any]:
        """Leave the cache behind when sent to another process."""
        return {name: value for name, value in vars(self).items() if name != "_cross"}

    def sideways(self, bound: Array) -> Array:
        """Return the displacements along the surface by pressures, 0 where they are neglected.

        Args:
            bound: μ times the pressures, shape (nx, ny) [MPa].

        Returns:
            Shape (2, nx, ny) [mm].
        """
        cross = self.cross((bound.shape[0], bound.shape[1])) if self.coupled else None
        if cross is None or not bound.any():
            return np.zeros((2, *bound.shape))
        return cross.sideways(bound / self.coefficient)

    @property
    def cell(self) -> float:
        """Area of a cell [mm²]."""
        return float(np.prod(self.spacing))


def _on_cells(body: TractionModes | None, box: Box, spacing: Pair) -> TractionsOnCells | None:
    """Return what a body adds on the cells of a box, if it is there."""
    if body is None:
        return None
    x, y = (
        step * np.arange(part.start, part.stop + 1) for part, step in zip(box, spacing, strict=True)
    )
    return body.on(x, y)


def _cross_on(
    spacing: Pair,
    materials: MaterialPair,
    periodic: bool,
    body: TractionModes | None,
    grid: tuple[int, int],
) -> CrossCompliance:
    """Return what couples pressures and tractions on all cells."""
    on_cells = _on_cells(body, (slice(0, grid[0]), slice(0, grid[1])), spacing)
    return CrossCompliance(grid, spacing, materials, periodic=periodic, body=on_cells)


class TractionRates:
    """Derivatives of the tractions where the shift of a state goes on as it changed last.

    Cells whose traction q lies on its bound g either slip on along it, or come off the bound where
    that is no slip against it: rates, in a direction e of the shift, obey

        q'·q ≤ g' g,    (e − S q')·q ≥ 0,    one of them with =.

    Across q they stick in both cases, as all others do. The cells that slip are sought as those of
    a load step are.

    Args:
        model: The model.
        state: A state of it, with contact.

    Attributes:
        ahead: e on the cells in contact, shape (2, n).
        rate: The latest derivatives, shape (2, n) [MPa/mm].
    """

    def __init__(self, model: FrictionModel, state: ShearState) -> None:
        closed = state.closed
        box = model.box(closed)
        self._closed, self._cells = closed, _cells_in(closed, box)
        self._grid = grid = model.grid(box)
        count, self._used = len(self._cells.flat), grid.products
        self._problem = TractionProblem(
            grid=grid,
            cells=self._cells,
            bound=np.ones(count),
            shift=np.zeros((2, count)),
            force=None,
            tolerance=model.tolerance,
        )
        self.ahead = np.repeat(np.array(state.direction)[:, None], count, axis=1)
        self._at_bound, normal = state.slipping[closed], state.traction[:, closed]
        self._normal = self._at_bound * normal / np.maximum(np.hypot(*normal), 1e-300)
        self._slips = (self._normal * self.ahead).sum(axis=0) > 0.0
        self.rate = np.zeros_like(self.ahead)

    @property
    def products(self) -> int:
        """Products of the tangential compliance so far."""
        return self._grid.products - self._used

    def solve(self, way: Array, residual: float, bound: Array | float = 0.0) -> float:
        """Find the rates, from those found last.

        Args:
            way: What the cells would follow without slip, shape (2, n).
            residual: Largest part of it that the cells that stick leave.
            bound: Derivatives g' of the bounds, shape (n,) [MPa/mm].

        Returns:
            The sum of the rates along `ahead` [MPa/mm], its error of second order where bounds and
            way are those of a shift alone; NaN where they are not found.
        """
        normal, slips, count = self._normal, self._slips, len(self._at_bound)
        rate = across(normal * slips, self.rate) + normal * slips * bound
        rest = way - self._grid.displacement_of(self._cells, rate)
        for _ in range(_MOST_SETS):
            free = FreeTractions(self._problem, normal * slips, np.zeros(count))
            left = free.free_part(rest)
            size = float(np.abs(left).max())
            if size > residual:
                stop = max(_FORCING * size, 0.25 * residual)
                rate = rate + free.solution(left, stop=stop, limit=_MOST_ITERATIONS)
                rest = way - self._grid.displacement_of(self._cells, rate)
            outward, along = ((normal * one).sum(axis=0) for one in (rest, rate))
            changed = self._at_bound & np.where(slips, outward < -residual, along > bound)
            if changed.any():
                slips = slips ^ changed
                rate = across(normal * slips, rate) + normal * slips * bound
                rest = way - self._grid.displacement_of(self._cells, rate)
            elif size <= residual:
                self._slips, self.rate = slips, rate
                return float(np.vdot(rate, self.ahead) + np.vdot(rate, left))
        return np.nan

    def on_grid(self, values: Array) -> Array:
        """Return values of the cells in contact as a field, shape (2, nx, ny)."""
        field = np.zeros((2, *self._closed.shape))
        field[:, self._closed] = values
        return field

    def on_cells(self, field: Array) -> Array:
        """Return the values of a field on the cells in contact, shape (…, n)."""
        return np.asarray(field[..., self._closed])


class _Step:
    """One load step: from the shear before it to that under new pressures.

    Args:
        model: The model.
        before: The shear before the step.
        bound: Bound μ p of the tractions in the step, shape (nx, ny) [MPa].
    """

    def __init__(self, model: FrictionModel, before: ShearState, bound: Array) -> None:
        self._model, self._before, self._bound = model, before, bound
        closed = bound > 0.0
        self._box = model.box(closed | before.closed)
        self._grid = model.grid(self._box)
        self._cells, self._closed = _cells_in(closed, self._box), closed
        self._sideways = model.sideways(bound)
        self._products = self._grid.products

    def solved(self, control: ShearControl, near: ShearState) -> ShearState:
        """Return the shear at the end of the step, from tractions near to those there."""
        model, before = self._model, self._before
        closed = self._closed
        slip_before = self._of_cells(self._slip_before())
        start = self._of_cells(near.traction)
        force = None if control.force is None else np.array(control.force) / model.cell
        prescribed = np.zeros(2) if control.shift is None else np.array(control.shift)
        solution = solve_tractions(
            TractionProblem(
                grid=self._grid,
                cells=self._cells,
                bound=self._of_cells(self._bound),
                shift=prescribed[:, None] - slip_before - self._of_cells(self._sideways),
                force=force,
                tolerance=model.tolerance,
            ),
            start,
        )
        shift = prescribed + solution.motion
        traction = self._on_grid(solution.traction)
        slip = self._on_grid(slip_before + solution.slip)
        slipping = np.zeros(self._bound.shape, bool)
        slipping[closed] = solution.slipping
        heat = self._dissipated(traction, self._on_grid(solution.slip), shift)
        lost = float(heat.sum() * model.cell)
        moved = shift - np.array(before.shift)
        size = float(np.hypot(*moved))
        direction = before.direction if size == 0.0 else tuple(float(one) for one in moved / size)
        cell = model.cell
        return ShearState(
            shift=(float(shift[0]), float(shift[1])),
            force=(float(traction[0].sum()) * cell, float(traction[1].sum()) * cell),
            traction=traction,
            slip=slip,
            bound=self._bound,
            slipping=slipping,
            heat=before.heat + heat,
            direction=direction,  # type: ignore[arg-type]
            dissipated=before.dissipated + lost,
            dissipated_in_step=lost,
            residual=solution.residual,
            products=self._grid.products - self._products,
        )

    def _slip_before(self) -> Array:
        """Return the slip before the step; cells that touch anew had none to follow, (2, nx, ny).

        Those were shifted against the plane by whatever the plane and the surface had moved by
        then, without traction.
        """
        before = self._before
        anew = self._closed & ~before.closed
        slip = before.slip
        moved = self._model.coupled and before.bound.any()
        if anew.any() and (moved or any(before.shift) or before.traction.any()):
            sideways = self._model.sideways(before.bound)
            free = self._free(np.array(before.shift), before.traction, sideways)
            slip = np.where(anew, free, slip)
        return slip

    def _free(self, shift: Array, traction: Array, sideways: Array) -> Array:
        """Return the slip of cells of the box that bear no traction, shape (2, nx, ny) [mm]."""
        free = np.zeros_like(traction)
        box = self._box
        moved = self._grid.displacement(traction[:, *box])
        free[:, *box] = shift[:, None, None] - moved - sideways[:, *box]
        return free

    def _dissipated(self, traction: Array, change: Array, shift: Array) -> Array:
        """Return the energy per area that friction takes up in the step, (nx, ny) [N/mm].

        On cells that stay in contact it is the traction times the change of the slip. Where the
        bound rises, its mean in the step counts; where it falls, the mean of both tractions. Under
        unchanging pressures, and shear along a line, it is exact. Cells that part lose the energy
        of their traction. Where cells wear it is that of the tractions at the end alone, as the
        worn depth is that of the pressures there.
        """
        if self._model.wear:
            return np.maximum((traction * change).sum(axis=0), 0.0)
        before, bound = self._before, self._bound
        parted = before.closed & ~self._closed
        if parted.any() and before.traction[:, parted].any():
            free = self._free(shift, traction, self._sideways)
            change = np.where(parted, free - before.slip, change)
        ratio = np.divide(before.bound, bound, out=np.ones_like(bound), where=bound > before.bound)
        own = 0.5 * (1.0 + ratio) * (traction * change).sum(axis=0)
        falling = ((before.traction - traction) * change).sum(axis=0)
        return np.asarray(np.maximum(own, 0.0) + 0.5 * np.maximum(falling, 0.0))

    def _of_cells(self, field: Array) -> Array:
        """Return the values of a field on the cells in contact, shape (…, n)."""
        part = field[..., *self._box]
        return np.ascontiguousarray(part.reshape(*part.shape[:-2], -1)[..., self._cells.flat])

    def _on_grid(self, values: Array) -> Array:
        """Return values on the cells in contact as a field, shape (2, nx, ny)."""
        field = np.zeros((2, *self._bound.shape))
        part = np.zeros((2, int(np.prod(self._grid.grid))))
        part[:, self._cells.flat] = values
        field[:, *self._box] = part.reshape(2, *self._grid.grid)
        return field


def _cells_in(flags: Flags, box: Box) -> Cells:
    """Return some cells within a box."""
    part = flags[box]
    return Cells.of(np.flatnonzero(part), part.shape)
