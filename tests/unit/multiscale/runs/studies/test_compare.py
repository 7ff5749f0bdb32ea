"""Comparisons end to end: records, report, command line; all is run in this process."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale import Run, Scene, compare, run
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs import comparison
from patchlaw.multiscale.runs.configurations import OWN, SMALL_SLOPES, configurations
from patchlaw.support import InputError, NotConverged
from patchlaw.support.files import LIST

PAPER = Path(__file__).parents[5] / "demos" / "scenes" / "paper.toml"
TINY = [
    "surface.grid=[64, 64]", "load.steps=2", "patches.grid=[2, 2]", "block.cells=[8, 8, 4]",
    "output.check=none",
]  # fmt: skip
OWN_NAME = "the scene as it is: isolated, 2 × 2 patches, circular, 8 × 8 × 4 elements"
PICKED = (
    OWN, "analytic, half-space", "analytic, elliptic", "concurrent, half-space",
    "consistent, 2 × 2 patches, half-space 32 × 32",
)  # fmt: skip


@pytest.fixture(scope="module")
def some():
    """Let comparisons have a few configurations, which takes less time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(
            comparison, "configurations",
            lambda scene: [one for one in configurations(scene) if one.name.startswith(PICKED)],
        )  # fmt: skip
        yield


@pytest.fixture(scope="module")
def found(some):
    return compare(Scene.load(PAPER, TINY))


@pytest.fixture
def runs(monkeypatch):
    """The configurations that are run, by name."""
    made, whole = [], comparison.solved

    def solved(one, progress):
        made.append(one.name)
        return whole(one, progress)

    monkeypatch.setattr(comparison, "solved", solved)
    return made


@pytest.mark.long
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


def test_a_row_holds_what_its_run_gives(found):
    one = found["analytic, elliptic"]
    history = run(one.scene)
    np.testing.assert_array_equal(one.curves["force"], history.force_N)
    np.testing.assert_array_equal(one.curves["patch_pressure"], history.patch_pressure_MPa)
    assert one.status == "done" and one.seconds > 0.0


def test_roughness_is_meshed_only_where_it_can_be_the_measure(monkeypatch):
    listed = []
    monkeypatch.setattr(comparison, "configurations", configurations)
    monkeypatch.setattr(comparison, "run_cases", lambda ways, *_, **__: listed.append(ways) or {})
    for against, meshed in ((None, True), ("reference", True), ("half-space", False)):
        with pytest.raises(KeyError):  # nothing is run
            compare(Scene.load(PAPER, TINY), against=against)
        assert any(one.kind == "reference" for one in listed[-1]) == meshed


def test_other_measure_can_be_forced(found):
    forced = comparison.compared(Scene.load(PAPER, TINY), found.rows, "half-space")
    assert forced.measure == "analytic, half-space 64 × 64"
    assert forced.warnings == ()


def test_measure_that_is_not_reached_is_told(found):
    missed = comparison.compared(Scene.load(PAPER, TINY), found.rows, "reference")
    assert missed.against == "concurrent"
    assert missed.warnings == (
        "no configuration of kind reference was reached: compared against the concurrent instead",
    )


def failing(monkeypatch, error, after=0):
    whole = Run.load_steps

    def load_steps(self):
        steps = whole(self)
        yield from (next(steps) for _ in range(after))
        raise error

    monkeypatch.setattr(Run, "load_steps", load_steps)


@pytest.mark.long
def test_configurations_that_fail_have_rows_and_no_errors(some, monkeypatch):
    failing(monkeypatch, NotConverged("step 2", reason="NONE", iterations=4, remedy="-"), after=1)
    rows = compare(Scene.load(PAPER, TINY)).rows
    assert {(row.status, row.steps) for row in rows} == {("not converged", 1)}
    assert all("did not converge: NONE after 4 iterations" in row.result.failure for row in rows)
    failing(monkeypatch, InputError("is nothing", key="load.force"))
    empty = compare(Scene.load(PAPER, TINY))
    assert (empty.measure, empty.frontier()) == (None, ())
    for row in empty.rows:
        assert (row.status, row.record()["message"]) == ("refused", "load.force: is nothing")
        assert np.isnan([row.seconds, row.errors["force_max"]]).all()


