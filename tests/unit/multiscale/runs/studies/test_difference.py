"""Two runs beside each other: ratios of closed forms, their errors, files, and what is refused."""

import csv
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from helpers.histories import ONES, history_of, load_step
from helpers.small_scene import SMALL_SCENE

from patchlaw.geometry import Regions
from patchlaw.multiscale import History, Scene, difference, run
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.loading.column import Leak
from patchlaw.multiscale.results.figures.studies import difference_over_pressure_figure
from patchlaw.multiscale.results.run_curves import interpolated
from patchlaw.support import InputError


def history(pressure, approach, *, area=2.0, **columns):
    """Return a history of given pressures and approaches, on a face of an area in mm²."""
    steps = [
        load_step(
            number, approach_mm=a, force_N=p * area, mean_pressure_MPa=p,
            contact_area_fraction=1e-3 * p, mean_separation_mm=0.05 - a,
        )
        for number, (p, a) in enumerate(zip(pressure, approach, strict=True), 1)
    ]  # fmt: skip
    for name, values in columns.items():
        steps = [replace(one, **{name: value}) for one, value in zip(steps, values, strict=True)]
    return history_of(steps, area)


def power(stiffness, exponent, loads, **other):
    """Return a history of p = k δ^n at some pressures."""
    return history(loads, (np.array(loads) / stiffness) ** (1.0 / exponent), **other)


def test_ratios_of_powers_are_exact():
    first, second = power(7e4, 1.5, [1.0, 2.3, 5.1]), power(3e4, 1.5, [0.7, 1.7, 4.0, 9.0])
    both = difference(first, second)
    # all loads of either between 1 and 5.1 MPa
    np.testing.assert_allclose(both.loads, [1.0, 1.7, 2.3, 4.0, 5.1])
    # powers are straight in logarithms, where the interpolation is exact
    np.testing.assert_allclose(both.of("approach_mm").ratio, (7.0 / 3.0) ** (2 / 3), rtol=1e-12)
    there = difference(first, second, at="approach")
    np.testing.assert_allclose(there.of("mean_pressure_MPa").ratio, 3.0 / 7.0, rtol=1e-12)
    assert (both.at, there.at, both.names) == ("pressure", "approach", ("first", "second"))
    with pytest.raises(InputError, match=r"name = 'force_N': is not known of both runs"):
        both.of("force_N")


def test_loads_of_both_are_taken_where_there_are_any():
    both = difference(power(7e4, 1.5, [1.0, 2.3, 5.1]), power(3e4, 1.4, [0.7, 2.3, 4.0, 5.1]))
    np.testing.assert_allclose(both.loads, [2.3, 5.1])
    assert np.isnan(both.of("contact_area_fraction").error).all()  # nothing is interpolated


def test_noise_is_seen_by_leaving_load_steps_out():
    """Against values between load steps: a power with 3 % of noise, which no curve follows."""
    random = np.random.default_rng(4)
    inside = []
    for _ in range(50):
        load = np.sort(random.uniform(1.0, 10.0, 40))
        values = load**0.9 * (1.0 + 0.03 * random.standard_normal(40))
        kept = np.arange(0, 40, 5)
        at = load[kept[0] : kept[-1]]
        found, error = interpolated(at, load[kept], values[kept])
        true = values[kept[0] : kept[-1]]
        inside.append(np.mean(np.abs(found - true) <= error + 1e-12 * true))
    assert np.mean(inside) > 0.9


@pytest.mark.parametrize("steps", [2, 3, 4])
def test_of_few_load_steps_values_lie_between_their_neighbours(steps):
    load = np.geomspace(1.0, 8.0, steps)
    at = np.linspace(1.0, 8.0, 30)
    for exponent in (0.3, 0.9, 2.5):
        found, error = interpolated(at, load, load**exponent + 0.2 * load)
        true = at**exponent + 0.2 * at
        assert (np.abs(found - true) <= error + 1e-9).all()
        on_step = np.isclose(at[:, None], load, rtol=1e-9).any(axis=1)
        assert (error[on_step] == 0.0).all() and (error[~on_step] > 0.0).all()


