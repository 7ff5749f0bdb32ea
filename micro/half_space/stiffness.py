"""The derivatives of the force by the mean gap and by the approach, of contacts on cells.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from patchlaw.geometry import Control, RigidPlane, Surface
from patchlaw.geometry.contact_state import ContactState, Start
from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures
from patchlaw.micro.complementarity.solver import approach_rate, pressure_rates
from patchlaw.micro.model import LEAST_CLOSING, NormalStiffness
from patchlaw.support.arrays import Array, Flags
from patchlaw.support.errors import NotConverged
from patchlaw.support.parallel import blas_threads

_AHEAD, _SAFETY = 0.05, 1.5
"""Part of the largest interference that the plane comes nearer by where cells yield anew, and error
of the stiffness over what half and twice as much change it by. On 24 surfaces of 64² cells,
of which half or nearly all that touch yield, the error was 1.5 times that or less on 21 and at most
twice that. As single cells come and go, it is 10 % in the median where 40 cells yield."""
_BENT = 0.03
"""Part of the stiffness of the interface that its error has besides: on 100 drawn contacts, 75 of
which had 30 yielding cells and more, the slope of a smooth curve was within 1.5 times the error on
91 % without it and on 96 % with it."""
_ROUGH = 5e-5
"""Residual of the solutions there. On 11 contacts of 192² cells stiffnesses differed by 4e-5 at
most from those with 1e-7, on periods by 6e-4; with 1e-5 they differed by as much."""
_NO_MOTIONS = np.zeros(3, bool)
_ROUNDING = 1e-7
"""Plastic depth, relative to the largest interference, that counts as none."""


class ModelOfCells(Protocol):
    """What the stiffness follows from; see `HalfSpaceModel`."""

    @property
    def surface(self) -> Surface:
        """The surface."""
        ...

    @property
    def contact_modulus(self) -> float:
        """E* [MPa]."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution."""
        ...

    @property
    def hardness(self) -> float | None:
        """Hardness of the softer body [MPa]."""
        ...

    def interference(self, plane: RigidPlane, depth: Array | None = None) -> Array:
        """Return the interference of a plane and the surface [mm]."""
        ...

    def problem(self, interference: Array, free: Flags, loads: Array) -> CellProblem:
        """Return the contact problem of a plane."""
        ...

    def pressures_under(
        self,
        control: Control,
        start: Start | None,
        depth: Array | None,
        displaced: Array | None,
        *,
        tolerance: float,
        same_slopes: bool,
    ) -> tuple[ContactPressures, RigidPlane]:
        """Return pressures and the plane."""
        ...


def stiffness(model: ModelOfCells, state: ContactState, *, turns: bool) -> NormalStiffness:
    """Return the stiffnesses of the curve that the load goes on along.

    They follow from a linear solution, unless cells yield further. Then they are difference
    quotients to a plane that comes nearer by `_AHEAD`: cells keep entering that soon carry the
    hardness, which the derivative for a fixed set of cells leaves out. Going on needs nothing but
    the plastic depth so far, however long the last load step was. What finite slopes add is worked
    out for one increment. For half and twice of it, which tell the error, it is taken from the
    straight line.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model.
        turns: Whether the plane turns so that its moments stay.
    """
    largest = float(model.interference(state.plane).max())  # whatever has yielded before
    if not _yields_anew(model, state, largest):
        return unloading_stiffness(model, state, turns=turns)
    rates: dict[float, Array] = {}  # of force and mean gap
    tilt, used = None if turns else state.tilt, 0
    here = start = state.start
    assert state.gap is not None
    cell, gap = float(np.prod(model.surface.spacing)), float(state.gap.mean())
    for part in (1.0, 0.5, 2.0):
        ahead = part * _AHEAD * largest
        further = Control(approach=state.approach + ahead, tilt=tilt)
        try:
            found, plane = model.pressures_under(
                further,
                start,
                start.lowered,
                state.displaced,
                tolerance=_ROUGH,
                same_slopes=bool(rates),
            )
        except NotConverged as error:
            return NormalStiffness(iterations=used + error.iterations)
        pressure = found.pressure
        if not rates:
            there = Start(plane=plane, values=pressure, by_slopes=found.by_slopes)
        start = replace(here.towards(there, 0.5 if part == 1.0 else 2.0), nearby=())
        closed = gap - _mean_gap(model, found, plane, state)
        rates[part] = np.array([float(pressure.sum()) * cell - state.force, closed]) / ahead
        used += found.iterations + 1
    # one cell that enters, up to the hardness or as far as it is displaced
    bears = (model.hardness or 0.0) * cell / (_AHEAD * largest)
    one = min(bears, model.contact_modulus * float(np.sqrt(cell)))
    by_approach = {part: rate[0] for part, rate in rates.items()}
    # by the square root of the force, which is closer to a straight line in the mean gap
    risen = {part: rate[0] * part * _AHEAD * largest for part, rate in rates.items()}
    by_gap = {
        part: 2.0 * rate[0] / rate[1] / (1.0 + math.sqrt(1.0 + risen[part] / state.force))
        for part, rate in rates.items()
    }
    errors = (
        _SAFETY * max(one * scale, *(abs(by[part] - by[1.0]) for part in (0.5, 2.0)))
        for by, scale in ((by_gap, 1.0 / rates[1.0][1]), (by_approach, 1.0))
    )
    own, whole = errors
    return NormalStiffness(by_gap[1.0], by_approach[1.0], used, own + _BENT * by_gap[1.0], whole)


