"""Shear stresses of the springs behind contact laws, each with a Coulomb slider of its own.

The sliders of a sample hold the stresses of its springs; a step changes them by a return mapping,
spring by spring. It is the backward Euler method: springs that touch in a step follow its whole
slip. In two directions, and under varying closure.

Behind all springs of a sample lies a compliance C, a share of that of the law: under the slip s
and the stress τ they are displaced by s − r C τ, and so a spring that slips unloads the others, as
neighbouring cells do. Springs of p(c) with any C are those of another law, p over c − C p. Along
lines all C give the same stresses; at turns they bind the directions of slip.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from patchlaw.geometry.spring_bed import SampleSprings, SpringBed, Springs, sums
from patchlaw.support import Array, Indices

_ROWS_AT_ONCE = 1000
"""Samples whose springs are worked on at a time, so that they stay in the cache: responses of
16,632 samples with 60 springs took 1.1 times as long with 600, 1.5 times with 300."""
_TINY = 1e-300
_AT_BOUND = 1e-9
"""Share by which the stress of a spring may lie below its bound and still slip."""
_LEAST = 1e-12
"""Least that stresses of springs are scaled by, where they touch and the law bears nothing yet."""
_MOST_STEPS = 60
_LEFT = 1e-13
"""Part of the slips that their share between springs and what lies behind them leaves."""
_FEW = 0.5
"""Share of samples that still leave more, below which these are copied and the others are left."""
MOST_REMEMBERED = 64
"""Load steps whose closures and slips are remembered, which tell the errors by the steps."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SliderState:
    """What a load step leaves behind of the sliders of n samples with up to N springs each.

    Args:
        closure: Closures, shape (n,) [mm].
        slip: Tangential displacements of the plane against the samples, shape (n, 2) [mm].
        stress: Shear stresses of the springs, before they are scaled, shape (n, 2, N) [MPa].
        scale: What they are scaled by, shape (n,).
        behind: Compliances C behind all springs of a sample, shape (n,) [mm/MPa].
    """

    closure: Array
    slip: Array
    stress: Array
    scale: Array
    behind: Array

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
        path: Closures and slips after each of the last k load steps, shape (m, k, 3) [mm].
    """

    place: Array
    sliders: SliderState
    stress: Array
    shift: Array
    direction: Array
    dissipated: float
    path: Array

    def of(self, rows: Any) -> SliderRecord:
        """Return the record of some of the samples, by their indices."""
        samples = {name: getattr(self, name)[rows] for name in ("place", "stress", "path")}
        return replace(self, sliders=self.sliders.of(rows), **samples)

    def with_ranks(self, comm: Any) -> SliderRecord:
        """Return the record of the samples of all ranks; collective.

        Args:
            comm: MPI communicator.
        """
        own = ({"place": self.place, "stress": self.stress, "path": self.path}, vars(self.sliders))
        every = comm.allgather(own)
        samples, sliders = (
            {name: np.concatenate([rank[i][name] for rank in every]) for name in own[i]}
            for i in range(2)
        )
        return replace(self, sliders=SliderState(**sliders), **samples)


class SliderResponse(NamedTuple):
    """Shear stresses of n samples after a step, and their derivatives.

    They are exact but for the compliance behind the springs, which counts as unchanging: what it
    leaves of the derivative by the closure is 0 along lines.

    Attributes:
        stress: Shear stresses, shape (n, 2) [MPa].
        by_slip: Their derivatives by the tangential displacement, shape (n, 2, 2) [MPa/mm].
        by_closure: Their derivatives by the closure, which make tangents unsymmetric, shape (n, 2)
            [MPa/mm].
        sticking: Tangential stiffness that all springs would have, shape (n,) [MPa/mm].
        scale: What stresses of springs are scaled by, shape (n,).
        behind: Compliances C behind all springs of a sample, shape (n,) [mm/MPa].
        closure: Closures after the step, shape (n,) [mm].
        slip: Tangential displacements after it, shape (n, 2) [mm].
    """

    stress: Array
    by_slip: Array
    by_closure: Array
    sticking: Array
    scale: Array
    behind: Array
    closure: Array
    slip: Array


class SliderStep(NamedTuple):
    """What a step did to n samples.

    Attributes:
        after: The sliders after the step.
        lost: Energy per area that friction took up in the step, ≥ 0, shape (n,) [N/mm].
        falling: What of it stresses of before took up beyond those of the end, likewise.
        stick_closure: Closure at which springs as stiff as those that stick have touched: area in
            contact there sticks, shape (n,) [mm].
    """

    after: SliderState
    lost: Array
    falling: Array
    stick_closure: Array


class Sliders:
    """Coulomb friction of samples with contact laws.

    Args:
        beds: Springs of every law.
        ratios: Mindlin's ratio r of every law.
        patch: Law of every sample, shape (n,).
        coefficient: Coefficient of friction μ, one for all laws or one of each.

    Attributes:
        ratio: r of every sample, shape (n,).
    """

    def __init__(
        self, beds: Sequence[SpringBed], ratios: Array, patch: Indices, coefficient: float | Array
    ) -> None:
        self.ratio = np.asarray(ratios, float)[patch]
        self._beds, self._patch = tuple(beds), patch
        self._springs = SampleSprings(beds, patch)
        self._coefficient = np.broadcast_to(coefficient, len(ratios))[patch][:, None]

    @property
    def first_touch(self) -> Array:
        """Closures at which the first springs of the samples touch, shape (n,) [mm]."""
        first = np.array([float(bed.start.min(initial=0.0)) for bed in self._beds])
        return np.asarray(first[self._patch])

    @property
    def at_rest(self) -> SliderState:
        """The sliders where nothing has touched yet."""
        n, springs = self._springs.shape
        closure = np.full(n, -1e30)  # far from touching, and a number
        slip, stress = np.zeros((n, 2)), np.zeros((2, springs, n)).transpose(2, 0, 1)
        return SliderState(
            closure=closure, slip=slip, stress=stress, scale=np.ones(n), behind=np.zeros(n)
        )

    def respond(
        self,
        before: SliderState,
        closure: Array,
        slip: Array,
        pressure: Array,
        rate: Array,
        *,
        sticks: bool = False,
        rows: Indices | None = None,
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
        parts = []
        for first in range(0, max(len(closure), 1), _ROWS_AT_ONCE):
            part = slice(first, first + _ROWS_AT_ONCE)
            own = part if rows is None else rows[part]
            at = closure[part], slip[part], pressure[part], rate[part]
            parts.append(self._respond(own, before.of(own), at, sticks))
        return SliderResponse(*map(np.concatenate, zip(*parts, strict=True)))

    def _respond(
        self, rows: Any, then: SliderState, at: tuple[Array, ...], sticks: bool
    ) -> SliderResponse:
        """Return the response of some samples: that of their springs, scaled to the pressures."""
        closure, slip, pressure, rate = at
        behind = self._springs.compliance_behind(np.maximum(closure, then.closure), rows)
        springs, ratio = self._springs.at(closure, behind, rows), self.ratio[rows]
        stress, by_slip, by_closure = self._of_springs(rows, springs, then, behind, slip, sticks)
        if behind.any():
            yields = np.eye(2) + behind[:, None, None] * by_slip
            by_slip = solved(yields, by_slip)
            by_closure = solved(yields, by_closure[..., None])[..., 0]
        borne, rise = springs.pressure, springs.whole
        scale = np.divide(pressure, borne, out=np.ones_like(pressure), where=borne > 0.0)
        scale = np.maximum(scale, _LEAST)
        scaling = np.divide(rate - scale * rise, borne, out=0.0 * rate, where=borne > 0.0)
        return SliderResponse(
            stress=scale[:, None] * stress,
            by_slip=(scale / ratio)[:, None, None] * by_slip,
            by_closure=scale[:, None] * by_closure + scaling[:, None] * stress,
            sticking=scale / ratio * springs.whole,
            scale=scale,
            behind=behind,
            closure=closure,
            slip=slip,
        )

    def _of_springs(
        self,
        rows: Any,
        springs: Springs,
        then: SliderState,
        behind: Array,
        slip: Array,
        sticks: bool,
    ) -> tuple[Array, Array, Array]:
        """Return stresses and derivatives as `_of_slips` does, where springs lie behind others.

        Springs have the slip sᵢ of s = sᵢ + r C τ(sᵢ). As τ is the gradient of a convex function,
        Newton's method finds it, with steps that are halved where they leave more.
        """
        last, start = self._seen_with(behind, then, rows, springs.force.shape[1])
        mu, ratio = self._coefficient[rows], self.ratio[rows]
        slack = springs.slack[:, None]  # of a slip, where all springs stick
        at = start + slack * (slip - then.slip)
        least, step = np.full(len(at), np.inf), np.zeros_like(at)
        enough = _LEFT * (np.abs(slip) + np.abs(start) + np.abs(then.slip)).sum(axis=1)
        found = tuple(np.full((len(at), *shape), np.nan) for shape in ((2,), (2, 2), (2,)))
        gives, left = (behind * ratio)[:, None], np.arange(len(at))
        for _ in range(_MOST_STEPS):
            tried = at[left] + step
            moved = (tried - start[left]) / ratio[left, None]
            new = _of_slips(springs, last, moved, mu, sticks=sticks)
            off = slip[left] - tried - gives[left] * new[0]
            size = np.abs(off).sum(axis=1)
            better = size < least[left]
            rows_now = left[better]
            for values, found_now in zip(found, new, strict=True):
                values[rows_now] = found_now[better]
            at[rows_now], least[rows_now] = tried[better], size[better]
            step *= 0.5
            more = np.eye(2) + behind[rows_now, None, None] * new[1][better]
            step[better] = solved(more, off[better][..., None])[..., 0]
            goes_on = least[left] > enough[left]
            if not goes_on.any():
                return found[0], found[1], found[2]
            if goes_on.mean() < _FEW:
                left, step, springs = left[goes_on], step[goes_on], springs.of(goes_on)
                last, mu = last[goes_on], mu[goes_on]
        found[0][least > enough] = np.nan
        return found[0], found[1], found[2]

    def _seen_with(
        self, behind: Array, state: SliderState, rows: Any, most: int
    ) -> tuple[Array, Array]:
        """Return stresses and slips of springs with another compliance behind them.

        A change of it moves a spring by the stress of those that touched later, and that of those
        before it if they were displaced as it is: normal loads move their closures so.

        Args:
            behind: That compliance of some samples, shape (n,) [mm/MPa].
            state: Their sliders.
            rows: These samples among all.
            most: Number k of springs whose stresses are asked for.

        Returns:
            Shapes (n, 2, k) [MPa] and (n, 2) [mm].
        """
        less, found = (state.behind - behind)[:, None, None], state.stress
        if less.any():
            stiffness, before = self._springs.stiffnesses(state.closure, behind, rows)
            stress = found[..., : stiffness.shape[1]]  # springs that touch later bear nothing
            later = stress.sum(axis=2, keepdims=True) - np.cumsum(stress, axis=2)
            found = np.zeros((2, max(most, stress.shape[2]), len(stress))).transpose(2, 0, 1)
            found[..., : stress.shape[2]] = (
                stress * (1.0 - less * before[:, None]) + less * stiffness[:, None] * later
            )
        gives = (self.ratio[rows] * behind)[:, None]
        return found[..., :most], state.slip - gives * found.sum(axis=2)

    def step(self, before: SliderState, found: SliderResponse) -> SliderStep:
        """Return what a step did.

        Args:
            before: The sliders before it.
            found: What it led to.
        """
        count = len(found.closure)
        stress = np.zeros_like(before.stress)
        lost, fell, stick_closure = np.empty((3, count))
        for first in range(0, count, _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            then, behind = before.of(rows), found.behind[rows]
            both = np.maximum(found.closure[rows], then.closure), behind, rows
            most = self._springs.at(*both).force.shape[1]
            now = self._springs.at(found.closure[rows], behind, rows, most)
            last, start = self._seen_with(behind, then, rows, most)
            gives = (self.ratio[rows] * behind / found.scale[rows])[:, None]
            moved = found.slip[rows] - gives * found.stress[rows] - start
            trial = last + now.stiffness[:, None] * (moved / self.ratio[rows][:, None])[..., None]
            size, share = self._returned(trial, now, rows)
            stress[rows, :, :most] = after = trial * share[:, None]
            release = moved - (found.slip[rows] - then.slip)
            sticks = size * share < (1.0 - _AT_BOUND) * self._coefficient[rows] * now.force
            own, falling = self._lost(then, now, last, trial, release, after, rows, behind)
            fell[rows] = then.scale * falling
            lost[rows] = found.scale[rows] * own + fell[rows]
            reached = self._springs.closure_of((now.touched * sticks).sum(axis=1), rows)
            stick_closure[rows] = np.minimum(reached, found.closure[rows])
        return SliderStep(
            after=SliderState(
                closure=found.closure,
                slip=found.slip,
                stress=stress,
                scale=found.scale,
                behind=found.behind,
            ),
            lost=lost,
            falling=fell,
            stick_closure=stick_closure,
        )

    def _returned(self, trial: Array, springs: Springs, rows: Any) -> tuple[Array, Array]:
        """Return the sizes of trial stresses, and the shares of them that are left, (n, N) each."""
        size = np.hypot(trial[:, 0], trial[:, 1])
        bound = self._coefficient[rows] * springs.force
        return size, bound / np.maximum(np.maximum(size, bound), _TINY)

    def following(self, other: Sliders, state: SliderState) -> SliderState:
        """Return sliders that go on from those of other laws of the same samples.

        Between the closures at which groups of springs touch, their displacements are lines.

        Args:
            other: The sliders of the other laws.
            state: Their state.
        """
        then, springs = (
            each._springs.at(state.closure, state.behind, most=each._springs.shape[1])
            for each in (other, self)
        )
        moved = state.stress / np.where(then.stiffness > 0.0, then.stiffness, 1.0)[:, None]
        stress = np.zeros((len(state.closure), 2, self._springs.shape[1]))
        for law in np.unique(self._patch):
            rows, bed, old = self._patch == law, self._beds[law], other._beds[law]
            lines = [np.interp(bed.centre, old.centre, each) for each in np.eye(len(old))]
            weights = np.reshape(lines, (len(old), len(bed)))
            stress[rows, :, : len(bed)] = moved[rows][..., : len(old)] @ weights
        stress *= springs.stiffness[:, None]
        stress *= self._returned(stress, springs, slice(None))[1][:, None]
        return replace(state, stress=stress)

    def _lost(
        self,
        before: SliderState,
        now: Springs,
        last: Array,
        trial: Array,
        release: Array,
        after: Array,
        rows: slice,
        behind: Array,
    ) -> tuple[Array, Array]:
        """Return what friction takes up per area, before it is scaled, shapes (n,) [N/mm].

        It is the stress of a spring times its slip. Where the bound rises in the step, its mean
        counts; where it falls, the mean of both stresses. Springs that part lose their energy,
        which they bore with the scale of before: that of the end has no bound near first touch.
        What lies behind them is released with them.

        Args:
            before: The sliders before the step.
            now: The springs at its end.
            last: Stresses of the springs before it, shape (n, 2, N) [MPa].
            trial: Those of springs that stick.
            release: Displacements of what lies behind the springs, shape (n, 2) [mm].
            after: Stresses at the end of the step.
            rows: The samples.
            behind: Compliances behind their springs, shape (n,) [mm/MPa].

        Returns:
            What is to be scaled as at the end of the step, and what as before it.
        """
        then = self._springs.at(before.closure, behind, rows, now.force.shape[1])
        stiffness = np.maximum(now.stiffness, then.stiffness)
        share = np.where(stiffness > 0.0, stiffness, 1.0)[:, None]
        parts = np.maximum(1.0 - now.stiffness[:, None] / share, 0.0)
        slip = (trial - after) * self.ratio[rows][:, None, None] / share + release[
            ..., None
        ] * parts
        largest = np.maximum(np.maximum(now.force, then.force), _TINY)
        own = (0.5 + 0.5 * then.force / largest) * (after * slip).sum(axis=1)
        falling = 0.5 * ((last - after) * slip).sum(axis=1)
        return np.maximum(own, 0.0).sum(axis=1), np.maximum(falling, 0.0).sum(axis=1)


def solved(matrices: Array, sides: Array) -> Array:
    """Return the solutions of pairs of equations, shape (n, 2, k).

    Args:
        matrices: Well-conditioned ones, shape (n, 2, 2).
        sides: Right-hand sides, shape (n, 2, k).
    """
    (a, b), (c, d) = matrices.transpose(1, 2, 0)[..., None]
    first, second = sides[:, 0], sides[:, 1]
    found = np.stack([d * first - b * second, a * second - c * first], axis=1)
    return np.asarray(found / (a * d - b * c)[:, None])


def _of_slips(
    springs: Springs, last: Array, moved: Array, mu: Array, *, sticks: bool
) -> tuple[Array, Array, Array]:
    """Return shear stresses by changes of the slip of springs over r, before they are scaled.

    Args:
        springs: The springs.
        last: Their stresses before, shape (n, 2, N) [MPa].
        moved: Changes of their slips over r, shape (n, 2) [mm].
        mu: Coefficients of friction, shape (n, 1).
        sticks: Whether they stick whatever they bear.

    Returns:
        The stresses, shape (n, 2), and their derivatives by the slip over r, shape (n, 2, 2),
        and by the closure, shape (n, 2).
    """
    stiffness = springs.stiffness
    tx, ty = last[:, 0] + stiffness * moved[:, :1], last[:, 1] + stiffness * moved[:, 1:]
    xx, yy, bound = tx * tx, ty * ty, mu * springs.force
    size = np.sqrt(xx + yy)
    bound = np.maximum(bound, size) if sticks else bound
    slips, size = size > bound, np.maximum(np.maximum(size, bound), _TINY)
    share = bound / size  # exactly 1 where springs stick; choosing by flags takes far longer
    least = slips * (1.0 / size)  # for directions of slip, 0 for springs that stick
    turns = stiffness * least
    across, whole = turns * (share * least), sums(share, stiffness)
    stress, by_slip = np.empty((len(mu), 2)), np.empty((len(mu), 2, 2))
    stress[:, 0], stress[:, 1] = sums(tx, share), sums(ty, share)
    by_slip[:, 0, 0], by_slip[:, 1, 1] = whole - sums(across, xx), whole - sums(across, yy)
    by_slip[:, 0, 1] = by_slip[:, 1, 0] = -sums(across * tx, ty)
    # the bound of springs grows with the closure, and the stiffness of the last group
    rise = mu * springs.slack[:, None] * np.stack([sums(turns, tx), sums(turns, ty)], 1)
    at = np.arange(len(mu)), springs.last
    way = np.stack([tx[at], ty[at]], axis=1) * least[at][:, None]
    grown = moved - way * (way * moved).sum(axis=1, keepdims=True)
    return stress, by_slip, rise + (share[at] * springs.growth)[:, None] * grown
