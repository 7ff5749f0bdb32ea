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
from numpy.typing import NDArray

from patchlaw.geometry.spring_bed import SampleSprings, SpringBed, Springs, sums
from patchlaw.support.arrays import Array

_ROWS_AT_ONCE = 600
"""Samples whose springs are worked on at a time, so that they stay in the cache: one return mapping
of 9,828 samples with 30 springs took 10.9 ms, 15.7 ms all at once; a response takes about six."""
_TINY = 1e-300
_AT_BOUND = 1e-9
"""Share by which the stress of a spring may lie below its bound and still slip."""
_MOST_STEPS = 60
_LEFT = 1e-13
"""Part of the slips that their share between springs and what lies behind them leaves."""
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
        own = (
            {"place": self.place, "stress": self.stress, "path": self.path},
            vars(self.sliders),
        )
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
        self,
        beds: Sequence[SpringBed],
        ratios: Array,
        patch: NDArray[np.intp],
        coefficient: float | Array,
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
        slip, stress = np.zeros((n, 2)), np.zeros((n, 2, springs))
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
            by_slip = np.linalg.solve(yields, by_slip)
            by_closure = np.linalg.solve(yields, by_closure[..., None])[..., 0]
        borne, rise = springs.force.sum(axis=1), springs.rise.sum(axis=1)
        scale = np.divide(pressure, borne, out=np.ones_like(pressure), where=borne > 0.0)
        scaling = np.divide(rate - scale * rise, borne, out=0.0 * rate, where=borne > 0.0)
        return SliderResponse(
            stress=scale[:, None] * stress,
            by_slip=(scale / ratio)[:, None, None] * by_slip,
            by_closure=scale[:, None] * by_closure + scaling[:, None] * stress,
            sticking=scale / ratio * springs.touched.sum(axis=1),
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
        last, start = self._seen_with(behind, then, rows)
        ratio = self.ratio[rows][:, None]
        slack = 1.0 - behind * springs.touched.sum(axis=1)  # of a slip, where all springs stick
        at = start + slack[:, None] * (slip - then.slip)
        least, step, goes_on = np.full(len(at), np.inf), np.zeros_like(at), np.full(len(at), True)
        enough = _LEFT * (np.abs(slip) + np.abs(start) + np.abs(then.slip)).sum(axis=1)
        found = tuple(np.full((len(at), *shape), np.nan) for shape in ((2,), (2, 2), (2,)))
        for _ in range(_MOST_STEPS):
            tried = at + step
            new = self._of_slips(rows, springs, last, (tried - start) / ratio, sticks)
            left = slip - tried - behind[:, None] * ratio * new[0]
            size = np.abs(left).sum(axis=1)
            better = goes_on & (size < least)
            for values, found_now in zip(found, new, strict=True):
                values[better] = found_now[better]
            at[better], least[better] = tried[better], size[better]
            goes_on &= size > enough
            if not goes_on.any():
                break
            step *= 0.5
            more = np.eye(2) + behind[better, None, None] * found[1][better]
            step[better] = np.linalg.solve(more, left[better][..., None])[..., 0]
        found[0][goes_on] = np.nan
        return found[0], found[1], found[2]

    def _of_slips(
        self, rows: Any, springs: Springs, last: Array, moved: Array, sticks: bool
    ) -> tuple[Array, Array, Array]:
        """Return shear stresses by changes of the slip of springs over r, before they are scaled.

        Returns:
            The stresses, shape (n, 2), and their derivatives by the slip over r, shape (n, 2, 2),
            and by the closure, shape (n, 2).
        """
        mx, my, mu = moved[:, :1], moved[:, 1:], self._coefficient[rows]
        last = last[..., : springs.force.shape[1]]
        tx, ty = last[:, 0] + springs.stiffness * mx, last[:, 1] + springs.stiffness * my
        size, bound = np.sqrt(tx * tx + ty * ty), mu * springs.force
        bound = np.maximum(bound, size) if sticks else bound
        slips, size = size > bound, np.maximum(np.maximum(size, bound), _TINY)
        share = bound / size  # exactly 1 where springs stick; choosing by flags takes far longer
        least = slips / size  # for directions of slip, 0 for springs that stick
        ax, ay = tx * least, ty * least
        stress = np.stack([sums(tx, share), sums(ty, share)], axis=1)
        by_slip = _across(share * springs.stiffness, ax, ay)
        by_closure = np.einsum("nij,nj->ni", _across(share * springs.growth, ax, ay), moved)
        by_closure += mu * np.stack([sums(springs.rise, ax), sums(springs.rise, ay)], 1)
        return stress, by_slip, by_closure

    def _seen_with(self, behind: Array, state: SliderState, rows: Any) -> tuple[Array, Array]:
        """Return stresses and slips of springs with another compliance behind them.

        A change of it moves a spring by the stress of those that touched later, and that of those
        before it if they were displaced as it is: normal loads move their closures so.

        Args:
            behind: That compliance of some samples, shape (n,) [mm/MPa].
            state: Their sliders.
            rows: These samples among all.

        Returns:
            Shapes (n, 2, N) [MPa] and (n, 2) [mm].
        """
        less, stress = (state.behind - behind)[:, None, None], state.stress
        if less.any():
            old, new = (
                self._springs.at(state.closure, each, rows, trimmed=False).stiffness[:, None]
                for each in (state.behind, behind)
            )
            moved = stress / np.where(old > 0.0, old, 1.0)
            later = np.cumsum(stress[..., ::-1], axis=2)[..., ::-1] - stress
            stress = new * (moved + less * (later + np.cumsum(old, axis=2) * moved))
        gives = (self.ratio[rows] * behind)[:, None]
        return stress, state.slip - gives * stress.sum(axis=2)

    def step(self, before: SliderState, found: SliderResponse) -> SliderStep:
        """Return what a step did.

        Args:
            before: The sliders before it.
            found: What it led to.
        """
        count = len(found.closure)
        stress = np.empty_like(before.stress)
        lost, fell, stick_closure = np.empty((3, count))
        for first in range(0, count, _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            then, behind = before.of(rows), found.behind[rows]
            now = self._springs.at(found.closure[rows], behind, rows, trimmed=False)
            last, start = self._seen_with(behind, then, rows)
            gives = (self.ratio[rows] * behind / found.scale[rows])[:, None]
            moved = found.slip[rows] - gives * found.stress[rows] - start
            trial = last + now.stiffness[:, None] * (moved / self.ratio[rows][:, None])[..., None]
            size, share = self._returned(trial, now, rows)
            stress[rows] = trial * share[:, None]
            release = moved - (found.slip[rows] - then.slip)
            sticks = size * share < (1.0 - _AT_BOUND) * self._coefficient[rows] * now.force
            own, falling = self._lost(then, now, last, trial, release, stress[rows], rows, behind)
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
            each._springs.at(state.closure, state.behind, trimmed=False) for each in (other, self)
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
        then = self._springs.at(before.closure, behind, rows, trimmed=False)
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


def _across(stiffness: Array, ax: Array, ay: Array) -> Array:
    """Return the stiffness of springs across their directions of slip, shape (n, 2, 2).

    Args:
        stiffness: That of the springs, shape (n, N).
        ax: The directions along x, shape (n, N); 0 for springs that stick.
        ay: Those along y.
    """
    found, sx = np.empty((len(ax), 2, 2)), stiffness * ax
    whole = stiffness.sum(axis=1)
    found[:, 0, 0], found[:, 1, 1] = whole - sums(sx, ax), whole - sums(stiffness * ay, ay)
    found[:, 0, 1] = found[:, 1, 0] = -sums(sx, ay)
    return found
