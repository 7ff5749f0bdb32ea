"""What the force of a load step is off by, cause by cause, measured by further contact problems.

Each cause is switched while all others stay, at the plane of the load step: the grid against
others, the laws against the contact problem, the modes of the body against fewer, finite slopes
against one order less and against those of a half-space. Causes hardly depend on each other: all
but the grid are measured on half as many cells a side, and the grid without slopes.

The constants of the grid were set on 140 half-spaces (64 to 128 heights along a side, 2.7 to 21
along the shortest wave, slopes of 0.05 to 0.25, tilted or level, 0.1 to 8 % contact area) against
three to six times as many cells along a side: the grid's error was within 1.5 × the measured one
on 97 %, which was 1.2 × the true one in the median; by coarser grids alone, on 60 of them, 95 % and
3.4 ×.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from geometry import Control
from micro import BodyModes, FiniteSlopes, HalfSpaceModel, HalfSpaceState, resampled
from multiscale.couplings.blocks import OnBody

_FINER, _COARSER, _TWICE = 1.5, 1 / 8, 1 / 30
"""Error of the grid over the difference to one twice as fine, to one twice as coarse, and between
that and one twice as coarse again; the largest counts."""
_ALONE = 8.0
"""Times that without the finer grid."""
_MATTERS = 0.5
"""Share of the other causes above which the grid is worth a finer one."""
_MOST_CELLS = 2**20
"""Cells of the finer grid at most."""
_SMALL = 32
"""Cells along a side below which coarser grids do not tell of the error."""
_FEWER_MODES = 0.75
"""Modes along a side of the body that it is compared with, of those it has."""
_SECOND, _SURROUNDED = 0.1, 0.1
"""Error of the force by finite slopes over what the second order adds, and over what they add on
the body instead of on a half-space, where free sides cut contacts. Against three meshes of the
rough block the force was off by 0.02 to 0.3 % on Sets 1 and 2 of Waddad et al. 2016 and on a cap in
the middle and near a side, where error bars were so small, and by 1.4 % on a cap cut in half."""
_RESIDUAL = 1e-6
"""Of the contact problems solved here: their forces are right to 1e-5 and better."""
_NUDGE = 0.01
"""Change of the approach that the stiffness is taken from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredErrors:
    """What the force under a given plane may be off by.

    Attributes:
        parts: Error of the force by cause [N].
        stiffness: Change of the force with the approach [N/mm]; 0 without contact, and NaN where
            it was not asked for.
    """

    parts: dict[str, float]
    stiffness: float

    @property
    def force(self) -> float:
        """Error of the force at the approach, the sum of all parts [N]."""
        return sum(self.parts.values())

    @property
    def approach(self) -> float:
        """Error of the approach under the force [mm]; 0 without contact."""
        return self.force / self.stiffness if self.stiffness else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorProbe:
    """Measures the errors of load steps of one scene.

    Args:
        model: The half-space model, on the cells of the run.
        on_body: Puts it on the scene's body.
        order: Order of finite slopes in the run; 0 where they are left out.
        by_laws: Whether load steps come from laws instead of the model.
    """

    model: HalfSpaceModel
    on_body: OnBody
    order: int
    by_laws: bool = False

    def measure(
        self,
        force: float,
        approach: float,
        tilt: tuple[float, float],
        *,
        turns: bool = False,
        stiffness: bool = False,
    ) -> MeasuredErrors:
        """Measure the errors of the force of one load step.

        Args:
            force: What the run found [N].
            approach: Approach of the plane [mm].
            tilt: Its slopes.
            turns: Whether the plane was free to turn. Laws are compared with what they should have
                found then; the other causes are measured under the plane as it is.
            stiffness: Whether the stiffness is asked for.

        Raises:
            NotConverged: When one of the contact problems cannot be solved.
        """
        parts = {}
        if self.by_laws:
            free = Control(approach=approach, tilt=None if turns else tilt)
            found = self.on_body(self.model, self.order).equilibrium(free)
            parts["laws"] = abs(force - found.force)
            force, tilt = found.force, found.plane.tilt
        problems = _Problems(self, Control(approach=approach, tilt=tilt))
        body = problems.body_error
        if body is not None:
            parts["body"] = body
        parts["slopes"] = problems.slopes_error
        parts["grid"] = problems.grid_error(force, beside=sum(parts.values()))
        change = problems.stiffness if stiffness else math.nan
        return MeasuredErrors(parts=parts, stiffness=change)