@pytest.mark.parametrize("steps", [6, 8, 16])
def test_errors_of_interpolation_contain_the_truth(steps):
    """Curves p = aδ + bδ² have no straight picture in logarithms; their inverse is known."""
    constants = (3.0e3, 4.0e5), (5.0e3, 1.0e5)
    loads = [np.linspace(10.0, 40.0, steps), np.linspace(7.3, 43.1, steps + 1)]

    def approach(pressure, a, b):
        return (-a + np.sqrt(a * a + 4.0 * b * pressure)) / (2.0 * b)

    def at(number):
        found = approach(loads[number], *constants[number])
        return history(
            loads[number], found, approach_error_mm=[0.0] * len(found),
            force_error_N=[0.0] * len(found),
        )  # fmt: skip

    both = difference(at(0), at(1), at="pressure")
    ratio = both.of("approach_mm")
    true = approach(both.loads, *constants[1]) / approach(both.loads, *constants[0])
    missed = np.abs(ratio.ratio - true)
    assert (missed <= ratio.error + 1e-12).all()
    assert missed.max() > 1e-9  # interpolated, not evaluated
    assert ratio.error.max() < 0.1


def test_runs_that_wear_are_compared_over_the_distance_slid():
    """Under 2 and 4 MPa contact areas grow as a + bs, twice and five times as fast as they are."""
    slid = np.array([0.0, 0.0, 10.0, 20.0, 40.0])

    def worn(pressure, growth, slid=slid):
        held = pressure * (1.0 + 1e-13 * np.arange(len(slid) - 1))  # to rounding
        steps = power(3e4, 1.5, [0.5 * pressure, *held], slid_mm=slid)
        area = 0.1 * (1.0 + growth * slid)
        return replace(steps, steps=tuple(
            replace(one, contact_area_fraction=share, worn_depth_mm=1e-7 * pressure * far)
            for one, share, far in zip(steps, area, slid, strict=True)
        ))  # fmt: skip

    both = difference(worn(2.0, 0.02), worn(4.0, 0.05))
    assert (both.at, both.load_text(0)) == ("slid", "distance slid 10 mm")
    np.testing.assert_allclose(both.loads, slid[2:])
    ratio = (1.0 + 0.05 * slid[2:]) / (1.0 + 0.02 * slid[2:])
    np.testing.assert_allclose(both.of("contact_area_fraction").ratio, ratio, rtol=1e-12)
    np.testing.assert_allclose(both.of("mean_pressure_MPa").ratio, 2.0, rtol=1e-12)
    np.testing.assert_allclose(both.of("worn_depth_mm").ratio, 2.0, rtol=1e-12)
    assert next(both.records())["at_slid_mm"] == 10.0
    assert both.plot().axes[-1].get_xlabel() == "distance slid [mm]"
    assert difference(worn(2.0, 0.02), worn(4.0, 0.05), at="pressure").loads == pytest.approx([2.0])
    assert both.over_pressure is None or both.over_pressure.at == "pressure"
    new = power(7e4, 1.5, [1.0, 2.0])
    beside = difference(worn(2.0, 0.02), new)  # before anything has worn off
    assert beside.at == "pressure" and "worn_depth_mm" not in [one.name for one in beside.ratios]
    with pytest.raises(InputError, match=r"second.*has no load step that slides"):
        difference(worn(2.0, 0.02), new, at="slid")
    with pytest.raises(InputError, match=r"distance slid: the runs have none in common"):
        difference(worn(2.0, 0.02), worn(2.0, 0.02, slid=10.0 * slid), at="slid")
    assert difference(worn(2.0, 0.02), worn(2.0, 0.02, slid=10.0 * slid)).at == "pressure"


