"""Shear stresses of the springs behind contact laws, each with a Coulomb slider of its own.

The sliders of a sample hold the stresses of its springs; a step changes them by a return mapping in
closed form, spring by spring. It is the backward Euler method: springs that touch in a step follow
its whole slip. In two directions, and under varying closure.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.spring_bed import SpringBed
from support.arrays import Array

_ROWS_AT_ONCE = 600
"""Samples whose springs are worked on at a time, so that they stay in the cache: 9,828 samples with
30 springs took 10.9 ms, 15.7 ms all at once."""
_TINY = 1e-300
_AT_BOUND = 1e-9
"""Share by which the stress of a spring may lie below its bound and still slip."""
_MOST_STEPS = 60
_LEFT = 1e-13
"""Part of the slips that their share between springs and what lies behind them leaves."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SliderState:
    """What a load step leaves behind of the sliders of n samples with up to N springs each.

    Args:
        closure: Closures of the springs, less than those of the law by what lies behind all of
            them, shape (n,) [mm].
        slip: Tangential displacements of the plane against the samples, shape (n, 2) [mm].
        stress: Shear stresses of the springs, before they are scaled, shape (n, 2, N) [MPa].
        scale: What they are scaled by, shape (n,).
    """

    closure: Array
    slip: Array
    stress: Array
    scale: Array

    def of(self, rows: Any) -> SliderState:
        """Return the sliders of some of the samples."""
        return SliderState(**{name: values[rows] for name, values in vars(self).items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class SliderRecord:
    """What load steps leave behind of friction on a face: of one rank's samples, or of all.

    Attributes:
        place: Places of the m samples in coordinates of the face, shape (m, 2) [mm].
        sliders: Their sliders.
        stress: Shear stresses there, shape (m, 2) [MPa].
        shift: Shift of the plane along the axes of the face, shape (2,) [mm].
        direction: Unit vector of its last change, shape (2,).
        dissipated: Energy lost to friction on the whole face since the start [N mm].
    """

    place: Array
    sliders: SliderState
    stress: Array
    shift: Array
    direction: Array
    dissipated: float

    def of(self, rows: Any) -> SliderRecord:
        """Return the record of some of the samples, by their indices."""
        sliders, stress = self.sliders.of(rows), self.stress[rows]
        return replace(self, place=self.place[rows], sliders=sliders, stress=stress)

    def with_ranks(self, comm: Any) -> SliderRecord:
        """Return the record of the samples of all ranks; collective.

        Args:
            comm: MPI communicator.
        """
        own = {"place": self.place, "stress": self.stress}, vars(self.sliders)
        every = comm.allgather(own)
        samples, sliders = (
            {name: np.concatenate([rank[i][name] for rank in every]) for name in own[i]}
            for i in range(2)
        )
        return replace(self, sliders=SliderState(**sliders), **samples)


class SliderResponse(NamedTuple):
    """Shear stresses of n samples after a step, and their exact derivatives.

    Attributes:
        stress: Shear stresses, shape (n, 2) [MPa].
        by_slip: Their derivatives by the tangential displacement, shape (n, 2, 2) [MPa/mm].
        by_closure: Their derivatives by the closure, which make tangents unsymmetric, shape (n, 2)
            [MPa/mm].
        sticking: Tangential stiffness that all springs would have, shape (n,) [MPa/mm].
        scale: What stresses of springs are scaled by, shape (n,).
        closure: Closures of the springs after the step, shape (n,) [mm].
        slip: Tangential displacements after it, shape (n, 2) [mm].
    """

    stress: Array
    by_slip: Array
    by_closure: Array
    sticking: Array
    scale: Array
    closure: Array
    slip: Array


class SliderStep(NamedTuple):
    """What a step did to n samples.

    Attributes:
        after: The sliders after the step.
        lost: Energy per area that friction took up in the step, ≥ 0, shape (n,) [N/mm].
        stuck: Tangential stiffness of the springs that stick, shape (n,) [MPa/mm].
        stick_closure: Closure at which springs as stiff as those that stick have touched: area in
            contact there sticks, shape (n,) [mm].
    """

    after: SliderState
    lost: Array
    stuck: Array
    stick_closure: Array


class _Springs(NamedTuple):
    """Springs of n samples at closures, shapes (n, N)."""

    stiffness: Array
    force: Array
    growth: Array


class Sliders:
    """Coulomb friction of samples with contact laws.

    Args:
        beds: Springs of every law.
        ratios: Mindlin's ratio r of every law.
        patch: Law of every sample, shape (n,).
        coefficient: Coefficient of friction μ.

    Attributes:
        ratio: r of every sample, shape (n,).
    """

    def __init__(
        self,
        beds: Sequence[SpringBed],
        ratios: Array,
        patch: NDArray[np.intp],
        coefficient: float,
    ) -> None:
        most = max((len(bed) for bed in beds), default=0)

        def padded(name: str, fill: float) -> Array:
            rows = np.full((len(beds), most), fill)
            for row, bed in zip(rows, beds, strict=True):
                row[: len(bed)] = getattr(bed, name)
            return rows[patch]

        self.ratio = np.asarray(ratios, float)[patch]
        self._beds, self._patch = tuple(beds), patch
        self._start, self._width = padded("start", np.inf), padded("width", 0.0)
        self._stiffness = padded("stiffness", 0.0)
        self._at_once = self._width == 0.0  # groups that touch all at one closure
        self._any_at_once = bool(self._at_once.any())
        self._series = np.array([bed.series for bed in beds])[patch]
        self._growth = self._stiffness / np.where(self._at_once, 1.0, self._width)
        self._coefficient = coefficient

    @property
    def at_rest(self) -> SliderState:
        """The sliders where nothing has touched yet."""
        n, springs = self._start.shape
        closure = np.full(n, -1e30)  # far from touching, and a number
        slip, stress = np.zeros((n, 2)), np.zeros((n, 2, springs))
        return SliderState(closure=closure, slip=slip, stress=stress, scale=np.ones(n))

    def respond(
        self,
        before: SliderState,
        closure: Array,
        slip: Array,
        pressure: Array,
        rate: Array,
        *,
        sticks: bool = False,
        rows: NDArray[np.intp] | None = None,
    ) -> SliderResponse:
        """Return the shear stresses after a step.

        Args:
            before: The sliders before the step, of all samples.
            closure: Closures c at its end, shape (n,) [mm].
            slip: Tangential displacements there, shape (n, 2) [mm].
            pressure: Pressures p of the laws there, shape (n,) [MPa].
            rate: dp/dc there, shape (n,) [MPa/mm].
            sticks: Whether springs stick whatever they bear, as a first guess of a step takes them.
            rows: Indices of the n samples among all; None: all of them.
        """
        count = len(closure)
        found = SliderResponse(
            stress=np.full((count, 2), np.nan),
            by_slip=np.full((count, 2, 2), np.nan),
            by_closure=np.full((count, 2), np.nan),
            sticking=np.empty(count),
            scale=np.empty(count),
            closure=closure - self._series[slice(None) if rows is None else rows] * pressure,
            slip=slip,
        )
        for first in range(0, count, _ROWS_AT_ONCE):
            part = slice(first, first + _ROWS_AT_ONCE)
            of_all = part if rows is None else rows[part]
            self._respond(of_all, before, pressure[part], rate[part], sticks, found, part)
        return found

    def _respond(
        self,
        rows: Any,
        before: SliderState,
        pressure: Array,
        rate: Array,
        sticks: bool,
        found: SliderResponse,
        into: slice,
    ) -> None:
        """Write the response of some samples.

        The slip is that of the springs and what lies behind them gives way by, s = sᵢ + r b τ(sᵢ).
        τ is the gradient of a convex function, and so Newton's method finds sᵢ, with steps that
        are halved where they leave more.
        """
        springs, then = self._at(found.closure[into], rows), before.of(rows)
        series, ratio = self._series[rows], self.ratio[rows]
        of_springs, stiffness = springs.force.sum(axis=1), springs.stiffness.sum(axis=1)
        loaded, falls = of_springs > 0.0, 1.0 - series * rate
        scale = np.divide(pressure, of_springs, out=np.ones_like(pressure), where=loaded)
        scaling = np.divide(
            rate - scale * stiffness * falls, of_springs, out=0.0 * rate, where=loaded
        )
        start, slip, behind = self._slip_of(then, rows), found.slip[into], (ratio * series)
        at = start + (slip - then.slip) / (1.0 + series * scale * stiffness)[:, None]
        size = sum(np.abs(each).sum(axis=1) for each in (start, slip))
        least, step, open_ = np.full(len(at), np.inf), np.zeros_like(at), np.ones(len(at), bool)
        for _ in range(_MOST_STEPS):
            tried = at + step
            moved = (tried - start) / ratio[:, None]
            stress, by_slip, by_closure = self._of_slips(springs, then.stress, moved, sticks)
            by_slip *= (scale / ratio)[:, None, None]
            by_closure *= (scale * falls)[:, None]
            by_closure += scaling[:, None] * stress
            stress *= scale[:, None]
            yields = np.eye(2) + behind[:, None, None] * by_slip
            off = slip - tried - behind[:, None] * stress
            left = np.abs(off).sum(axis=1)
            better = open_ & (left < least)
            for name, value in (
                ("stress", stress),
                ("by_slip", by_slip),
                ("by_closure", by_closure),
            ):
                getattr(found, name)[into][better] = value[better]
            at[better], least[better] = tried[better], left[better]
            step *= 0.5
            step[better] = np.linalg.solve(yields[better], off[better][..., None])[..., 0]
            open_ &= left > _LEFT * size
            if not open_.any():
                break
        for name in ("stress", "by_slip", "by_closure"):
            getattr(found, name)[into][open_] = np.nan
        if behind.any():
            yields = np.eye(2) + behind[:, None, None] * found.by_slip[into]
            for name in ("by_slip", "by_closure"):
                rates = getattr(found, name)[into]
                columns = rates.reshape(len(at), 2, -1)
                rates[:] = np.linalg.solve(yields, columns).reshape(rates.shape)
        found.sticking[into] = scale * stiffness / ratio / (1.0 + series * scale * stiffness)
        found.scale[into] = scale

    def _of_slips(
        self, springs: _Springs, before: Array, moved: Array, sticks: bool
    ) -> tuple[Array, Array, Array]:
        """Return shear stresses by slips of the springs over r, before they are scaled.

        Returns:
            The stresses, shape (n, 2), and their derivatives by the slip over r, shape (n, 2, 2),
            and by the closure of the springs, shape (n, 2).
        """
        mx, my, mu = moved[:, :1], moved[:, 1:], self._coefficient
        last = before[..., : springs.force.shape[1]]
        tx, ty = last[:, 0] + springs.stiffness * mx, last[:, 1] + springs.stiffness * my
        size, bound = np.sqrt(tx * tx + ty * ty), mu * springs.force
        bound = np.maximum(bound, size) if sticks else bound
        slips, size = size > bound, np.maximum(np.maximum(size, bound), _TINY)
        share = bound / size  # exactly 1 where springs stick; choosing by flags takes far longer
        least = slips / size  # for directions of slip, 0 for springs that stick
        ax, ay = tx * least, ty * least
        new = share * springs.growth
        by_closure = np.einsum("nij,nj->ni", _across(new, ax, ay), moved)
        by_closure += mu * np.stack([_sums(springs.stiffness, ax), _sums(springs.stiffness, ay)], 1)
        stress = np.stack([_sums(tx, share), _sums(ty, share)], axis=1)
        return stress, _across(share * springs.stiffness, ax, ay), by_closure

    def _slip_of(self, state: SliderState, rows: Any) -> Array:
        """Return the slips of the springs, without what lies behind them, shape (n, 2) [mm]."""
        behind = (self.ratio * self._series)[rows] * state.scale
        return np.asarray(state.slip - behind[:, None] * state.stress.sum(axis=2))

    def step(self, before: SliderState, found: SliderResponse) -> SliderStep:
        """Return what a step did.

        Args:
            before: The sliders before it.
            found: What it led to.
        """
        count = len(found.closure)
        stress, lost = np.empty_like(before.stress), np.empty(count)
        stuck, stick_closure = np.empty(count), np.empty(count)
        for first in range(0, count, _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            then, now = before.of(rows), self._at(found.closure[rows], rows, trimmed=False)
            behind = (self.ratio * self._series)[rows][:, None]
            moved = found.slip[rows] - behind * found.stress[rows] - self._slip_of(then, rows)
            moved /= self.ratio[rows][:, None]
            trial = then.stress + now.stiffness[:, None] * moved[..., None]
            size, share = self._returned(trial, now)
            stress[rows] = trial * share[:, None]
            sticks = size * share < (1.0 - _AT_BOUND) * self._coefficient * now.force
            stuck[rows] = (now.stiffness * sticks).sum(axis=1)
            own, falling = self._lost(then, now, trial, stress[rows], rows)
            lost[rows] = found.scale[rows] * own + then.scale * falling
            depth = np.minimum(self._closure_of(stuck[rows], rows), found.closure[rows])
            borne = found.scale[rows] * self._at(depth, rows).force.sum(axis=1)
            stick_closure[rows] = depth + self._series[rows] * borne
        return SliderStep(
            after=SliderState(
                closure=found.closure, slip=found.slip, stress=stress, scale=found.scale
            ),
            lost=lost,
            stuck=found.scale * stuck / self.ratio / (1.0 + self._series * found.scale * stuck),
            stick_closure=stick_closure,
        )

    def _returned(self, trial: Array, springs: _Springs) -> tuple[Array, Array]:
        """Return the sizes of trial stresses, and the shares of them that are left, (n, N) each."""
        size, bound = np.hypot(trial[:, 0], trial[:, 1]), self._coefficient * springs.force
        return size, bound / np.maximum(np.maximum(size, bound), _TINY)

    def following(self, other: Sliders, state: SliderState) -> SliderState:
        """Return sliders that go on from those of other laws of the same samples.

        Between the closures at which groups of springs touch, their displacements are lines.

        Args:
            other: The sliders of the other laws.
            state: Their state.
        """
        then = other._at(state.closure, trimmed=False)
        borne, less = state.scale * then.force.sum(axis=1), other._series - self._series
        closure = state.closure + less * borne
        springs, n = self._at(closure, trimmed=False), len(closure)
        moved = state.stress / np.where(then.stiffness > 0.0, then.stiffness, 1.0)[:, None]
        # a change of what lies behind moves a spring by the stress of those that touch later, which
        # all bear their own displacement, and of those before, which bear its
        later = np.cumsum(state.stress[..., ::-1], axis=2)[..., ::-1] - state.stress
        upto = np.cumsum(then.stiffness, axis=1)[:, None] * moved
        moved = moved + (less * state.scale)[:, None, None] * (upto + later)
        stress = np.zeros((n, 2, self._start.shape[1]))
        for law in np.unique(self._patch):
            rows, bed, old = self._patch == law, self._beds[law], other._beds[law]
            at = [each.centre + each.series * each.pressure(each.centre) for each in (bed, old)]
            lines = [np.interp(*at, each) for each in np.eye(len(old))]
            weights = np.reshape(lines, (len(old), len(bed)))
            stress[rows, :, : len(bed)] = moved[rows][..., : len(old)] @ weights
        stress *= springs.stiffness[:, None]
        stress *= self._returned(stress, springs)[1][:, None]
        return replace(state, stress=stress, closure=closure)

    def _at(self, closure: Array, rows: Any = slice(None), *, trimmed: bool = True) -> _Springs:
        """Return stiffness and force of the springs at closures, and the stiffness's growth.

        Args:
            closure: Closures of some samples, shape (n,) [mm].
            rows: These samples among all.
            trimmed: Whether the last springs are left out that touch at none of them.
        """
        start = self._start[rows]
        depth = np.maximum(closure[:, None] - start, 0.0)
        if trimmed:  # groups touch one after another
            depth = depth[:, : int(np.count_nonzero(depth, axis=1).max(initial=0))]
        most = depth.shape[1]
        width, growth = self._width[rows][:, :most], self._growth[rows][:, :most]
        inside = np.minimum(depth, width)
        stiffness = growth * inside
        if self._any_at_once:
            at_once = self._at_once[rows][:, :most] & (depth > 0.0)
            stiffness = np.where(at_once, self._stiffness[rows][:, :most], stiffness)
        return _Springs(
            stiffness=stiffness,
            force=stiffness * (depth - 0.5 * inside),
            growth=growth * ((inside > 0.0) & (inside < width)),
        )

    def _lost(
        self, before: SliderState, now: _Springs, trial: Array, after: Array, rows: slice
    ) -> tuple[Array, Array]:
        """Return what friction takes up per area, before it is scaled, shapes (n,) [N/mm].

        It is the stress of a spring times its slip. Where the bound rises in the step, its mean
        counts; where it falls, the mean of both stresses. Springs that part lose their energy,
        which they bore with the scale of before: that of the end has no bound near first touch.

        Returns:
            What is to be scaled as at the end of the step, and what as before it.
        """
        then = self._at(before.closure, rows, trimmed=False)
        stiffness = np.maximum(now.stiffness, then.stiffness)
        slip = (trial - after) * self.ratio[rows][:, None, None]
        slip /= np.where(stiffness > 0.0, stiffness, 1.0)[:, None]
        largest = np.maximum(np.maximum(now.force, then.force), _TINY)
        own = (0.5 + 0.5 * then.force / largest) * (after * slip).sum(axis=1)
        falling = 0.5 * ((before.stress - after) * slip).sum(axis=1)
        return np.maximum(own, 0.0).sum(axis=1), np.maximum(falling, 0.0).sum(axis=1)

    def _closure_of(self, stiffness: Array, of: slice) -> Array:
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


def _sums(one: Array, other: Array) -> Array:
    """Return the sums of products along rows, shape (n,)."""
    return np.asarray(np.einsum("nk,nk->n", one, other))


def _across(stiffness: Array, ax: Array, ay: Array) -> Array:
    """Return the stiffness of springs across their directions of slip, shape (n, 2, 2).

    Args:
        stiffness: That of the springs, shape (n, N).
        ax: The directions along x, shape (n, N); 0 for springs that stick.
        ay: Those along y.
    """
    found, sx = np.empty((len(ax), 2, 2)), stiffness * ax
    whole = stiffness.sum(axis=1)
    found[:, 0, 0], found[:, 1, 1] = whole - _sums(sx, ax), whole - _sums(stiffness * ay, ay)
    found[:, 0, 1] = found[:, 1, 0] = -_sums(sx, ay)
    return found
