"""Shares of patches in the forces and areas of elliptic contacts, by the integral of the pressure.

Hertz's pressure is a semi-ellipsoid. A contact within one patch belongs to it whole; one that
straddles borders is integrated over every patch: along y in closed form (a chord of the ellipse
cut by two borders), along x by Gauss' rule in the angle, between the rim's crossings of borders.
The shares are good to 4e-7 and add up to one. What lies outside of all patches counts for the
nearest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Partition

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_AT_ONCE = 4096  # pairs of contacts and patches, of 60 points each

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


def shares(patches: Partition, position: Array, semi_axes: Array, angle: Array) -> Shares:
    """Share contacts among patches.

    Args:
        patches: The N patches.
        position: Centres of the m contacts, shape (m, 2) [mm].
        semi_axes: Semi-axes (a, b), shape (m, 2) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
    """
    cos, sin = np.cos(angle), np.sin(angle)
    axes = np.asarray(semi_axes, float) ** 2
    spread = np.stack([cos, sin], axis=1) ** 2
    across = np.sqrt(np.stack([(axes * spread).sum(1), (axes * spread[:, ::-1]).sum(1)], axis=1))
    lean = cos * sin * (axes[:, 0] - axes[:, 1])  # the ellipse's matrix is [[X², lean], [lean, Y²]]
    first, last = (_interval(patches, position + side * across) for side in (-1.0, 1.0))
    whole = np.flatnonzero((first == last).all(axis=1))
    stride = np.array([patches.shape[1], 1])
    home = first[whole] @ stride
    parts = [Shares(whole, home, np.ones(len(whole)), np.ones(len(whole)))]
    cut = np.flatnonzero((first != last).any(axis=1))
    if cut.size:
        contacts = _Cut(patches, position[cut], across[cut], lean[cut])
        spans = (last - first)[cut].max(axis=0) + 1
        for i in range(spans[0]):  # a column of patches at once: large contacts reach many
            rows = np.arange(spans[1])[:, None]
            inside = (first[cut, 0] + i <= last[cut, 0]) & (first[cut, 1] + rows <= last[cut, 1])
            row, on = np.nonzero(inside)
            place = first[cut[on]] + np.stack([np.full_like(row, i), row], axis=1)
            for part in range(0, len(on), _AT_ONCE):
                some = slice(part, part + _AT_ONCE)
                force, area = contacts.within(on[some], place[some])
                parts.append(Shares(cut[on[some]], place[some] @ stride, force, area))
    return _normed(Shares(*map(np.concatenate, zip(*parts, strict=True))), len(position))


class _Cut(NamedTuple):
    """Contacts that straddle borders: half extents and covariance of their ellipses."""

    patches: Partition
    position: Array
    across: Array
    lean: Array

    def within(self, on: Indices, place: Indices) -> tuple[Array, Array]:
        """Return the shares of contacts ``on`` in the patches at grid places ``place``."""
        low, high = (self._borders(place, side) - self.position[on] for side in (0, 1))
        half_x, half_y = self.across[on].T
        # x = X sin θ; the ellipse spans X, and the chord at x has the half length h cos θ
        start, end = (np.arcsin(np.clip(side[:, 0] / half_x, -1.0, 1.0)) for side in (low, high))
        slope = self.lean[on] / half_x**2
        chord = np.sqrt(np.maximum(half_y**2 - slope * self.lean[on], 0.0))
        theta, weight = _rule(
            start, end, _kinks(slope * half_x, chord, np.stack([low[:, 1], high[:, 1]], axis=1))
        )
        middle = (slope * half_x)[:, None] * np.sin(theta)
        half = np.maximum(chord[:, None] * np.cos(theta), np.finfo(float).tiny)
        lower, upper = (
            np.clip((side[:, 1, None] - middle) / half, -1.0, 1.0) for side in (low, high)
        )
        # ∫ sqrt(1 − t²) dt over the chord; the pressure at its middle goes as cos θ
        segment = 0.5 * (_segment(upper) - _segment(lower))
        force = 1.5 / np.pi * np.sum(weight * np.cos(theta) ** 3 * segment, axis=1)
        area = np.sum(weight * np.cos(theta) ** 2 * (upper - lower), axis=1) / np.pi
        return force, area

    def _borders(self, place: Indices, side: int) -> Array:
        """Return borders below (0) or above (1); the outer ones are nowhere."""
        borders = []
        for axis, ticks in enumerate((self.patches.borders_x, self.patches.borders_y)):
            open_ended = np.concatenate([[-np.inf], ticks[1:-1], [np.inf]])
            borders.append(open_ended[place[:, axis] + side])
        return np.stack(borders, axis=1)


def _kinks(lean: Array, chord: Array, borders: Array) -> Array:
    """Return the angles where the ellipse crosses two borders along y, shape (m, 4).

    The ellipse's rim is y = lean sin ψ + chord cos ψ; both its halves share θ = asin(sin ψ).
    """
    height = np.hypot(lean, chord)[:, None]
    turn = np.arctan2(lean, chord)[:, None]
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
    """Return the grid places (ix, iy) of points, outside the nearest."""
    ticks = patches.borders_x, patches.borders_y
    columns = [
        np.searchsorted(border[1:-1], values, side="right")
        for border, values in zip(ticks, point.T, strict=True)
    ]
    return np.stack(columns, axis=1)


def _normed(found: Shares, count: int) -> Shares:
    """Let the shares of every contact add up to one."""
    force, area = (
        share / np.bincount(found.contact, share, minlength=count)[found.contact]
        for share in (found.force, found.area)
    )
    return Shares(found.contact, found.patch, force, area)
