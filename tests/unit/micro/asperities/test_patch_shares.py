"""Shares of patches in elliptic contacts against points that carry equal force or area."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from patchlaw.geometry import PatchGrid
from patchlaw.micro.asperities.hertz_pairs import EllipticContacts, shares

GRID = PatchGrid(grid=(4, 5), lengths=(1.0, 1.2))


def _shares(patches, position, semi_axes, angle):
    x, y = np.reshape(position, (-1, 2)).T
    contacts = EllipticContacts(
        x=x, y=y, angle=angle, semi_axes=semi_axes, force=np.ones(len(position))
    )
    return shares(patches, contacts)


def _table(position, semi_axes, angle, patches=GRID):
    found = _shares(patches, position, semi_axes, angle)
    table = np.zeros((2, len(position), patches.count))
    np.add.at(table[0], (found.contact, found.patch), found.force)
    np.add.at(table[1], (found.contact, found.patch), found.area)
    return table


def _random_contacts(count, seed=0):
    rng = np.random.default_rng(seed)
    position = rng.uniform([0.0, 0.0], [1.0, 1.2], (count, 2))
    axes = np.sort(rng.uniform(0.02, 0.3, (count, 2)), axis=1)[:, ::-1]
    return position, axes, rng.uniform(0.0, np.pi, count)


def _integrated(position, axes, angle, patch):
    """Shares of one patch by adaptive quadrature across the chords of the ellipse."""
    (a, b), cos, sin = axes, np.cos(angle), np.sin(angle)
    xx, yy = (cos / a) ** 2 + (sin / b) ** 2, (sin / a) ** 2 + (cos / b) ** 2
    xy = cos * sin * (a**-2.0 - b**-2.0)
    ix, iy = divmod(patch, GRID.grid[1])
    end_x, end_y = (
        np.concatenate([[-9.0], borders[1:-1], [9.0]])[i : i + 2] - middle
        for borders, i, middle in zip(
            (GRID.borders_x, GRID.borders_y), (ix, iy), position, strict=True
        )
    )
    reach = np.hypot(a * cos, b * sin)

    def strip(x, force):
        middle = -xy * x / yy
        half = np.sqrt(max((1.0 - xx * x * x) / yy + middle**2, 1e-300))
        low, high = np.clip((end_y - middle) / half, -1.0, 1.0)
        if not force:
            return half * (high - low)
        parts = [0.5 * (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) for t in (low, high)]
        return np.sqrt(yy) * half**2 * (parts[1] - parts[0])

    crossings = np.concatenate(
        [np.real(np.roots([xx, 2.0 * xy * y, yy * y * y - 1.0])) for y in end_y]
    )
    ticks = np.sort(np.clip([*end_x, *crossings, -reach, reach], *np.clip(end_x, -reach, reach)))
    force, area = (
        sum(quad(strip, *ends, (kind,), epsabs=1e-13)[0] for ends in pairwise(ticks))
        for kind in (True, False)
    )
    return 1.5 * force / (np.pi * a * b), area / (np.pi * a * b)


def test_shares_are_good_to_a_millionth():
    position, axes, angle = _random_contacts(12, seed=4)
    found = _shares(GRID, position, axes, angle)
    for k, patch, force, area in zip(*found, strict=True):
        expected = _integrated(position[k], axes[k], angle[k], patch)
        assert (force, area) == pytest.approx(expected, abs=1e-6)  # stated: 4e-7


def test_a_circle_cut_off_centre_follows_the_closed_forms():
    patches = PatchGrid(grid=(2, 1), lengths=(2.0, 2.0))
    t = 0.3  # border at 0.3 radii beyond the centre
    force, area = _table(np.array([[1.0 - 0.3 * 0.2, 1.0]]), np.full((1, 2), 0.2), [0.7], patches)
    # spherical cap and circular segment
    assert force[0, 1] == pytest.approx((2.0 - 3.0 * t + t**3) / 4.0, abs=1e-6)
    segment = (np.arccos(t) - t * np.sqrt(1.0 - t * t)) / np.pi
    assert area[0, 1] == pytest.approx(segment, abs=1e-12)


def test_shares_add_up_and_whole_contacts_stay_whole():
    position, axes, angle = _random_contacts(300, seed=3)
    table = _table(position, 0.5 * axes, angle)
    assert table.sum(axis=2) == pytest.approx(1.0, abs=1e-14)
    assert (table >= -1e-14).all()
    tiny = _shares(GRID, position, 1e-9 * axes, angle)
    assert np.array_equal(tiny.patch, GRID.index_of(*position.T))
    assert (tiny.force == 1.0).all()


def test_what_lies_outside_counts_for_the_nearest_patch():
    force, _ = _table(np.array([[0.01, 0.6], [-0.5, 1.5]]), np.full((2, 2), 0.05), np.zeros(2))
    assert force[0].sum() == pytest.approx(1.0, abs=1e-14)
    assert force[1, GRID.index_of(0.0, 1.2)] == 1.0


def test_no_contact_has_no_share():
    assert len(_shares(GRID, np.empty((0, 2)), np.empty((0, 2)), np.empty(0)).contact) == 0


def test_shares_do_not_depend_on_how_many_are_integrated_at_once():
    """Contacts larger than the surface reach into every patch: more pairs than go into a block."""
    patches = PatchGrid(grid=(16, 16), lengths=(1.0, 1.2))
    position, _, angle = _random_contacts(20)
    axes = np.full((20, 2), [9.0, 5.0])
    whole = _shares(patches, position, axes, angle)
    assert len(whole.contact) == 20 * 256 > 4096
    for k in range(20):
        alone, own = _shares(patches, position[[k]], axes[[k]], angle[[k]]), whole.contact == k
        np.testing.assert_array_equal(alone.patch, whole.patch[own])
        np.testing.assert_allclose(alone.force, whole.force[own], rtol=1e-13)
        np.testing.assert_allclose(alone.area, whole.area[own], rtol=1e-13)
