"""What load steps tell over the mean pressure: exponents, and the curve between load steps."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.histories import history_of, load_step

from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.results.figures.curves import over_pressure_figure
from patchlaw.multiscale.results.run_curves import over_pressure, pressure_between

AREA = 2.7


def history(pressure, **columns):
    """Return a history of given pressures on a face of 2.7 mm²."""
    columns = {"approach_mm": np.sqrt(pressure) * 1e-4, "mean_separation_mm": 1e-3} | columns
    columns = {name: np.broadcast_to(one, len(pressure)) for name, one in columns.items()}
    steps = [
        load_step(
            k + 1, force_N=AREA * p, mean_pressure_MPa=p, contact_area_fraction=1e-3 * p**0.93,
            **{name: None if np.isnan(one[k]) else float(one[k]) for name, one in columns.items()},
        )
        for k, p in enumerate(pressure)
    ]  # fmt: skip
    return history_of(steps, AREA)


def test_exponents_of_powers_are_exact():
    pressure = np.array([1.7, 3.1, 9.3, 41.0])
    found = over_pressure(
        history(
            pressure, interface_stiffness_N_per_mm=321.0 * pressure**1.24,
            interface_stiffness_error_N_per_mm=AREA,
        )
    )  # fmt: skip
    by_name = {one.quantity.name: one for one in found}
    assert list(by_name) == [
        "contact_area_fraction", "mean_separation_mm", "interface_stiffness_MPa_per_mm"
    ]  # fmt: skip
    stiffness = by_name["interface_stiffness_MPa_per_mm"]
    assert stiffness.text == "p^1.24 from 1.7 to 41 MPa"
    np.testing.assert_allclose(stiffness.laws[0].at(pressure), stiffness.values, rtol=1e-12)
    np.testing.assert_allclose(stiffness.errors, 1.0)
    assert by_name["contact_area_fraction"].text == "p^0.93 from 1.7 to 41 MPa"
    assert by_name["mean_separation_mm"].laws == ()


def test_what_bends_has_two_powers():
    pressure = np.geomspace(1.0, 100.0, 7)
    bent = 5.0 * np.where(pressure <= 10.0, pressure, 10.0**0.4 * pressure**0.6)
    steps = history(pressure, interface_stiffness_N_per_mm=bent)
    *_, one = over_pressure(steps)
    assert one.text == "p^1.00 from 1 to 4.64 MPa, p^0.60 from 10 to 100 MPa"
    figure = over_pressure_figure(steps, "concurrent")  # with a line for each of them
    figure.canvas.draw()
    title, panel, whole = figure.axes[2].title, figure.axes[2].bbox, figure.bbox
    assert title.get_text() == one.text.replace(", ", "\n")
    box = title.get_window_extent()
    assert box.y1 <= whole.y1 and box.x1 <= whole.x1 and box.y0 >= panel.y1


def test_what_follows_no_power_has_none_and_a_logarithmic_axis():
    """A leak falls as an exponential; two of its points in half of the range are no power."""
    pressure = np.array([3.0, 6.0, 9.0, 12.0, 18.0, 21.0])
    steps = history(pressure, interface_stiffness_N_per_mm=np.exp(-0.9 * pressure))
    *_, one = over_pressure(steps)
    assert one.laws == ()
    axes = over_pressure_figure(steps, "concurrent").axes[2]
    assert axes.get_yscale() == "log"
    assert axes.get_title() == ""


@pytest.mark.parametrize("pressure", [[5.0], [5.0, 5.0, 5.0], [0.0, 5.0], [5.0, 2.0], [0.0]])
def test_one_load_is_no_curve(pressure):
    assert over_pressure(history(np.array(pressure))) == []


def test_powers_are_those_of_the_first_rise():
    pressure = np.array([1.0, 4.0, 2.0, 4.0, 9.0])
    area = np.where([0, 0, 1, 1, 1], 0.5, 1e-2 * pressure)
    steps = history(pressure)
    steps = replace(steps, steps=tuple(
        replace(one, contact_area_fraction=float(share))
        for one, share in zip(steps, area, strict=True)
    ))  # fmt: skip
    first, *_ = over_pressure(steps)
    assert first.text == "p^1.00 from 1 to 4 MPa"
    assert first.back.tolist() == [False, False, True, True, True]


def test_powers_end_where_the_surfaces_wear():
    pressure = np.array([1.0, 4.0, 4.0, 8.0, 16.0])
    slid = np.array([0.0, 0.0, 3.0, 3.0, 5.0])
    stiffness = 7.0 * pressure**0.9 * (1.0 + slid)
    *_, one = over_pressure(history(pressure, interface_stiffness_N_per_mm=stiffness, slid_mm=slid))
    assert one.text == "p^0.90 from 1 to 4 MPa"


def test_full_contact_follows_no_power():
    pressure = np.array([1.0, 4.0, 8.0, 16.0])
    steps = history(pressure)
    area = 0.1 * pressure, np.ones(4) - 1e-16
    found = [
        over_pressure(replace(steps, steps=tuple(
            replace(one, contact_area_fraction=min(float(share), 1.0))
            for one, share in zip(steps, shares, strict=True)
        )))[0]
        for shares in area
    ]  # fmt: skip
    assert found[0].text == "p^1.00 from 1 to 8 MPa"
    assert found[1].laws == ()


def pressed(steps, seed):
    scene = {
        "surface": {
            "spectrum": {"hurst": 0.8, "waves": [2, 8], "rms_slope": 0.1, "seed": seed},
            "grid": [48, 48],
            "lengths": [1.0, 1.0],
        },
        "block": {"young_modulus": 210e3, "poisson_ratio": 0.3},
        "micro": {"model": "half-space"},
        "coupling": {"kind": "analytic"},
        "load": {"force": 31.7, "steps": steps},
        "output": {"check": "none", "figures": False, "report": False},
    }
    return run(Scene.from_dict(scene))


@pytest.mark.long
def test_between_load_steps_curves_pass_where_further_load_steps_are():
    """Against 24 load steps, to which straight chords through first touch and 3 are farther off.

    On this surface and two others 3.4 to 4.1 times by approach and 1.6 to 3.4 times by mean gap.
    """
    few, many = pressed(3, 11), pressed(24, 11)
    true = many.mean_pressure_MPa
    for over, better in (("approach_mm", 3.0), ("mean_separation_mm", 1.3)):
        parts = [(x, y) for _, x, y in pressure_between(few, over)]
        x, y = map(np.concatenate, zip(*parts, strict=True))
        ends = {"x": getattr(few, over), "y": few.mean_pressure_MPa}
        if over == "approach_mm":
            assert (x[0], y[0]) == (0.0, 0.0)
            ends = {name: np.append(0.0, one) for name, one in ends.items()}
        at = getattr(many, over)
        inside = (at >= x.min()) & (at <= x.max())
        off = [
            np.abs(np.interp(at, *(one[np.argsort(px, kind="stable")] for one in (px, py))) - true)
            for px, py in ((x, y), (ends["x"], ends["y"]))
        ]
        curve, chord = (one[inside].max() for one in off)
        assert curve < chord / better


def test_a_sphere_is_met_exactly():
    """Hertz: F ∝ δ^1.5, also from first touch to the first load step."""
    approach = np.array([2e-3, 3.1e-3])
    pressure = 4e4 * approach**1.5
    steps = history(
        pressure, approach_mm=approach, approach_stiffness_N_per_mm=1.5 * AREA * 4e4 * approach**0.5
    )
    (_, x, y), _ = pressure_between(steps, "approach_mm")
    np.testing.assert_allclose(y, 4e4 * x**1.5, rtol=1e-12, atol=1e-12)
    unknown = history(pressure, approach_mm=approach)
    assert list(pressure_between(unknown, "approach_mm")) == []
    doubtful = replace(steps, steps=tuple(
        replace(one, stiffness_scatter=0.3)
        for one in steps
    ))  # fmt: skip
    assert list(pressure_between(doubtful, "approach_mm")) == []


@pytest.mark.parametrize(("slopes", "count"), [((0.5, 2.0), 1), ((1.2, 2.0), 0), ((0.8, 0.7), 0)])
def test_slopes_on_one_side_of_that_between_load_steps_are_those_of_something_else(slopes, count):
    """As on faces of uneven pressures; a curve through both would have a wave."""
    steps = history(
        np.array([1.0, 2.0]), mean_separation_mm=np.array([2e-3, 1e-3]),
        interface_stiffness_N_per_mm=AREA * 1e3 * np.array(slopes),
    )  # fmt: skip
    assert len(list(pressure_between(steps, "mean_separation_mm"))) == count


def test_worn_surfaces_have_no_curve_from_those_that_are_less_worn():
    """Their pressures are one to rounding, but none of the load steps lies on the other's curve."""
    steps = history(
        np.array([5.0, 11.0, 11.0 * (1.0 + 1e-12)]), approach_mm=[1e-3, 1.5e-3, 3e-3],
        approach_stiffness_N_per_mm=AREA * 1e4, slid_mm=[0.0, 0.0, 10.0],
    )  # fmt: skip
    assert [index for index, *_ in pressure_between(steps, "approach_mm")] == [0, 1]


