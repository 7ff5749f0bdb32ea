"""Errors of contacts by cause, measured by further contact problems.

Each cause is varied while all others stay, under the plane of a load step: the grid against other
grids, the laws against the contact problem, the modes of the body against fewer, finite slopes
against those of a half-space and by the size of the orders that they leave out. Causes hardly
depend on each other. All but the grid are therefore measured on half as many cells a side. What
finite slopes add to the displacements stays as it is in the run.

First touch is a single point of the surface, and the forces of all grids count from it. Its error
is therefore a cause of its own: what the force changes while the plane moves by it.

The factors of the grid were set on 140 half-spaces (64 to 128 heights along a side, 2.7 to 21
along the shortest wave, slopes of 0.05 to 0.25, tilted or level, 0.1 to 8 % contact area) against
three to six times as many cells along a side. The error of the grid was within 1.5 × the measured
one on 97 %, which was 1.2 × the true one in the median. By coarser grids alone, on 60 of them, it
was within the measured one on 95 %, which was 3.4 × the true one.

What finite slopes leave out is estimated by `FiniteSlopes.error`. Where a side cuts a cap in half
the force was off by another 1.4 % against three meshes of the block.

The same solutions tell the errors of what else is read off them, see `read`. Of stiffnesses the
coarser grids tell that by the cells, under the same force; by other causes they change as the
contact area does, and that against the approach as the force.

Theory: docs/theory.md, section 13.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry import Control, PatchGrid, Surface, overlaps
from patchlaw.geometry.contact_state import ContactState, Start
from patchlaw.micro.boundary_elements.body_modes import BodyModes
from patchlaw.micro.boundary_elements.finite_slopes import SLOPES, FiniteSlopes
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.micro.model import NormalStiffness
from patchlaw.support import Array, InputError
from patchlaw.support.readable import WHOLE, ProgressObserver, unobserved

OnBody = Callable[[HalfSpaceModel, int], HalfSpaceModel]
"""Puts a half-space model on a body; with finite slopes up to an order, 0 for none."""

ZERO = "zero"
"""Name of the error by the height that approaches count from."""

MOST_CHECKED_CELLS, _FEWEST_CELLS = 2**20, 32
"""Cells of the finer grid at most, and cells along a side below which coarser grids do not show the
error."""
_RESIDUAL, _RESIDUAL_OF_FINER = 1e-5, 1e-4
"""Residuals of solutions, and of those on the grid of the run and the finer one. On 8 surfaces,
three of which yield, errors by the body and by slopes differed by 1 % at most from those with 1e-6,
and what the finer grid changes by 3 % from that with 1e-8."""

_OF_OTHERS = 0.5, 0.25, 2.0, 2.0
_OF_GRIDS = np.transpose([(1.0 / 8.0, 1.0 / 30.0, 1.5, 8.0), _OF_OTHERS, _OF_OTHERS])
"""Errors of the force by the cells, and of what else is read off, over what half as many a side
change, over what a quarter changes against half, and over what twice as many change; and, where
these are not solved, over what the first two tell. Others err by the cells along the borders of
contacts, in proportion to their sides. On 64 scenes of 32² and 48² cells, 0.3 to 34 % contact area,
against four times as many a side, 190 of 192 true errors were within 1.5 × the measured ones, which
were 3 to 8 × the true ones in the median."""

_UNKNOWN = math.nan, math.nan
_OF_RADII = 0.6
"""Error of the stiffness by the cells over that of the contact area, relative, at least: a spot is
as stiff as its radius. On 384 half-spaces of 24² to 40² cells, 0.2 to 32 % in contact, with 4 to
2000 cells, against four times as many a side, coarser grids agreed by accident on 10, where the
true error was up to 12 × the one stated without this; with it, it was more than 1.5 × on one."""
_OF_YIELDING = 0.5
"""Error of the stiffness of cells that yield over what fewer cells change by as `_OF_OTHERS`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactErrors:
    """What the force under a given plane may be off by, and what else is read off there.

    Attributes:
        by_cause: By cause errors of the force [N], of the contact area fraction and of the mean
            gap [mm]; where they were requested, of the interface's stiffness, relative to it; and,
            where they may be others, of its conductance and of the stiffness against the approach,
            likewise; shape (3,), (4,) or (6,). Infinite where they cannot be measured.
        stiffness: Change of the force with the approach [N/mm]; 0 without contact, and NaN where
            it was not requested.
        zero: Error of the height that the approach counts from [mm].
    """

    by_cause: dict[str, Array]
    stiffness: float
    zero: float = 0.0

    @property
    def parts(self) -> dict[str, float]:
        """Error of the force by cause [N]."""
        return {cause: float(error[0]) for cause, error in self.by_cause.items()}

    @property
    def force(self) -> float:
        """Error of the force at the approach, the sum of all parts [N]."""
        return sum(self.parts.values())

    @property
    def approach(self) -> float:
        """Error of the approach under the force [mm]; 0 without contact, infinite if not known."""
        if self.stiffness > 0.0:  # which NaN is not
            others = self.force - self.parts.get(ZERO, 0.0)
            return others / self.stiffness + self.zero
        return math.inf if self.force else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorProbe:
    """Measures the errors of load steps of one scene.

    Args:
        model: The half-space model, on the cells of the run.
        on_body: Puts it on the scene's body.
        order: Order of finite slopes in the run; 0 where they are left out.
        by_laws: Whether load steps come from laws instead of the model.
        zero: Error of the height that approaches count from [mm].
        by_cells: Errors by the cells of the force at the approach and of what else is read off,
            where the run knows them from the history of the surface; shape (3,).
        tell: Told how much is done, in percent of the time that it takes, roughly.
    """

    model: HalfSpaceModel
    on_body: OnBody
    order: int
    by_laws: bool = False
    zero: float = 0.0
    by_cells: Array | None = None
    tell: ProgressObserver = unobserved

    def measure(
        self,
        own: Array,
        approach: float,
        tilt: tuple[float, float],
        *,
        start: Start | None = None,
        turns: bool = False,
        stiffness: bool = False,
        behind: ContactState | None = None,
        by_force: bool = False,
        stiffnesses: tuple[float, float] | None = None,
        elastic: bool = False,
    ) -> ContactErrors:
        """Measure the errors of the force of one load step, and of what else is read off it.

        Args:
            own: What the run found, as `read` returns it.
            approach: Approach of the plane [mm].
            tilt: Its slopes.
            start: Where the model is known to be under this plane, or nearby.
            turns: Whether the plane was free to tilt. Laws are then compared with a solution whose
                plane is free. The other causes are measured under the plane as it is.
            stiffness: Whether the stiffness is requested.
            behind: The contact that laws stand for, where friction changes it.
            by_force: Whether errors of area and gap are those under the force, and not at the
                approach.
            stiffnesses: Those of the interface and against the approach [N/mm], whose errors are
                measured, too; NaN where the run does not know one, None where they are not wanted.
            elastic: Whether they are those of cells of which none yields further, whatever has
                yielded.

        Raises:
            NotConverged: When one of the contact problems cannot be solved.
        """
        force, behind_laws = float(own[0]), None
        if self.by_laws:
            model = self.on_body(self.model, self.order)
            free = Control(approach=approach, tilt=None if turns else tilt)
            found = model.press(free, start=start)
            force, tilt, start = found.force, found.plane.tilt, found.guess
            behind_laws = model, behind or found
        control = Control(approach=approach, tilt=tilt)
        self.tell("check", 0, WHOLE)
        if start is None or (self.order and start.by_slopes is None):
            start = self.on_body(self.model, self.order).press(control, start=start).guess
        asked = _Asked(force, by_force, np.array(stiffnesses or _UNKNOWN), turns, elastic)
        problems = _Problems(self, control, start, asked)
        parts = self._by_cause(problems, own, behind_laws)
        if stiffnesses is not None:
            shares = problems.stiffness_errors(parts, float(own[0]), behind_laws)
            parts = {cause: np.append(error, shares[cause]) for cause, error in parts.items()}
        return ContactErrors(
            by_cause={cause: stated(error) for cause, error in parts.items()},
            stiffness=problems.stiffness() if stiffness else math.nan,
            zero=self.zero,
        )

    def _by_cause(
        self, problems: _Problems, own: Array, behind_laws: _Behind | None
    ) -> dict[str, Array]:
        """Return by cause errors of the force and of what else `read` returns, shape (3,) each."""
        parts = dict[str, Array]()
        if behind_laws is not None:
            parts["laws"] = np.abs(problems.comparable(own) - problems.read(behind_laws[1]))
        # measured: 12 to 44, 30 to 60 once others are known, 60 to 75 with the grid
        self.tell("check", 20, WHOLE)
        parts |= problems.body_error()
        parts["slopes"] = problems.slopes_error()
        self.tell("check", 30, WHOLE)
        if (by_cells := self.by_cells) is None:
            by_cells = problems.grid_error(others=sum(error[0] for error in parts.values()))
        parts["grid"] = by_cells
        self.tell("check", 65, WHOLE)
        parts[ZERO] = problems.zero_error(self.zero)
        return parts


