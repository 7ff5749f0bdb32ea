"""Comparisons end to end: records, report, command line; all is run in this process."""

import csv
from argparse import ArgumentTypeError, Namespace
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale import compare
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.cli.studies import compare_scene
from patchlaw.multiscale.cli.words import wall_time
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene_run import run
from patchlaw.multiscale.studies.configurations import OWN, SMALL_SLOPES
from patchlaw.multiscale.studies.measured_run import measured_run
from patchlaw.multiscale.studies.running import CaseResult
from patchlaw.support.errors import InputError, NotConverged
from patchlaw.support.own_files import LIST

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
TINY = [
    "surface.grid=[64, 64]", "load.steps=2", "patches.grid=[2, 2]", "block.cells=[8, 8, 4]",
    "output.check=none",
]  # fmt: skip
OWN_NAME = "the scene as it is: isolated, 2 × 2 patches, circular, 8 × 8 × 4 elements"
PICKED = (
    "analytic, half-space", "analytic, elliptic", "concurrent, half-space",
    "consistent, 2 × 2 patches, half-space 32 × 32",
)  # fmt: skip


RUN = {}  # results by key of the configuration: several tests want the same


def measured(result, **values):
    return replace(result, measured={**result.measured, **values})


def solved(one, comm=None, seconds=None):
    """Run some of the configurations; the others fail."""
    if one.name.startswith((OWN, *PICKED)):
        if one.key not in RUN:
            result = measured_run(one)
            RUN[one.key] = measured(result, cpu_s=sum(result.measured["phases"].values()))
        return RUN[one.key]
    return measured(CaseResult(status="failed", failure="no memory"), exit_code=5)


@pytest.fixture(scope="module")
def found():
    return compare(Scene.load(PAPER, TINY), solve=solved)


def test_the_best_is_the_measure(found):
    assert (found.against, found.response) == ("concurrent", "force")
    assert found.measure == "concurrent, half-space 64 × 64"
    measure = found[found.measure]
    assert measure.is_measure
    assert measure.errors == found.uncertainty
    assert 0.0 < found.uncertainty["force_max"] < 0.1  # half the heights change a few per cent


def test_errors_are_those_of_the_forces(found):
    right = found[found.measure].curves["force"]
    for name in (OWN_NAME, "analytic, elliptic"):
        expected = np.abs(found[name].curves["force"] - right).max() / right.max()
        assert found[name].errors["force_max"] == pytest.approx(
            expected, rel=1e-12
        )  # the same sums


def test_shares_of_every_error_add_up(found):
    for record in found.records():
        shares = [record[name] for name in record if name.startswith("share_")]
        if record["is_measure"] or record["error_force_last"] is None:
            continue
        total = sum(share for share in shares if share is not None)
        assert total == pytest.approx(record["error_force_last"], abs=1e-12)  # a sum of five


def test_failed_configurations_have_rows_and_no_errors(found):
    failed = [row for row in found.rows if row.status == "failed"]
    assert len(failed) > 10
    for row in failed:
        assert (row.record()["exit_code"], row.record()["message"]) == (5, "no memory")
        assert np.isnan([row.seconds, row.errors["force_max"]]).all()


def test_other_measure_can_be_forced():
    forced = compare(Scene.load(PAPER, TINY), against="half-space", solve=solved)
    assert forced.measure == "analytic, half-space 64 × 64"
    assert forced.warnings == ()


def test_measure_that_is_not_reached_is_told():
    missed = compare(Scene.load(PAPER, TINY), against="reference", solve=solved)
    assert missed.against == "concurrent"
    assert missed.warnings == (
        "no configuration of kind reference was reached: compared against the concurrent instead",
    )


def test_busy_machine_is_told():
    def slow(one, comm, seconds):
        return measured(solved(one), cpu_s=0.0)

    (warning,) = compare(Scene.load(PAPER, TINY), solve=slow).warnings
    assert "the machine was busy with something else" in warning


def test_a_comparison_shares_its_folder_with_none(tmp_path):
    scene, out = Scene.load(PAPER, TINY), tmp_path / "out"
    failed, refused = CaseResult(status="failed"), []

    def solve(*_):
        if not refused:
            with pytest.raises(InputError, match="another run is writing to this folder") as other:
                compare(scene, folder=out, solve=lambda *_: failed)
            refused.append(other)
        return failed

    assert compare(scene, folder=out, solve=solve).measure is None and refused
    assert not out.exists()  # nothing was stored, and nothing is left


def test_nothing_reached_is_no_comparison():
    def never(one, comm, seconds):
        return CaseResult(status="failed")

    empty = compare(Scene.load(PAPER, TINY), solve=never)
    assert (empty.measure, empty.frontier()) == (None, ())
    assert len(empty.records()) == len(empty)


def test_prescribed_force_is_measured_by_the_approach():
    scene = Scene.load(PAPER, TINY).to_dict(whole=False)
    scene["load"] = {"force": 2.0, "steps": 2, "tilt": "free"}

    def analytic(one, comm, seconds):
        assert one.scene.loading.tilt == "free"
        if one.name.startswith("analytic, half-space"):
            return measured_run(one)
        return CaseResult(status="not started")

    by_force = compare(Scene.from_dict(scene), solve=analytic)
    coarse = by_force["analytic, half-space 32 × 32"]
    right, mine = by_force[by_force.measure], coarse.last("approach")
    assert by_force.response == "approach"
    assert coarse.errors["force_max"] < 1e-6  # what the balance of the force leaves
    expected = mine / right.last("approach") - 1.0
    assert coarse.errors["approach_last"] == pytest.approx(expected, rel=1e-9)  # a difference
    assert coarse.shares["discretisation"] == pytest.approx(expected, rel=1e-9)


