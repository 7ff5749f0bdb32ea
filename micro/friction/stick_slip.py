"""Search for the cells that stick and the directions in which the others slip.

It is the search of `micro.complementarity.active_set` for tractions in two directions. A step takes
the cells at the bound that slip outwards as slipping. Their tractions may only turn; those of all
others are free. The linear problem of these cells is solved roughly by conjugate gradients, the
same as those of the normal contact, and tractions beyond their bounds are brought back to them.
Turning a traction g by an angle shortens it along the slip s, which adds the stiffness |s|/g to the
direction across (Newton's method for the bound).

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

import numpy as np

from micro.boundary_elements.half_space_grid import Cells
from micro.complementarity.conjugate_gradients import ContactCells
from micro.friction.traction_problem import TractionProblem, Tractions
from support.arrays import Array
from support.errors import NotConverged

_TRUSTING_STEPS = 20
"""Steps that may raise the energy when they lower the residual; later ones must lower the energy."""
_MOST_STEPS, _MOST_ITERATIONS, _MOST_HALVINGS = 200, 100, 12
_FORCING = (0.2, 0.01)
"""Displacements at which the conjugate gradients of a step end, relative to the present residual:
where the slipping cells have changed, and where they are the same as before."""


class FreeTractions:
    """Tractions of some cells that stick, and of others that turn, as one linear problem.

    It has the two products of `GridCompliance` that `ContactCells` takes.

    Args:
        problem: The traction problem.
        normal: Directions in which tractions stay as they are, unit vectors of the cells that slip
            and zeros of those that stick, shape (2, n).
        stiffness: Compliance |s|/g that slip adds across these directions, shape (n,) [mm].
    """

    def __init__(self, problem: TractionProblem, normal: Array, stiffness: Array) -> None:
        self._problem, self._normal, self._added = problem, normal, stiffness
        self._weight = 1.0 / np.sqrt(1.0 + stiffness / problem.grid.self_compliance)

    def free_part(self, vectors: Array) -> Array:
        """Return the part of vectors along which tractions are free, shape (2, n)."""
        return vectors - self._normal * (self._normal * vectors).sum(axis=0)

    def apply_compliance(self, cells: Cells, change: Array) -> Array:
        """Return the free part of the displacements by a free change, both flat."""
        part = change.reshape(2, -1)
        moved = self._problem.grid.roughly(cells, part) + self._added * part
        return self.free_part(moved).ravel()

    def apply_inverse(self, cells: Cells, displacement: Array) -> Array:
        """Return roughly the free change that displaces the cells, both flat."""
        part = self.free_part(self._weight * displacement.reshape(2, -1))
        moved = self._problem.grid.inverse(cells, part)
        return self.free_part(self._weight * moved).ravel()

    def solution(self, displacement: Array, *, stop: float, limit: int) -> Array:
        """Return the free change that makes displacements, and keeps a prescribed force.

        Args:
            displacement: The displacements, shape (2, n) [mm].
            stop: Largest part of them that may be left [mm].
            limit: Number of iterations after which the change is returned as it is.
        """
        count = displacement.shape[1]
        modes = np.zeros((0, 2 * count))
        if self._problem.force is not None:
            units = np.zeros((2, 2, count))
            units[0, 0] = units[1, 1] = 1.0
            modes = np.stack([self.free_part(unit).ravel() for unit in units])
        contact = ContactCells(self, self._problem.cells, modes)
        left = -self.free_part(displacement).ravel()
        return contact.close(left, stop=stop, limit=limit).reshape(2, -1)


class StickSlip:
    """Tractions on cells and how far they are from a solution.

    Args:
        problem: The traction problem.
        start: Tractions / E* to begin with, shape (2, n).

    Attributes:
        traction: Present tractions / E*, which are admissible, shape (2, n).
        motion: Shift of all cells where the force is prescribed, shape (2,) [mm].
        slip: Slip of the cells in this step as the tractions have it, shape (2, n) [mm].
        slipping: Which cells slip, shape (n,).
        residual: Largest violation of the conditions over the largest shift.
    """

    def __init__(self, problem: TractionProblem, start: Array) -> None:
        self.problem = problem
        self._set = np.zeros(len(problem.bound), bool)
        tractions = problem.admissible(start)
        if tractions is None:
            tractions = problem.admissible(np.zeros_like(start))
        if tractions is None:
            raise NotConverged(
                "the tractions to start from",
                reason="no tractions within the bounds have the prescribed shear force",
                iterations=0,
                remedy="give a smaller shear force",
            )
        self._accept(tractions)

    def _accept(self, traction: Array) -> None:
        """Evaluate admissible tractions."""
        problem, self.traction = self.problem, traction
        moved = problem.grid.displacement_of(problem.cells, traction)
        self._energy = float(np.vdot(traction, 0.5 * moved - problem.shift))
        wanted, size = problem.shift - moved, np.hypot(*traction)
        at_bound, self.motion = problem.at_bounds(traction), np.zeros(2)
        if problem.force is not None:
            weights = np.where(at_bound, 0.0, problem.bound - size)
            weights = weights if weights.any() else problem.bound
            self.motion = -np.average(wanted, axis=1, weights=weights)
        slip = self.slip = wanted + self.motion[:, None]
        self._normal = traction / np.maximum(size, 1e-300)
        outward = (self._normal * slip).sum(axis=0)
        self.slipping = at_bound & (outward > 0.0)
        self._normal *= self.slipping
        self._outward = np.where(self.slipping, outward, 0.0)
        self._left = slip - self._outward * self._normal
        shifted = np.abs(problem.shift + self.motion[:, None]).max(initial=0.0)
        self._scale = max(float(shifted), float(np.abs(moved).max(initial=0.0)))
        largest = float(np.abs(self._left).max(initial=0.0))
        self.residual = largest / self._scale if self._scale > 0.0 else 0.0

    def step(self, *, cautious: bool) -> bool:
        """Solve with the cells that seem to slip; return whether it gained.

        Args:
            cautious: Whether no step may raise the energy.
        """
        problem = self.problem
        same = bool(np.array_equal(self.slipping, self._set))
        self._set = self.slipping
        free = FreeTractions(problem, self._normal, self._outward / problem.bound)
        stop = max(_FORCING[same] * self.residual, 0.25 * problem.tolerance) * self._scale
        change = free.solution(self._left, stop=stop, limit=_MOST_ITERATIONS)
        old, residual, energy = self.traction, self.residual, self._energy
        for halving in range(_MOST_HALVINGS):
            moved = problem.admissible(old + 0.5**halving * change)
            if moved is None:
                continue
            self._accept(moved)
            gain = self._energy < energy or (self.residual < residual and not cautious)
            if gain or self.residual <= problem.tolerance:
                return True
        return False


def solve_tractions(problem: TractionProblem, start: Array) -> Tractions:
    """Solve the traction problem.

    Args:
        problem: The traction problem.
        start: Tractions / E* to start from, shape (2, n).

    Raises:
        NotConverged: When the residual stays above the tolerance, or the contact slides under a
            prescribed force.

    Source:
        Stadler 2004, doi 10.1137/S1052623403420833, for friction with a given bound as a
        semismooth Newton method; Hüeber, Stadler & Wohlmuth 2008, doi 10.1137/060671061, in two
        directions.
    """
    used, limit = problem.grid.products, float(problem.bound.sum())
    if problem.slides:
        raise NotConverged(
            "the tractions",
            reason="the shear force exceeds what friction transmits: the contact slides",
            iterations=0,
            remedy="give a smaller shear force, or prescribe the shift",
        )
    if not limit > 0.0:
        empty = np.zeros_like(start)
        return Tractions(empty, np.zeros(2), empty, np.zeros(0, bool), 0.0, 0)
    search = StickSlip(problem, start)
    for steps in range(_MOST_STEPS):
        if search.residual <= problem.tolerance:
            return Tractions(
                search.traction,
                search.motion,
                np.where(search.slipping, search._outward, 0.0) * search._normal,
                problem.at_bounds(search.traction),
                search.residual,
                problem.grid.products - used,
            )
        if not search.step(cautious=steps >= _TRUSTING_STEPS):
            break
    raise NotConverged(
        f"the tractions (residual {search.residual:.1e}, asked {problem.tolerance:.1e})",
        reason="the cells that slip were not found",
        iterations=problem.grid.products - used,
        remedy="take smaller steps of the shear",
    )
