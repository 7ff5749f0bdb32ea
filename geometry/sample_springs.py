"""Springs of samples with contact laws at closures: their stiffness, force and compliance.

Behind all springs of a sample lies a compliance C, a share of that of the law.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry.spring_bed import SpringBed
from patchlaw.support.arrays import Array


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
        gaps = np.diff(begins, axis=1, prepend=begins[:, :1]) - _shifted(inside)
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


def _shifted(values: Array) -> Array:
    """Return values along rows one place later, 0 first, shape (n, N)."""
    return np.concatenate([np.zeros_like(values[:, :1]), values[:, :-1]], axis=1)


def sums(one: Array, other: Array) -> Array:
    """Return the sums of products along rows, shape (n,)."""
    return np.asarray(np.einsum("nk,nk->n", one, other))
