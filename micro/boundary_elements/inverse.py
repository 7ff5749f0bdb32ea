"""Linear contact problem of given cells: approximate inverse, conjugate gradients.

With the set of cells fixed the contact is a linear system. The pressures p on the cells A in
contact make the gap vanish there, (C p)_A = d_A. Where motions of the rigid body are free, they
make the gap a rigid motion, while the loads of that motion stay as they are.

The preconditioner is the inverse of the half-space, by transforms on a period, as in the multigrid
smoother of Zhao, Vollebregt & Oosterlee 2014 (Numer. Linear Algebra Appl. 21, 256-274). There,
displacements are known in contact alone. On many cells they are extended to all others at low
energy; on few they are continued by zeros, which costs less.

With the compliance C of a half-space and displacements u of the cells A in contact, the pressures
on A are C_AA⁻¹ u. The energy of that is the least of all displacements of the whole surface that
are u on A. So C_AA⁻¹ = Eᵀ C⁻¹ E, where E is the extension of least energy, and any other extension
makes an approximate inverse whose energy is larger. Extension by zeros, which cuts C⁻¹ down to A,
makes it too large by a factor that grows with the logarithm of the size of a contact over that of a
cell, and with the size of the grid over the distance of the contacts.

Around a contact of size a the least energy has a displacement that falls as a/r, until other
contacts are near. A pyramid of grids, each half as fine, imitates that. Weights say how much a cell
knows: 1 in contact and 0 elsewhere on the finest grid. On the next one they are a share of the sum
over the four cells below, and 1 at most, so that those of a lone contact fall with the size of the
cells. On the way back every cell takes what it does not know from the next coarser grid.

A cell that bears its load on a spring of its own, in series with the half-space, moves more than
the surface does. Its weight on the finest grid is less than 1 (`micro.friction.stick_slip`).

Theory: docs/theory.md, sections 3 and 4.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from patchlaw.micro.boundary_elements.half_space_grid import Cells, Convolution
from patchlaw.support import BLOCK, Array, Indices, blocks, in_threads, largest, on_rows

Field = NDArray[np.float32]

_SHARE = 0.32
"""Weight of a coarse cell over the sum of the weights of its four cells. On 33 rough contacts of
512² cells, 2 to 97 % of which touch, solutions took 17.8 products with 0.4, 16.4 with 0.35, 16.1
with 0.3 and 17.1 with 0.25."""
_NONE = 1e-20
"""Weights up to which a cell knows nothing; quotients of smaller ones are inaccurate."""
_SMALLEST = 2
"""Cells along the shorter side of the coarsest grid."""
_SMALL = 64
"""Cells along the longer side of a grid up to which matrices interpolate to it: two products take
as long as two of the twenty operations on rows and columns."""


class Extension:
    """Extension of values on some cells to all cells of a period, and its transpose.

    Args:
        cells: The n cells.
        period: Cells (mx, my) of the period, which holds them.
        weights: How much each cell knows, from 0 to 1, shape (n,); all 1 when not given.

    Attributes:
        place: Rows and columns of the cells.
    """

    def __init__(self, cells: Cells, period: tuple[int, int], weights: Array | None = None) -> None:
        self.place = rows, columns = cells.rows[cells.row], cells.column
        self._period, shape = period, _halved(period)
        self._block = (rows >> 1) * shape[1] + (columns >> 1)
        weight = self._summed(weights)
        self._scales: list[Field] = []  # from sums over four cells to a level's weighted values
        self._unknown: list[Field] = []  # of each level but the finest, what it does not know
        while True:
            limited, unknown = _limited(weight)
            self._scales.append(weight)
            self._unknown.append(unknown)
            if min(shape) <= _SMALLEST:
                break
            weight = _sums(limited)
            shape = _halved(shape)

    def inverse(self, inverse: Convolution, displacement: Array) -> Array:
        """Return roughly the pressures that displace the cells, shape (n,).

        Args:
            inverse: Product with the inverse on all cells of the period, in single precision.
            displacement: Displacements of the cells, shape (n,) [mm].
        """
        scale = largest(displacement) or 1.0  # single precision ends at 1e-38
        memory = inverse.memory()
        self.extended(displacement / scale, memory)
        inverse(memory[:, : self._period[1]])
        return scale * self.gathered(memory)

    def extended(self, values: Array, out: Field) -> None:
        """Extend values that the cells know whole.

        Args:
            values: Of the cells, shape (n,).
            out: Row by row in memory, at least (mx, my); its first my columns are overwritten by
                the extension.
        """
        self.interpolated(values, out[:, : self._period[1]])
        out.ravel()[self._flat(out)] = values

    def gathered(self, field: Field) -> Array:
        """Return the transpose of `extended` times a field.

        Args:
            field: Row by row in memory, at least (mx, my); overwritten.

        Returns:
            Shape (n,).
        """
        flat, place = field.ravel(), self._flat(field)
        own = flat[place].astype(float)
        flat[place] = 0.0
        own += self.collected(field[:, : self._period[1]])
        return own

    def _flat(self, field: Field) -> Indices:
        """Return the flat indices of the cells in a field, which are faster than two."""
        return np.asarray(self.place[0] * field.shape[1] + self.place[1])

    def interpolated(self, weighted: Array, out: Field) -> None:
        """Interpolate from coarser grids to all cells, those that know values among them.

        Args:
            weighted: Values of the cells times their weights, shape (n,).
            out: Overwritten by the interpolation, shape (mx, my).
        """
        known = [self._summed(weighted, self._scales[0])]
        for scale in self._scales[1:]:
            known.append(scale * _sums(known[-1]))
        field = known.pop()
        for mine, unknown in zip(reversed(known), self._unknown[-2::-1], strict=True):
            finer = np.empty_like(mine)
            _interpolate(field, finer, unknown, mine)
            field = finer
        _interpolate(field, out)

    def _summed(self, values: Array | None, scale: Field | None = None) -> Field:
        """Return sums of values of the cells, or of ones, over coarse cells, times a scale."""
        found = np.empty(_halved(self._period), np.float32)
        sums = np.bincount(self._block, values, found.size).reshape(found.shape)
        return np.multiply(sums, 1.0 if scale is None else scale, out=found, casting="same_kind")

    def collected(self, field: Field) -> Array:
        """Return the transpose of `interpolated` times a field.

        Args:
            field: Shape (mx, my).

        Returns:
            Shape (n,).
        """
        levels = [_collected(field)]
        for unknown in self._unknown[:-1]:
            levels.append(_collected(levels[-1], unknown))
        total = levels.pop() * self._scales[-1]
        for scale, level in zip(self._scales[-2::-1], reversed(levels), strict=True):
            total = _scaled_sum(level, total, scale)
        return np.asarray(total.take(self._block))


def _halved(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the shape of the next coarser grid."""
    return (shape[0] + 1) // 2, (shape[1] + 1) // 2


