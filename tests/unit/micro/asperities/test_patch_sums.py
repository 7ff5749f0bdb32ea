"""What patches have of contacts: mean displacements, and shares of ellipses that borders cut."""

from itertools import pairwise

import numpy as np
import pytest
from helpers.boussinesq import love_integral
from scipy.integrate import quad
from scipy.special import roots_jacobi

from patchlaw.geometry import PatchGrid
from patchlaw.micro import HertzContact
from patchlaw.micro.asperities.hertz_pairs import EllipticContacts, patch_displacements, shares

PATCHES = PatchGrid(grid=(4, 2), lengths=(1.0, 0.6))


def displacements(patches, position, semi_axes, angle, force, contact_modulus):
    contacts = EllipticContacts(
        x=position[:, 0], y=position[:, 1], angle=angle, semi_axes=semi_axes, force=force
    )
    return patch_displacements(patches, contacts, contact_modulus)


def means(position, semi_axes, angle=0.0):
    return displacements(
        PATCHES,
        np.atleast_2d(np.asarray(position, float)),
        np.atleast_2d(np.asarray(semi_axes, float)),
        np.array([angle]),
        np.array([2.0]),
        3.0,
    )


def test_point_force_by_reciprocity():
    a, b = PATCHES.half_sizes
    x, y = PATCHES.centres.T
    expected = 2.0 * love_integral(0.3 - x, 0.1 - y, a, b) / (np.pi * 3.0 * PATCHES.area)
    assert means((0.3, 0.1), (1e-12, 1e-12)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_average_of_the_hertz_field(angle):
    ball = HertzContact(contact_modulus=3.0, radius_major=0.3, radius_minor=0.1, indentation=3e-3)
    axes = (float(ball.semi_major), float(ball.semi_minor))
    got = means((0.36, 0.17), axes, angle) * ball.force / 2.0
    n = 240  # cells per patch side; the field is smooth but for its curvature at the rim
    x = (np.arange(4 * n) + 0.5)[:, None] / (4 * n) - 0.36
    y = (np.arange(2 * n) + 0.5) * 0.6 / (2 * n) - 0.17
    turned = (x + 1j * y) * np.exp(-1j * angle)
    field = ball.displacement(turned.real, turned.imag)
    average = field.reshape(4, n, 2, n).mean(axis=(1, 3)).ravel()
    # Midpoint rule with cells of 1 µm, an error of 1.9e-6 that falls with the cells.
    assert got == pytest.approx(average, rel=4e-6)


def test_contact_across_a_border():
    # 0.015 a/s of the patch's own displacement, as the module says; a/s = 0.08 here.
    ball = HertzContact(contact_modulus=3.0, radius_major=0.1, radius_minor=0.1, indentation=4e-3)
    a = float(ball.semi_major)
    position = (0.25 + 0.3 * a, 0.16)
    got = means(position, (a, a)) * ball.force / 2.0
    n = 200
    x = (np.arange(4 * n) + 0.5)[:, None] / (4 * n) - position[0]
    y = (np.arange(2 * n) + 0.5) * 0.6 / (2 * n) - position[1]
    average = ball.displacement(x, y).reshape(4, n, 2, n).mean(axis=(1, 3)).ravel()
    assert got == pytest.approx(average, abs=0.015 * a / 0.25 * average.max())
    assert got.sum() == pytest.approx(average.sum(), rel=1e-5)  # the whole is exact


@pytest.mark.parametrize(("offset", "bound"), [(3.0, 1e-9), (1.0, 4e-4 * 0.1), (0.5, 0.02 * 0.1)])
def test_contact_at_the_outer_border(offset, bound):
    """Of radius a, its centre so many a inside; against a rule of 60 radii and 1001 angles."""
    whole, a = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)), 0.1
    position = np.array([offset * a, 0.4])
    none, one = np.zeros(1), np.ones(1)
    got = displacements(whole, position[None], np.full((1, 2), a), none, one, 1.0)
    nodes, shares = roots_jacobi(60, 0.5, 0.0)
    around = 2.0 * np.pi * np.arange(1001) / 1001
    place = position + a * np.sqrt(0.5 * (1.0 + nodes))[:, None, None] * np.stack(
        [np.cos(around), np.sin(around)], axis=-1
    )
    love = love_integral(place[..., 0] - 0.5, place[..., 1] - 0.5, 0.5, 0.5).mean(axis=1)
    assert got[0] == pytest.approx(shares @ love / shares.sum() / np.pi, rel=bound)


def test_patches_add_up():
    whole = PatchGrid(grid=(1, 1), lengths=PATCHES.lengths)
    position, axes = np.array([[0.5, 0.3], [0.77, 0.01]]), np.array([[0.02, 0.01], [0.05, 0.04]])
    angle, force = np.array([0.3, 0.0]), np.array([1.0, 4.0])
    fine = displacements(PATCHES, position, axes, angle, force, 1.0)
    coarse = displacements(whole, position, axes, angle, force, 1.0)
    assert fine.mean() == pytest.approx(coarse[0], rel=1e-13)  # the corner terms telescope


def test_no_contact():
    none = np.empty((0, 2))
    assert not displacements(PATCHES, none, none, np.empty(0), np.empty(0), 1.0).any()


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
