"""Pressures of a figure have one unit, a face stays within its axes, notebooks show figures."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.text import Text

from patchlaw.multiscale.results.contacts import ContactRecord, ContactScales
from patchlaw.multiscale.results.figures.contact import contact_figure, face_figure


def record(peak):
    """A contact in which one cell of a thousand bears far more than the others."""
    pressure = np.zeros((40, 40))
    pressure[:20] = 3.1e3
    pressure[0, 0] = peak
    spots = np.array([[0.1, 0.2, 0.5, 1e3, peak]])
    centres = (np.arange(40) + 0.5) / 40
    return ContactRecord(
        step=1, approach_mm=1e-3, force_N=1e3, lengths_mm=(1.0, 1.0), spots=spots,
        x_mm=centres, y_mm=centres, pressure_MPa=pressure, gap_mm=np.where(pressure > 0, 0.0, 1e-3),
    )  # fmt: skip


@pytest.mark.parametrize(("peak", "unit"), [(14.1e3, "GPa"), (9.1e3, "GPa"), (14.1e4, "GPa")])
def test_pressures_of_a_figure_have_one_unit(peak, unit):
    figure = contact_figure(record(peak))
    texts = [text.get_text() for text in figure.findobj(Text)]
    told = [text for text in texts if text.endswith(("Pa", "Pa]"))]
    assert len(told) == 3  # the title of the map, its colour bar, the shares
    assert all(unit in text for text in told)
    scales = ContactScales.of([record(peak)])
    assert scales.pressure < 0.5 * scales.spot  # the end of the bar alone may suit another unit


def test_a_figure_is_a_picture_in_a_notebook():
    shown = contact_figure(record(5e3))._repr_png_()
    assert shown.startswith(b"\x89PNG") and len(shown) < 100_000


@pytest.mark.parametrize("lengths", [(40.0, 4.0), (3.0, 30.0), (1.0, 1.0)])
def test_a_face_of_any_outline_fills_its_axes_and_stays_within(lengths):
    """Facets of any size, of which none is missing: their polygons cover the face."""
    x, y = (length * np.linspace(0.0, 1.0, 31) ** 2 for length in lengths)
    low, high = np.meshgrid(x[:-1], y[:-1]), np.meshgrid(x[1:], y[1:])
    around = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    facets = np.stack([np.column_stack([a.ravel(), b.ravel()]) for a, b in around], axis=1)
    pressures = np.maximum(facets[:, 0, 0] - 0.3 * lengths[0], 0.0)
    step = SimpleNamespace(approach_mm=1e-3, force_N=5.0, mean_pressure_MPa=2.0)
    axes = face_figure(facets, pressures, step).axes[0]
    paths = [path for one in axes.findobj(PolyCollection) for path in one.get_paths()]
    assert len(paths) >= 900
    corners = np.concatenate([path.vertices for path in paths[:900]])
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    assert np.allclose(np.ptp(corners, axis=0), np.ptp(limits, axis=1), rtol=1e-9)
    assert all(one.get_clip_on() for one in axes.findobj(PolyCollection))
