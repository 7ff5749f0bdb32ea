"""The contact problem of a rigid body on an elastic one, and pressures that a search starts from.

Unknown are the pressures p on the cells of a grid and those rigid motions q of the body that are
free. With the compliance C, the interference d of the undeformed bodies where all free motions are
zero, and ℓ_i, how much nearer motion i brings the body, the gap is

    g = C p − d − Σ_i q_i ℓ_i,

and the pressures, bounded by the hardness H of the cells where one is given, satisfy

    p = 0 where g > 0,    g = 0 where 0 < p < H,    p = H where g < 0,    Σ p ℓ_i = f_i.

These are the conditions of the minimum of the convex energy ½ p·C p − p·d over all pressures
between 0 and H that meet the loads f_i.

Source: Almqvist, Sahlin, Larsson & Glavatskih 2007, Tribol. Int. 40, 574-579, for the bound H.

A free motion q moves the body towards the surface by Σ_i q_i ℓ_i(x, y): the approach by ℓ = 1,
slopes by the distance from the centre over half the diagonal. Free motions add the unknowns q to a
contact problem, and as many conditions Σ p ℓ_i = f_i on its pressures.

The plane is that of `geometry.rigid_plane`. What differs is how its equilibrium is found. Contacts
here are cells, whose pressures the active set and conjugate gradients are still looking for. So no
Newton's method of its own moves the plane: every iterate keeps the loads exactly, by a projection
of search directions and a scaling of pressures, and the motion is read off the gaps. Modes are
products of a factor along x and one along y, as a full matrix would be as large as many fields.

A search starts from pressures within their bounds that meet their loads. Where the approach is
prescribed and the tilt is free, no load presses the body. Either it turns until it is clear of the
surface, or some cells hold it: a linear programme tells which.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import NamedTuple, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry.rigid_plane import motion_units
from patchlaw.micro.boundary_elements.compliance_matrix import ComplianceMatrix
from patchlaw.micro.boundary_elements.grid_compliance import Compliance, GridCompliance
from patchlaw.support import Array, Flags, Indices, NotConverged, on_rows

Box = tuple[slice, slice]
"""Rows and columns of a rectangle of cells."""


def coarsened(field: Array, factors: Sequence[int]) -> Array:
    """Average blocks of cells; an incomplete last block is filled with its last cells."""
    missing = [(0, -n % factor) for n, factor in zip(field.shape, factors, strict=True)]
    full = np.pad(field, missing, mode="edge") if np.any(missing) else field
    (x, y), found = factors, np.empty([n // m for n, m in zip(full.shape, factors, strict=True)])

    def work(rows: slice) -> None:
        fine = full[x * rows.start : x * rows.stop]
        sums = reduce(np.add, (fine[i::x] for i in range(x)))
        found[rows] = reduce(np.add, (sums[:, j::y] for j in range(y))) / (x * y)

    on_rows(work, (len(found), x * full.shape[1]))
    return found


def refined(field: Array, factors: Sequence[int]) -> Array:
    """Return the value of every coarse cell on each of the finer cells that it covers."""
    x, y = factors
    found = np.empty((x * field.shape[0], y * field.shape[1]), field.dtype)

    def work(rows: slice) -> None:
        for i, j in np.ndindex(x, y):  # a repetition takes three times as long, and in one thread
            found[x * rows.start + i : x * rows.stop : x, j::y] = field[rows]

    on_rows(work, (len(field), x * found.shape[1]))
    return found


def box_around(cells: Flags) -> Box:
    """Return a box around some cells, at least one.

    Its sides are rounded up to 2^k or 3 · 2^(k−1) cells, as far as the grid has them. Few sizes
    then occur along a load path, and their kernels and work arrays are used again.

    Args:
        cells: Which cells, shape (nx, ny).
    """
    rows, columns = (np.logical_or.reduce(cells, axis=axis) for axis in (1, 0))
    return _span(rows), _span(columns)


def _span(used: Flags) -> slice:
    first, last = (int(at) for at in np.flatnonzero(used)[[0, -1]])
    count = last - first + 1
    power = 1 << max(count - 1, 7).bit_length()
    rounded = 3 * power // 4 if count <= 3 * power // 4 else power
    size = min(rounded, used.size)
    start = min(first, used.size - size)
    return slice(start, start + size)


_MOST_STEPS, _MOST_HALVINGS = 100, 8
_LONGEST = 1.5
"""Largest change of an exponent in one step."""
_FARTHEST = 60.0
"""Largest exponent; loads that need more cannot be met by pressures on these cells."""
_AT_BOUND = 1e-13
"""Pressures below their bound by no more than this share of it count as lying on it."""
_DECREASE = 0.9
"""Slope along a step, relative to that before it, that a step may have where it went beyond the
lowest point of the convex function."""
_ROUNDING, _ENOUGH = 1e-14, 1e-12
"""Residual of the loads, relative to those that all pressures would have on the longest mode: the
one that is aimed at, and the one that is accepted where steps gain no more."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motions:
    """The k free motions of a rigid body on nx × ny cells.

    Args:
        along_x: Factors of the modes ℓ_i = X_i(x) Y_i(y) along x, dimensionless, shape (k, nx).
        along_y: Their factors along y, shape (k, ny).
        loads: Loads f_i: sums of pressures times mode over the cells, shape (k,) [MPa].
        unit: Approach [mm] or slope of the plane that moves its corners by 1 mm, shape (k,).
    """

    along_x: Array
    along_y: Array
    loads: Array
    unit: Array | float = 1.0

    @classmethod
    def of_plane(cls, x: Array, y: Array, free: Flags, loads: ArrayLike, half: float = 1.0) -> Self:
        """Return those motions of a plane that are free: its approach and its two tilts.

        Args:
            x: Abscissae of the cells from the middle, shape (nx,) [mm].
            y: Ordinates, shape (ny,) [mm].
            free: Which of approach and tilts are free, shape (3,).
            loads: Sums of pressures, and of these times x and y, shape (3,); those of free motions
                count.
            half: Half the diagonal of the face [mm].
        """
        unit = motion_units(half)
        ones_x, ones_y = np.ones_like(x), np.ones_like(y)
        along_x = np.stack([ones_x, x * unit[1], ones_x])
        along_y = np.stack([ones_y, ones_y, y * unit[2]])
        loads = np.asarray(loads, float) * unit
        return cls(along_x=along_x[free], along_y=along_y[free], loads=loads[free], unit=unit[free])

    @property
    def count(self) -> int:
        """Number k of free motions."""
        return len(self.loads)

    @property
    def turns(self) -> bool:
        """Whether slopes are free."""
        return self.count > 1

    def displacement(self, motion: Array) -> Array:
        """Return how far a motion moves the body towards the surface, shape (nx, ny) [mm].

        Args:
            motion: The motion, shape (k,) [mm].
        """
        return np.asarray((self.along_x * motion[:, None]).T @ self.along_y)

    def modes_of(self, cells: Indices) -> Array:
        """Return the modes of some cells by their flat indices, shape (k, n)."""
        if not self.turns:  # the approach, whose mode is 1
            return np.ones((self.count, len(cells)))
        row, column = np.divmod(cells, self.along_y.shape[1])
        return np.asarray(self.along_x[:, row] * self.along_y[:, column])

    def closing(self, pressure: Array, gap: Array) -> Array:
        """Return the motion that closes gaps best in the least-squares sense, shape (k,) [mm].

        Args:
            pressure: Pressures, by which cells are weighted, shape (nx, ny).
            gap: Gaps, shape (nx, ny) [mm].
        """
        if not self.turns:  # the approach, whose mode is 1
            return np.array([np.vdot(pressure, gap) / pressure.sum()])
        cells = np.flatnonzero(pressure > 0.0)
        root = np.sqrt(pressure.ravel()[cells] / pressure.max())
        modes, left = self.modes_of(cells), gap.ravel()[cells]
        motion = np.zeros(self.count)
        for _ in range(2):  # again for what rounding leaves of light cells
            change = np.linalg.lstsq((modes * root).T, left * root, rcond=1e-10)[0]
            motion, left = motion + change, left - change @ modes
        return motion

    def on(self, box: Box) -> Motions:
        """Return the motions on a part of the cells, which carries all loads."""
        return replace(self, along_x=self.along_x[:, box[0]], along_y=self.along_y[:, box[1]])

    def among(self, cells: Indices) -> Motions:
        """Return the motions on a column of some cells, which carry all loads."""
        return replace(self, along_x=self.modes_of(cells), along_y=np.ones((self.count, 1)))

    def coarsened(self, factors: Sequence[int]) -> Motions:
        """Return the motions on blocks of cells; see `coarsened`."""
        return replace(
            self,
            along_x=coarsened(self.along_x, (1, factors[0])),
            along_y=coarsened(self.along_y, (1, factors[1])),
            loads=self.loads / np.prod(factors),
        )

    def scaled_to_loads(
        self, pressure: Array, upper: float = np.inf, fixed: Flags | None = None
    ) -> Array | None:
        """Return pressures p exp(Σ μ_i ℓ_i), within their bound, that meet the loads.

        The multipliers μ minimise a convex function, which Newton's method does.

        Args:
            pressure: Pressures ≥ 0, shape (nx, ny) [MPa]; may be overwritten by the result.
            upper: Largest pressure; none when not given.
            fixed: Cells whose pressures stay as they are, shape (nx, ny).

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if not self.turns and upper == np.inf:
            total = sum(on_rows(lambda rows: float(pressure[rows].sum()), pressure.shape))
            if not total > 0.0:
                return None
            pressure *= float(self.loads[0]) / total
            return pressure
        cells, loads, acting = np.flatnonzero(pressure > 0.0), self.loads, 0.0
        if fixed is not None:
            cells = np.flatnonzero((pressure > 0.0) & ~fixed)
            stay = np.flatnonzero(fixed)
            loads = loads - self.modes_of(stay) @ pressure.ravel()[stay]
            acting = float(pressure.ravel()[stay].sum())
        if not cells.size and loads.any():
            return None
        longest = np.abs(self.along_x).max(axis=1) * np.abs(self.along_y).max(axis=1)
        start = np.minimum(pressure.ravel()[cells], upper)
        if self.turns:
            values = _Scaled(start, self.modes_of(cells), loads, upper).solution(longest, acting)
        else:
            values = _scaled_to_load(start, upper, float(loads[0]), acting)
        if values is None:
            return None
        found = np.zeros(pressure.shape) if fixed is None else np.where(fixed, pressure, 0.0)
        found.ravel()[cells] = values
        return found

    def shifted_to_load(self, wanted: Array, upper: float, acting: float) -> Array | None:
        """Return the pressures nearest to given ones, between 0 and H, that meet the only load.

        They are p_i = min(max(p_i⁰ + μ, 0), H), and their sum is linear in μ between the values
        of it at which a cell meets a bound.

        Args:
            wanted: Pressures of some cells, of either sign, shape (n,).
            upper: Their largest pressure, finite.
            acting: Sum of the pressures of all other cells.

        Returns:
            The pressures; None where motions turn or these cells cannot meet the load.
        """
        load = float(self.loads[0]) - acting
        if self.turns or not 0.0 <= load <= upper * wanted.size:
            return None
        shifts = np.concatenate((-wanted, upper - wanted))
        order = np.argsort(shifts, kind="stable")
        moving = np.cumsum(np.repeat((1.0, -1.0), wanted.size)[order])  # cells between the bounds
        sums = np.append(0.0, np.cumsum(moving[:-1] * np.diff(shifts[order])))
        shift = float(np.interp(load, sums, shifts[order]))
        return np.clip(wanted + shift, 0.0, upper)


def _scaled_to_load(start: Array, upper: float, load: float, acting: float) -> Array | None:
    """Return the pressures min(t p⁰, H) that sum up to a load; None where all H are less.

    Their sum is linear in t between the values of it at which a cell reaches its bound.

    Args:
        start: Pressures p⁰ > 0 within the bounds, shape (n,).
        upper: The bound H.
        load: The load.
        acting: Sum of the pressures of all other cells.
    """
    descending = np.sort(start)[::-1]
    scaled = np.cumsum(descending[::-1])[::-1]  # what is left to scale as a cell meets the bound
    bounded = upper * np.arange(start.size + 1.0)
    reached = int(np.searchsorted(upper / descending * scaled + bounded[:-1], load))
    off = load - bounded[reached]
    if reached == start.size:
        met = off <= _ENOUGH * (acting + bounded[-1])
        return np.full_like(start, upper) if met else None
    if load < -_ENOUGH * acting:
        return None
    return _bounded(max(off / scaled[reached], np.exp(-_FARTHEST)) * start, upper)


def _bounded(pressure: Array, upper: float) -> Array:
    """Return pressures within their bound, equal to it where they differ by rounding."""
    return np.where(pressure < (1.0 - _AT_BOUND) * upper, pressure, upper)


class _Scaled(NamedTuple):
    """Pressures p_i = min(p_i⁰ exp(μ · ℓ_i), H) that meet loads f.

    They minimise Σ ψ_i − f · μ, where ψ_i is the integral of p_i in μ · ℓ_i.
    """

    start: Array
    modes: Array
    loads: Array
    upper: float

    def solution(self, longest: Array, acting: float) -> Array | None:
        """Return the pressures; None where there are none.

        Args:
            longest: Longest mode of each motion, shape (k,).
            acting: Sum of the pressures that stay as they are.
        """
        exponents, values = np.zeros(len(self.loads)), self.start
        for _ in range(_MOST_STEPS):
            off = self.modes @ values - self.loads
            scale = np.maximum(longest * (acting + values.sum()), np.abs(self.loads))
            error = float(np.max(np.abs(off) / np.where(scale > 0.0, scale, 1.0)))
            if error <= _ROUNDING:
                return values
            # cells at the bound do not resist, unless they are to leave it
            moved = self._step(exponents, off, np.where(values < self.upper, values, 0.0))
            moved = self._step(exponents, off, values) if moved is None else moved
            if moved is None or np.abs(moved).max() > _FARTHEST:
                break
            exponents, values = moved, self.at(moved)
        return values if error <= _ENOUGH else None

    def at(self, exponents: Array) -> Array:
        """Return the pressures for multipliers μ."""
        return _bounded(self.start * np.exp(exponents @ self.modes), self.upper)

    def _step(self, exponents: Array, off: Array, weights: Array) -> Array | None:
        """Return the multipliers after a Newton step, shortened where it goes too far."""
        curvature = (self.modes * weights) @ self.modes.T
        if not np.isfinite(curvature).all() or not curvature.any():
            return None
        step = -np.linalg.lstsq(curvature, off, rcond=1e-14)[0]
        change = float(np.abs(step @ self.modes).max())
        step *= min(1.0, _LONGEST / change) if change > 0.0 else 1.0
        for _ in range(_MOST_HALVINGS):
            left = self.modes @ self.at(exponents + step) - self.loads
            if float(left @ step) <= -_DECREASE * float(off @ step):
                return exponents + step
            step = 0.5 * step
        return None


_ROUGH = 5e-5
"""Tolerance from which on displacements are evaluated in single precision. That errs by 3e-7 of the
largest one, which thin layers have a hundred times as large on a half-space."""
_DIGITS = 4.0 * float(np.finfo(float).eps)
"""Rounding of displacements in double precision, over those of the longest wave of a period."""


class ContactPressures(NamedTuple):
    """A solution of the contact problem, or pressures to start one from.

    Attributes:
        pressure: Pressures, shape (nx, ny) [MPa].
        motion: Free motions of the body, counted from where the interference was, (k,) [mm].
        residual: Largest violation of the contact conditions over the largest interference.
        iterations: Products of the compliance with pressures.
        by_slopes: What finite slopes add to the displacements, shape (nx, ny) [mm]; None where that
            is not known.
        nearby: Returns interferences of solutions nearby, less what finite slopes add, and what
            these add, shape (nx, ny) [mm].
        gap: Gaps of the cells, shape (nx, ny) [mm]; None where some are not known.
    """

    pressure: Array
    motion: Array = np.zeros(0)
    residual: float = 0.0
    iterations: int = 0
    by_slopes: Array | None = None
    nearby: Callable[[], Sequence[tuple[Array, Array]]] = tuple
    gap: Array | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class CellProblem:
    """Contact of a rigid body with a rectangle of cells of a surface.

    Args:
        compliance: The elastic body.
        spacing: Sides of a cell [mm].
        interference: Interference d of the undeformed bodies at zero free motions, negative where
            they are apart, shape (nx, ny) [mm].
        motions: Free rigid motions of the body, if there are any, with their loads.
        tolerance: Largest residual of a solution.
        hardness: Largest pressure H [MPa], infinite where contacts are elastic. Pressures of a
            solution that are at this bound equal it exactly.
        lowered: What finite slopes have taken off the interference [mm].
        corner: Corner of the first cell on the surface [mm].
        coarse: Whether these are no cells of the surface but coarser ones, where free sides may be
            left out.
        matrix: Compliance of the cells where they are few, here and there on the surface; they are
            a column then.
    """

    compliance: Compliance
    spacing: tuple[float, float]
    interference: Array
    motions: Motions
    tolerance: float
    hardness: float = np.inf
    lowered: Array | float = 0.0
    corner: tuple[float, float] = (0.0, 0.0)
    coarse: bool = False
    matrix: ComplianceMatrix | None = None

    @cached_property
    def grid(self) -> GridCompliance | ComplianceMatrix:
        """Compliance of these cells, without finite slopes."""
        if self.matrix is not None:
            return self.matrix
        return self.compliance.on_grid(
            self.interference.shape,
            self.spacing,
            self.corner,
            coarse=self.coarse,
            rough=self.tolerance >= _ROUGH,
        )

    @property
    def undeformed(self) -> Array:
        """Interference without finite slopes, shape (nx, ny) [mm]."""
        return np.asarray(self.interference + self.lowered)

    @property
    def unloaded(self) -> bool:
        """Whether no free motion has a load: the approach is prescribed and the tilt is free."""
        return self.motions.turns and not self.motions.loads.any()

    @property
    def has_no_gap(self) -> bool:
        """Whether no pressures hold a period at a prescribed approach, as it leaves no gap."""
        return self.mean_is_free and not self.yields and float(self.interference.mean()) >= 0.0

    @property
    def mean_is_free(self) -> bool:
        """Whether nothing resists a mean pressure on all cells: neither a load nor the body."""
        whole = self.compliance.periodic and self.matrix is None
        return whole and not (self.motions.count or self.compliance.own)

    @cached_property
    def noise(self) -> float:
        """What rounding makes of a period's displacements, over the largest pressure [mm/MPa].

        Without periods it is 0: there rounding is no more than that of the interference.
        """
        if not self.compliance.periodic:
            return 0.0
        digits = GridCompliance.rounding if self.tolerance >= _ROUGH else _DIGITS
        longest = float(max(np.multiply(self.interference.shape, self.spacing)))
        return digits * longest / (math.pi * self.compliance.modulus)

    @property
    def yields(self) -> bool:
        """Whether cells yield, at a pressure that is the hardness."""
        return self.hardness < np.inf

    def lowered_by(self, displaced: Array) -> CellProblem:
        """Return the problem without finite slopes, with what they displace the surface by.

        Args:
            displaced: This displacement into the body, shape (nx, ny) [mm].
        """
        return replace(self, interference=self.interference - displaced, lowered=displaced)

    def on(self, box: Box) -> CellProblem:
        """Return the problem of a box of these cells, those of a surface, which carries all loads.

        Args:
            box: Rows and columns of the box.
        """
        x, y = (part.start * step for part, step in zip(box, self.spacing, strict=True))
        interference = np.ascontiguousarray(self.interference[box])
        return replace(self, interference=interference, motions=self.motions.on(box), corner=(x, y))

    def among(self, cells: Indices, matrix: ComplianceMatrix | None = None) -> CellProblem:
        """Return the problem of a few of these cells, those of a surface, which carry all loads.

        Args:
            cells: Their flat indices, shape (n,).
            matrix: Their compliance; that without finite slopes when not given.
        """
        if matrix is None:
            matrix = self.compliance.matrix_on(cells, self.interference.shape, self.spacing)
        return replace(
            self,
            interference=self.interference.ravel()[cells][:, None],
            motions=self.motions.among(cells),
            matrix=matrix,
        )

    def coarsened(self, factors: Sequence[int], tolerance: float) -> CellProblem:
        """Return the problem on coarse cells, with a tolerance of its own.

        Args:
            factors: Fine cells along x and y in a coarse one.
            tolerance: Largest residual of a solution.
        """
        return replace(
            self,
            interference=coarsened(self.interference, factors),
            motions=self.motions.coarsened(factors),
            spacing=(self.spacing[0] * factors[0], self.spacing[1] * factors[1]),
            tolerance=tolerance,
            coarse=True,
        )

    def admissible(self, pressure: Array, fixed: Flags | None = None) -> Array | None:
        """Return pressures near given ones that lie within the bounds and meet the loads.

        Args:
            pressure: Pressures ≥ 0 that may do neither, shape (nx, ny); may be overwritten by
                the result.
            fixed: Cells whose pressures stay as they are where that is possible, shape (nx, ny).

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if not self.motions.count:
            return np.minimum(pressure, self.hardness, out=pressure) if self.yields else pressure
        scaled = None
        if fixed is not None:
            scaled = self.motions.scaled_to_loads(pressure, self.hardness, fixed)
        return self.motions.scaled_to_loads(pressure, self.hardness) if scaled is None else scaled

    def first_at_bounds(self, pressure: Array, change: Array) -> tuple[Indices, float]:
        """Return the cells that meet their bounds first along a change, and its share up to there.

        Cells that the change would drive out of a bound which they are at already come first, with
        a share of 0: the half of them that it changes most.

        Args:
            pressure: Pressures of some cells, within the bounds, shape (n,).
            change: Their change, shape (n,).
        """
        distance = np.where(change < 0.0, pressure, self.hardness - pressure)
        size = np.abs(change)
        stuck = np.flatnonzero((distance <= 0.0) & (size > 0.0))
        if stuck.size:
            most = np.argsort(-size[stuck], kind="stable")[: (stuck.size + 1) // 2]
            return stuck[most], 0.0
        parts = np.divide(distance, size, out=np.full_like(change, np.inf), where=size > 0.0)
        first = int(np.argmin(parts))
        return np.array([first]), min(1.0, float(parts[first]))


_EVEN_SHARES = 0.0, *np.logspace(-3.0, 6.0, 10)
"""Shares of uniform pressure that are added, one after the other, until a start meets the loads."""
_MOST_CONDITIONS = 500
_MOST_MOTION = 100.0
"""Bound of the motions, relative to the largest interference. It keeps the programme finite while
it has the conditions of few cells only."""
_CLEARANCE_ROUNDING = 1e-13


def admissible_start(problem: CellProblem, pressure: Array) -> tuple[Array, Array]:
    """Return admissible pressures near given ones, and the free motions if nothing touches.

    Args:
        problem: The contact problem.
        pressure: Pressures ≥ 0, shape (nx, ny) [MPa]; may be overwritten.

    Raises:
        NotConverged: When no pressures within the bounds meet the loads.
    """
    if problem.unloaded:
        return _unloaded_start(problem, pressure)
    for share in _EVEN_SHARES:
        even = share * (float(pressure.max()) or 1.0)
        admissible = problem.admissible(pressure + even if share else pressure)
        if admissible is not None:
            return admissible, np.zeros(problem.motions.count)
    turns = problem.motions.turns and np.any(problem.motions.loads[1:])
    raise NotConverged(
        "the pressures to start from",
        reason="no pressures within their bounds meet the loads on these cells",
        iterations=0,
        remedy="let the force act within the face, by smaller moments"
        if turns
        else "give a smaller force",
    )


def _unloaded_start(problem: CellProblem, pressure: Array) -> tuple[Array, Array]:
    """Start a body that turns without load from pressures of negative energy.

    The energy without pressure is zero. A body that cannot turn clear must not come to that point,
    for no single contact can carry it from there. Steps that lower the energy never do.
    """
    admissible = problem.admissible(pressure)
    if admissible is None or float(np.vdot(admissible, problem.interference)) <= 0.0:
        clear = clearance(problem.interference, problem.motions)
        if clear.interference <= 0.0:
            return np.zeros(pressure.shape), clear.motion
        admissible = clear.support
    twice_elastic = float(np.vdot(admissible, problem.grid.displacement(admissible)))
    factor = float(np.vdot(admissible, problem.interference)) / twice_elastic  # of the least energy
    admissible = admissible * min(factor, problem.hardness / float(admissible.max()))
    balanced = problem.admissible(admissible)
    return admissible if balanced is None else balanced, np.zeros(problem.motions.count)


class Clearance(NamedTuple):
    """The free motions that make the largest interference as small as possible.

    Attributes:
        motion: The motions, shape (k,) [mm].
        interference: Largest interference then [mm]; the body is clear where it is not positive.
        support: Shares of the force of the cells that hold the body there, which have no load along
            any motion, shape (nx, ny).
    """

    motion: Array
    interference: float
    support: Array


def clearance(interference: Array, motions: Motions) -> Clearance:
    """Find how far a body can come clear of a surface by its free motions.

    It is a linear programme in the motions and the largest interference, with one condition for
    every cell. Cells that violate the motions found so far most are added one by one. The start of
    a plane on few peaks (`Peaks`) is the same programme with all conditions at once.

    Args:
        interference: Interference where the motions are 0, shape (nx, ny) [mm].
        motions: Free motions; the approach is not among them.
    """
    size = float(np.abs(interference).max()) or 1.0
    scaled = interference / size  # the programme's tolerances are absolute
    cells: list[int] = []
    motion, shares, bound = np.zeros(motions.count), np.zeros(0), -np.inf
    limits = [(-_MOST_MOTION, _MOST_MOTION)] * motions.count + [(None, None)]
    for _ in range(_MOST_CONDITIONS):
        now = scaled + motions.displacement(motion)
        worst = int(np.argmax(now))
        if worst in cells or now.ravel()[worst] <= bound + _CLEARANCE_ROUNDING:
            break
        cells.append(worst)
        modes = motions.modes_of(np.array(cells)).T
        programme = scipy.optimize.linprog(
            np.append(np.zeros(motions.count), 1.0),
            A_ub=np.column_stack((modes, -np.ones(len(cells)))),
            b_ub=-scaled.ravel()[cells],
            bounds=limits,
            method="highs-ds",
        )
        motion, bound = np.asarray(programme.x[:-1]), float(programme.x[-1])
        shares = np.maximum(-np.asarray(programme.ineqlin.marginals), 0.0)
    support = np.zeros(interference.shape)
    support.ravel()[cells[: len(shares)]] = shares
    motion = size * motion
    largest = float((interference + motions.displacement(motion)).max())
    return Clearance(motion, largest, support)
