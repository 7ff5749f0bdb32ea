"""Conjugate gradients for the pressures of a given set of cells in contact.

With the set fixed the contact is a linear system. The pressures p on the cells A in contact make
the gap vanish there, (C p)_A = d_A. Where motions of the rigid body are free, they make the gap a
rigid motion, while the loads of that motion stay as they are.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.boundary_elements.inverse import ContactInverse
from patchlaw.support.arrays import Array


class LinearCompliance(Protocol):
    """A symmetric compliance of n unknowns on some cells, and its approximate inverse."""

    def apply_compliance(self, cells: Cells, pressure: Array, /) -> Array:
        """Return the displacements by loads on the cells, shape (n,) [mm]."""
        ...

    def inverse_on(self, cells: Cells, /) -> ContactInverse:
        """Return an approximate inverse of the compliance of the cells."""
        ...


class ContactCells:
    """Cells in contact, loaded by a rigid body of which k motions are free.

    Args:
        compliance: The elastic body; pressures on the cells, or tractions (`micro.friction`).
        cells: The n cells in contact.
        modes: How much nearer each of k ≥ 0 free motions brings them, shape (k, n).

    Attributes:
        accurate: Whether the approximate inverse of the compliance is accurate.
    """

    def __init__(self, compliance: LinearCompliance, cells: Cells, modes: Array) -> None:
        self.compliance, self.cells, self.modes = compliance, cells, modes
        self._inverse = compliance.inverse_on(cells)
        self.accurate = self._inverse.accurate
        # pressures by each free motion, roughly, and the inverse of their loads
        self.resistance = modes
        if not self.accurate:
            self.resistance = np.array([self._inverse(mode) for mode in modes]).reshape(modes.shape)
        loads = modes @ self.resistance.T
        if len(modes) > 1:
            self.inverse = np.linalg.pinv(loads, rcond=1e-10)
        else:  # at once what takes as long as a product on few cells
            self.inverse = np.divide(1.0, loads, out=np.zeros_like(loads), where=loads != 0.0)

    def balanced(self, gap: Array) -> Array:
        """Subtract from gaps the part that free motions of the body take up."""
        if not len(self.modes):
            return gap
        # transposed: the approximate resistance is symmetric only to single precision
        return gap - (self.inverse.T @ (self.resistance @ gap)) @ self.modes

    def preconditioned(self, gap: Array) -> Array:
        """Return roughly the pressures that make these gaps, without loads on free motions."""
        pressure = self._inverse(gap)
        if not len(self.modes):
            return pressure
        return pressure - (self.inverse @ (self.modes @ pressure)) @ self.resistance

    def close(self, gap: Array, *, stop: float, limit: int) -> Array:
        """Return the change of the pressures that closes gaps, by preconditioned iterations.

        Args:
            gap: Gaps of the cells under the present pressures, shape (n,) [mm].
            stop: Largest gap that may be left [mm].
            limit: Number of iterations after which the change is returned as it is.

        Returns:
            Change of the pressures, shape (n,) [MPa]; of either sign.

        Source:
            Polonsky & Keer 1999, doi 10.1016/S0043-1648(99)00113-1, for the given force by removal
            of the mean; Gould, Hribar & Nocedal 2001, doi 10.1137/S1064827598345667, for its
            preconditioned form with any linear conditions.
        """
        left = self.balanced(gap)
        change, direction, before = np.zeros_like(left), np.zeros_like(left), np.inf
        for _ in range(limit):
            step = self.preconditioned(left)
            size = float(left @ step)
            if size <= 0.0:
                break
            direction = step + (size / before) * direction
            answer = self.compliance.apply_compliance(self.cells, direction)
            curvature = float(direction @ answer)
            if curvature <= 0.0:
                break
            length = size / curvature
            change -= length * direction
            left = self.balanced(left - length * answer)
            if np.abs(left).max() <= stop:
                break
            before = size
        return change
