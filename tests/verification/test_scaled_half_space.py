"""Curvature at the scale of the contact and border asperities against half-space solutions."""

from functools import cache

import numpy as np
import pytest
from half_space_oracle import force_and_area, pressures

from geometry import PatchGrid, Spectrum, Surface, synthesise
from micro import ScaledModel

APPROACHES = np.array([4e-3, 8e-3, 14e-3, 20e-3, 26e-3])
PATCHES = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
SETS = {
    "set 1": {"waves": (2, 10)},
    "set 2": {"waves_x": (2, 7), "waves_y": (2, 12)},
}
ALL = [
    {"curvature": curvature, "border": border}
    for curvature in ("summit", "contact")
    for border in ("ignore", "include")
]


@cache
def solved(band, seed):
    """Return a surface, and its forces and areas by the oracle, shape (approaches, 2)."""
    spectrum = Spectrum(hurst=0.95, rms_slope=0.215, seed=seed, **SETS[band])
    surface = synthesise(spectrum, grid=(128, 128), lengths=(1.0, 1.0))
    p, exact = None, []
    for approach in APPROACHES:
        p = pressures(surface.heights, surface.highest - approach, start=p)
        exact.append(force_and_area(p))
    return surface, np.array(exact)


def errors(band, kind, options):
    """Return relative errors of force and area, shape (2, seeds, approaches)."""
    found = []
    for seed in (1, 2, 3, 5):
        surface, exact = solved(band, seed)
        model = ScaledModel(kind=kind, surface=surface, contact_modulus=1.0, **options)
        response = model.respond(APPROACHES, patches=PATCHES, mean_heights=[0.0])
        ours = np.stack([response.force, response.contact_area])
        found.append(ours / exact.T - 1.0)
    return np.swapaxes(found, 0, 1)


@pytest.mark.parametrize("band", ["set 1", pytest.param("set 2", marks=pytest.mark.long)])
def test_both_options_repair_the_elliptic_model(band):
    force, area = errors(band, "elliptic", ALL[-1])
    # Measured on 20 surfaces: 1 to 2.3 % (6 %) in force, 2 to 7 % in area; the oracle's 128² cells
    # add 1 % and a few per cent to the smallest contacts.
    assert np.sqrt(np.mean(force**2)) < 0.03 and np.abs(force).max() < 0.07
    assert np.sqrt(np.mean(area**2)) < 0.08


@pytest.mark.long
def test_each_option_does_its_part():
    bias = [errors("set 1", "elliptic", options).mean(axis=(1, 2)) for options in ALL]
    neither, border, curvature, both = np.array(bias)
    assert neither[0] < -0.04 and neither[1] < -0.1  # as low as the paper's model is known to be
    assert border[0] > neither[0] + 0.01 and curvature[0] > neither[0] + 0.01
    assert abs(both[0]) < 0.02
    assert curvature[1] > neither[1] + 0.05  # the area suffers from the curvature above all
    assert abs(both[1]) < 0.05


@pytest.mark.parametrize(
    ("centre", "force", "area"),
    [((0.5, 0.5), 0.01, 0.05), ((0.0, 0.5), 0.07, 0.12), ((0.0, 0.0), 0.11, 0.16)],
    ids=["whole", "half", "quarter"],
)
def test_summit_cut_by_the_border(centre, force, area):
    x = (np.arange(192) + 0.5) / 192
    heights = -((x[:, None] - centre[0]) ** 2 + (x - centre[1]) ** 2) / 0.6
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    exact = force_and_area(pressures(heights, surface.highest - 8e-3))
    state = ScaledModel(kind="elliptic", surface=surface, contact_modulus=1.0).solve(8e-3)
    # The whole one tells the oracle's error, the others what the module states.
    assert state.contacts.force.sum() == pytest.approx(exact[0], rel=force)
    assert state.contacts.area.sum() == pytest.approx(exact[1], rel=area)
