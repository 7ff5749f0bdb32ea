"""Compliances of the top of a body in its Legendre modes: of pressures alone, or of all tractions.

Matrices have the shape (K², K²), or (3, 3, K², K²) by directions of displacements and tractions.
Mode k K + l varies as mode k along x and l along y (`geometry.legendre_modes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from geometry.legendre_modes import mode_means, modes_within
from support.arrays import Array
from support.checks import positive_lengths
from support.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class FaceModes:
    """Compliance of the top of a body in its Legendre modes.

    Args:
        lengths: Sides (Lx, Ly) of the top [mm].
        matrix: Displacements in modes by the moments of pressures or tractions, symmetric [mm/N].
        origin: Corner of the top, where the contact face does not start with it [mm].
        rough: The same from a coarser discretisation, which shows the error; None where there is
            none.

    Attributes:
        directions: Shape of the directions of displacements and of tractions; none of pressures.

    Raises:
        InputError: When a length is not positive, or the matrix not one of K² modes, not finite or
            not symmetric.
    """

    directions: ClassVar[tuple[int, ...]] = ()

    lengths: tuple[float, float]
    matrix: Array
    origin: tuple[float, float] = (0.0, 0.0)
    rough: Array | None = None

    def __post_init__(self) -> None:
        matrix = np.asarray(self.matrix, float)
        object.__setattr__(self, "matrix", matrix)
        positive_lengths(self.lengths, "the top")
        count = round(matrix.shape[-1] ** 0.5) if matrix.ndim else 0
        if not count or matrix.shape != (*self.directions, count**2, count**2):
            shape = ", ".join([*map(str, self.directions), "K²", "K²"])
            problem = "the compliance is not one of K × K modes"
            raise InputError(problem, value=matrix.shape, allowed=f"({shape}), K ≥ 1")
        apart = float(np.abs(matrix - _transposed(matrix)).max())
        if not apart <= 1e-9 * float(np.abs(matrix).max()):
            problem = "the compliance is not finite and symmetric"
            raise InputError(problem, value=apart, allowed="D = Dᵀ")

    @property
    def count(self) -> int:
        """Modes K along a side."""
        return _count(self.matrix)

    def fewer(self, count: int) -> Self:
        """Return the compliance of the first modes alone, which shows how well K modes resolve it.

        Args:
            count: Modes along a side, at most K.
        """
        if not 1 <= count <= self.count:
            allowed = f"1 … {self.count}"
            raise InputError("so many modes are not there", value=count, allowed=allowed)
        first = _by_modes(self.matrix)[..., :count, :count, :count, :count]
        return type(self)(self.lengths, _of_modes(first), self.origin)

    def within(self, lengths: tuple[float, float]) -> Self:
        """Return the compliance of a rectangle of the top, in modes of its own.

        Args:
            lengths: Sides of the rectangle, whose corner is the origin of the coordinates [mm].
        """
        if lengths == self.lengths and self.origin == (0.0, 0.0):
            return self
        change = modes_within(lengths, self.lengths, self.origin, self.count)

        def changed(matrix: Array) -> Array:
            found = change @ matrix @ change.T
            return np.asarray(0.5 * (found + _transposed(found)))

        rough = None if self.rough is None else changed(self.rough)
        return type(self)(lengths, changed(self.matrix), rough=rough)

    def plus(self, other: Self) -> Self:
        """Return the compliance of this body and of another one on the same rectangle.

        Args:
            other: That of the other body, whose modes may be more or fewer.
        """
        rough = None
        if self.rough is not None or other.rough is not None:
            parts = (one.matrix if one.rough is None else one.rough for one in (self, other))
            rough = _sum(*parts)
        return type(self)(self.lengths, _sum(self.matrix, other.matrix), self.origin, rough)

    def placed(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Return places counted from the corner of the top [mm]."""
        return np.asarray(x, float) - self.origin[0], np.asarray(y, float) - self.origin[1]

    def means(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the means of the modes over cells, shapes (K, nx) and (K, ny).

        Args:
            x: Borders of the cells along x, counted from the corner of the top, (nx + 1,) [mm].
            y: Borders along y, shape (ny + 1,) [mm].
        """
        length_x, length_y = self.lengths
        return mode_means(x, length_x, self.count), mode_means(y, length_y, self.count)


def _count(matrix: Array) -> int:
    """Return the number of modes along a side."""
    return round(matrix.shape[-1] ** 0.5)


def _transposed(matrix: Array) -> Array:
    """Return a compliance with displacements and tractions exchanged."""
    swapped = matrix.swapaxes(-1, -2)
    return swapped if matrix.ndim == 2 else swapped.swapaxes(0, 1)


def _sum(one: Array, other: Array) -> Array:
    """Return the sum of two compliances, of which one may have fewer modes."""
    count = max(map(_count, (one, other)))
    total = np.zeros((*one.shape[:-2], *4 * (count,)))
    for part in (one, other):
        few = _count(part)
        total[..., :few, :few, :few, :few] += _by_modes(part)
    return _of_modes(total)


def _by_modes(matrix: Array) -> Array:
    """Return a compliance with an axis for the modes along each side."""
    return matrix.reshape(*matrix.shape[:-2], *4 * (_count(matrix),))


def _of_modes(by_modes: Array) -> Array:
    """Return the compliance of which `_by_modes` makes this."""
    count = by_modes.shape[-1]
    return by_modes.reshape(*by_modes.shape[:-4], *2 * (count**2,))