class _Problems:
    """Contact problems about one under the same plane, each solved once."""

    def __init__(self, probe: ErrorProbe, control: Control) -> None:
        self._probe, self._control = probe, control
        self._grid = probe.model.surface.grid
        self._half, self._quarter = (_coarser(self._grid, times) for times in (2, 4))
        self._states: dict[tuple[tuple[int, int], int], HalfSpaceState] = {}

    def force(self, grid: tuple[int, int], order: int) -> float:
        """Return the force on a grid with slopes up to an order [N]."""
        return self._state(grid, order).force

    @property
    def slopes_error(self) -> float:
        """Error by finite slopes, or what they take where they are left out [N]."""
        whole = self.force(self._half, 2)
        if not self._probe.order:
            return abs(whole - self.force(self._half, 0))
        second = abs(whole - self.force(self._half, 1))
        return _SECOND * second + _SURROUNDED * abs(whole - self._on_half_space)

    @property
    def _on_half_space(self) -> float:
        """Force with the slopes of a half-space in place of the body's [N]."""
        placed, flat = self._model(self._half, 2), self._model(self._half, 0)
        if not isinstance(placed.slopes, FiniteSlopes) or placed.body is None:
            return self.force(self._half, 2)
        alone = FiniteSlopes(flat.surface, placed.slopes.half_space)
        start = self._state(self._half, 2)
        return replace(flat, slopes=alone).equilibrium(self._control, start=start).force

    @property
    def body_error(self) -> float | None:
        """Error by the modes of the body [N]; None on a half-space."""
        model, flat = self._model(self._half, 0), self._state(self._half, 0)
        if not isinstance(model.body, BodyModes):
            return None
        fewer = model.body.fewer(math.ceil(_FEWER_MODES * model.body.count))
        found = replace(model, body=fewer).equilibrium(self._control, start=flat)
        return abs(found.force - flat.force)

    def grid_error(self, force: float, beside: float) -> float:
        """Return the error by the cells [N].

        Args:
            force: Of the model itself [N].
            beside: Error by other causes; where the grid has little to say beside it, coarser
                grids tell enough [N].
        """
        coarser = abs(force - self.force(self._half, self._probe.order))
        twice = abs(self.force(self._half, 0) - self.force(self._quarter, 0))
        error = max(_COARSER * coarser, _TWICE * twice)
        nx, ny = self._grid
        small, large = min(nx, ny) < _SMALL, 4 * nx * ny > _MOST_CELLS
        if large or not (small or _ALONE * error > _MATTERS * beside):
            return _ALONE * error
        finer = abs(self.force((2 * nx, 2 * ny), 0) - self.force((nx, ny), 0))
        return max(_FINER * finer, error)

    @property
    def stiffness(self) -> float:
        """Change of the force with the approach, without slopes on a coarse grid [N/mm]."""
        grid = self._half if min(self._half) >= _SMALL else self._grid
        state, approach = self._state(grid, 0), self._control.approach or 0.0
        step = _NUDGE * float(state.interference.max())
        if not (state.force > 0.0 and step > 0.0):
            return 0.0
        back = replace(self._control, approach=approach - step)
        less = self._model(grid, 0).equilibrium(back, start=state)
        return (state.force - less.force) / step

    def _state(self, grid: tuple[int, int], order: int) -> HalfSpaceState:
        if (grid, order) not in self._states:
            near = [state for (cells, _), state in self._states.items() if cells == grid]
            model = self._model(grid, order)
            found = model.equilibrium(self._control, start=near[-1] if near else None)
            self._states[grid, order] = found
        return self._states[grid, order]

    def _model(self, grid: tuple[int, int], order: int) -> HalfSpaceModel:
        model = self._probe.model
        cells = replace(
            model, surface=resampled(model.surface, grid), highest=model.reference_height
        )
        return replace(self._probe.on_body(cells, order), tolerance=_RESIDUAL)


def _coarser(grid: tuple[int, int], times: int) -> tuple[int, int]:
    return max(grid[0] // times, 4), max(grid[1] // times, 4)
