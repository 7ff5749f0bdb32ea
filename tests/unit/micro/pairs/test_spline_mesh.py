"""The smooth part of the point-force field on a mesh against the direct sum."""

import numpy as np
import pytest

from micro.pairs.spline_mesh import SplineMesh, smooth_kernel


@pytest.fixture(scope="module", params=[(1.0, 1.0), (2.0, 0.3)])
def points(request):
    rng = np.random.default_rng(3)
    return rng.random((600, 2)) * request.param - 0.2  # an origin of its own


def apart(points):
    return points[:, None] - points


def test_forces(points):
    mesh = SplineMesh.over(*points.T, 0.02)
    distance = np.linalg.norm(apart(points), axis=-1)
    force = np.random.default_rng(0).random(len(points))
    exact = smooth_kernel(distance, mesh.sharpness)[0] @ force
    error = mesh.displacement(force) - exact
    # 2e-7 in the mean, 1e-6 at most, as measured for the order 6 at α h = 0.4.
    assert np.sqrt(np.mean(error**2)) < 1e-6 * exact.mean()
    assert np.abs(error).max() < 5e-6 * exact.mean()


def test_second_derivatives(points):
    mesh = SplineMesh.over(*points.T, 0.02)
    delta = apart(points)
    r = np.linalg.norm(delta, axis=-1)
    _, slope, curvature = smooth_kernel(r, mesh.sharpness)
    unit = delta / np.where(r > 0.0, r, 1.0)[..., None]
    rng = np.random.default_rng(1)
    xx, xy, yy = rng.random((3, len(points)))
    tensor = (curvature - slope)[..., None, None] * unit[..., None] * unit[..., None, :]
    tensor += slope[..., None, None] * np.eye(2)
    exact = tensor[..., 0, 0] @ xx + tensor[..., 0, 1] @ xy + tensor[..., 1, 1] @ yy
    error = mesh.displacement(np.zeros(len(points)), xx, xy, yy) - exact
    # Two derivatives lose two of the six orders in α h = 0.4.
    assert np.sqrt(np.mean(error**2)) < 1e-3 * np.sqrt(np.mean(exact**2))


def test_subset_is_the_same_mesh(points):
    mesh = SplineMesh.over(*points.T, 0.02)
    index = np.arange(0, len(points), 7)
    force = np.zeros(len(points))
    force[index] = 1.0
    some = mesh.subset(index).displacement(np.ones(len(index)))
    assert some == pytest.approx(mesh.displacement(force)[index], rel=1e-12)


def test_kernel_near_zero():
    value, slope, curvature = smooth_kernel(np.array([0.0, 1e-4, 0.01]), 2.0)
    assert value[:2] == pytest.approx(4.0 / np.sqrt(np.pi), rel=1e-7)
    assert slope == pytest.approx(curvature, rel=1e-3)  # isotropic at 0
    assert slope[0] == pytest.approx(-16.0 / 3.0 * 2.0 / np.sqrt(np.pi), rel=1e-12)


@pytest.mark.parametrize("r", [0.05, 0.3, 1.0, 4.0])
def test_kernel_derivatives(r):
    h = 1e-4
    below, here, above = (smooth_kernel(np.array([r + d]), 2.0)[0][0] for d in (-h, 0.0, h))
    _, slope, curvature = smooth_kernel(np.array([r]), 2.0)
    # Central differences: truncation 1e-7, rounding 1e-8 in the second.
    assert slope[0] == pytest.approx((above - below) / (2 * h * r), rel=1e-5)
    assert curvature[0] == pytest.approx((above - 2 * here + below) / h**2, rel=1e-5)
