"""Mean displacement of patches by contacts, against averages of the displaced surface."""

import numpy as np
import pytest
from helpers.boussinesq import love_integral
from scipy.special import roots_jacobi

from patchlaw.geometry import PatchGrid
from patchlaw.micro import HertzContact
from patchlaw.micro.asperities.hertz_pairs import EllipticContacts, patch_displacements

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