def test_approaches_below_zero_are_compared_as_those_above():
    """As counted from a mean plane: pressures grow as exp(δ/l), which is exact over δ."""
    length, approaches = 1.3e-3, ([-3.1e-3, -1.7e-3, 0.4e-3], [-4.3e-3, -2.3e-3, -0.7e-3])
    first, second = (
        history(factor * np.exp(np.array(each) / length), each, approach_error_mm=[0.0] * 3)
        for factor, each in zip((2.0, 3.0), approaches, strict=True)
    )
    both = difference(first, second)
    assert both.at == "approach"
    np.testing.assert_allclose(both.loads, [-3.1e-3, -2.3e-3, -1.7e-3, -0.7e-3])
    np.testing.assert_allclose(both.of("mean_pressure_MPa").ratio, 1.5, rtol=1e-12)
    np.testing.assert_allclose(difference(first, first).loads, approaches[0])


def test_what_one_run_knows_up_to_some_load_is_not_known_beyond():
    stiffness = {"interface_stiffness_N_per_mm": [1e3, 2e3, None]}
    loads = [1.0, 2.3, 5.1]
    both = difference(
        power(7e4, 1.5, loads, **stiffness), power(3e4, 1.5, [1.0, 3.0, 5.1], **stiffness)
    )
    one = both.of("interface_stiffness_MPa_per_mm")
    assert np.isfinite(one.values[:, 0]).all()
    assert np.isnan(one.values[:, -1]).all() and np.isnan(one.errors[:, -1]).all()
    assert both.table(-1)[1][-1][1:] == ("–", "–", "–")


def test_load_steps_that_slid_are_counted():
    worn = power(3e4, 1.5, [1.0, 2.3, 2.3, 2.3, 5.1], slid_mm=[0.0, 0.0, 7.0, 9.0, 9.0])
    both = difference(power(7e4, 1.5, [1.0, 2.3, 5.1]), worn, names=("new", "worn"))
    np.testing.assert_allclose(both.loads, [1.0, 2.3, 5.1])
    assert "worn: 2 load steps that slid to no larger load are left out" in both.notes
    assert "worn: the surfaces wear between load steps that are compared" in both.notes
    assert not [note for note in both.notes if note.startswith("new:")]


def in_zones(names, pressures):
    """Return a history of one load step on a face in named regions."""
    pressures = np.array(pressures)
    state = replace(ONES, pressure_MPa=pressures, contact_area_fraction=1e-3 * pressures)
    one = power(7e4, 1.5, [float(pressures.mean())])
    return replace(one, steps=(replace(one.steps[0], patches=state),), patches=Regions(names))


def test_regions_of_one_name_are_compared():
    both = difference(
        in_zones(("rim", "land", "middle"), [1.0, 2.0, 6.0]), in_zones(("land", "rim"), [5.0, 1.0])
    )
    np.testing.assert_allclose(both.of("land pressure_MPa").ratio, 2.5)
    np.testing.assert_allclose(both.of("rim pressure_MPa").ratio, 1.0)
    assert not [one for one in both.ratios if one.name.startswith("middle")]


def test_leaks_are_compared_with_their_errors_way_by_way():
    """A leak over the whole face, and through gaps along x; y is known of one run alone."""
    loads, drops = [1.0, 2.0, 4.0], ((8.0, 4.0, 0.5), (2.0, 3.0, 0.25))
    leaks = [
        [tuple(Leak(way=way, rate=r, error=0.1 * r) for way in ways) for r in rates]
        for rates, ways in zip(drops, (("face", "x", "y"), ("face", "x")), strict=True)
    ]
    first, second = (power(1e4, 1.5, loads, leaks=one) for one in leaks)
    both = difference(first, second)
    for name in ("leak_mm3_per_s", "leak_x_mm3_per_s"):
        np.testing.assert_allclose(both.of(name).ratio, [0.25, 0.75, 0.5], rtol=1e-12)
        np.testing.assert_allclose(both.of(name).error, 0.2 * both.of(name).ratio, rtol=1e-12)
    assert np.isnan(both.of("leak_y_mm3_per_s").ratio).all()
    _, rows = both.table()
    assert [row[0] for row in rows if "leak" in row[0]] == [
        "leak along x [mm³/s]", "leak along y [mm³/s]", "leak over the contact face [mm³/s]",
    ]  # fmt: skip


