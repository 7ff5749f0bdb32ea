"""Maps are drawn in the unit of their size, and show what the micro model uses."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from geometry.asperities import find_asperities
from geometry.patches import PatchGrid
from geometry.spectrum import Spectrum
from geometry.synthesis import synthesise
from multiscale.figures.contact import contact_figure
from multiscale.output.figures import draw_pressures, surface_figure


@pytest.mark.parametrize(
    ("side", "unit", "end"), [(0.02, "µm", 20.0), (0.48, "µm", 480.0), (1.0, "mm", 1.0)]
)
def test_maps_below_a_millimetre_are_drawn_in_micrometres(side, unit, end):
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_height=1e-3 * side)
    surface = synthesise(spectrum, grid=(24, 24), lengths=(side, side))
    summits, patches = find_asperities(surface), PatchGrid(grid=(2, 2), lengths=(side, side))
    axes = surface_figure(surface, summits, patches).axes[0]
    assert axes.get_xlabel() == f"x [{unit}]" and axes.get_xlim() == (0.0, pytest.approx(end))
    drawn = axes.get_lines()[2]  # after the two borders
    np.testing.assert_allclose(drawn.get_xdata(), summits.x * (end / side))
    axes = Figure().add_subplot()
    draw_pressures(axes.figure, axes, patches, np.arange(4.0))
    assert axes.get_ylabel() == f"y [{unit}]" and axes.get_ylim() == (0.0, pytest.approx(end))
    assert axes.texts[0].get_position() == pytest.approx((end / 4, end / 4))


def test_summits_are_left_out_where_they_are_not_used():
    surface = synthesise(
        Spectrum(hurst=0.8, waves=(2, 6), rms_height=1e-3), grid=(24, 20), lengths=(1.0, 1.0)
    )
    axes = surface_figure(surface, None, PatchGrid(grid=(3, 2), lengths=(1.0, 1.0))).axes[0]
    assert axes.get_title() == "24 × 20 heights, 3 × 2 patches"
    assert axes.get_legend() is None and len(axes.get_lines()) == 3  # borders of patches


@pytest.mark.parametrize(("side", "unit", "label"), [(0.48, "µm", "240"), (2.0, "mm", "1")])
def test_maps_of_contact_have_the_same_unit(side, unit, label):
    record = SimpleNamespace(
        step=1, approach_mm=1e-3, force_N=1.0, spots=(), lengths_mm=(side, side),
        pressure_MPa=np.eye(4), gap_mm=1.0 - np.eye(4), area_mm2=np.array([1e-4]),
    )  # fmt: skip
    axes = contact_figure(record).axes[0]
    assert axes.get_xlabel() == f"x [{unit}]"
    assert axes.xaxis.get_major_formatter()(side / 2.0, 0) == label
