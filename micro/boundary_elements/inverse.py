"""Approximate inverse of the compliance of the cells in contact, a preconditioner.

It is that of the half-space, by transforms on a period, as in the multigrid smoother of Zhao,
Vollebregt & Oosterlee 2014 (Numer. Linear Algebra Appl. 21, 256-274). There, displacements are
known in contact alone. On many cells they are extended to all others at low energy
(`micro.boundary_elements.extension`); on few they are continued by zeros, which costs less.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from micro.boundary_elements.extension import Extension
from micro.boundary_elements.half_space_grid import Cells, Convolution, HalfSpaceGrid, many
from support.arrays import Array


class ContactInverse(Protocol):
    """Symmetric, positive approximate inverse of the compliance of n cells.

    Attributes:
        accurate: Whether it needs no pressures by free motions to project with.
    """

    accurate: bool

    def __call__(self, displacement: Array, /) -> Array:
        """Return roughly the pressures / E* that displace the cells, shape (n,).

        Args:
            displacement: Displacements of the cells, shape (n,) [mm].
        """
        ...


def contact_inverse(half_space: HalfSpaceGrid, cells: Cells) -> ContactInverse:
    """Return the approximate inverse of the compliance of some cells.

    Args:
        half_space: The half-space.
        cells: The cells.
    """
    if many(half_space.compliance.grid):
        return ExtendedInverse(half_space.inverse, cells)
    return CutInverse(half_space.inverse, cells)


class CutInverse:
    """Inverse of the half-space on a period, cut down to some cells.

    Args:
        inverse: Product with the inverse on the period, in single precision.
        cells: The cells.
    """

    accurate = False

    def __init__(self, inverse: Convolution, cells: Cells) -> None:
        self._inverse, self._cells = inverse, cells

    def __call__(self, displacement: Array) -> Array:
        """Return roughly the pressures / E* that displace the cells; see `ContactInverse`."""
        return self._inverse.on_cells(self._cells, displacement)


class ExtendedInverse:
    """Inverse of the half-space on a period, between an extension to it and its transpose.

    Args:
        inverse: Product with the inverse on all cells of the period, in single precision.
        cells: The cells.
    """

    accurate = True

    def __init__(self, inverse: Convolution, cells: Cells) -> None:
        self._inverse, self._extension = inverse, Extension(cells, inverse.grid)

    def __call__(self, displacement: Array) -> Array:
        """Return roughly the pressures / E* that displace the cells; see `ContactInverse`."""
        scale = float(np.abs(displacement).max(initial=0.0)) or 1.0  # single precision: 1e-38
        memory = self._inverse.memory()
        self._extension.extended(displacement / scale, memory)
        self._inverse(memory[:, : self._inverse.grid[1]])
        return scale * self._extension.gathered(memory)
