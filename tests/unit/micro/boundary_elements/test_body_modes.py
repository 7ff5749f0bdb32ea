"""A compliance in modes on cells, at points and on patches."""

import numpy as np
import pytest
from helpers.uneven_grid import uneven_grid

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import mode_values
from patchlaw.micro import BodyModes
from patchlaw.micro.boundary_elements.body_modes import BodyPoints
from patchlaw.support import InputError

LENGTHS = (1.2, 0.8)


@pytest.fixture
def body():
    random = np.random.default_rng(3)
    half = random.standard_normal((9, 9))
    return BodyModes(LENGTHS, half + half.T)


def even(cells):
    return [np.linspace(0.0, length, n + 1) for length, n in zip(LENGTHS, cells, strict=True)]


def test_cells_see_each_other_alike(body):
    cells = body.on(*even((6, 5)))
    one, other = np.random.default_rng(1).random((2, 6, 5))
    there = (other * cells.displacement(one)).sum()
    assert there == pytest.approx((one * cells.displacement(other)).sum(), rel=1e-13)


def between(body, x, y):
    """Return displacements of points by unit forces at points."""
    points = BodyPoints.at(body, x, y)
    return points.by(points)


def test_small_cells_are_forces_at_points(body):
    x, y = np.array([0.1, 0.7, 1.1]), np.array([0.2, 0.3, 0.75])
    size = 1e-4
    found = np.empty((3, 3))
    for j in range(3):
        here = body.on([x[j] - size, x[j] + size], [y[j] - size, y[j] + size])
        pressure = np.full((1, 1), 1.0 / (2.0 * size) ** 2)
        moments = (here.means_x * here.widths_x) @ pressure @ (here.means_y * here.widths_y).T
        for i in range(3):
            at = [
                mode_values(p[i : i + 1], length, 3)
                for p, length in zip((x, y), LENGTHS, strict=True)
            ]
            found[i, j] = np.kron(*at)[:, 0] @ body.matrix @ moments.ravel()
    # means over the cells differ by the curvature of the modes times the size squared
    np.testing.assert_allclose(between(body, x, y), found, rtol=1e-5)


def test_patches_are_cells(body):
    patches = uneven_grid(ticks_x=(0.0, 0.3, 1.2), ticks_y=(0.0, 0.1, 0.5, 0.8))
    cells = body.on(patches.borders_x, patches.borders_y)
    found = body.patch_compliance(patches)
    for j in range(patches.count):
        pressure = np.zeros(patches.count)
        pressure[j] = 1.0
        displaced = cells.displacement(pressure.reshape(patches.grid))
        np.testing.assert_allclose(found[:, j], displaced.ravel(), rtol=1e-12, atol=1e-12)


def test_top_may_begin_before_the_face(body):
    moved = BodyModes(LENGTHS, body.matrix, (-0.2, -0.1))
    points = np.array([0.0, 0.4]), np.array([0.3, 0.2])
    np.testing.assert_allclose(
        between(moved, *points), between(body, points[0] + 0.2, points[1] + 0.1), rtol=1e-13
    )
    patches = PatchGrid(grid=(2, 2), lengths=(0.8, 0.6))
    borders = patches.borders_x, patches.borders_y
    pressure = np.arange(4.0).reshape(2, 2)
    np.testing.assert_allclose(
        moved.on(*borders).displacement(pressure),
        body.on(borders[0] + 0.2, borders[1] + 0.1).displacement(pressure),
        rtol=1e-12,
    )


def test_modes_of_a_rectangle_within_the_top_lose_nothing(body):
    moved = BodyModes(LENGTHS, body.matrix, (-0.2, -0.1), 0.5 * body.matrix)
    inner = moved.within((0.7, 0.5))
    assert inner.lengths == (0.7, 0.5) and inner.origin == (0.0, 0.0)
    points = np.array([0.0, 0.4, 0.7]), np.array([0.3, 0.2, 0.5])
    np.testing.assert_allclose(between(inner, *points), between(moved, *points), rtol=1e-11)
    np.testing.assert_allclose(inner.rough, 0.5 * inner.matrix, rtol=1e-13)
    assert body.within(LENGTHS) is body


def test_two_bodies_add_whatever_their_modes(body):
    few, points = body.fewer(2), (np.array([0.1, 1.0]), np.array([0.3, 0.6]))
    for one, other in ((body, few), (few, body)):
        found = between(one.plus(other), *points)
        np.testing.assert_allclose(found, between(body, *points) + between(few, *points))
    assert few.plus(few).rough is None
    shown = BodyModes(LENGTHS, body.matrix, rough=0.5 * body.matrix)
    np.testing.assert_allclose(shown.plus(body).rough, 1.5 * body.matrix)


def test_fewer_modes_are_the_first_ones(body):
    x, y = np.array([0.3, 0.9]), np.array([0.1, 0.6])
    cut = body.matrix.reshape(3, 3, 3, 3).copy()
    for axis in range(4):
        np.moveaxis(cut, axis, 0)[2] = 0.0
    same = BodyModes(LENGTHS, cut.reshape(9, 9))
    np.testing.assert_allclose(between(body.fewer(2), x, y), between(same, x, y), rtol=1e-12)
    with pytest.raises(InputError, match=r"so many modes are not there .*1 … 3"):
        body.fewer(4)


@pytest.mark.parametrize(
    ("lengths", "matrix", "problem"),
    [
        ((0.0, 1.0), np.eye(4), "lengths = .*; 0.0 must be greater"),
        ((1.0, 1.0), np.eye(5), "the compliance is not one of K × K modes"),
        ((1.0, 1.0), np.full((4, 4), np.nan), "the compliance is not finite and symmetric"),
        ((1.0, 1.0), np.triu(np.ones((4, 4))), "the compliance is not finite and symmetric"),
    ],
)
def test_what_is_no_compliance_is_refused(lengths, matrix, problem):
    with pytest.raises(InputError, match=problem):
        BodyModes(lengths, matrix)
