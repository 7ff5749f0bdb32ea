"""All figures have one style, whoever draws them and whatever matplotlib is set to elsewhere."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import rc_context, rcParams
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

from patchlaw.geometry import PatchGrid, Spectrum, roughness, synthesise
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.contact import draw_gaps
from patchlaw.multiscale.results.figures.curves import draw_points
from patchlaw.multiscale.results.figures.style import (
    coarsened,
    colour_bar,
    draw_pressures,
    map_axes,
    place_colours,
)
from patchlaw.multiscale.results.figures.surface import draw_spectrum


def png_chunks(content):
    """Yield name and data of the chunks of a PNG file."""
    place = 8
    while place < len(content):
        (length,) = struct.unpack(">I", content[place : place + 4])
        yield content[place + 4 : place + 8], content[place + 8 : place + 8 + length]
        place += length + 12


def drawn(width=style.ONE_COLUMN):
    with style.styled():
        figure = style.new_figure(width, 2.0)
        figure.add_subplot().plot([0.0, 1.0], [0.0, 1.0])
    return figure


def test_files_have_200_dots_an_inch_and_an_svg_beside(tmp_path):
    path = style.save(drawn(), tmp_path / "new" / "curve.png")
    chunks = dict(png_chunks(path.read_bytes()))
    assert struct.unpack(">II", chunks[b"IHDR"][:8]) == (700, 400)  # 3.5 by 2 inches
    across, down, unit = struct.unpack(">IIB", chunks[b"pHYs"])
    assert across == down == round(200 / 0.0254) and unit == 1  # dots a metre
    text = path.with_suffix(".svg").read_text()
    assert 'width="252pt"' in text and "<dc:date>" not in text


def test_the_same_figure_gives_the_same_bytes():
    assert style.encoded(drawn()) == style.encoded(drawn())


def test_no_ticks_are_made_out_of_view():
    _, (axes,) = style.panels(1, 1, 2.0)
    axes.set(xlim=(0.3, 9.7), ylim=(7.0, -1.0))
    assert list(axes.get_xticks()) == [2.0, 4.0, 6.0, 8.0]
    assert list(axes.get_yticks()) == [0.0, 2.0, 4.0, 6.0]


def test_style_holds_when_the_figure_is_written_elsewhere():
    expected = style.encoded(drawn())
    with rc_context({"xtick.labelsize": 30, "font.size": 30, "savefig.dpi": 50}):
        assert style.encoded(drawn()) == expected
        assert rcParams["font.size"] == 30


def test_logarithmic_axes_say_so_once():
    figure = drawn()
    (axes,) = figure.axes
    axes.set(xscale="log", xlabel="pressure [MPa]", ylabel="area [%]", xlim=(1.0, 10.0))
    assert style.encoded(figure) == style.encoded(figure)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("pressure [MPa] (log)", "area [%]")


@pytest.mark.parametrize("high", [3.0, 50.0, 2e3])
def test_logarithmic_axes_have_no_ticks_without_labels(high):
    axes = style.new_figure(style.ONE_COLUMN, 2.0).add_subplot()
    axes.set(xscale="log", xlim=(1.0, high))
    assert len(axes.get_xticks(minor=True))
    style.logarithmic(axes.xaxis)
    assert not len(axes.get_xticks(minor=True)) and len(axes.get_xticks())


def test_scripts_draw_in_the_style():
    with rc_context():
        style.use_style()
        axes = style.new_figure(style.FULL_WIDTH, 2.0).add_subplot()
        assert axes.plot([0.0, 1.0])[0].get_color() == style.BLUE
        assert axes.xaxis.label.get_size() == 8.0


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (4.0, 1.0), (0.2, 0.9)])
def test_colour_bars_are_as_tall_as_their_axes(lengths):
    figure = style.new_figure(style.FULL_WIDTH, 3.0)
    left, right = figure.subplots(1, 2)
    for axes in (left, right):
        map_axes(axes, lengths)
    bar = colour_bar(left.imshow(np.eye(2), extent=(0, 1, 0, 1), aspect="equal"), left, "p [MPa]")
    figure.draw_without_rendering()
    beside, box = bar.ax.get_window_extent(), left.get_window_extent()
    assert (beside.y0, beside.y1) == pytest.approx((box.y0, box.y1), abs=0.5)
    assert beside.x0 > box.x1 and bar.ax.get_tightbbox().x1 < right.get_tightbbox().x0


def test_open_patches_are_white_and_not_numbered():
    axes = style.new_figure(3.0, 3.0).add_subplot()
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    image = draw_pressures(axes, patches, np.array([0.0, 0.012, 934.0, 5.0]))
    image.update_scalarmappable()
    # cells are drawn row by row along x: patches 0, 2, 1, 3
    assert image.get_array().ravel().tolist() == [None, 934.0, 0.012, 5.0]
    assert image.get_facecolor()[0][3] == 0.0 and axes.get_facecolor() == (1.0, 1.0, 1.0, 1.0)
    assert [text.get_text() for text in axes.texts] == ["", "0.012", "934", "5"]


def test_places_have_colours_of_their_own():
    shares = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2), axis=-1).reshape(-1, 2)
    colours = place_colours(shares)
    assert colours.shape == (25, 3) and (colours >= 0).all() and (colours <= 1).all()
    apart = np.linalg.norm(colours[:, None] - colours, axis=-1) + np.eye(25)
    assert apart.min() > 0.1
    luminance = colours @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(luminance.reshape(5, 5), axis=0) > 0.02).all()  # lighter along y


def test_coarse_maps_keep_the_smallest_spot():
    field = np.zeros((1000, 700))
    field[501, 77] = 3.0
    shown = coarsened(field, largest=True, most=100)
    assert shown.shape == (100, 70) and shown[50, 7] == 3.0 and shown.sum() == 3.0
    assert coarsened(field, largest=False, most=100).sum() == pytest.approx(0.03)


@pytest.mark.parametrize(("waves", "labels"), [((2, 10), {"20", "50"}), ((2, 400), {"100"})])
def test_wavenumbers_are_labelled_however_short_their_range(waves, labels):
    grid = (2 * waves[1] + 2,) * 2
    made = Spectrum(hurst=0.8, waves=waves, rms_slope=0.1, seed=1)
    surface = synthesise(made, grid=grid, lengths=(1.0, 1.0))
    figure = style.new_figure(style.ONE_COLUMN, 2.0)
    axes = figure.subplots()
    draw_spectrum(axes, surface, roughness(surface))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    low, high = axes.get_xlim()
    shown = {
        label.get_text()
        for place, label in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
        if low <= place <= high
    }
    assert labels <= shown


def test_dollars_of_users_are_no_formulas():
    name = r"$\no{formula}$"
    axes = style.new_figure(style.ONE_COLUMN, 2.0).subplots()
    axes.plot([0.0, 1.0], label=style.literal(name))
    (label,) = axes.legend().get_texts()
    assert label._preprocess_math(label.get_text()) == (name, False)


def test_bars_of_what_cannot_be_negative_end_at_zero():
    axes = style.new_figure(style.ONE_COLUMN, 2.0).add_subplot()
    one, every = np.array([1.0]), np.array([True])
    draw_points(axes, one, one, (3.0 * one, 4.0 * one), ~every, every, {"color": "k", "label": ""})
    along, up = (bars.get_segments()[0] for bars in axes.collections)
    np.testing.assert_array_equal(along, [[-2.0, 1.0], [4.0, 1.0]])  # as of approaches
    np.testing.assert_array_equal(up, [[1.0, 0.0], [1.0, 5.0]])


def test_where_no_node_lies_is_no_contact():
    """Midpoints of edges, which the nodes with forces of quadratic triangles are, leave corners."""
    x, y = np.array([0.5, 1.0, 0.5, 0.0]), np.array([0.0, 0.5, 1.0, 0.5])
    figure = style.new_figure(style.ONE_COLUMN, style.ONE_COLUMN)
    axes = figure.add_subplot()
    nodes = {"x_mm": x, "y_mm": y, "pressure_MPa": 0.0 * x, "gap_mm": 0.0 * x + 1e-3}
    draw_gaps(axes, SimpleNamespace(**nodes, lengths_mm=(1.0, 1.0)), 2e-3)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    colours = np.asarray(canvas.buffer_rgba())[..., :3].reshape(-1, 3)
    orange = 255.0 * np.array(to_rgb(style.VERMILLION))
    assert not (np.abs(colours - orange).max(axis=1) < 2.0).any()
