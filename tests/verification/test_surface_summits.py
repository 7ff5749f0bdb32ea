"""Places, heights and radii of summits converge to those of analytic surfaces."""

import numpy as np
import pytest

from patchlaw.geometry import Spectrum, Surface, find_asperities, synthesise
from patchlaw.geometry.spectrum import random_waves

GRIDS = (48, 96, 192)


def bump(x, y, place, radii, angle):
    """Return a summit that is no paraboloid and not symmetric, with known radii."""
    u = np.cos(angle) * (x - place[0]) + np.sin(angle) * (y - place[1])
    v = -np.sin(angle) * (x - place[0]) + np.cos(angle) * (y - place[1])
    shape = u**2 / radii[0] + v**2 / radii[1]
    return np.exp(-0.5 * shape) + 20.0 * u * v**2 * np.exp(-shape) + 15.0 * u**3 * np.exp(-shape)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.6, 2.5])
def test_place_height_radii_and_direction_converge(angle, periodic):
    place, radii = (0.5123, 0.4789), (0.012, 0.007)
    errors = {"place": [], "height": [], "radii": [], "direction": []}
    for n in GRIDS:
        x = (np.arange(n) + 0.5) / n
        heights = bump(x[:, None], x[None, :], place, radii, angle)
        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=periodic)
        asperities = find_asperities(surface)
        top = asperities.subset(np.argmax(asperities.z)[None])
        errors["place"].append(np.hypot(top.x[0] - place[0], top.y[0] - place[1]))
        errors["height"].append(abs(top.z[0] - 1.0))
        found = np.array([top.radius_major[0], top.radius_minor[0]])
        errors["radii"].append(np.abs(found / radii - 1.0).max())
        errors["direction"].append(abs(np.sin(top.angle[0] - angle)))
    rate = {name: np.log2(error[0] / error[-1]) / 2.0 for name, error in errors.items()}
    # spline: third order in the slope, so in the place, fourth in the height (the exact rates
    # depend on where the summit lies between samples); differences of one cell: second order
    assert rate["place"] > 2.5 and errors["place"][-1] < 1e-2 / GRIDS[-1]
    assert rate["height"] > 3.3 and errors["height"][-1] < 1e-6
    assert rate["radii"] == pytest.approx(2.0, abs=0.3) and errors["radii"][-1] < 0.01
    assert errors["direction"][-1] < 0.01
    if angle:  # on the axes the direction is exact by symmetry of the differences
        assert rate["direction"] > 1.7


def test_summits_of_a_random_surface_are_stationary_points_of_the_cosine_sum():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=4)
    waves = random_waves(spectrum, (1.0, 1.0))
    surface = synthesise(spectrum, grid=(256, 256), lengths=(1.0, 1.0))
    asperities = find_asperities(surface)
    q = 2.0 * np.pi * np.stack([waves.kx, waves.ky])
    angle = np.stack([asperities.x, asperities.y], axis=1) @ q + waves.phase
    weight = 2.0 * waves.amplitude
    z = np.cos(angle) @ weight
    slope = -np.einsum("kw,sw,w->sk", q, np.sin(angle), weight)
    hessian = -np.einsum("iw,jw,sw,w->sij", q, q, np.cos(angle), weight)
    curvature = -np.linalg.eigvalsh(hessian)[:, ::-1]
    # spline: (Q dx)⁴ with Q dx ≤ 0.25 at the shortest wave; 1e-7 mm of heights of 1e-2 mm
    np.testing.assert_allclose(asperities.z, z, atol=1e-7)
    assert np.abs(np.linalg.solve(hessian, slope[..., None])).max() < 1e-2 / 256  # of a cell
    # differences over one cell: (Q dx)²/12 = 0.5 % where the shortest waves bear the curvature,
    # relative to the sharper one
    found = np.stack([1.0 / asperities.radius_major, 1.0 / asperities.radius_minor], axis=1)
    assert np.all(np.abs(found - curvature) < 0.01 * curvature[:, 1:])
    assert np.all(found > 0.0)