_Behind = tuple[HalfSpaceModel, ContactState]
"""A model of the cells behind laws, and the contact that these stand for."""


def read(state: ContactState) -> Array:
    """Return force [N], contact area fraction and mean gap [mm] of a contact, shape (3,)."""
    return np.array([state.force, state.contact_area_fraction, state.mean_separation])


def stated(errors: ArrayLike) -> Array:
    """Return errors, infinite where they are not known."""
    return np.where(np.isnan(errors), math.inf, errors)


def error_by_cells(own: ArrayLike, half: ArrayLike, quarter: ArrayLike) -> Array:
    """Return errors by the cells of numbers that err in proportion to the sides of cells.

    Args:
        own: The numbers, of any shape.
        half: Those on half as many cells along a side.
        quarter: Those on a quarter.
    """
    by_half, by_quarter, _, alone = _OF_OTHERS
    changes = np.abs(np.subtract(own, half)), np.abs(np.subtract(half, quarter))
    found = np.maximum(by_half * changes[0], by_quarter * changes[1])
    return np.asarray(alone * found)


def _share_by_cells(own: float, half: float, quarter: float) -> float:
    """Return the relative error by the cells of a ratio, the smaller one of it and its inverse.

    They agree where changes are small. Where coarse cells are far too soft the error of force over
    stiffness has no bound, where they are far too stiff that of stiffness over force.

    Args:
        own: The ratio; 0 where it is not known or its inverse has no bound.
        half: That on half as many cells along a side.
        quarter: That on a quarter.
    """
    share = float(error_by_cells(own, half, quarter)) / (own or math.nan)
    if not (own and half and quarter):
        return share
    return min(share, own * float(error_by_cells(1.0 / own, 1.0 / half, 1.0 / quarter)))


