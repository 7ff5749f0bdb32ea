"""Maps are drawn in the unit of their size, and show what the micro model uses."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from geometry.asperities import Asperities, find_asperities
from geometry.patches import PatchGrid
from geometry.spectrum import Spectrum, synthesise
from multiscale.figures.contact import contact_figure
from multiscale.figures.maps import draw_pressures
from multiscale.figures.surface import MOST_SUMMITS, surface_figure


@pytest.mark.parametrize(
    ("side", "unit", "end"), [(0.02, "µm", 20.0), (0.48, "µm", 480.0), (1.0, "mm", 1.0)]
)
def test_maps_below_a_millimetre_are_drawn_in_micrometres(side, unit, end):
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_height=1e-3 * side)
    surface = synthesise(spectrum, grid=(24, 24), lengths=(side, side))
    summits, patches = find_asperities(surface), PatchGrid(grid=(2, 2), lengths=(side, side))
    axes = surface_figure(surface, summits, patches).axes[0]
    assert axes.get_xlabel() == f"x [{unit}]" and axes.get_xlim() == (0.0, pytest.approx(end))
    drawn = axes.get_lines()[2]  # after the borders of the patches
    np.testing.assert_allclose(np.sort(drawn.get_xdata()), np.sort(summits.x) * (end / side))
    axes = Figure().add_subplot()
    draw_pressures(axes, patches, np.arange(4.0))
    assert axes.get_ylabel() == f"y [{unit}]" and axes.get_ylim() == (0.0, pytest.approx(end))
    assert axes.texts[1].get_position() == pytest.approx((end / 4, 3 * end / 4))


def test_summits_are_left_out_where_they_are_not_used():
    surface = synthesise(
        Spectrum(hurst=0.8, waves=(2, 6), rms_height=1e-3), grid=(24, 20), lengths=(1.0, 1.0)
    )
    axes = surface_figure(surface, None, PatchGrid(grid=(3, 2), lengths=(1.0, 1.0))).axes[0]
    assert axes.get_title() == "24 × 20 heights"
    assert axes.get_legend() is None and len(axes.get_lines()) == 3  # borders of patches


@pytest.mark.parametrize(("side", "unit", "end"), [(0.48, "µm", 480.0), (2.0, "mm", 2.0)])
def test_maps_of_contact_have_the_same_unit(side, unit, end):
    record = SimpleNamespace(
        step=1, approach_mm=1e-3, force_N=2.5e-7, spots=(), lengths_mm=(side, side),
        pressure_MPa=np.eye(4), gap_mm=1.0 - np.eye(4), area_mm2=np.array([1e-4]),
    )  # fmt: skip
    figure = contact_figure(record)
    for axes in figure.axes[:2]:
        assert axes.get_xlabel() == f"x [{unit}]" and axes.get_xlim() == (0.0, pytest.approx(end))
        (image,) = axes.get_images()
        assert image.get_extent() == pytest.approx([0.0, end, 0.0, end])
    assert figure._suptitle.get_text() == "load step 1: approach 1 µm, force 250 nN, 0 spots"


def test_of_many_summits_the_highest_are_marked():
    rng = np.random.default_rng(5)
    count = 20_000
    x, y, z = rng.random((3, count))
    summits = Asperities(
        x=x, y=y, z=z, radius_major=np.ones(count), radius_minor=np.ones(count),
        angle=np.zeros(count), lengths=(1.0, 1.0), highest=1.0, mean_height=0.0,
        border_x=np.zeros(2), border_y=np.array([0.25, 0.5]), border_z=np.array([0.1, 0.9999]),
    )  # fmt: skip
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_height=1e-3)
    surface = synthesise(spectrum, grid=(24, 24), lengths=(1.0, 1.0))
    axes = surface_figure(surface, summits, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))).axes[0]
    assert axes.get_title() == f"the {MOST_SUMMITS} highest of 20 000 summits"
    drawn, edge = axes.get_lines()
    assert sorted(drawn.get_xdata()) == sorted(x[np.argsort(z)[-MOST_SUMMITS:]])
    assert edge.get_ydata().tolist() == [0.5]


def test_surface_is_shown_with_heights_spectrum_and_bearing_ratio():
    spectrum = Spectrum(hurst=0.8, waves=(2, 10), rms_height=1e-3)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    whole = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    _, heights, spectral, bearing = surface_figure(surface, None, whole, spectrum).axes
    (bars,) = heights.patches
    shares, edges, _ = bars.get_data()
    assert (shares * np.diff(edges)).sum() == pytest.approx(1.0)
    normal = heights.get_lines()[0]
    h, share = normal.get_data()
    assert np.sum(share) * (h[1] - h[0]) == pytest.approx(1.0, abs=0.02)
    found, target = spectral.get_lines()
    # phases are random, amplitudes are not: rings of the surface lie on the target
    np.testing.assert_allclose(
        np.log(found.get_ydata()[2:6]),
        np.interp(np.log(found.get_xdata()[2:6]), *np.log(target.get_data())),
        atol=0.15,  # a ring is one wave wide
    )
    ratio, height = bearing.get_lines()[0].get_data()
    for share in (10.0, 50.0, 90.0):
        above = np.mean(
            1e3 * (surface.heights - surface.mean_height) > np.interp(share, ratio, height)
        )
        assert 100 * above == pytest.approx(share, abs=0.1)