def _mean_gap(
    model: ModelOfCells, found: ContactPressures, plane: RigidPlane, before: ContactState
) -> float:
    """Return the mean gap of a solution, the plastic depth that it leaves included [mm].

    Args:
        model: The surface and what it lies on.
        found: The solution.
        plane: The plane there.
        before: The contact that it goes on from.
    """
    below = model.interference(plane, before.start.lowered)
    problem = model.problem(below, _NO_MOTIONS, np.zeros(3))
    gap = problem.grid.displacement(found.pressure) - problem.interference
    for more in (found.by_slopes, before.displaced):
        if more is not None:
            gap += more
    gap[(found.pressure >= problem.hardness) & (gap < 0.0)] = 0.0
    return float(gap.mean())


def unloading_stiffness(
    model: ModelOfCells, state: ContactState, *, turns: bool = False
) -> NormalStiffness:
    """Return the stiffnesses of the cells in contact, by a linear solution.

    They are those of unloading: cells that yield bear less than the hardness then.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model.
        turns: Whether the plane turns so that its moments stay.
    """
    problem = _problem_at(model, state, np.array([False, turns, turns]))
    pressure = state.pressures
    with blas_threads(1):
        found = approach_rate(problem, pressure)
        if state.force and not found.total > 0.0:
            # the approach of a period near full contact may turn back, with finite slopes
            return NormalStiffness(iterations=found.products)
        closed = 1.0 - found.mean_displacement(problem, pressure)
    approach = found.total * float(np.prod(model.surface.spacing))
    own = approach / closed if closed > LEAST_CLOSING else None  # in full contact no gap closes
    return NormalStiffness(own, approach, found.products + 1)


def rates_of_pressures(
    model: ModelOfCells, state: ContactState, free: Flags, displaced: Array, residual: float
) -> tuple[Array, int]:
    """Return what displacements change in the pressures of a contact, to first order.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model, none of whose cells yields.
        free: Which of approach and slopes of the plane are free, their loads fixed, shape (3,).
        displaced: The displacements into the body, shape (nx, ny) [mm].
        residual: Largest part of them that the pressures leave.

    Returns:
        The changes, shape (nx, ny) [MPa], NaN where the iteration does not converge, and the
        products of the compliance.
    """
    with blas_threads(1):
        problem = _problem_at(model, state, free)
        return pressure_rates(problem, state.pressures, -displaced, residual)


def _problem_at(model: ModelOfCells, state: ContactState, free: Flags) -> CellProblem:
    """Return the contact problem whose solution a state is."""
    interference = model.interference(state.plane, state.lowered_before)
    problem = model.problem(interference, free, np.zeros(3))
    if state.by_slopes is None:
        return problem
    lowered = state.by_slopes
    return replace(problem, interference=interference - lowered, lowered=lowered)


def _yields_anew(model: ModelOfCells, state: ContactState, largest: float) -> bool:
    """Tell whether the load of a state has left plastic depth; ``largest`` is interference."""
    if state.plastic_depth is None or not state.force:
        return False
    before = 0.0 if state.earlier_depth is None else state.earlier_depth
    anew = float((state.plastic_depth - before).max())
    return anew > max(_ROUNDING, 10.0 * model.tolerance) * largest