def test_errors_of_both_runs_add_up():
    """Against both runs moved to the ends of their bars, one corner after the other."""
    loads, bars = [4.0], (0.03, 0.05)
    sides = [power(k, 1.5, loads) for k in (7e4, 3e4)]
    approach = np.array([side.approach_mm[0] for side in sides])
    runs = [
        history(loads, side.approach_mm, approach_error_mm=[bar * a], force_error_N=[0.0])
        for side, bar, a in zip(sides, bars, approach, strict=True)
    ]
    both = difference(*runs).of("approach_mm")
    corners = [
        approach[1] * (1 + s * bars[1]) / (approach[0] * (1 + t * bars[0]))
        for s in (-1, 1)
        for t in (-1, 1)
    ]
    widest = max(abs(corner - both.ratio[0]) for corner in corners)
    assert both.error[0] == pytest.approx(0.08 * both.ratio[0])
    assert both.error[0] == pytest.approx(widest, rel=0.05)  # first order in the bars


def test_error_of_a_force_is_one_of_the_approach_at_equal_force():
    loads = np.array([1.0, 2.0, 4.0, 8.0])
    known = power(5e4, 1.5, loads, force_error_N=0.02 * 2.0 * loads, approach_error_mm=[0.0] * 4)
    exact = power(5e4, 1.5, loads, force_error_N=[0.0] * 4, approach_error_mm=[0.0] * 4)
    both = difference(known, exact, at="pressure").of("approach_mm")
    np.testing.assert_allclose(both.ratio, 1.0, rtol=1e-12)
    # δ ∝ p^(2/3): two thirds of 2 %, up to the slopes by differences
    assert both.error[1:3] == pytest.approx(0.02 * 2 / 3, rel=0.2)


def test_what_was_not_measured_has_no_error():
    both = difference(power(7e4, 1.5, [1.0, 2.0]), power(3e4, 1.5, [1.0, 2.0]))
    assert np.isnan(both.of("approach_mm").error).all()
    assert "±" not in str(both.table())
    assert any("measured no error" in note for note in both.notes)


def test_faces_of_different_area_are_compared_by_pressure():
    both = difference(power(7e4, 1.5, [1.0, 2.0]), power(7e4, 1.5, [1.0, 2.0], area=6.0))
    np.testing.assert_allclose(both.of("approach_mm").ratio, 1.0)
    assert any("nominal areas differ: 2 and 6 mm²; forces do by 200 %" in x for x in both.notes)


def test_first_rise_alone_is_compared():
    pressure, approach = [1.0, 2.0, 1.5, 0.0, 3.0], [1e-3, 2e-3, 1.9e-3, 1e-3, 3e-3]
    both = difference(history(pressure, approach), power(7e4, 1.5, [1.0, 3.0]))
    np.testing.assert_allclose(both.loads, [1.0])
    assert any("first: 3 load steps without a force or after" in note for note in both.notes)


def test_heights_of_different_zeros_count_from_first_touch():
    loads = [1.0, 2.0]
    level = power(7e4, 1.5, loads)
    lower = History(
        steps=tuple(step.counted_from(1.3e-3) for step in level.steps), patches=level.patches
    )
    assert lower.approach_mm[0] != level.approach_mm[0]
    both = difference(level, lower)
    np.testing.assert_allclose(both.of("approach_mm").ratio, 1.0, rtol=1e-12)
    assert any("count from first touch" in note for note in both.notes)


