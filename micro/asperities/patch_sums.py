"""Elliptic contacts summed over patches: forces and areas, and mean displacements by the forces.

Hertz's pressure is a semi-ellipsoid. A contact within one patch belongs to it whole. The pressure
of one that straddles borders is integrated over every patch: along y in closed form, over a chord
of the ellipse that two borders cut; along x by Gauss' rule in the angle, between the angles at
which the rim crosses borders. The shares are good to 4e-7 and add up to one. What lies outside of
all patches counts for the nearest.

By reciprocity the mean displacement of patch i by a contact is the contact's force times the mean
of L_i over its pressure, divided by π E* A_i, with L_i the Love integral of the patch. That mean
is taken with a cubature for the semi-ellipsoidal pressure: 4 radii by 16 angles, exact to degree 8.
Its points have the symmetries of a square, and follow the ellipse without a jump where it becomes a
circle, whose axes have no direction. L_i is smooth except on the patch's border, where its slope is
logarithmic.

So a contact of radius a that lies across a border of a patch of side s misplaces up to 0.005 a/s of
that patch's displacement between the two sides (a point force 0.17). The mean over all patches is
good to 1e-9 for contacts away from the outer border, and to 0.005 a/s, s now the side of the whole,
for one that reaches across it.

Theory: docs/theory.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.legendre_modes import gauss_rule
from patchlaw.micro.closed_forms.love import corner_integral
from patchlaw.support import Array, Indices, blocks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EllipticContacts:
    """Hertz contacts of a surface.

    Args:
        x: Abscissae of the centres, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
        semi_axes: Semi-axes (a, b), shape (m, 2) [mm].
        force: Forces, shape (m,) [N].
    """

    x: Array
    y: Array
    angle: Array
    semi_axes: Array
    force: Array

    @property
    def area(self) -> Array:
        """Areas π a b, shape (m,) [mm²]."""
        return np.asarray(np.pi * self.semi_axes.prod(axis=1))

    @property
    def position(self) -> Array:
        """Centres (x, y), shape (m, 2) [mm]."""
        return np.stack([self.x, self.y], axis=1)


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


def patch_loads(patches: PatchGrid, contacts: EllipticContacts) -> tuple[Array, Array]:
    """Return the forces [N] and the contact areas [mm²] of patches, shape (N,) each.

    Args:
        patches: The N patches.
        contacts: The m contacts.
    """
    parts = shares(patches, contacts)
    force = parts.force * contacts.force[parts.contact]
    area = parts.area * contacts.area[parts.contact]
    sums = [np.bincount(parts.patch, part, patches.count) for part in (force, area)]
    return np.asarray(sums[0], float), np.asarray(sums[1], float)


def shares(patches: PatchGrid, contacts: EllipticContacts) -> Shares:
    """Share contacts among patches.

    Args:
        patches: The N patches.
        contacts: The m contacts.
    """
    position, axes = contacts.position, contacts.semi_axes**2
    cos, sin = np.cos(contacts.angle), np.sin(contacts.angle)
    squares = np.stack([cos, sin], axis=1) ** 2
    # The ellipse is that of the matrix [[X², cross], [cross, Y²]], (X, Y) its half extents.
    extent = np.sqrt(np.stack([(axes * squares).sum(1), (axes * squares[:, ::-1]).sum(1)], axis=1))
    cross = cos * sin * (axes[:, 0] - axes[:, 1])
    ticks = patches.borders_x, patches.borders_y
    first, last = (_intervals(ticks, position + side * extent) for side in (-1.0, 1.0))
    spans = last - first + 1
    count = spans.prod(axis=1)
    contact = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(contact)) - np.repeat(np.cumsum(count) - count, count)
    place = first[contact] + np.stack(np.divmod(number, spans[contact, 1]), axis=1)
    parts = np.ones((2, len(contact)))
    cut = np.flatnonzero(count[contact] > 1)
    for block in blocks(len(cut), 4096):  # pairs of 60 points each: blocks bound the memory
        some = cut[block]
        on = contact[some]
        low, high = (_borders(ticks, place[some] + side) - position[on] for side in (0, 1))
        parts[:, some] = _within(low, high, extent[on], cross[on])
    force, area = (part / np.bincount(contact, part)[contact] for part in parts)
    return Shares(contact, place @ np.array([len(ticks[1]) - 1, 1]), force, area)


def _intervals(ticks: tuple[Array, Array], point: Array) -> Indices:
    """Return the grid places (ix, iy) of the patches that hold points, or are nearest to them."""
    pairs = zip(ticks, point.T, strict=True)
    places = [np.searchsorted(borders[1:-1], along, side="right") for borders, along in pairs]
    return np.stack(places, axis=1)


def _borders(ticks: tuple[Array, Array], place: Indices) -> Array:
    """Return the lower borders of grid places, shape (s, 2); the outer ones lie at infinity."""
    lower = []
    for borders, along in zip(ticks, place.T, strict=True):
        lower.append(np.concatenate([[-np.inf], borders[1:-1], [np.inf]])[along])
    return np.stack(lower, axis=1)


def _within(low: Array, high: Array, extent: Array, cross: Array) -> tuple[Array, Array]:
    """Return the shares of contacts between borders, which are counted from their centres."""
    half_x, half_y = extent.T
    # With x = X sin θ the chord at x has the half length h cos θ.
    start, end = (np.arcsin(np.clip(side[:, 0] / half_x, -1.0, 1.0)) for side in (low, high))
    slope = cross / half_x**2
    chord = np.sqrt(np.maximum(half_y**2 - slope * cross, 0.0))
    theta, weight = _rule(
        start, end, _kinks(slope * half_x, chord, np.stack([low[:, 1], high[:, 1]], axis=1))
    )
    middle = (slope * half_x)[:, None] * np.sin(theta)
    half = np.maximum(chord[:, None] * np.cos(theta), np.finfo(float).tiny)
    lower, upper = (np.clip((side[:, 1, None] - middle) / half, -1.0, 1.0) for side in (low, high))
    # The integral of sqrt(1 − t²) over the chord; the pressure at its middle goes as cos θ.
    segment = 0.5 * (_segment(upper) - _segment(lower))
    force = 1.5 / np.pi * np.sum(weight * np.cos(theta) ** 3 * segment, axis=1)
    area = np.sum(weight * np.cos(theta) ** 2 * (upper - lower), axis=1) / np.pi
    return force, area


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
    points, weights = gauss_rule(12)
    nodes = 0.5 * (ticks[:, 1:] + ticks[:, :-1])[:, :, None] + half * points
    flat = len(start), nodes.shape[1] * nodes.shape[2]
    return nodes.reshape(flat), (half * weights).reshape(flat)


def _segment(t: Array) -> Array:
    return t * np.sqrt(1.0 - t * t) + np.arcsin(t)


def patch_displacements(
    patches: PatchGrid, contacts: EllipticContacts, contact_modulus: float
) -> Array:
    """Return the mean normal displacement of every patch of a half-space [mm], shape (N,).

    Args:
        patches: The N patches.
        contacts: The m contacts.
        contact_modulus: E* [MPa].
    """
    point, weight = _cubature(contacts)
    load = (contacts.force[:, None] * weight).ravel()
    ticks_x, ticks_y = patches.borders_x, patches.borders_y
    corners = np.zeros((len(ticks_x), len(ticks_y)))
    for some in blocks(len(load), 2**20 // corners.size):  # blocks bound the memory
        to_x, to_y = ticks_x - point[some, 0, None], ticks_y - point[some, 1, None]
        integrals = corner_integral(to_x[:, :, None], to_y[:, None, :])
        corners += np.tensordot(load[some], integrals, axes=1)
    love = np.diff(np.diff(corners, axis=0), axis=1)
    return np.asarray(love.ravel() / (np.pi * contact_modulus * patches.areas))


def _cubature(contacts: EllipticContacts) -> tuple[Array, Array]:
    """Return points, shape (64 m, 2), and the 64 weights of every contact's mean."""
    u, v, weight = _on_unit_disk()
    # the symmetric matrix that turns the unit circle into the ellipse
    cos, sin = np.cos(contacts.angle), np.sin(contacts.angle)
    major, minor = contacts.semi_axes.T
    xx, yy = cos**2 * major + sin**2 * minor, sin**2 * major + cos**2 * minor
    xy = cos * sin * (major - minor)
    x = contacts.x[:, None] + np.outer(xx, u) + np.outer(xy, v)
    y = contacts.y[:, None] + np.outer(xy, u) + np.outer(yy, v)
    return np.stack([x.ravel(), y.ravel()], axis=1), weight


@cache
def _on_unit_disk() -> tuple[Array, Array, Array]:
    """Return abscissae, ordinates and weights of the 64 points of the mean over a unit disk."""
    places, weights = scipy.special.roots_jacobi(4, 0.5, 0.0)  # t = r² weighs as (1 − t)^½
    radius, angles = np.sqrt(0.5 * (1.0 + places))[:, None], 16
    around = 2.0 * np.pi / angles * (np.arange(angles) + 0.5)
    weight = np.repeat(weights / (weights.sum() * angles), angles)
    return (radius * np.cos(around)).ravel(), (radius * np.sin(around)).ravel(), weight
