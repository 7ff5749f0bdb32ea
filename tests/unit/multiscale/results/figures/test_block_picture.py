"""The picture of a rough block in contact."""

import numpy as np
import pytest

from patchlaw.geometry import Surface
from patchlaw.multiscale.results.figures.surface import BlockView, block_figure


def rough(grid=(48, 40), lengths=(1.0, 0.8), scale=1e-3):
    heights = scale * np.random.default_rng(2).normal(size=grid)
    return Surface(heights=heights, lengths=lengths)


def pressed(grid, *cells):
    pressure = np.zeros(grid)
    for number, cell in enumerate(cells):
        pressure[cell] = 300.0 + number
    return pressure


@pytest.mark.parametrize(("column", "turned"), [(5, False), (33, True)])
def test_the_cut_goes_along_the_most_loaded_row_and_the_larger_part_is_shown(column, turned):
    pressure = pressed((48, 40), (10, column), (30, column), (12, 20))
    view = BlockView(rough(), pressure, 0.3)
    assert view.turned == turned
    assert view.pressure[:, 0].max() == 301.0
    assert view.pressure.shape[1] > 20
    assert view.relief.shape == (49, view.pressure.shape[1] + 1)
    # the largest stress is below the largest pressure, on the same side
    assert view.stress.max(axis=1).argmax() == (47 - 30 if turned else 30)


def test_fine_surfaces_show_the_largest_pressure_of_blocks():
    pressure = pressed((600, 600), (301, 17))
    view = BlockView(rough((600, 600), (1.0, 1.0)), pressure, 0.3)
    assert max(view.pressure.shape) <= 256
    assert view.pressure.max() == 300.0


@pytest.mark.parametrize(("scale", "said"), [(1e-5, "exaggerated 1000 times"), (0.1, "to scale")])
def test_exaggeration_is_said(scale, said):
    figure = block_figure(rough(scale=scale), pressed((48, 40), (3, 3)), 0.3, title="step 3")
    texts = [text.get_text() for text in figure.texts]
    assert texts[0] == "step 3"
    assert texts[1].endswith(said)
    labels = {text.get_text() for text in figure.axes[0].texts}
    assert {"x [µm]", "y [µm]", "depth [µm]", "1000"} <= labels
    bars = [axes.get_ylabel() for axes in figure.axes[1:]]
    assert bars == ["contact pressure [MPa]", "von Mises stress [MPa]\n(square-root scale)"]


def test_a_surface_without_contact_is_drawn():
    figure = block_figure(rough(), np.zeros((48, 40)), 0.3)
    figure.canvas.draw()
    assert [axes.get_ylim() for axes in figure.axes[1:]] == [(0.0, 1.0)] * 2  # scales of nothing
