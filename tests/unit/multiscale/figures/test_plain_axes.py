"""Plain axes, and files of figures, look as matplotlib's own do."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from patchlaw.multiscale.figures import style
from patchlaw.multiscale.figures.plain_axes import PlainAxes
from patchlaw.multiscale.figures.style import png_of


def drawn(axes_class, draw):
    """Return the pixels of a figure with one panel."""
    with style.styled():
        figure = style.StyledFigure(figsize=(4.0, 3.0), dpi=style.DOTS_PER_INCH)
        axes = figure.add_axes((0.3, 0.3, 0.5, 0.5), axes_class=axes_class)
        draw(axes)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).astype(int)


def linear(axes):
    axes.plot([0.0, 1.0], [-120.0, 3.0])
    axes.set(xlabel="abscissa", ylabel="ordinate", xlim=(1.1, -0.1))


def logarithmic(axes):
    axes.loglog([1.0, 40.0], [1e-3, 1.0])
    axes.set(xlabel="abscissa", ylabel="ordinate")
    style.plain_logarithmic(axes.xaxis)


def few_decades(axes):
    axes.plot([0.0, 1.0], [2.0, 6.0])
    axes.set(yscale="log", ylabel="ordinate")


def multiples(axes):
    axes.plot([0.0, 3e-9], [1e7, 2e7])
    axes.set(xlabel="abscissa", ylabel="ordinate")


def on_the_right(axes):
    axes.yaxis.set(label_position="right", ticks_position="right")
    axes.set(ylabel="ordinate", yticks=[0.2, 0.7], yticklabels=["low", "high"], xticks=[])
    axes.grid(False)


@pytest.mark.parametrize("draw", [linear, logarithmic, few_decades, multiples, on_the_right])
def test_plain_axes_look_as_those_of_matplotlib(draw):
    plain, usual = (drawn(kind, draw) for kind in (PlainAxes, Axes))
    differing = np.count_nonzero(np.abs(plain - usual).max(axis=2) > 40)
    ink = np.count_nonzero(np.abs(usual - 255).max(axis=2) > 40)
    # ticks that matplotlib rounds to another pixel; a label that moves by one makes 10 %
    assert differing < 0.02 * ink and ink > 2000


def test_box_of_plain_axes_is_around_their_labels():
    with style.styled():
        figure, (axes, _) = style.panels(1, 2, 2.0)
        linear(axes)
        figure.draw_without_rendering()
    box, label = axes.get_tightbbox(), axes.yaxis.label.get_window_extent()
    assert box.x0 == pytest.approx(label.x0) and label.x1 < axes.bbox.x0


def test_files_hold_the_pixels_that_were_drawn():
    figure, (axes,) = style.panels(1, 1, 2.0)
    linear(axes)
    content = png_of(figure, 120)
    with Image.open(BytesIO(content)) as image:
        read = np.asarray(image.convert("RGBA"))
        assert image.info["dpi"] == pytest.approx((120.0, 120.0), abs=0.02)  # whole dots a metre
    assert np.array_equal(read, np.asarray(figure.canvas.buffer_rgba()))