def test_small_slopes_are_a_cause_of_their_own(found):
    """The same with finite slopes differs by nothing else."""
    for kind in ("concurrent", "analytic"):
        steep, small = (found[f"{kind}, half-space 64 × 64{end}"] for end in ("", SMALL_SLOPES))
        assert (steep.finite_slopes, small.finite_slopes) == (True, False)
        assert 1.005 < small.last("force") / steep.last("force") < 1.06
        assert small.shares["slopes"] > 0.005
        if kind == "concurrent":  # the measure
            assert small.errors["force_last"] == pytest.approx(small.shares["slopes"], rel=1e-12)
            continue
        assert steep.shares["slopes"] == 0.0
        assert small.shares["block"] == steep.shares["block"]
    assert found["analytic, elliptic"].shares["slopes"] > 0.005


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"against": "experiment"}, r"'experiment': is nothing to compare against \(allowed: ref"),
        ({"budget_s": 0.0}, "budget_s = 0.0: must be greater"),
    ],
)
def test_wrong_arguments(arguments, text):
    with pytest.raises(InputError, match=text):
        compare(Scene.load(PAPER, TINY), solve=solved, **arguments)


def test_heights_in_memory_are_refused():
    heights = {"heights": np.eye(8), "lengths": [1.0, 1.0]}
    with pytest.raises(InputError, match=r"surface\.heights: are not compared in memory"):
        compare(Scene.load(PAPER, TINY).with_({"surface": heights}))


@pytest.mark.parametrize(
    ("text", "seconds"), [("5min", 300.0), ("90 s", 90.0), ("0.5 h", 1800.0), ("1e3 ms", 1.0)]
)
def test_budget(text, seconds):
    assert wall_time(text) == pytest.approx(seconds, rel=1e-12)  # a change of unit


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("5", r"'5': has no unit \(allowed: a quantity in units of s, such as \"55 min\""),
        ("5 mm", "has the wrong unit"),
        ("soon", "cannot be read as a quantity"),
        ("-1 s", "must be greater than 0"),
    ],
)
def test_no_budget(text, problem):
    with pytest.raises(ArgumentTypeError, match=problem):
        wall_time(text)


def chosen(folder, **choice):
    words = {"scene": PAPER, "set": TINY, "out": folder}
    return Namespace(**words | {"against": None, "budget": None, "open": False} | choice)


@pytest.fixture
def some_solved(monkeypatch):
    monkeypatch.setattr("patchlaw.multiscale.cli.studies.compare", partial(compare, solve=solved))


def test_command_writes_table_figure_and_report(capsys, tmp_path, monkeypatch, some_solved):
    compare_scene(chosen(tmp_path), [], None)
    shown = capsys.readouterr().out
    assert "They are compared with “concurrent, half-space 64 × 64" in shown
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"compare.csv", "pareto.png", "report.html", "cases", LIST}
    with (tmp_path / "compare.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    measure = [row for row in rows if row["is_measure"] == "True"]
    assert [row["kind"] for row in measure] == ["concurrent"]
    assert float(rows[0]["error_force_max"]) > 0.0
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert report.count("data:image/png;base64,") == 1
    assert "://" not in report  # it needs no network
    assert "Configurations without a result" in report
    # the table that all look at has six columns, a page's width; the others are folded
    visible, _, folded = report.partition("<details>")
    first = visible[visible.index("<h2>Configurations</h2>") :]
    assert first[: first.index("</tr>")].count("<th") == 6
    assert "set-up" in folded and "set-up" not in visible

    def none_again(one, comm, seconds):
        assert not one.name.startswith((OWN, *PICKED))
        return solved(one)

    table = (tmp_path / "compare.csv").read_bytes()
    again = partial(compare, solve=none_again)
    monkeypatch.setattr("patchlaw.multiscale.cli.studies.compare", again)
    compare_scene(chosen(tmp_path), [], None)
    assert (tmp_path / "compare.csv").read_bytes() == table


def test_command_tells_when_the_measure_was_not_reached(capsys, tmp_path, some_solved):
    text = "the comparison against reference did not converge: MEASURE_NOT_REACHED"
    with pytest.raises(NotConverged, match=text):
        compare_scene(chosen(tmp_path, against="reference"), [], None)
    assert "compared against the concurrent instead" in capsys.readouterr().out
    assert (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--against", "truth"], "argument --against: invalid choice: 'truth' (choose from 'refe"),
        (["--budget", "soon"], "argument --budget: 'soon': cannot be read as a quantity"),
    ],
)
def test_command_refuses_before_anything_is_run(capsys, tmp_path, words, text):
    assert main(["compare", str(PAPER), "--out", str(tmp_path / "out"), *words]) == 2
    assert text in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_history_gives_records():
    scene = Scene.load(PAPER, [*TINY, "coupling.kind=analytic", "micro.model=elliptic"])
    history = run(scene)
    records, patches = history.records(), history.patch_records()
    assert [record["force_N"] for record in records] == list(history.force_N)
    assert [record["pressure_MPa"] for record in patches] == list(
        history.patch_pressure_MPa.ravel()
    )
    assert set(patches[0]) == {
        "step", "ix", "iy", "closure_mm", "pressure_MPa", "contact_area_fraction",
    }  # fmt: skip


def test_configurations_take_no_petsc_options():
    text = "-- = '-ksp_monitor': configurations take no PETSc options"
    with pytest.raises(InputError, match=text):
        compare_scene(chosen(None), ["-ksp_monitor"], None)
