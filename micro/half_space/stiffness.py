"""The derivative of the force with respect to the approach, of contacts on cells.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from patchlaw.geometry import Control, RigidPlane, Surface
from patchlaw.geometry.contact_state import ContactState, Start
from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures
from patchlaw.micro.complementarity.tangent import approach_stiffness, pressure_rates
from patchlaw.micro.model import Stiffness
from patchlaw.support.arrays import Array, Flags
from patchlaw.support.cores import blas_threads
from patchlaw.support.errors import NotConverged

_AHEAD, _SAFETY = 0.05, 1.5
"""Part of the largest interference that the plane comes nearer by where cells yield anew, and error
of the stiffness over what half and twice as much change it by. On 24 surfaces of 64² cells,
of which half or nearly all that touch yield, the error was 1.5 times that or less on 21 and at most
twice that. As single cells come and go, it is 10 % in the median where 40 cells yield."""
_ROUGH = 5e-5
"""Residual of the solutions there. On 11 contacts of 192² cells stiffnesses differed by 4e-5 at
most from those with 1e-7, on periods by 6e-4; with 1e-5 they differed by as much."""
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
        *,
        tolerance: float,
        same_slopes: bool,
    ) -> tuple[ContactPressures, RigidPlane]:
        """Return pressures / E* and the plane."""
        ...


def stiffness(model: ModelOfCells, state: ContactState, *, turns: bool) -> Stiffness:
    """Return dF/dδ of the curve that the load goes on along.

    It follows from a linear solution, unless cells yield further. Then it is the difference
    quotient to a plane that comes nearer by `_AHEAD`: cells keep entering that soon carry the
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
        value, used = elastic_stiffness(model, state, turns=turns)
        # the approach of a period near full contact may turn back, with finite slopes
        return Stiffness(value if value > 0.0 or not state.force else None, used)
    rates: dict[float, float] = {}
    tilt, used = None if turns else state.tilt, 0
    here = start = state.start
    cell = float(np.prod(model.surface.spacing))
    for part in (1.0, 0.5, 2.0):
        ahead = part * _AHEAD * largest
        further = Control(approach=state.approach + ahead, tilt=tilt)
        try:
            found, plane = model.pressures_under(
                further, start, state.plastic_depth, tolerance=_ROUGH, same_slopes=bool(rates)
            )
        except NotConverged as error:
            return Stiffness(None, used + error.iterations)
        pressure = found.pressure * model.contact_modulus
        if not rates:
            there = Start(plane=plane, values=pressure, by_slopes=found.by_slopes)
        start = replace(here.towards(there, 0.5 if part == 1.0 else 2.0), nearby=())
        rates[part] = (float(pressure.sum()) * cell - state.force) / ahead
        used += found.iterations
    # one cell that enters, up to the hardness or as far as it is displaced
    bears = (model.hardness or 0.0) * cell / (_AHEAD * largest)
    one = min(bears, model.contact_modulus * float(np.sqrt(cell)))
    change = max(one, *(abs(rates[part] - rates[1.0]) for part in (0.5, 2.0)))
    return Stiffness(rates[1.0], used, _SAFETY * change)


def elastic_stiffness(
    model: ModelOfCells, state: ContactState, *, turns: bool
) -> tuple[float, int]:
    """Return dF/dδ of the cells in contact [N/mm], and the products of the compliance.

    It is that of unloading: cells that yield bear less than the hardness then.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model.
        turns: Whether the plane turns so that its moments stay.
    """
    problem = _problem_at(model, state, np.array([False, turns, turns]))
    with blas_threads(1):
        rate, products = approach_stiffness(problem, state.pressures / model.contact_modulus)
    return rate * model.contact_modulus * float(np.prod(model.surface.spacing)), products


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
    problem, modulus = _problem_at(model, state, free), model.contact_modulus
    with blas_threads(1):
        rates, used = pressure_rates(problem, state.pressures / modulus, -displaced, residual)
    return rates * modulus, used


def _problem_at(model: ModelOfCells, state: ContactState, free: Flags) -> CellProblem:
    """Return the contact problem whose solution a state is."""
    interference = model.interference(state.plane, state.earlier_depth)
    problem = model.problem(interference, free, np.zeros(3))
    if state.by_slopes is None:
        return problem
    lowered = state.by_slopes
    return replace(problem, interference=interference - lowered, lowered=lowered)


def _yields_anew(model: ModelOfCells, state: ContactState, largest: float) -> bool:
    """Tell whether the load of a state has left plastic depth; ``largest`` is interference."""
    if state.plastic_depth is None:
        return False
    before = 0.0 if state.earlier_depth is None else state.earlier_depth
    anew = float((state.plastic_depth - before).max())
    return anew > max(_ROUNDING, 10.0 * model.tolerance) * largest
