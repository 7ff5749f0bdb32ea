"""The springs behind a contact law p(c), which make it a law of friction as well.

A convex law is a bed of springs that touch one after another: p″(c′) dc′ of them at the closure c′.
Each has a tangential stiffness, smaller by Mindlin's ratio r, and a Coulomb slider of its own. For
shear under an unchanging closure they give τ = μ [p(c) − p(c − s/(μ r))], the normal law read
twice, as the half-space does (Ciavarella 1998; Jäger 1998; for histories Popov & Heß 2015). The
springs have a compliance in common, by which one that slips unloads the others.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from patchlaw.geometry.materials import PoissonRatio, mindlin_ratio
from patchlaw.support import Array, Indices, InputError, Limits, check_fields

Coefficient = Annotated[float, Limits(ge=1e-6, le=10)]
"""Coefficient of friction. The smallest that were measured, between two crystals, are some 1e-5;
far below them shifts of sliding drown in the rounding of displacements."""

TOLERANCE = 1e-3
"""Error of the shear stress that chooses the springs, relative to the bound μ p of friction."""
FEWEST, MOST = 10, 60
"""Numbers of springs. Laws with waves on three octaves take 40 to 50 of them."""
MANY, ALONE = 0.47, 0.9
"""Couplings of springs behind many contacts and behind one: with those between, springs lose what
cells lose on circles, within 4 % (16 periodic surfaces with 1 to 27 contacts, and a sphere)."""
AT_TURNS, BY_POISSON = 0.015, 0.06
"""Errors of the shear stress by springs at turns, over the bound of friction: at ν = 0, where cells
of a contact follow in directions that differ from those of springs, and over ν, as contacts are
stiffer across or along their longer sides, which no spring is. See
benchmarks/friction_of_laws.py."""
_FLOOR = 0.03
"""Share of the largest pressure below which errors count relative to it, not to the pressure."""
_SAMPLES = 600
_NEVER = 1e30
"""Closure at which springs touch that a law does not have [mm]."""
_COARSER, _FINER = 1.05, 0.5
_ROUNDING = 1e-12
"""Relative difference of stiffnesses that count as equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Coulomb friction of an interface with laws.

    Args:
        coefficient: Coefficient of friction μ: no shear stress exceeds μ times the pressure.
        poisson_ratio: Poisson's ratio of the bodies, for laws without a ratio of normal to
            tangential stiffness; of two bodies the mean, weighted by 1/G. None: the laws have it,
            as those of a scene do.

    Raises:
        InputError: When a number is outside its range.
    """

    coefficient: Coefficient
    poisson_ratio: PoissonRatio | None = None

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpringBed:
    """Groups of springs that touch between two closures, evenly spread over them.

    Attributes:
        start: Closures at which the N groups begin to touch, ascending, shape (N,) [mm].
        width: Closure over which all springs of a group touch, shape (N,) [mm].
        stiffness: Normal stiffness of the groups, shape (N,) [MPa/mm].
        error: Largest error of the shear stress by their number, relative to μ p; that of all
            paths is `path_error`.
        missed: Largest share of the law's pressure by which that of the springs differs, which
            are scaled to it; much where the stiffness of the law falls.
        coupling: Compliance behind all springs together, in parts of that of the law where each
            group has touched, from 0 to below 1, shape (N,); one number holds everywhere.
    """

    start: Array
    width: Array
    stiffness: Array
    error: float = 0.0
    missed: float = 0.0
    coupling: Array | float = 0.0

    def __len__(self) -> int:
        return len(self.start)

    @property
    def centre(self) -> Array:
        """Mean closure at which the springs of each group touch, shape (N,) [mm]."""
        return np.asarray(self.start + 0.5 * self.width)

    def path_error(self, stiffness_ratio: float) -> float:
        """Return the error of the shear stress on any path, turning ones included, over μ p.

        Args:
            stiffness_ratio: Mindlin's ratio r, which tells Poisson's ratio.
        """
        nu = (2.0 * stiffness_ratio - 2.0) / (2.0 * stiffness_ratio - 1.0)
        return self.error + AT_TURNS + BY_POISSON * nu

    def pressure(self, closure: Array) -> Array:
        """Return the pressure of all springs at closures of shape (n,) [MPa]."""
        depth = np.asarray(closure)[..., None] - self.start
        inside = np.clip(depth, 0.0, self.width)
        square = 0.5 * inside**2 / np.where(self.width > 0.0, self.width, 1.0)
        return np.asarray((square + np.maximum(depth - self.width, 0.0)) @ self.stiffness)


def springs_of(
    pressure: Callable[[Array], Array],
    stiffness: Callable[[Array], Array],
    first: float,
    last: float,
    tolerance: float = TOLERANCE,
    coupling: Callable[[Array], Array] | None = None,
) -> SpringBed:
    """Choose the springs of a law by the error of the shear stress.

    Between two closures springs are spread evenly, so that the stiffness is a line there. A group
    of stiffness k and width h acts as one spring with one slider, which changes the shear stress
    of partial slip by μ k h/8 at most. Where the stiffness of a law falls, as that of patches whose
    neighbours take load over, the springs bear the largest convex pressure below that of the law,
    and are scaled to it: their stiffness is the nearest one that does not fall.

    Args:
        pressure: The law's pressure at closures [MPa].
        stiffness: Its derivative [MPa/mm].
        first: Closure at first touch [mm]; infinite where nothing touches.
        last: Largest closure of the law [mm].
        tolerance: Error of the shear stress.
        coupling: That of the springs at closures; None: as behind many contacts.
    """
    if not (np.isfinite(first) and np.isfinite(last)):
        return SpringBed(start=np.zeros(0), width=np.zeros(0), stiffness=np.zeros(0))
    share = np.linspace(0.0, 1.0, _SAMPLES + 1) if last > first else np.zeros(1)
    closure = first + (last - first) * share**2  # laws start as a power of the closure
    p = np.asarray(pressure(closure), float)
    steps = np.diff(closure)
    weights = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]]) if len(steps) else 1.0
    stiff = np.asarray(stiffness(closure), float)
    slope = np.maximum(never_falling(stiff, weights), 0.0)
    less = stiff - slope
    borne = p - np.concatenate([[0.0], np.cumsum(0.5 * (less[1:] + less[:-1]) * steps)])
    allowed = np.maximum(p, _FLOOR * p.max())
    nodes, reached = _nodes(closure, borne, slope, allowed, tolerance)
    while len(nodes) > MOST + 1:
        tolerance *= _COARSER
        nodes, reached = _nodes(closure, borne, slope, allowed, tolerance)
    while len(nodes) < FEWEST + 1 and reached > 1e-9 and len(closure) > 1:
        tolerance *= _FINER
        nodes, reached = _nodes(closure, borne, slope, allowed, tolerance)
    at, steep = closure[nodes], slope[nodes]
    group = np.diff(steep) > 0.0
    jumps = steep[:1] > 0.0
    bed = SpringBed(
        start=np.concatenate([at[:1][jumps], at[:-1][group]]),
        width=np.concatenate([np.zeros(int(jumps.sum())), np.diff(at)[group]]),
        stiffness=np.concatenate([steep[:1][jumps], np.diff(steep)[group]]),
        error=reached,
    )
    bed = replace(bed, coupling=coupling(bed.start + bed.width) if coupling else MANY)
    missed = np.abs(bed.pressure(closure) - p) / np.where(allowed > 0.0, allowed, 1.0)
    return replace(bed, missed=float(missed.max()))


def coupling_of(contacts: Array) -> Array:
    """Return how much of the compliance of springs is what they have in common.

    A slip unloads the cells around it, most of all those of the same contact.

    Args:
        contacts: Numbers of contacts that the springs stand for.
    """
    return np.asarray(MANY + (ALONE - MANY) * np.maximum(1.0, contacts) ** (-2.0 / 3.0))


def never_falling(values: Array, weights: Array | float) -> Array:
    """Return the values nearest to given ones that do not fall (isotonic regression).

    Of the derivative of a function they are the derivative of its greatest convex minorant.

    Args:
        values: Shape (n,).
        weights: Their weights in the sum of squares, positive, shape (n,).

    Source:
        Barlow, Bartholomew, Bremner & Brunk, Statistical Inference under Order Restrictions (1972),
        ch. 1: adjacent values that fall are pooled.
    """
    pools: list[tuple[float, float, int]] = []  # mean, weight, number of values
    for value, weight in zip(values, np.broadcast_to(weights, values.shape), strict=True):
        mean, whole, count = float(value), float(weight), 1
        while pools and pools[-1][0] > mean:
            other, more, others = pools.pop()
            mean = (mean * whole + other * more) / (whole + more)
            whole, count = whole + more, count + others
        pools.append((mean, whole, count))
    return np.repeat([mean for mean, _, _ in pools], [count for _, _, count in pools])


def _nodes(
    closure: Array, pressure: Array, slope: Array, allowed: Array, tolerance: float
) -> tuple[list[int], float]:
    """Return the samples at which groups end, and the error of the shear stress by them."""
    nodes, reached, last = [0], 0.0, len(closure) - 1
    while nodes[-1] < last:
        i = nodes[-1]
        ends = np.arange(i + 1, last + 1)
        width, more = closure[ends] - closure[i], slope[ends] - slope[i]
        line = pressure[i] + slope[i] * width + 0.5 * more * width
        error = np.maximum(more * width / 8.0, np.abs(line - pressure[ends])) / allowed[ends]
        beyond = np.flatnonzero(error > tolerance)
        step = max(int(beyond[0]) if len(beyond) else len(ends), 1)
        reached = max(reached, float(error[step - 1]))
        nodes.append(i + step)
    return nodes, reached


def springs_of_law(law: Any) -> SpringBed:
    """Return the springs of a law: its own, or those of its pressure over its range.

    Args:
        law: Has ``springs``; or ``pressure``, ``stiffness`` and ``range``, the closures at first
            touch and at the end of the law.

    Raises:
        InputError: When it has none of both.
    """
    if isinstance(bed := getattr(law, "springs", None), SpringBed):
        return bed
    ends = np.array(getattr(law, "range", ()))
    if ends.shape != (2,) or not 0.0 < ends[1] - ends[0] < np.inf:
        raise InputError(
            "friction needs the range of a law, over which springs stand for it",
            key="friction",
            value=law,
            allowed="laws with range = (closure at first touch, larger finite closure) in mm",
        )
    return springs_of(law.pressure, law.stiffness, float(ends[0]), float(ends[1]))


def stiffness_ratios(laws: Sequence[Any], friction: Friction) -> Array:
    """Return Mindlin's ratios r of normal to tangential stiffness of laws, shape (N,).

    Args:
        laws: The laws.
        friction: Says the bodies' Poisson's ratio, or that the laws know it.

    Raises:
        InputError: When neither does.
    """
    if friction.poisson_ratio is not None:
        return np.full(len(laws), mindlin_ratio(friction.poisson_ratio))
    ratios = np.array([float(getattr(law, "stiffness_ratio", np.nan)) for law in laws])
    if not np.isfinite(ratios).all():
        raise InputError(
            "the laws do not know their ratio of normal to tangential stiffness",
            key="friction",
            value=friction.coefficient,
            allowed="Friction(coefficient=…, poisson_ratio=…), or laws made by a scene",
        )
    return ratios


class Springs(NamedTuple):
    """Springs of n samples at closures, shapes (n, N), and all of a sample together, shapes (n,).

    Attributes:
        touched: Stiffness without what lies behind all springs.
        stiffness: Stiffness with it.
        force: Normal force.
        pressure: That of all springs.
        whole: Stiffness of all without what lies behind them, the derivative of the pressure.
        slack: Part of a closure that is left of it for all of them.
        last: Group that is the last to touch; those before it touch wholly.
        growth: Derivative of its stiffness by the closure.
    """

    touched: Array
    stiffness: Array
    force: Array
    pressure: Array
    whole: Array
    slack: Array
    last: Indices
    growth: Array

    def of(self, rows: Indices) -> Springs:
        """Return the springs of some of the samples."""
        return Springs._make(values[rows] for values in self)


class SampleSprings:
    """Springs of samples, whose laws several of them may have in common.

    Groups touch one after another: but for the last that does, they are as the law has them.

    Args:
        beds: Springs of every law, up to N.
        patch: Law of every sample, shape (n,).
    """

    def __init__(self, beds: Sequence[SpringBed], patch: Indices) -> None:
        most = max((len(bed) for bed in beds), default=0)
        self._patch = patch
        # start, width, stiffness, coupling, pressures at start and end; stiffness until then
        self._groups = np.zeros((7, max(most, 1), len(beds)))
        self._groups[0] = _NEVER
        for groups, bed in zip(self._groups.transpose(2, 0, 1), beds, strict=True):
            groups[:4, : len(bed)] = np.broadcast_arrays(
                bed.start, bed.width, bed.stiffness, bed.coupling
            )
            groups[4:6, : len(bed)] = bed.pressure(bed.start), bed.pressure(bed.start + bed.width)
        np.cumsum(self._groups[2], axis=0, out=self._groups[6])

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers (n, N) of samples and springs."""
        return len(self._patch), self._groups.shape[1]

    def at(
        self, closure: Array, behind: Array, rows: Any = slice(None), most: int | None = None
    ) -> Springs:
        """Return the springs at closures, with a compliance behind them.

        Args:
            closure: Closures of some samples, shape (n,) [mm].
            behind: That compliance, shape (n,) [mm/MPa].
            rows: These samples among all.
            most: How many springs to return; None: until the last that touches at any of them.
        """
        groups, row = self._of(rows)
        last, part, whole, pressure = self._reached(closure, groups, row)
        most = most or int(last.max(initial=0)) + 1
        start, width, _, _, _, borne, upto = groups[:, :, :most]
        c, d = behind[:, None], closure[:, None]
        _, slack, touched = _touching(upto, whole, behind)
        loose = touched / slack[:, :-1]
        stiffness = loose / slack[:, 1:]
        beyond = np.maximum(d - (start + width), 0.0)
        beyond -= c * np.maximum(pressure[:, None] - borne, 0.0)
        force = stiffness * beyond + 0.5 * loose * np.minimum(d - start, width)
        at, partly = (row, last), (part > 0.0) & (part < 1.0)
        growth = np.divide(groups[2][at], groups[1][at], out=np.zeros_like(part), where=partly)
        left = 1.0 - behind * whole
        return Springs(touched, stiffness, force, pressure, whole, left, last, growth / left**2)

    def stiffnesses(self, closure: Array, behind: Array, rows: Any) -> tuple[Array, Array]:
        """Return the stiffnesses of springs, and of all before each, until the last that touches.

        Shapes are (n, k) [MPa/mm].

        Args:
            closure: Closures of some samples, shape (n,) [mm].
            behind: Compliance behind them, shape (n,) [mm/MPa].
            rows: These samples among all.
        """
        groups, row = self._of(rows)
        last, _, whole, _ = self._reached(closure, groups, row)
        upto = groups[6][:, : int(last.max(initial=0)) + 1]
        until, slack, touched = _touching(upto, whole, behind)
        return touched / (slack[:, 1:] * slack[:, :-1]), until[:, :-1] / slack[:, :-1]

    def compliance_behind(self, closure: Array, rows: Any) -> Array:
        """Return the compliances behind all springs at closures, shape (n,) [mm/MPa]."""
        groups, row = self._of(rows)
        last, part, whole, _ = self._reached(closure, groups, row)
        before = np.where(last > 0, groups[3, row, last - 1], 0.0)
        share = before + part * (groups[3, row, last] - before)
        return np.divide(share, whole, out=np.zeros_like(share), where=whole > 0.0)

    def closure_of(self, stiffness: Array, of: slice) -> Array:
        """Return the closures at which springs of some samples have a stiffness, (n,) [mm]."""
        (start, width, springs, *_, upto), row = self._of(of)
        last = np.count_nonzero(springs, axis=1) - 1
        reached = upto <= (1.0 + _ROUNDING) * stiffness[:, None]
        group = np.minimum(reached.sum(axis=1), np.maximum(last, 0))
        share = (stiffness - upto[row, group] + springs[row, group]) / np.where(
            last >= 0, springs[row, group], 1.0
        )
        return np.asarray(start[row, group] + np.clip(share, 0, 1) * width[row, group])

    def _of(self, rows: Any) -> tuple[Array, Any]:
        """Return the groups of laws, shape (7, m, N), and which of the m are those of samples."""
        laws = self._patch[rows]
        if len(laws) and (laws == laws[0]).all():
            return self._groups[:, :, laws[:1]].swapaxes(1, 2), 0
        return np.take(self._groups, laws, axis=2).swapaxes(1, 2), np.arange(len(laws))

    @staticmethod
    def _reached(closure: Array, groups: Array, row: Any) -> tuple[Indices, Array, Array, Array]:
        """Return the last groups that touch, which part of them does, and the sum of all.

        Args:
            closure: Closures of some samples, shape (n,) [mm].
            groups: Their groups, as `_of` returns them.
            row: Which of them are those of the samples.

        Returns:
            The groups, the first where none touches, their parts, the stiffnesses [MPa/mm] and the
            pressures [MPa] of all, shape (n,) each.
        """
        count = np.count_nonzero(groups[0] < closure[:, None], axis=1)
        last = np.maximum(count - 1, 0)
        start, width, stiffness, _, pressure, _, upto = groups[:, row, last]
        depth = np.where(count > 0, closure - start, 0.0)
        inside = np.minimum(depth, width)
        part = np.divide(inside, width, out=np.where(count > 0, 1.0, 0.0), where=width > 0.0)
        before = np.where(last > 0, groups[6, row, last - 1], 0.0)
        borne = (before + 0.5 * part * stiffness) * inside + upto * (depth - inside)
        return last, part, before + part * stiffness, pressure + borne


def _touching(upto: Array, whole: Array, behind: Array) -> tuple[Array, Array, Array]:
    """Return the stiffness until springs, what of a closure is left there, and their own.

    Args:
        upto: Stiffness until groups that touch wholly, shape (1 or n, N).
        whole: Stiffness of what touches, shape (n,).
        behind: Compliance behind it, shape (n,).

    Returns:
        Shapes (n, N + 1), from before the first group on, and (n, N).
    """
    until = np.zeros((upto.shape[1] + 1, len(whole))).T  # samples side by side in memory
    np.minimum(upto, whole[:, None], out=until[:, 1:])
    return until, 1.0 - behind[:, None] * until, np.diff(until, axis=1)


def sums(one: Array, other: Array) -> Array:
    """Return the sums of products along rows, shape (n,)."""
    return np.asarray(np.einsum("nk,nk->n", one, other))
