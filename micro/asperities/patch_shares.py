"""Shares of patches in the forces and areas of elliptic contacts, by the integral of the pressure.

Hertz's pressure is a semi-ellipsoid. A contact within one patch belongs to it whole. The pressure
of one that straddles borders is integrated over every patch: along y in closed form, over a chord
of the ellipse that two borders cut; along x by Gauss' rule in the angle, between the angles at
which the rim crosses borders. The shares are good to 4e-7 and add up to one. What lies outside of
all patches counts for the nearest.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Partition

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_AT_ONCE = 4096  # pairs of a contact and a patch, of 60 points each

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


class Shares(NamedTuple):
    """Sparse table: contact k has a share of its force and of its area in a patch.

    Attributes:
        contact: Indices of contacts, shape (s,).
        patch: Flat indices of patches, shape (s,).
        force: Shares of the force; those of one contact add up to 1, shape (s,).
        area: Shares of the area, shape (s,).
    """

    contact: Indices
    patch: Indices
    force: Array
    area: Array

    def sums(self, share: Array, values: Array, patches: Partition) -> Array:
        """Return the sums over patches of values that the contacts share, shape (N,).

        Args:
            share: `force` or `area`.
            values: Values of the m contacts, shape (m,).
            patches: The N patches.
        """
        parts = share * values[self.contact]
        return np.asarray(np.bincount(self.patch, parts, minlength=patches.count), float)


def shares(
    patches: Partition,
    position: Array,
    semi_axes: Array,
    angle: Array,
    *,
    at_once: int = _AT_ONCE,
) -> Shares:
    """Share contacts among patches.

    Args:
        patches: The N patches.
        position: Centres of the m contacts, shape (m, 2) [mm].
        semi_axes: Semi-axes (a, b), shape (m, 2) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
        at_once: Pairs of a contact and a patch that are integrated at once, to bound the memory.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    axes = np.asarray(semi_axes, float) ** 2
    squares = np.stack([cos, sin], axis=1) ** 2
    # The ellipse is that of the matrix [[X², cross], [cross, Y²]], (X, Y) its half extents.
    extent = np.sqrt(np.stack([(axes * squares).sum(1), (axes * squares[:, ::-1]).sum(1)], axis=1))
    cross = cos * sin * (axes[:, 0] - axes[:, 1])
    first, last = (_interval(patches, position + side * extent) for side in (-1.0, 1.0))
    whole = np.flatnonzero((first == last).all(axis=1))
    stride = np.array([patches.shape[1], 1])
    parts = [Shares(whole, first[whole] @ stride, np.ones(len(whole)), np.ones(len(whole)))]
    cut = np.flatnonzero((first != last).any(axis=1))
    if cut.size:
        contacts = _Cut(patches, position[cut], extent[cut], cross[cut])
        spans = (last - first)[cut].max(axis=0) + 1
        for i in range(spans[0]):  # one column of patches at a time
            rows = np.arange(spans[1])[:, None]
            inside = (first[cut, 0] + i <= last[cut, 0]) & (first[cut, 1] + rows <= last[cut, 1])
            row, on = np.nonzero(inside)
            place = first[cut[on]] + np.stack([np.full_like(row, i), row], axis=1)
            for part in range(0, len(on), at_once):
                some = slice(part, part + at_once)
                force, area = contacts.within(on[some], place[some])
                parts.append(Shares(cut[on[some]], place[some] @ stride, force, area))
    found = Shares(*map(np.concatenate, zip(*parts, strict=True)))
    force, area = (
        share / np.bincount(found.contact, share, minlength=len(position))[found.contact]
        for share in (found.force, found.area)
    )
    return found._replace(force=force, area=area)


class _Cut(NamedTuple):
    """Contacts that straddle borders; half extents (X, Y) and cross terms of their ellipses."""

    patches: Partition
    position: Array
    extent: Array
    cross: Array

    def within(self, on: Indices, place: Indices) -> tuple[Array, Array]:
        """Return the shares of contacts ``on`` in the patches at grid places ``place``."""
        low, high = (self._borders(place, side) - self.position[on] for side in (0, 1))
        half_x, half_y = self.extent[on].T
        # With x = X sin θ the chord at x has the half length h cos θ.
        start, end = (np.arcsin(np.clip(side[:, 0] / half_x, -1.0, 1.0)) for side in (low, high))
        slope = self.cross[on] / half_x**2
        chord = np.sqrt(np.maximum(half_y**2 - slope * self.cross[on], 0.0))
        theta, weight = _rule(
            start, end, _kinks(slope * half_x, chord, np.stack([low[:, 1], high[:, 1]], axis=1))
        )
        middle = (slope * half_x)[:, None] * np.sin(theta)
        half = np.maximum(chord[:, None] * np.cos(theta), np.finfo(float).tiny)
        lower, upper = (
            np.clip((side[:, 1, None] - middle) / half, -1.0, 1.0) for side in (low, high)
        )
        # The integral of sqrt(1 − t²) over the chord; the pressure at its middle goes as cos θ.
        segment = 0.5 * (_segment(upper) - _segment(lower))
        force = 1.5 / np.pi * np.sum(weight * np.cos(theta) ** 3 * segment, axis=1)
        area = np.sum(weight * np.cos(theta) ** 2 * (upper - lower), axis=1) / np.pi
        return force, area

    def _borders(self, place: Indices, side: int) -> Array:
        """Return the borders below (side 0) or above (side 1); the outer ones lie at infinity."""
        borders = []
        for axis, ticks in enumerate((self.patches.borders_x, self.patches.borders_y)):
            open_ended = np.concatenate([[-np.inf], ticks[1:-1], [np.inf]])
            borders.append(open_ended[place[:, axis] + side])
        return np.stack(borders, axis=1)


def _kinks(shear: Array, chord: Array, borders: Array) -> Array:
    """Return the angles where the ellipse crosses two borders along y, shape (m, 4).

    The ellipse's rim is y = shear sin ψ + chord cos ψ; both its halves share θ = asin(sin ψ).
    """
    height = np.hypot(shear, chord)[:, None]
    turn = np.arctan2(shear, chord)[:, None]
    opening = np.arccos(np.clip(borders / height, -1.0, 1.0))
    rim = np.concatenate([turn - opening, turn + opening], axis=1)
    return np.asarray(np.arcsin(np.sin(rim)))


def _rule(start: Array, end: Array, kinks: Array) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss' rule between successive kinks, shape (m, 5 n)."""
    inner = np.clip(kinks, start[:, None], end[:, None])
    ticks = np.sort(np.concatenate([start[:, None], inner, end[:, None]], axis=1), axis=1)
    half = 0.5 * np.diff(ticks, axis=1)[:, :, None]
    nodes = 0.5 * (ticks[:, 1:] + ticks[:, :-1])[:, :, None] + half * _NODES
    flat = len(start), nodes.shape[1] * nodes.shape[2]
    return nodes.reshape(flat), (half * _WEIGHTS).reshape(flat)


def _segment(t: Array) -> Array:
    return t * np.sqrt(1.0 - t * t) + np.arcsin(t)


def _interval(patches: Partition, point: Array) -> Indices:
    """Return the grid places (ix, iy) of the patches that hold points, or are nearest to them."""
    ticks = patches.borders_x, patches.borders_y
    columns = [
        np.searchsorted(border[1:-1], values, side="right")
        for border, values in zip(ticks, point.T, strict=True)
    ]
    return np.stack(columns, axis=1)