def coarser(surface: Surface, times: int) -> tuple[int, int]:
    """Return the cells of a coarser grid of a surface, 4 along a side at least.

    Periodic surfaces have an even number, as they may consist of mirror images: what begins with
    another one of them then has the same cells.

    Args:
        surface: The surface.
        times: How many of its cells along a side make one.
    """
    x, y = (count // times + surface.periodic * (count // times % 2) for count in surface.grid)
    return max(x, 4), max(y, 4)


def other_bodies(body: Any) -> list[Any]:
    """Return bodies that tell the error by the modes of a body.

    Args:
        body: What a finite body adds to the displacements by pressures or tractions.

    Returns:
        The body with fewer modes, and one whose modes are off by what its elements err, where it
        has some; None instead where that is not known.
    """
    off = body.off_by_error()
    return [body.fewer(math.ceil(0.75 * body.count)), *([] if off is body else [off])]


class _Asked(NamedTuple):
    """What errors are of.

    Attributes:
        force: The force of the solution on the grid of the run [N].
        by_force: Whether area and gap are compared under the same force, and not at the same
            approach.
        stiffnesses: Those of the interface and against the approach in the run [N/mm]; NaN where
            one is not known.
        turns: Whether the plane was free to tilt.
        elastic: Whether they are those of cells of which none yields further.
    """

    force: float
    by_force: bool
    stiffnesses: Array
    turns: bool
    elastic: bool


class _Problems:
    """Contact problems under one plane on several grids, each solved once, from those before.

    An answer is what is read off a solution, shape (3,). Finite slopes add what they do in the run.

    Args:
        probe: What measures the errors.
        control: The plane.
        start: The solution on the grid of the run.
        asked: What errors are of.
    """

    def __init__(self, probe: ErrorProbe, control: Control, start: Start, asked: _Asked) -> None:
        self._probe, self._control, self._start, self._asked = probe, control, start, asked
        self._grid = probe.model.surface.grid
        self._half, self._quarter = (coarser(probe.model.surface, n) for n in (2, 4))
        self._on_body = probe.on_body(probe.model.resampled(self._half), probe.order)
        self._states: dict[tuple[int, int], ContactState] = {}
        self._others = self._half if self._touches(self._half) else self._grid
        self._known, self._model = self._state(self._others), self._without_slopes(self._others)

    def _touches(self, grid: tuple[int, int]) -> bool:
        """Tell whether a coarser grid shows errors: it may touch nowhere, or have no gap left."""
        try:
            return self._state(grid).force > 0.0
        except InputError:
            return False

    # --- errors by cause, shape (3,)

    def body_error(self) -> dict[str, Array]:
        """Return the error by the modes of the body, by cause; nothing on a half-space."""
        if not isinstance(self._model.body, BodyModes):
            return {}
        return {"body": sum(map(self._by_body, other_bodies(self._model.body)), np.zeros(3))}

    def _by_body(self, body: BodyModes | None) -> Array:
        if body is None:
            return np.full(3, math.inf)
        return np.abs(self._change(replace(self._model, body=body)))

    def zero_error(self, zero: float) -> Array:
        """Return what changes while the plane comes nearer by the error of the zero [mm].

        Area and gap under a force do not depend on where its approach counts from.
        """
        if not zero:
            return np.zeros(3)
        change = self._change(self._model, nearer=zero) * [1.0, *2 * [not self._asked.by_force]]
        return np.append(max(change[0], 0.0), np.abs(change[1:]))

    def slopes_error(self) -> Array:
        """Return the error by finite slopes, and what they change where they are left out.

        It is infinite where the surface is too steep for them.
        """
        known, probe, model = self._known, self._probe, self._on_body
        if not probe.order or self._others != self._half:
            try:
                model = probe.on_body(probe.model.resampled(self._others), SLOPES)
            except InputError:
                return np.full(3, math.inf)
        if not known.force:
            return np.zeros(3)
        missing = sum(each.error(known.pressures) for each in model.slopes)
        # to first order forces change as the elastic energy, ½ ∫ p u dA
        share = missing / (2.0 * known.elastic_energy)
        error = share * np.append(known.force, np.abs(self._answer(self._others)[1:]))
        if not probe.order:
            model = replace(model, tolerance=_RESIDUAL)
            state = model.press(self._control, start=known.guess)
            return error + np.abs(self.read(state) - self._answer(self._others))
        if model.periodic:  # whether the body under a sample can widen is not known
            return error + self._by_slopes(model, [e.on_held_body() for e in model.slopes])
        if model.body is None:
            return error
        # free sides cut contacts
        return error + 0.1 * self._by_slopes(model, [e.on_half_space() for e in model.slopes])

    def _by_slopes(self, model: HalfSpaceModel, others: Sequence[FiniteSlopes]) -> Array:
        """Return what changes on a flat body, by other slopes than those of a model.

        They add almost the same, which may therefore be taken under the pressures as they are.
        """
        pressures = self._known.pressures
        own, changed = (
            sum(each.displacement(pressures) for each in some) for some in (model.slopes, others)
        )
        flat = self._probe.on_body(self._probe.model.resampled(self._others), 0)
        return np.abs(self._change(replace(self._model, body=flat.body), displaced=changed - own))

    def grid_error(self, others: float) -> Array:
        """Return the error by the cells.

        Args:
            others: Error of the force by other causes [N]. The finer grid is solved only where the
                error of the grid matters beside it.
        """
        nx, ny = self._grid
        # The largest counts: by a grid twice as fine, by one twice as coarse, and by that and one
        # twice as coarse again. Without the finer grid coarser ones tell an eighth of the error. It
        # matters from half of the other causes on.
        own = np.append(self._asked.force, self._answer(self._grid)[1:])
        half, quarter = map(self._answer, (self._half, self._quarter))
        by_half, by_quarter, by_finer, alone = _OF_GRIDS
        error = np.maximum(by_half * np.abs(own - half), by_quarter * np.abs(half - quarter))
        needed = min(nx, ny) < _FEWEST_CELLS or alone[0] * error[0] > 0.5 * others
        if 4 * nx * ny > MOST_CHECKED_CELLS or not needed:
            return alone * error
        finer = np.abs(self._answer((2 * nx, 2 * ny)) - self._answer(self._grid))
        return np.maximum(by_finer * finer, error)

    def stiffness(self) -> float:
        """Return the change of the force with the approach, without finite slopes [N/mm]."""
        grid = self._others if min(self._others) >= _FEWEST_CELLS else self._grid
        found = self._without_slopes(grid).stiffness(self._state(grid), turns=False).approach
        return math.nan if found is None else found

    def stiffness_errors(
        self, parts: Mapping[str, Array], own_force: float, behind: _Behind | None
    ) -> dict[str, Array]:
        """Return relative errors of stiffnesses and conductance by cause, shape (3,) each.

        They are those of the interface's stiffness, of what its contacts conduct, and of the
        stiffness against the approach. They grow as the force, and err by cells and by laws as the
        force at the approach does, where that is prescribed, and as the stiffness over the force.
        By other causes they err as the contact area and, against the approach, what yields beside
        the interface as the force. Contacts conduct by their elastic stiffness, which is another
        while they yield. Without contact they are 0, unless a cause may let the plane touch.

        Args:
            parts: The errors of answers by cause.
            own_force: Force of the run [N].
            behind: The contact that laws stand for, and its model; None without laws.
        """
        if not (own_force and self._asked.force):  # behind laws nothing may touch
            return {c: np.full(3, math.inf if error[0] else 0.0) for c, error in parts.items()}
        own = np.append(self._asked.force, self._answer(self._others)[1:])
        whole = {cause: error[0] / own[0] for cause, error in parts.items()}
        force = dict.fromkeys(parts, 0.0) if self._asked.by_force else whole
        beside = {c: force[c] if c == ZERO else share for c, share in whole.items()}
        areas = {cause: error[1] / own[1] for cause, error in parts.items()}
        shares = {c: np.maximum([force[c], force[c], beside[c]], area) for c, area in areas.items()}
        interface, approach = own_force / self._asked.stiffnesses
        if behind is not None:
            model, state = behind
            cells = _lengths(model.stiffness(state, turns=self._asked.turns), state)
            laws = np.abs(1.0 - [interface, approach] / np.where(cells, cells, math.nan))
            shares["laws"], (interface, approach) = force["laws"] + laws[[0, 0, 1]], cells
        elif math.isnan(interface):
            interface = self._lengths_on(self._grid)[0]
        half, quarter = map(self._lengths_on, (self._half, self._quarter))
        known = interface, interface, approach
        by_cells = np.array([_share_by_cells(*on) for on in zip(known, half, quarter, strict=True)])
        # coarser grids may agree by accident: spots are as stiff as their radii, compliances add to
        # that of the plane, and at an approach stiffnesses err as forces where these are lines
        area = self._answer(self._grid)[1]
        by_cells[:2] = np.maximum(by_cells[:2], _OF_RADII * parts["grid"][1] / area)
        part = by_cells[0] * min(1.0, interface / (approach or math.nan))
        by_cells[2] = max(by_cells[2], whole["grid"] - force["grid"], part)
        if not np.array_equal([half[0], quarter[0]], [half[1], quarter[1]]):
            # single cells that yield scatter on all grids, and are an error of their own
            elastic = self._lengths_on(self._grid, elastic=True)[1]
            by_cells = _OF_YIELDING * by_cells[[0, 0, 2]]
            by_cells[1] += _share_by_cells(elastic, half[1], quarter[1])
        shares["grid"] = force["grid"] + by_cells
        return shares

    def _lengths_on(self, grid: tuple[int, int], *, elastic: bool = False) -> Array:
        """Return forces over stiffnesses on a grid under the run's force, shape (3,).

        They are those of the interface, of its elastic cells, and against the approach.

        At the same approach coarse cells may hardly touch, where they fall to nothing.

        Args:
            grid: Its cells.
            elastic: Whether all are wanted of the elastic cells alone.
        """
        model, known = self._without_slopes(grid), self._states.get(grid)
        state = known or self._state(self._grid)
        if grid != self._grid:
            control = replace(self._control, approach=None, force=self._asked.force)
            start = known.guess if known and known.force else None
            state = model.press(control, start=start, displaced=self._displaced(grid))
        unloading = found = model.unloading_stiffness(state, turns=self._asked.turns)
        if model.hardness is not None and not (elastic or self._asked.elastic):
            found = model.stiffness(state, turns=self._asked.turns)
        own, approach = _lengths(found, state)
        return np.array([own, _lengths(unloading, state)[0], approach])

    # --- answers, shape (3,)

    def read(self, state: ContactState) -> Array:
        """Return the answer of a solution."""
        return self.comparable(read(state))

    def comparable(self, answer: Array) -> Array:
        """Return an answer with area and gap under the force of the run, where that is wanted.

        To first order from the approach at which it was found.
        """
        if not self._asked.by_force:
            return answer
        return np.asarray(answer - self._rates * (answer[0] - self._asked.force))

    @cached_property
    def _rates(self) -> Array:
        """What answers change by with the force, shape (3,) [1/N]."""
        state = self._state(self._grid)
        if not state.force:  # of what is left is not known what it grows by
            return np.array([0.0, math.nan, math.nan])
        length = 1.0 / self._asked.stiffnesses[0]
        if math.isnan(length):
            length = self._lengths_on(self._grid)[0] / state.force
        return np.array([0.0, state.contact_area_fraction / state.force, -length])

    def _answer(self, grid: tuple[int, int]) -> Array:
        """Return the answer on a grid."""
        return self.read(self._state(grid))

    def _change(
        self, model: HalfSpaceModel, *, nearer: float = 0.0, displaced: Array | float = 0.0
    ) -> Array:
        """Return what changes of the known answer on another body.

        Args:
            model: The body.
            nearer: How much nearer the plane comes [mm].
            displaced: What displaces the surface besides, shape (nx, ny) [mm].
        """
        control = replace(self._control, approach=(self._control.approach or 0.0) + nearer)
        displaced = displaced + self._displaced(self._others)
        state = model.press(control, start=self._known.guess, displaced=displaced)
        return self.read(state) - self._answer(self._others)

    def _state(self, grid: tuple[int, int]) -> ContactState:
        """Return the solution on a grid."""
        if grid not in self._states:
            nearest = self._states.get(self._half) if grid == self._quarter else None
            known = self._start if nearest is None else nearest.guess
            start = replace(known, values=on_grid(known.values, grid), by_slopes=None)
            model, displaced = self._without_slopes(grid), self._displaced(grid)
            self._states[grid] = model.press(self._control, start=start, displaced=displaced)
        return self._states[grid]

    def _displaced(self, grid: tuple[int, int]) -> Array:
        """Return what finite slopes displace the cells of a grid by in the run [mm]."""
        by_slopes = self._start.by_slopes if self._probe.order else None
        return np.zeros(grid) if by_slopes is None else on_grid(by_slopes, grid)

    def _without_slopes(self, grid: tuple[int, int]) -> HalfSpaceModel:
        """Return the model on a grid, without finite slopes."""
        body, sides = self._on_body.body, self._on_body.sides
        model = replace(self._probe.model, body=body, sides=sides).resampled(grid)
        tolerance = _RESIDUAL_OF_FINER if math.prod(grid) > math.prod(self._half) else _RESIDUAL
        return replace(model, tolerance=tolerance)


def _lengths(found: NormalStiffness, state: ContactState) -> Array:
    """Return force over both stiffnesses, (2,) [mm]; 0 where one is not known or unbounded."""
    return np.array(
        [state.force / one if one else 0.0 for one in (found.interface, found.approach)]
    )


def on_grid(field: Array, grid: tuple[int, int]) -> Array:
    """Return a field on other cells of the same surface, by its means over them.

    Args:
        field: Shape (nx, ny).
        grid: Number of the other cells along x and y.
    """
    nx, ny, x, y = *field.shape, *grid
    if nx % x == ny % y == 0:
        return np.asarray(field.reshape(x, nx // x, y, ny // y).mean(axis=(1, 3)))
    if x % nx == y % ny == 0:
        return np.repeat(np.repeat(field, x // nx, axis=0), y // ny, axis=1)
    along_x, along_y = overlaps(PatchGrid(grid=grid, lengths=(1.0, 1.0)), (1.0, 1.0), (nx, ny))
    return np.asarray(along_x @ field @ along_y.T * (x * y))
