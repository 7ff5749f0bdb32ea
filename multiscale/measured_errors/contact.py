"""Errors of load steps by cause, measured in the run by further contact problems.

Each cause is varied while all others stay, under the plane of the load step: the grid against other
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

Theory: docs/theory.md, section 13.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from patchlaw.geometry import Control, PatchGrid, overlaps
from patchlaw.geometry.contact_state import Start
from patchlaw.micro import BodyModes, ContactState, HalfSpaceModel
from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes
from patchlaw.multiscale.bodies.bodies import SLOPES, OnBody
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import Caution, percent, quantity
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError

ZERO = "zero"
"""Name of the error by the height that approaches count from."""
MOST_CHECKED_CELLS, _FEWEST_CELLS = 2**20, 32
"""Cells of the finer grid at most, and cells along a side below which coarser grids do not show the
error."""
_RESIDUAL, _RESIDUAL_OF_FINER = 1e-5, 1e-4
"""Residuals of solutions, and of those on the grid of the run and the finer one. On 8 surfaces,
three of which yield, errors by the body and by slopes differed by 1 % at most from those with 1e-6,
and what the finer grid changes by 3 % from that with 1e-8."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredErrors:
    """What the force under a given plane may be off by.

    Attributes:
        parts: Error of the force by cause [N]; infinite where it cannot be measured.
        stiffness: Change of the force with the approach [N/mm]; 0 without contact, and NaN where
            it was not requested.
        zero: Error of the height that the approach counts from [mm].
    """

    parts: dict[str, float]
    stiffness: float
    zero: float = 0.0

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
    """

    model: HalfSpaceModel
    on_body: OnBody
    order: int
    by_laws: bool = False
    zero: float = 0.0

    def measure(
        self,
        force: float,
        approach: float,
        tilt: tuple[float, float],
        *,
        start: Start | None = None,
        turns: bool = False,
        stiffness: bool = False,
        behind: float | None = None,
    ) -> MeasuredErrors:
        """Measure the errors of the force of one load step.

        Args:
            force: What the run found [N].
            approach: Approach of the plane [mm].
            tilt: Its slopes.
            start: Where the model is known to be under this plane, or nearby.
            turns: Whether the plane was free to tilt. Laws are then compared with a solution whose
                plane is free. The other causes are measured under the plane as it is.
            stiffness: Whether the stiffness is requested.
            behind: Force of the contact that laws stand for, where friction changes it [N].

        Raises:
            NotConverged: When one of the contact problems cannot be solved.
        """
        parts = {}
        if self.by_laws:
            free = Control(approach=approach, tilt=None if turns else tilt)
            found = self.on_body(self.model, self.order).press(free, start=start)
            parts["laws"] = abs(force - (found.force if behind is None else behind))
            force, tilt, start = found.force, found.plane.tilt, found.guess
        control = Control(approach=approach, tilt=tilt)
        if start is None or (self.order and start.by_slopes is None):
            start = self.on_body(self.model, self.order).press(control, start=start).guess
        problems = _Problems(self, control, start)
        parts |= problems.body_error()
        parts["slopes"] = problems.slopes_error()
        parts["grid"] = problems.grid_error(force, others=sum(parts.values()))
        parts[ZERO] = problems.zero_error(self.zero)
        change = problems.stiffness() if stiffness else math.nan
        return MeasuredErrors(parts=parts, stiffness=change, zero=self.zero)


class _Problems:
    """Contact problems under one plane on several grids, each solved once, from those before.

    Finite slopes add what they add in the run.

    Args:
        probe: What measures the errors.
        control: The plane.
        start: The solution on the grid of the run.
    """

    def __init__(self, probe: ErrorProbe, control: Control, start: Start) -> None:
        self._probe, self._control, self._start = probe, control, start
        self._grid = nx, ny = probe.model.surface.grid
        self._half, self._quarter = ((max(nx // n, 4), max(ny // n, 4)) for n in (2, 4))
        self._on_body = probe.on_body(probe.model.resampled(self._half), probe.order)
        self._states: dict[tuple[int, int], ContactState] = {}
        # under small loads coarse cells may not touch, and would show no error
        self._others = self._half if self._state(self._half).force > 0.0 else self._grid
        self._known, self._model = self._state(self._others), self._without_slopes(self._others)

    def body_error(self) -> dict[str, float]:
        """Return the error by the modes of the body, by cause [N]; nothing on a half-space."""
        body = self._model.body
        if not isinstance(body, BodyModes):
            return {}
        fewer = body.fewer(math.ceil(0.75 * body.count))
        error = abs(self._change(replace(self._model, body=fewer)))
        off = body.off_by_error()
        if off is None:
            return {"body": math.inf}
        if off is not body:
            error += abs(self._change(replace(self._model, body=off)))
        return {"body": error}

    def zero_error(self, zero: float) -> float:
        """Return what the force changes while the plane comes nearer by the error of the zero [N].

        Args:
            zero: This error [mm].
        """
        return max(self._change(self._model, nearer=zero), 0.0) if zero else 0.0

    def slopes_error(self) -> float:
        """Return the error by finite slopes, and what they change where they are left out [N].

        It is infinite where the surface is too steep for them.
        """
        known, probe, model = self._known, self._probe, self._on_body
        if not probe.order or self._others != self._half:
            try:
                model = probe.on_body(probe.model.resampled(self._others), SLOPES)
            except InputError:
                return math.inf
        if not known.force:
            return 0.0
        missing = sum(each.error(known.pressures) for each in model.slopes)
        # to first order forces change as the elastic energy, ½ ∫ p u dA
        error = known.force * missing / (2.0 * known.elastic_energy)
        if not probe.order:
            model = replace(model, tolerance=_RESIDUAL)
            return error + abs(model.press(self._control, start=known.guess).force - known.force)
        if model.periodic:  # whether the body under a sample can widen is not known
            return error + abs(self._by_slopes(model, [e.on_held_body() for e in model.slopes]))
        if model.body is None:
            return error
        # free sides cut contacts
        alone = [each.on_half_space() for each in model.slopes]
        return error + 0.1 * abs(self._by_slopes(model, alone))

    def _by_slopes(self, model: HalfSpaceModel, others: Sequence[FiniteSlopes]) -> float:
        """Return what the force changes on a flat body, by other slopes than those of a model [N].

        They add almost the same, which may therefore be taken under the pressures as they are.
        """
        pressures = self._known.pressures
        own, changed = (
            sum(each.displacement(pressures) for each in some) for some in (model.slopes, others)
        )
        flat = self._probe.on_body(self._probe.model.resampled(self._others), 0)
        return self._change(replace(self._model, body=flat.body), displaced=changed - own)

    def grid_error(self, force: float, others: float) -> float:
        """Return the error by the cells [N].

        Args:
            force: Of the model itself [N].
            others: Error by other causes [N]. The finer grid is solved only where the error of the
                grid matters beside it.
        """
        nx, ny = self._grid
        # The largest counts: by a grid twice as fine, by one twice as coarse, and by that and one
        # twice as coarse again. Without the finer grid coarser ones tell an eighth of the error. It
        # matters from half of the other causes on.
        half, quarter = (self._force(grid) for grid in (self._half, self._quarter))
        error = max(abs(force - half) / 8, abs(half - quarter) / 30)
        needed = min(nx, ny) < _FEWEST_CELLS or 8.0 * error > 0.5 * others
        if 4 * nx * ny > MOST_CHECKED_CELLS or not needed:
            return 8.0 * error
        finer = abs(self._force((2 * nx, 2 * ny)) - self._force((nx, ny)))
        return max(1.5 * finer, error)

    def stiffness(self) -> float:
        """Return the change of the force with the approach, without finite slopes [N/mm]."""
        grid = self._others if min(self._others) >= _FEWEST_CELLS else self._grid
        found = self._without_slopes(grid).stiffness(self._state(grid), turns=False).approach
        return math.nan if found is None else found

    def _change(
        self, model: HalfSpaceModel, *, nearer: float = 0.0, displaced: Array | float = 0.0
    ) -> float:
        """Return what the force of the known contact changes on another body [N].

        Args:
            model: The body.
            nearer: How much nearer the plane comes [mm].
            displaced: What displaces the surface besides, shape (nx, ny) [mm].
        """
        control = replace(self._control, approach=(self._control.approach or 0.0) + nearer)
        displaced = displaced + self._displaced(self._others)
        return model.force_at(control, self._known.guess, displaced) - self._known.force

    def _state(self, grid: tuple[int, int]) -> ContactState:
        """Return the solution on a grid."""
        if grid not in self._states:
            model, start, displaced = self._problem_on(grid)
            self._states[grid] = model.press(self._control, start=start, displaced=displaced)
        return self._states[grid]

    def _force(self, grid: tuple[int, int]) -> float:
        """Return the force of the solution on a grid [N]."""
        if grid in self._states:
            return self._states[grid].force
        model, start, displaced = self._problem_on(grid)
        return model.force_at(self._control, start, displaced)

    def _problem_on(self, grid: tuple[int, int]) -> tuple[HalfSpaceModel, Start, Array]:
        """Return the model on a grid, what to start from, and what finite slopes displace."""
        nearest = self._states.get(self._half, None) if grid == self._quarter else None
        known = self._start if nearest is None else nearest.guess
        start = replace(known, values=_on_grid(known.values, grid), by_slopes=None)
        return self._without_slopes(grid), start, self._displaced(grid)

    def _displaced(self, grid: tuple[int, int]) -> Array:
        """Return what finite slopes displace the cells of a grid by in the run [mm]."""
        by_slopes = self._start.by_slopes if self._probe.order else None
        return np.zeros(grid) if by_slopes is None else _on_grid(by_slopes, grid)

    def _without_slopes(self, grid: tuple[int, int]) -> HalfSpaceModel:
        """Return the model on a grid, without finite slopes."""
        body, sides = self._on_body.body, self._on_body.sides
        model = replace(self._probe.model, body=body, sides=sides).resampled(grid)
        tolerance = _RESIDUAL_OF_FINER if math.prod(grid) > math.prod(self._half) else _RESIDUAL
        return replace(model, tolerance=tolerance)


def _on_grid(field: Array, grid: tuple[int, int]) -> Array:
    """Return a field on other cells of the same surface, by its means over them."""
    nx, ny, x, y = *field.shape, *grid
    if nx % x == ny % y == 0:
        return np.asarray(field.reshape(x, nx // x, y, ny // y).mean(axis=(1, 3)))
    if x % nx == y % ny == 0:
        return np.repeat(np.repeat(field, x // nx, axis=0), y // ny, axis=1)
    along_x, along_y = overlaps(PatchGrid(grid=grid, lengths=(1.0, 1.0)), (1.0, 1.0), (nx, ny))
    return np.asarray(along_x @ field @ along_y.T * (x * y))


def checked_force(
    step: LoadStep,
    probe: ErrorProbe,
    load_history: LoadHistory,
    *,
    start: Start | None = None,
    behind: float | None = None,
) -> tuple[LoadStep, float]:
    """Return a load step with the errors of its normal force measured, and its stiffness [N/mm].

    Args:
        step: The load step.
        probe: Measures the errors.
        load_history: The loads.
        start: The solution of the load step, where the run has it.
        behind: See `ErrorProbe.measure`.

    Raises:
        NotConverged: When a contact problem cannot be solved.
    """
    by_force = load_history.quantity_in(step.stage) == "force"
    known = step.approach_stiffness_N_per_mm
    found = probe.measure(
        step.force_N,
        step.approach_mm,
        step.tilt,
        start=start,
        turns=load_history.slopes is None,
        stiffness=by_force and known is None,
        behind=behind,
    )
    if known is not None:
        found = replace(found, stiffness=known)
    return with_errors(step, found, by_force=by_force), found.stiffness


def with_errors(step: LoadStep, found: MeasuredErrors, *, by_force: bool) -> LoadStep:
    """Return a load step with measured errors.

    Args:
        step: The load step.
        found: Its errors.
        by_force: Whether the force is prescribed, and not the approach.
    """
    force, approach = (
        each if math.isfinite(each) else None for each in (found.force, found.approach)
    )
    return replace(
        step,
        force_error_N=0.0 if by_force else force,
        approach_error_mm=approach if by_force else 0.0,
        errors=tuple(found.parts.items()),
    )


def with_further_errors(
    step: LoadStep, errors: dict[str, float], stiffness: float, *, by_force: bool
) -> LoadStep:
    """Return a load step with more errors of its normal load than those that it has.

    Args:
        step: The load step.
        errors: By cause those of the approach where the force is prescribed [mm], of the force
            where the approach is [N].
        stiffness: Change of the force with the approach [N/mm].
        by_force: Whether the force is prescribed, and not the approach.
    """
    name = "approach_error_mm" if by_force else "force_error_N"
    known, whole = getattr(step, name), sum(errors.values())
    slope = stiffness if by_force else 1.0
    known_slope = math.isfinite(slope)
    parts = {cause: error * slope if known_slope else math.inf for cause, error in errors.items()}
    either = known is None or not math.isfinite(whole)
    changes: dict[str, Any] = {name: None if either else known + whole}
    return replace(step, errors=(*step.errors, *parts.items()), **changes)


def causes_text(errors: Iterable[tuple[str, float]], unit: str) -> str:
    """Return errors by cause in words.

    Args:
        errors: Causes and errors.
        unit: Unit of the errors.
    """
    return ", ".join(
        f"{cause} {quantity(error, unit, 2) if math.isfinite(error) else 'not measured'}"
        for cause, error in errors
    )


def error_notes(steps: list[LoadStep]) -> Iterator[str]:
    """Yield the errors of the last load step that was measured.

    Args:
        steps: The load steps.
    """
    measured = [step for step in steps if step.errors]
    if not measured:
        return
    step = measured[-1]
    whole = sum(error for _, error in step.errors)
    causes = causes_text(step.errors, "N")
    largest = max(step.errors, key=lambda each: each[1])[0]
    if whole == math.inf:
        yield Caution(
            f"measured at load step {step.step}: {causes}; the force has no stated error, as that "
            f"by {largest} may be larger than all others"
        )
    else:
        text = f"measured at load step {step.step}: at its approach the force is "
        share = f" ({percent(whole / step.force_N)})" if step.force_N else ""
        if whole > step.force_N > 0.0:
            # towards full contact of a period it rises without bound
            text, share = f"{text}not known, as its error exceeds it", ""
        else:
            text += f"within {quantity(whole, 'N', 2)}"
        if step.approach_error_mm:
            size = quantity(step.approach_error_mm, "mm", 2)
            text += f", and under its force the approach within {size}"
        yield f"{text}{share}: {causes}"