@pytest.mark.long
def test_interrupted_comparisons_go_on_where_they_were(some, runs, tmp_path, monkeypatch):
    scene, whole = Scene.load(PAPER, TINY), Run.load_steps

    def load_steps(self):
        if len(runs) == 3:
            raise KeyboardInterrupt
        return whole(self)

    monkeypatch.setattr(Run, "load_steps", load_steps)
    with pytest.raises(KeyboardInterrupt):
        compare(scene, folder=tmp_path)
    before, runs[:] = list(runs), []
    monkeypatch.setattr(Run, "load_steps", whole)
    rows = compare(scene, folder=tmp_path).rows
    assert runs == [row.name for row in rows[2:]]
    assert before == [row.name for row in rows[:3]]


def test_prescribed_force_is_measured_by_the_approach(monkeypatch):
    scene = Scene.load(PAPER, TINY).to_dict(whole=False)
    scene["load"] = {"force": 2.0, "steps": 2, "tilt": "free"}
    monkeypatch.setattr(
        comparison, "configurations",
        lambda one: [each for each in configurations(one) if "analytic, half" in each.name],
    )  # fmt: skip
    by_force = compare(Scene.from_dict(scene))
    coarse = by_force["analytic, half-space 32 × 32"]
    right, mine = by_force[by_force.measure], coarse.last("approach")
    assert by_force.response == "approach"
    assert coarse.errors["force_max"] < 1e-6  # what the balance of the force leaves
    expected = mine / right.last("approach") - 1.0
    assert coarse.errors["approach_last"] == pytest.approx(expected, rel=1e-9)  # a difference


def test_small_slopes_need_more_force(found):
    """The same with finite slopes differs by nothing else."""
    for kind in ("concurrent", "analytic"):
        steep, small = (found[f"{kind}, half-space 64 × 64{end}"] for end in ("", SMALL_SLOPES))
        assert (steep.finite_slopes, small.finite_slopes) == (True, False)
        assert 1.005 < small.last("force") / steep.last("force") < 1.06


def test_wrong_arguments():
    text = r"'experiment': is nothing to compare against \(allowed: ref"
    with pytest.raises(InputError, match=text):
        compare(Scene.load(PAPER, TINY), against="experiment")
    heights = {"heights": np.eye(8), "lengths": [1.0, 1.0]}
    with pytest.raises(InputError, match=r"surface\.heights: are not compared in memory"):
        compare(Scene.load(PAPER, TINY).with_({"surface": heights}))


@pytest.mark.long
def test_command_writes_table_figure_and_report(capsys, tmp_path, some, runs):
    words = ["compare", str(PAPER), "--out", str(tmp_path), "--set", *TINY]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "They are compared with “concurrent, half-space 64 × 64" in shown
    begun = re.findall(r"^\d\d:\d\d:\d\d (.*)$", shown, re.MULTILINE)  # long before they are done
    assert begun == runs and len(begun) > 3
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
    # the table that all look at has six columns, a page's width; the others are folded
    visible, _, folded = report.partition("<details>")
    first = visible[visible.index("<h2>Configurations</h2>") :]
    assert first[: first.index("</tr>")].count("<th") == 6
    assert "distribution [%]" in folded and "distribution [%]" not in visible
    table, count = (tmp_path / "compare.csv").read_bytes(), len(runs)
    assert main(words) == 0 and len(runs) == count  # times too: nothing is run again
    assert (tmp_path / "compare.csv").read_bytes() == table


@pytest.mark.long
def test_command_tells_when_the_measure_was_not_reached(capsys, tmp_path, some):
    words = ["compare", str(PAPER), "--out", str(tmp_path), "--against", "reference", "--set"]
    assert main([*words, *TINY]) == 3
    shown = capsys.readouterr()
    text = "the comparison against reference did not converge: MEASURE_NOT_REACHED"
    assert text in shown.err and "compared against the concurrent instead" in shown.out
    assert (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["compare", "SCENE", "--against", "truth"], "argument --against: invalid choice: 'truth'"),
        (["compare", "SCENE", "--at", "approach"], "--at = 'approach': does not go with that"),
        (["compare", "a", "b", "--set", "load.steps=1"], "--set = ['load.steps=1']: does not go"),
        (["compare", "a", "b", "--against", "reference"], "--against = 'reference': does not go"),
        (["compare", "a", "b"], "a: holds no run: there is no history.csv in it"),
        (["compare", "SCENE", "--", "-log_view_memory"], "comparisons take no PETSc options"),
        (["compare", "SCENE", "--budget", "1min"], "compare has no --budget any more"),
        (["diff", "a", "b"], "diff is now a part of compare: patchlaw compare RESULTS RESULTS"),
    ],
)
def test_command_refuses_before_anything_is_run(capsys, tmp_path, monkeypatch, words, text):
    monkeypatch.chdir(tmp_path)
    assert main([str(PAPER) if word == "SCENE" else word for word in words]) == 2
    assert text in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
