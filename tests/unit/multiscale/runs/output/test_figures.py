"""Maps are drawn in the unit of their size, and show what the micro model uses."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.histories import history_of, load_step
from matplotlib.figure import Figure

from patchlaw.geometry import Asperities, PatchGrid, Spectrum, find_asperities, synthesise
from patchlaw.multiscale.results.contacts import ContactRecord, ContactScales
from patchlaw.multiscale.results.figures.contact import contact_figure, contact_maps
from patchlaw.multiscale.results.figures.curves import history_figure, wear_figure
from patchlaw.multiscale.results.figures.style import draw_pressures
from patchlaw.multiscale.results.figures.surface import MOST_SUMMITS, surface_figure


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
    assert axes.get_title() == "24 × 20 heights; lines: patches"
    assert axes.get_legend() is None and len(axes.get_lines()) == 3  # borders of patches


@pytest.mark.parametrize(("side", "unit", "end"), [(0.48, "µm", 480.0), (2.0, "mm", 2.0)])
def test_maps_of_contact_have_the_same_unit(side, unit, end):
    record = contact(
        step=1, force_N=2.5e-7, lengths_mm=(side, side), plastic_depth_mm=None, unloading=False
    )
    figure = contact_figure(record)
    for axes in figure.axes[:2]:
        assert axes.get_xlabel() == f"x [{unit}]" and axes.get_xlim() == (0.0, pytest.approx(end))
        (image,) = axes.get_images()
        assert image.get_extent() == pytest.approx([0.0, end, 0.0, end])
    assert figure._suptitle.get_text() == "load step 1: approach 1 µm, force 250 nN, 1 spot"


def test_areas_of_spots_have_a_handy_unit():
    """One of 100 µm², and one as large as the face."""
    whole = contact(spots=np.array([[0.1, 0.1, 1.0, 2.0, 1.0]]))
    for record, unit in ((contact(), "µm²"), (whole, "mm²")):
        labels = [axes.get_xlabel() for axes in contact_figure(record).axes]
        assert f"area of a spot [{unit}]" in labels


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


def contact(**changes):
    given = dict(
        step=2, approach_mm=1e-3, force_N=2.0, lengths_mm=(1.0, 1.0),
        spots=np.array([[0.1, 0.1, 1e-4, 2.0, 1.0]]), pressure_MPa=np.eye(4),
        gap_mm=1.0 - np.eye(4), plastic_depth_mm=1e-3 * np.eye(4), unloading=True,
    )  # fmt: skip
    none = np.zeros((4, 4))
    empty = dict(force_N=0.0, spots=np.zeros((0, 5)), pressure_MPa=none, gap_mm=1.0 + none)
    if changes.pop("empty", False):
        given |= empty
    return ContactRecord(**(given | changes))


def titles_and_texts(figure):
    shown = [axes.get_title() for axes in figure.axes if axes.get_title()]
    return shown, [text.get_text() for axes in figure.axes for text in axes.texts]


def test_plastic_depths_are_drawn_and_unloading_is_said():
    figure = contact_figure(contact())
    assert figure._suptitle.get_text().startswith("load step 2, unloading: approach 1 µm")
    titles, texts = titles_and_texts(figure)
    assert "plastic depth, at most 1 µm" in titles and texts == []
    image = figure.axes[2].get_images()[0]
    np.testing.assert_allclose(image.get_array().filled(0.0), np.eye(4))  # in µm
    elastic, _ = titles_and_texts(contact_figure(contact(plastic_depth_mm=None)))
    assert not any("plastic" in title for title in elastic)


def test_what_bears_the_hardness_has_a_colour_of_its_own():
    """Of a map in which nearly all cells bear one pressure a scale of colours shows nothing."""
    pressure = np.array([[2e3, 2e3, 0.0], [150.0, 2e3, 0.0]])
    record = contact(pressure_MPa=pressure, gap_mm=1.0 - pressure, plastic_depth_mm=1e-3 * pressure)
    axes = contact_figure(record).axes[0]
    assert axes.get_title() == "75 % of the contact, in grey, bears 2 GPa"
    (image,) = axes.get_images()
    grey = tuple(image.get_cmap().get_over())
    shown = image.to_rgba(image.get_array())
    assert [tuple(one) == grey for one in shown[0]] == [True, False]  # the second cell along x
    assert [tuple(one) == grey for one in shown[1]] == [True, True]
    elastic = contact(pressure_MPa=pressure, gap_mm=1.0 - pressure, plastic_depth_mm=None)
    assert contact_figure(elastic).axes[0].get_title() == "contact pressure, at most 2 GPa"


def test_no_force_says_so_instead_of_an_empty_map():
    figure = contact_figure(contact(empty=True))
    assert figure._suptitle.get_text().endswith("force 0 N, no contact")
    titles, texts = titles_and_texts(figure)
    assert "gap; no contact" in titles
    assert texts == ["no contact:\nthe force at load step 2 is zero", "no spots", "none"]
    of_spots = contact(empty=True, pressure_MPa=None, gap_mm=None, plastic_depth_mm=None)
    assert titles_and_texts(contact_figure(of_spots))[1][0].startswith("no contact")
    axes = Figure().add_subplot()
    draw_pressures(axes, PatchGrid(grid=(2, 2), lengths=(1.0, 1.0)), np.zeros(4))
    assert axes.texts[-1].get_text() == "no contact"


def test_several_contacts_share_their_colours():
    low, high = contact(), contact(pressure_MPa=3.0 * np.eye(4), gap_mm=5.0 * (1.0 - np.eye(4)))
    scales = ContactScales.of([low, high, contact(empty=True)])
    assert scales == pytest.approx((3.0, 5.0, 1e-3, 1.0))
    ends = [
        [axes.get_images()[0].get_clim()[1] for axes in contact_maps(one, scales).axes[:3]]
        for one in (low, high)
    ]
    assert ends[0] == ends[1] == pytest.approx([3.0, 5.0e3, 1.0])  # MPa, µm, µm
    own = contact_figure(low).axes[0].get_images()[0]
    assert own.get_clim()[1] == pytest.approx(1.0)


def loaded(loads, stiffness):
    """Return a history of pairs of force [N] and approach [mm] on 1 mm²; None as stiffness leaves
    curves between load steps unknown."""
    return history_of(
        load_step(
            number, approach_mm=approach, force_N=force, mean_pressure_MPa=force,
            contact_area_fraction=0.01 * force, mean_separation_mm=0.01 - approach,
            approach_stiffness_N_per_mm=stiffness, force_error_N=0.0,
            approach_error_mm=1e-4 * number,
        )
        for number, (force, approach) in enumerate(loads, 1)
    )  # fmt: skip


CYCLE = [(1.0, 1e-3), (2.0, 2e-3), (1.0, 1.5e-3), (0.0, 1e-3), (3.0, 3e-3)]


def test_unloading_is_dashed():
    history = loaded(CYCLE, 1500.0)
    assert history.unloading.tolist() == [False, False, True, True, False]
    force = history_figure(history, "mine").axes[0]
    curves = [line for line in force.lines if len(line.get_xdata()) > 2]
    ends = [line.get_ydata()[[0, -1]].tolist() for line in curves if line.get_marker() == "None"]
    assert ends == [[0.0, 1.0], [1.0, 2.0], [2.0, 1.0], [1.0, 0.0], [0.0, 3.0]]
    looks = [line.get_linestyle() for line in curves if line.get_marker() == "None"]
    assert looks == ["-", "-", "--", "--", "-"]
    points = [bars.lines[0] for bars in force.containers]
    assert [line.get_ydata().tolist() for line in points] == [[1.0, 2.0, 3.0], [1.0, 0.0]]
    assert [text.get_text() for text in force.get_legend().texts] == ["mine", "unloading"]
    headings, rows = history.table("curve")
    assert headings[:2] == ["step", "load"]
    assert [row[1] for row in rows] == ["loading"] * 2 + ["unloading"] * 2 + ["loading"]
    rising = loaded(CYCLE[:2], 1500.0)
    assert rising.table("curve")[0][1].startswith("approach")
    assert history_figure(rising, "mine").axes[0].get_legend() is None


def test_load_steps_without_any_force_stand_at_zero():
    """No force tells the nominal area then, which pressures refer to."""
    force = history_figure(loaded([(0.0, 1e-3), (0.0, 2e-3)], None), "mine").axes[0]
    np.testing.assert_allclose(force.lines[0].get_xydata(), [(1.0, 0.0), (2.0, 0.0)])


def test_nothing_is_drawn_between_load_steps_where_nothing_is_known():
    force, area, _ = history_figure(loaded(CYCLE, None), "mine").axes
    for axes in (force, area):  # first touch and points alone
        assert all(len(line.get_xdata()) == 1 or line.get_ls() == "None" for line in axes.lines)


def test_points_have_their_error_bars():
    force, *_ = history_figure(loaded(CYCLE[:2], 1500.0), "mine").axes
    (bars,) = force.containers
    (across,) = bars.lines[2]
    widths = [np.ptp(segment[:, 0]) for segment in across.get_segments()]
    assert widths == pytest.approx([0.2, 0.4])  # ± 0.1 and 0.2 µm


def test_load_steps_under_one_load_are_one_point():
    """As under a shear, which changes neither force nor approach."""
    force, *_ = history_figure(loaded([*CYCLE[:2], *CYCLE[1:2] * 5], 1500.0), "mine").axes
    (bars,) = force.containers
    assert bars.lines[0].get_ydata().tolist() == [1.0, 2.0]
    assert [text.get_text() for text in force.texts] == ["steps 2 to 7"]
    beside = [(2.0, 1.001 * CYCLE[1][1])] * 3  # words on both points would stand on each other
    force, *_ = history_figure(loaded([*CYCLE[:2], *CYCLE[1:2] * 5, *beside], 1500.0), "mine").axes
    assert [text.get_text() for text in force.texts] == ["steps 2 to 10"]


def test_what_vanishes_as_surfaces_wear_is_drawn_from_zero_on():
    """As a mean pressure that falls to nothing, or a leak that closes."""
    given = loaded([(1.0, 1e-3), (1.0, 2e-3), (0.0, 3e-3)], None)
    steps = [replace(one, slid_mm=1.0 * k) for k, one in enumerate(given.steps)]
    for axes in wear_figure(replace(given, steps=tuple(steps)), "mine").axes:
        assert axes.get_ylim()[0] == 0.0


def test_panels_over_the_distance_slid_end_alike_and_show_what_was_before():
    """A stiffness is not known in full contact; dotted lines lie far from what has worn."""
    given = loaded([(1.0, 1e-3)] * 4, None)
    known = {"peak_pressure_MPa": (9e3, 90.0, 80.0, 70.0), "worn_depth_mm": (None, 1e-6, 1e-3, 1.0)}
    known["interface_stiffness_MPa_per_mm"] = (1.0, 2.0, None, None)
    steps = [
        replace(one, slid_mm=slid, **{name: of[k] for name, of in known.items()})
        for k, (one, slid) in enumerate(zip(given.steps, (0.0, 1.0, 30.0, 1e3), strict=True))
    ]
    panels = wear_figure(replace(given, steps=tuple(steps)), "mine").axes
    assert {axes.get_xscale() for axes in panels} == {"log"}
    assert len({axes.get_xlim() for axes in panels}) == 1
    assert panels[0].get_yscale() == "log"
