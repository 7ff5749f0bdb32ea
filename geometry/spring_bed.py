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
from numpy.typing import NDArray

from patchlaw.geometry.materials import PoissonRatio, mindlin_ratio
from patchlaw.support.arguments import Limits, check_fields
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError

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
_COARSER, _FINER = 1.05, 0.5


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
    ends = getattr(law, "range", None)
    if ends is None or np.shape(ends) != (2,):
        raise InputError(
            "friction needs the range of a law, over which springs stand for it",
            key="friction",
            value=law,
            allowed="laws with range = (closure at first touch, largest closure) in mm",
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
    """Springs of n samples at closures, shapes (n, N).

    Attributes:
        touched: Stiffness without what lies behind all springs.
        stiffness: Stiffness with it.
        force: Normal force.
        growth: Derivative of the stiffness by the closure.
        rise: Derivative of the force by the closure.
    """

    touched: Array
    stiffness: Array
    force: Array
    growth: Array
    rise: Array


class SampleSprings:
    """Springs of samples, whose laws several of them may have in common.

    Args:
        beds: Springs of every law, up to N.
        patch: Law of every sample, shape (n,).
    """

    def __init__(self, beds: Sequence[SpringBed], patch: NDArray[np.intp]) -> None:
        most = max((len(bed) for bed in beds), default=0)

        def padded(name: str, fill: float) -> Array:
            rows = np.full((len(beds), most), fill)
            for row, bed in zip(rows, beds, strict=True):
                row[: len(bed)] = getattr(bed, name)
            return rows[patch]

        self._coupling = np.diff(padded("coupling", 0.0), axis=1, prepend=0.0)
        self._start, self._width = padded("start", np.inf), padded("width", 0.0)
        self._stiffness = padded("stiffness", 0.0)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers (n, N) of samples and springs."""
        return self._start.shape[0], self._start.shape[1]

    def at(
        self, closure: Array, behind: Array, rows: Any = slice(None), *, trimmed: bool = True
    ) -> Springs:
        """Return the springs at closures, with a compliance behind them.

        Args:
            closure: Closures of some samples, shape (n,) [mm].
            behind: That compliance, shape (n,) [mm/MPa].
            rows: These samples among all.
            trimmed: Whether the last springs are left out that touch at none of them.
        """
        part, begins, ends = self._touched(closure, rows, trimmed=trimmed)
        most, c, whole = part.shape[1], behind[:, None], self._stiffness[rows]
        touched = whole[:, :most] * part
        upto = np.cumsum(touched, axis=1)
        before, inside = upto - touched, ends - begins
        # pressure of the springs until a group, and how far c − C p has gone beyond it
        gaps = np.zeros_like(begins)
        np.subtract(begins[:, 1:], ends[:, :-1], out=gaps[:, 1:])
        borne = np.cumsum(before * gaps + (before + 0.5 * touched) * inside, axis=1)
        beyond = closure[:, None] - ends
        beyond = beyond - c * (borne[:, -1:] + upto[:, -1:] * beyond[:, -1:] - borne)
        slack, slack_before = 1.0 - c * upto, 1.0 - c * before
        stiffness = touched / (slack * slack_before)
        force = stiffness * beyond + 0.5 * touched * inside / slack_before
        partly = (part > 0.0) & (part < 1.0)
        width = np.where(partly, self._width[rows][:, :most], 1.0)
        growth = np.where(partly, whole[:, :most] / width / slack**2, 0.0)
        return Springs(touched, stiffness, force, growth, stiffness * slack[:, -1:])

    def compliance_behind(self, closure: Array, rows: Any) -> Array:
        """Return the compliances behind all springs at closures, shape (n,) [mm/MPa]."""
        touched = self._touched(closure, rows)[0]
        stiffness = sums(self._stiffness[rows], touched)
        share = sums(self._coupling[rows], touched)
        return np.divide(share, stiffness, out=np.zeros_like(share), where=stiffness > 0.0)

    def closure_of(self, stiffness: Array, of: slice) -> Array:
        """Return the closures at which springs of some samples have a stiffness, (n,) [mm]."""
        if not self._start.shape[1]:
            return np.full(len(stiffness), np.inf)
        springs = self._stiffness[of]
        upto = np.cumsum(springs, axis=1)
        last = np.count_nonzero(springs, axis=1) - 1
        group = np.minimum((upto <= stiffness[:, None]).sum(axis=1), np.maximum(last, 0))
        rows = np.arange(len(stiffness))
        below = upto[rows, group] - springs[rows, group]
        share = (stiffness - below) / np.where(last >= 0, springs[rows, group], 1.0)
        return np.asarray(
            self._start[of][rows, group] + np.clip(share, 0, 1) * self._width[of][rows, group]
        )

    def _touched(self, closure: Array, rows: Any, *, trimmed: bool = False) -> tuple[Array, ...]:
        """Return the shares of groups that touch, and where they begin and end to.

        Args:
            closure: Closures of some samples, shape (n,) [mm].
            rows: These samples among all.
            trimmed: Whether the last groups are left out that touch at none of them.

        Returns:
            Three of shape (n, N), the latter below the closure.
        """
        start = self._start[rows]
        depth = np.maximum(closure[:, None] - start, 0.0)
        if trimmed:  # groups touch one after another
            depth = depth[:, : int(np.count_nonzero(depth, axis=1).max(initial=0))]
        most = depth.shape[1]
        width = self._width[rows][:, :most]
        inside, begins = np.minimum(depth, width), np.minimum(start[:, :most], closure[:, None])
        part = np.where(width > 0.0, inside / np.where(width > 0.0, width, 1.0), depth > 0.0)
        return part, begins, begins + inside


def sums(one: Array, other: Array) -> Array:
    """Return the sums of products along rows, shape (n,)."""
    return np.asarray(np.einsum("nk,nk->n", one, other))