def _limited(weight: Field) -> tuple[Field, Field]:
    """Return a share of sums of weights, at most 1, and what it lacks of 1.

    Its ratio to the sums takes their place.
    """
    limited, lacking = np.empty_like(weight), np.empty_like(weight)

    def work(rows: slice) -> None:
        here, most = weight[rows], limited[rows]
        np.minimum(np.float32(_SHARE) * here, np.float32(1.0), out=most)
        np.subtract(np.float32(1.0), most, out=lacking[rows])
        np.divide(most, here, out=here, where=here > _NONE)

    on_rows(work, weight.shape)
    return limited, lacking


def _sums(fine: Field) -> Field:
    """Return sums over the cells of the next coarser grid."""
    odd = [(0, n % 2) for n in fine.shape]
    full = np.pad(fine, odd) if odd != [(0, 0), (0, 0)] else fine
    found = np.empty((len(full) // 2, full.shape[1] // 2), np.float32)

    def work(rows: slice) -> None:
        here = full[2 * rows.start : 2 * rows.stop]
        sums = here[0::2] + here[1::2]
        np.add(sums[:, 0::2], sums[:, 1::2], out=found[rows])

    on_rows(work, (len(found), full.shape[1]))
    return found


def _scaled_sum(fine: Field, coarse: Field, scale: Field) -> Field:
    """Add to fine cells the value of the coarse one that covers them, `_sums` transposed; scale.

    Args:
        fine: Values of the fine cells; overwritten by the result.
        coarse: Values of the coarse cells.
        scale: What the sums are multiplied by, of the fine shape.
    """
    height, width = fine.shape

    def work(here: slice) -> None:
        rows = np.empty((here.stop - here.start, 2 * coarse.shape[1]), np.float32)
        rows[:, 0::2] = rows[:, 1::2] = coarse[here]  # faster than to repeat columns
        for below in (0, 1):
            part = fine[2 * here.start + below : 2 * here.stop : 2]
            part += rows[: len(part), :width]
        some = slice(2 * here.start, 2 * here.stop)
        fine[some] *= scale[some]

    in_threads(work, blocks(-(-height // 2), BLOCK // (16 * width)))
    return fine


def _interpolate(
    coarse: Field, out: Field, factors: Field | None = None, terms: Field | None = None
) -> None:
    """Interpolate linearly, and periodically, from the middles of coarse cells to fine ones.

    Args:
        coarse: Values of the coarse cells.
        out: Overwritten by those of the fine cells.
        factors: What these are multiplied by, of the same shape; 1 when not given.
        terms: What is added then; nothing when not given.
    """
    (rows, columns), (height, width) = coarse.shape, out.shape
    if max(height, width) <= _SMALL:
        np.matmul(_interpolation(height) @ coarse, _interpolation(width).T, out=out)
        out *= 1.0 if factors is None else factors
        out += 0.0 if terms is None else terms
        return

    def work(here: slice) -> None:
        near = coarse[np.arange(here.start - 1, here.stop + 1) % rows]
        near *= np.float32(1.0 / 16.0)
        across, middle = np.empty((len(near), width), np.float32), np.float32(3.0) * near
        np.add(middle[:, 1:], near[:, :-1], out=across[:, 2::2])
        np.add(middle[:, 0], near[:, -1], out=across[:, 0])
        np.add(middle[:, :-1], near[:, 1:], out=across[:, 1 : 2 * columns - 1 : 2])
        if width % 2 == 0:
            np.add(middle[:, -1], near[:, 0], out=across[:, -1])
        middle = np.float32(3.0) * across[1:-1]
        some = slice(2 * here.start, 2 * here.stop)
        fine = out[some]
        np.add(middle, across[:-2], out=fine[0::2])
        odd = len(fine) // 2
        np.add(middle[:odd], across[2 : odd + 2], out=fine[1::2])
        if factors is not None:
            fine *= factors[some]
        if terms is not None:
            fine += terms[some]

    in_threads(work, blocks(rows, BLOCK // (16 * width)))


def _collected(fine: Field, factors: Field | None = None) -> Field:
    """Return the transpose of `_interpolate` times a field.

    Args:
        fine: The field.
        factors: What it is multiplied by first, of the same shape; 1 when not given.
    """
    height, width = fine.shape
    rows, columns = _halved((height, width))
    if max(height, width) <= _SMALL:
        field = fine if factors is None else fine * factors
        return np.asarray(_interpolation(height).T @ field @ _interpolation(width))
    result = np.empty((rows, columns), np.float32)

    def part(some: slice | int) -> Field:
        """Return some rows, or one."""
        return fine[some] if factors is None else fine[some] * factors[some]

    def work(here: slice) -> None:
        block = part(slice(2 * here.start, 2 * here.stop))
        even, odd = block[0::2], block[1::2]
        total = even.copy()
        total[: len(odd)] += odd
        total *= np.float32(3.0)
        total[:-1] += even[1:]
        total[-1] += part(2 * (here.stop % rows))
        total[1:] += odd[: len(total) - 1]
        before = 2 * ((here.start - 1) % rows) + 1
        if before < height:
            total[0] += part(before)
        even, odd, found = total[:, 0::2], total[:, 1::2], result[here]
        found[...] = even
        found[:, : width // 2] += odd
        found *= np.float32(3.0)
        found[:, :-1] += even[:, 1:]
        found[:, -1] += even[:, 0]
        found[:, 1:] += odd[:, : columns - 1]
        if width % 2 == 0:
            found[:, 0] += odd[:, -1]
        found *= np.float32(1.0 / 16.0)

    in_threads(work, blocks(rows, BLOCK // (16 * width)))
    return result


@cache
def _interpolation(count: int) -> Field:
    """Return the linear interpolation to a number of fine cells as a matrix, see `_interpolate`."""
    fine, coarse = np.arange(count), (count + 1) // 2
    matrix = np.zeros((count, coarse), np.float32)
    matrix[fine, fine // 2] = 0.75
    matrix[fine, (fine // 2 + 2 * (fine % 2) - 1) % coarse] += 0.25
    return matrix


Inverse = Callable[[Array], Array]
"""Returns roughly the pressures that displace n cells, by their displacements, shape (n,) [mm]; a
symmetric, positive approximation."""


class LinearCompliance(Protocol):
    """A symmetric compliance of n unknowns on some cells, and its approximate inverse."""

    @property
    def accurate(self) -> bool:
        """Whether the inverse needs no pressures by free motions to project with."""

    def apply_compliance(self, cells: Cells, pressure: Array, /) -> Array:
        """Return the displacements by loads on the cells, shape (n,) [mm]."""
        ...

    def inverse_on(self, cells: Cells, /) -> Inverse:
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
        self._inverse, self.accurate = compliance.inverse_on(cells), compliance.accurate
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