@pytest.mark.parametrize(("first", "second", "text"), [
    ([1.0, 2.0], [3.0, 4.0], "mean pressure: the runs have none in common: 1 to 2 MPa in first"),
    ([0.0, 0.0], [3.0, 4.0], "first: has no load step with a force"),
])  # fmt: skip
def test_loads_that_do_not_overlap_are_refused(first, second, text):
    with pytest.raises(InputError, match=text):
        difference(power(7e4, 1.5, first), power(7e4, 1.5, second))


def test_twice_the_modulus_is_twice_the_pressure(tmp_path):
    (tmp_path / "scene.toml").write_text(SMALL_SCENE)
    soft = run(Scene.load(tmp_path / "scene.toml"))
    stiff = run(Scene.load(tmp_path / "scene.toml", ["block.young_modulus=8 GPa"]))
    both = difference(soft, stiff, at="approach")
    for name, ratio in {
        "mean_pressure_MPa": 2.0, "contact_area_fraction": 1.0,
        "interface_stiffness_MPa_per_mm": 2.0,
        "peak_pressure_MPa": 2.0, "mean_separation_mm": 1.0,
    }.items():  # fmt: skip
        np.testing.assert_allclose(both.of(name).ratio, ratio, rtol=1e-8)  # of the solver


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Return the folders of two runs whose scenes differ in one key."""
    top = tmp_path_factory.mktemp("runs")
    (top / "scene.toml").write_text(SMALL_SCENE)
    for name, modulus in (("soft", "4 GPa"), ("stiff", "8 GPa")):
        words = ["run", str(top / "scene.toml"), "--out", str(top / name), "--set"]
        assert main([*words, f"block.young_modulus={modulus}", "output.check=last"]) == 0
    return top / "soft", top / "stiff"


class Page(HTMLParser):
    """Collects the cells of a page."""

    def __init__(self, text):
        super().__init__()
        self.cells = []
        self.feed(text)

    def handle_data(self, data):
        self.cells.append(data)


@pytest.mark.long
def test_command_writes_table_figure_and_page(folders, tmp_path, capsys):
    assert main(["compare", *map(str, folders), "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "stiff / soft" in shown and "results in" in shown
    assert re.search(r"mean pressure \[MPa\] .* ± .* ± .*  2\.0 ± [\d.]+", shown)
    both = difference(*folders)
    assert both.at == "approach"  # which both prescribe
    assert ("block.young_modulus", "4 GPa", "8 GPa") in both.changes
    assert len(both.changes) == 1
    with (tmp_path / "out" / "diff.csv").open() as file:
        rows = list(csv.DictReader(file))
    pressure = [row for row in rows if row["quantity"] == "mean_pressure_MPa"]
    assert [float(row["ratio"]) for row in pressure] == pytest.approx([2.0, 2.0], rel=1e-8)
    assert float(pressure[-1]["ratio_error"]) > 0.0
    assert pressure[0]["ratio_error"] == ""  # measured at the last load step alone
    page = (tmp_path / "out" / "diff.html").read_text()
    assert "://" not in page and "data:image/png;base64," in page
    assert {"block.young_modulus", "4 GPa", "8 GPa"} <= set(Page(page).cells)
    assert (tmp_path / "out" / "diff.png").stat().st_size > 10_000
    assert (tmp_path / "out" / "over_pressure.png").stat().st_size > 10_000
    assert page.count("data:image/png;base64,") == 2


def test_figure_has_both_curves(folders):
    figure = difference(*folders).plot()
    force, _, _, ratios = figure.axes
    assert force.get_legend_handles_labels()[1] == ["soft", "stiff"]
    drawn = {bars.get_label(): bars.lines[0].get_ydata() for bars in ratios.containers}
    np.testing.assert_allclose(drawn["mean pressure"], 2.0, rtol=1e-8)


def test_over_pressure_both_are_over_each_other_with_their_ratio():
    loads = np.geomspace(2.0, 60.0, 5)
    runs = [
        power(
            7e4, 1.5, loads, interface_stiffness_N_per_mm=factor * loads**exponent,
            interface_stiffness_error_N_per_mm=0.1 * factor * loads**exponent,
        )
        for factor, exponent in ((100.0, 0.9), (300.0, 1.1))
    ]  # fmt: skip
    both = difference(*runs)
    assert both.over_pressure is both
    assert difference(*runs, at="approach").over_pressure.at == "pressure"
    assert difference(*(one[-1:] for one in runs)).over_pressure is None
    (row,) = [one for one in both.power_table()[1] if "stiffness" in one[0]]
    assert row[1:] == ("p^0.90 from 2 to 60 MPa", "p^1.10 from 2 to 60 MPa")
    figure = difference_over_pressure_figure(both)
    assert len(figure.axes) == 6  # area, gap and stiffness, each with its ratio
    stiffness, ratio = figure.axes[2], figure.axes[5]
    assert stiffness.get_xscale() == stiffness.get_yscale() == "log"
    drawn = [bars.lines[0].get_ydata() for bars in stiffness.containers]
    np.testing.assert_allclose(drawn[1] / drawn[0], 3.0 * loads**0.2, rtol=1e-12)
    ((points, _, (bars,)),) = ratio.containers
    np.testing.assert_allclose(points.get_ydata(), 3.0 * loads**0.2, rtol=1e-12)
    widths = [np.ptp(segment[:, 1]) for segment in bars.get_segments()]
    np.testing.assert_allclose(widths, 0.4 * 3.0 * loads**0.2, rtol=1e-9)  # 10 % of both, ±


def test_ratios_over_pressures_stand_below_their_curves():
    """One run ends at pressures of a smaller unit, in which both have theirs in common."""
    low = [0.013, 0.031, 0.071]
    figure = difference_over_pressure_figure(
        difference(power(7e4, 1.5, low), power(7e4, 1.5, [*low, 2.0]))
    )
    upper, lower = figure.axes[0], figure.axes[2]
    assert lower.get_xlabel() == upper.get_xlabel() == "mean pressure [MPa]"
    np.testing.assert_allclose(lower.lines[1].get_xdata(), low)


@pytest.mark.long
def test_by_default_results_go_to_a_folder_of_both_names(folders, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["compare", *map(str, folders)]) == 0
    assert (tmp_path / "results" / "soft-stiff-compare" / "diff.csv").is_file()


@pytest.fixture
def broken(folders, tmp_path):
    """Return a copy of the first folder, to be damaged."""
    copy = tmp_path / "broken"
    copy.mkdir()
    for path in folders[0].iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    return copy


def refused(folders, tmp_path, capsys, *words):
    """Return the message of a refusal that wrote nothing."""
    out = tmp_path / "never"
    assert main(["compare", *map(str, folders), "--out", str(out), *words]) == 2
    assert not out.exists()
    return capsys.readouterr().err


def test_other_units_are_refused(folders, broken, tmp_path, capsys):
    path = broken / "provenance.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"units": "m, N, Pa"}))
    said = refused((folders[1], broken), tmp_path, capsys)
    assert "units = 'm, N, Pa': has other units (allowed: mm, N, MPa)" in said


def test_approaches_of_periodic_surfaces_are_not_compared_with_others(folders, broken):
    path = broken / "provenance.json"
    facts = json.loads(path.read_text())
    facts["scene_given"]["surface"]["periodic"] = True
    path.write_text(json.dumps(facts))
    both = difference(folders[1], broken)
    assert both.at == "pressure" and any("is periodic" in note for note in both.notes)
    with pytest.raises(InputError, match="approach_mm"):
        both.of("approach_mm")
    with pytest.raises(InputError, match="at = 'approach': approaches count from the mean"):
        difference(folders[1], broken, at="approach")


def test_at_is_one_of_two(folders):
    with pytest.raises(InputError, match=r"at = 'force': .*\(allowed: pressure, approach, slid\)"):
        difference(*folders, at="force")
