"""Shares of patches in elliptic contacts against points that carry equal force or area."""

import numpy as np
import pytest

from geometry import PatchGrid
from micro.attribution import shares

GRID = PatchGrid(grid=(4, 5), lengths=(1.0, 1.2))


def _table(position, semi_axes, angle, patches=GRID):
    found = shares(patches, position, semi_axes, angle)
    table = np.zeros((2, len(position), patches.count))
    np.add.at(table[0], (found.contact, found.patch), found.force)
    np.add.at(table[1], (found.contact, found.patch), found.area)
    return table


def _random_contacts(count, seed=0):
    rng = np.random.default_rng(seed)
    position = rng.uniform([0.0, 0.0], [1.0, 1.2], (count, 2))
    axes = np.sort(rng.uniform(0.02, 0.3, (count, 2)), axis=1)[:, ::-1]
    return position, axes, rng.uniform(0.0, np.pi, count)


def _counted(position, axes, angle, cumulated):
    """Share one contact by points of equal weight; ``cumulated``: radius over weight within."""
    count = 1000
    within, turn = np.meshgrid(
        cumulated((np.arange(count) + 0.5) / count), 2 * np.pi * np.arange(count) / count
    )
    u, v = axes[0] * within * np.cos(turn), axes[1] * within * np.sin(turn)
    x = np.clip(position[0] + np.cos(angle) * u - np.sin(angle) * v, 0.0, 1.0)
    y = np.clip(position[1] + np.sin(angle) * u + np.cos(angle) * v, 0.0, 1.2)
    return np.bincount(GRID.index_of(x, y).ravel(), minlength=GRID.count) / count**2


@pytest.mark.parametrize("index", range(6))
def test_shares_are_the_integrals_of_the_pressure(index):
    position, axes, angle = _random_contacts(6)
    force, area = _table(position, axes, angle)
    own = position[index], axes[index], angle[index]
    # a point in a thousand squared is on the wrong side where a border cuts its row of points
    expected = _counted(*own, lambda t: np.sqrt(1.0 - (1.0 - t) ** (2.0 / 3.0)))
    assert force[index] == pytest.approx(expected, abs=1e-4)
    assert area[index] == pytest.approx(_counted(*own, np.sqrt), abs=1e-4)


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
    tiny = shares(GRID, position, 1e-9 * axes, angle)
    assert np.array_equal(tiny.patch, GRID.index_of(*position.T))
    assert (tiny.force == 1.0).all()


def test_what_lies_outside_counts_for_the_nearest_patch():
    force, _ = _table(np.array([[0.01, 0.6], [-0.5, 1.5]]), np.full((2, 2), 0.05), np.zeros(2))
    assert force[0].sum() == pytest.approx(1.0, abs=1e-14)
    assert force[1, GRID.index_of(0.0, 1.2)] == 1.0


def test_no_contact_has_no_share():
    assert len(shares(GRID, np.empty((0, 2)), np.empty((0, 2)), np.empty(0)).contact) == 0