def test_errors_of_the_grid_leave_the_curve_between_load_steps():
    """They are those of both load steps: the curve is that of the run's cells."""
    gap = np.array([2e-3, 1.5e-3])
    steps = history(
        np.array([5.0, 11.0]), mean_separation_mm=gap, interface_stiffness_N_per_mm=AREA * 1.1e4,
        approach_stiffness_N_per_mm=AREA * 1e4, interface_stiffness_error_N_per_mm=AREA * 1e4,
    )  # fmt: skip
    assert [index for index, *_ in pressure_between(steps, "mean_separation_mm")] == [1]


def test_slopes_of_yielding_surfaces_count_on_their_side_alone():
    """The stiffness of a load that goes on is not that of unloading from there."""
    pressure, approach = np.array([10.0, 20.0, 12.0]), np.array([1e-3, 2e-3, 1.8e-3])
    slopes = np.array([1.2e4, 0.9e4, 3e4])
    steps = history(
        pressure, approach_mm=approach, approach_stiffness_N_per_mm=AREA * slopes,
        plastic_depth_mm=1e-4, stiffness_scatter=[0.1, 0.1, 0.0],
    )  # fmt: skip
    curves = list(pressure_between(steps, "approach_mm"))
    assert [index for index, *_ in curves] == [0, 1, 2]
    ends = [(np.diff(y) / np.diff(x))[[0, -1]] for _, x, y in curves]
    # one of twelve parts of a curve turns by less than a fifth
    np.testing.assert_allclose(ends[1], slopes[:2], rtol=0.2)
    assert ends[2][0] > 4e4  # the mean slope, to which 3e4 at the other end bends up
    np.testing.assert_allclose(ends[2][1], slopes[2], rtol=0.2)
