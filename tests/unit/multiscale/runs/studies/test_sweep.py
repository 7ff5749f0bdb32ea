"""Sweeps: all combinations, shared among ranks, gone on with after an interruption."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.legend import Legend

from patchlaw.multiscale import Run, Scene, run, sweep
from patchlaw.multiscale.cli import studies
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs.sweep import sweep_cases, values_from_text
from patchlaw.support import InputError, NotConverged
from patchlaw.support.files import sealed, unsealed

SEED, MODULUS = "surface.spectrum.seed", "block.young_modulus"
VARY = {MODULUS: ["1 GPa", "4 GPa"], SEED: range(3)}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SMALL_SCENE)
    return path


@pytest.fixture
def scene(file):
    return Scene.load(file)


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_cases_are_all_combinations_the_last_key_fastest(scene):
    cases = sweep_cases(scene, VARY)
    assert [case.values[SEED] for case in cases] == [0, 1, 2, 0, 1, 2]
    assert [case.scene.block.young_modulus for case in cases] == 3 * [1e3] + 3 * [4e3]
    assert [case.scene.surface.spectrum.seed for case in cases] == [0, 1, 2, 0, 1, 2]


@pytest.mark.parametrize(("text", "values"), {
    "a.b=2..5": [2, 3, 4, 5], "a.b = -1..1": [-1, 0, 1], "a.b=1 GPa, 4 GPa": ["1 GPa", "4 GPa"],
    "a.b=0.5,1": [0.5, 1], "a.b=true": [True], "a.b=[[16, 16], [32, 32]]": [[16, 16], [32, 32]],
    'a.b="x, y", z': ['"x', 'y"', "z"],
}.items())  # fmt: skip
def test_values_are_ranges_lists_or_texts(text, values):
    assert values_from_text(text) == ("a.b", values)


@pytest.mark.parametrize(("text", "problem"), {
    "a.b": "varies no key", "=1": "varies no key", "a.b=": "varies no key",
    "a.b=5..2": r"--vary a.b = '5..2': is no range", "a.b=0..10000000": "is no range",
    "a.b=[1, 2": "is no list of values", "a.b=[]": "is no list of values",
    "a.b=1,,2": "is no list of values",
}.items())  # fmt: skip
def test_what_varies_nothing_is_refused(text, problem):
    with pytest.raises(InputError, match=problem):
        values_from_text(text)


@pytest.mark.parametrize(("vary", "problem"), [
    ({}, "varies nothing"), ({SEED: []}, "has no values"), ({SEED: [1, 1]}, "takes a value twice"),
    ({SEED: [1, -1]}, r"surface.spectrum.seed = -1"),
    ({"surface.sed": [1]}, "did you mean 'seed'|unknown key"),
    ({"block.height": range(2000), SEED: range(2000)}, "make 4000000 cases"),
])  # fmt: skip
def test_wrong_cases_are_refused_before_any_runs(scene, vary, problem):
    with pytest.raises(InputError, match=problem):
        sweep(scene, vary)


def test_cases_have_the_same_keys_whatever_their_numbers(scene):
    cases = sweep_cases(scene, VARY)
    assert cases[4].values == {MODULUS: "4 GPa", SEED: 1}
    assert len({case.key for case in cases}) == 6
    other = sweep_cases(scene, {SEED: range(9), MODULUS: ["4 GPa"]})
    assert [case.key for case in other][:3] == [case.key for case in cases][3:]
    assert sweep_cases(scene, {SEED: [0]})[0].key not in {case.key for case in cases}


def test_cases_are_what_runs_of_their_own_are(scene):
    found = sweep(scene, VARY)
    for case, forces in zip(found.cases, found.force_N, strict=True):
        alone = run(scene.with_(case.values))
        np.testing.assert_array_equal(forces, alone.force_N)
    assert found.force_N.shape == (6, 2)
    assert found.unfinished == 0
    assert found.failures == {}


def test_means_and_bands_are_over_the_seeds_of_each_ensemble(scene):
    found = sweep(scene, VARY)
    (soft, part), (stiff, other) = found.ensembles()
    assert (soft, stiff) == ({MODULUS: "1 GPa"}, {MODULUS: "4 GPa"})
    np.testing.assert_allclose(part.mean("force_N"), found.force_N[:3].mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(4.0 * part.mean("force_N"), other.mean("force_N"), rtol=1e-12)
    low, high = part.band("force_N", (0.0, 1.0))
    np.testing.assert_array_equal(low, found.force_N[:3].min(axis=0))
    np.testing.assert_array_equal(high, found.force_N[:3].max(axis=0))
    with pytest.raises(InputError, match="no case of the sweep has these values"):
        found.where({SEED: 7})


def test_a_sweep_goes_on_after_the_cases_that_are_done(scene, tmp_path):
    first, again = [], []
    whole = sweep(scene, VARY, folder=tmp_path, observe=lambda case, result: first.append(case))
    journal = tmp_path / "cases" / "1-of-1" / "rank-0.cases"
    whole_file = journal.read_bytes()
    ends = [end for _, end in unsealed(whole_file)]
    journal.write_bytes(whole_file[: ends[3] + 20])  # as a killed process leaves it
    rest = sweep(scene, VARY, folder=tmp_path, observe=lambda case, result: again.append(case))
    assert (len(first), len(again)) == (6, 3)
    np.testing.assert_array_equal(rest.force_N, whole.force_N)
    assert len(list(unsealed(journal.read_bytes()))) == 7  # the scene, and six cases


def test_damaged_journals_give_no_wrong_number(scene, tmp_path, monkeypatch):
    """Bytes changed, cut off, put in: refused by name, or run again."""
    known = {}
    whole = sweep(
        scene,
        VARY,
        folder=tmp_path / "whole",
        observe=lambda case, result: known.update({str(case.scene): replace(result, case="")}),
    ).force_N
    # what a case comes to is known: its journal is what is tested
    monkeypatch.setattr(
        "patchlaw.multiscale.runs.sweep.run_case", lambda scene, progress: known[str(scene)]
    )
    journal = tmp_path / "out" / "cases" / "1-of-1" / "rank-0.cases"
    journal.parent.mkdir(parents=True)
    content = (tmp_path / "whole" / "cases" / "1-of-1" / "rank-0.cases").read_bytes()
    dice, ends = np.random.default_rng(8), {"refused": 0, "run again": 0}
    for number in range(24):
        at, damaged = int(dice.integers(len(content))), bytearray(content)
        if number % 3 == 0:
            damaged[at] ^= 1 << int(dice.integers(8))
        elif number % 3 == 1:
            del damaged[at:]
        else:
            damaged[at:at] = dice.bytes(int(dice.integers(1, 90)))
        journal.write_bytes(damaged)
        try:
            found = sweep(scene, VARY, folder=tmp_path / "out").force_N
        except InputError as error:
            assert str(error).startswith(f"{journal}: is damaged") and "computed again" in str(
                error
            )
            ends["refused"] += 1
        else:
            np.testing.assert_array_equal(found, whole)
            ends["run again"] += 1
    assert min(ends.values()) >= 5, ends


def drawn(figure):
    """Return how many pixels of each of the two diagrams have a colour, neither grey nor white."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    coloured = np.ptp(pixels, axis=2) > 40
    return [int(half.sum()) for half in np.array_split(coloured, 2, axis=1)]


def legend(figure):
    """Return the texts of a figure's legend; a title stands for one alone."""
    texts = [text.get_text() for one in figure.findobj(Legend) for text in one.get_texts()]
    return texts or [
        line.get_label() for line in figure.axes[0].lines if line.get_label()[0] != "_"
    ]


@pytest.mark.parametrize(("load", "vary"), [
    ({"load.approach": "1 um"}, {SEED: range(3)}),
    ({"load.force": "0.5 N"}, {MODULUS: ["1 GPa", "4 GPa"]}),
])  # fmt: skip
def test_one_load_step_is_drawn_as_points(scene, load, vary):
    found = sweep(scene.with_(load | {"load.steps": 1}), vary)
    # a point of 4 pt is some 30 pixels at 100 dpi; lines through one point are none
    assert min(drawn(found.plot())) >= 40


def test_scatter_is_drawn_under_forces_too(scene):
    found = sweep(scene.with_({"load.force": "0.5 N", "load.steps": 3}), {SEED: range(4)})
    force, _ = found.plot().axes
    (band,) = force.collections
    low, high = 1e3 * found.band("approach_mm")
    (path,) = band.get_paths()
    assert path.vertices[:, 0].min() == pytest.approx(low.min(), rel=1e-12)
    assert path.vertices[:, 0].max() == pytest.approx(high.max(), rel=1e-12)


def test_of_several_ensembles_means_are_marked_and_no_curve_is_covered(scene):
    found = sweep(scene.with_({"load.steps": 2}), {SEED: range(3), MODULUS: ["1 GPa", "4 GPa"]})
    figure = found.plot()
    figure.draw_without_rendering()
    force, area = figure.axes
    (legend_below,) = figure.legends
    assert len(legend_below.texts) == 2 and force.get_legend() is None
    top = legend_below.get_window_extent().y1
    assert all(top <= axes.get_tightbbox().y0 for axes in (force, area))
    for axes in (force, area):
        marked = [line.get_linewidth() for line in axes.lines if line.get_marker() != ""]
        assert len(marked) == 2 and min(marked) > 1.0  # thin lines are single cases


def test_files_are_compared_and_seeds_averaged(file, tmp_path):
    dice = np.random.default_rng(2)
    for name in ("scan.npy", "worn.npy"):
        np.save(file.with_name(name), dice.normal(scale=1e-3, size=(8, 8)))
    base = Scene.load(file).with_({"surface": {"file": "scan.npy", "lengths": [1.0, 1.0]}})
    found = sweep(base, {"surface.file": ["scan.npy", str(file.with_name("worn.npy"))]})
    assert [len(part) for _, part in found.ensembles()] == [1, 1]
    records = [one for one in found.statistics_records() if one["column"] == "force_N"]
    assert {one["cases"] for one in records} == {1}
    assert legend(found.plot()) == ["scan.npy", "worn.npy"]
    seeds = sweep(Scene.load(file), {SEED: range(3)})
    assert [len(part) for _, part in seeds.ensembles()] == [3]
    assert legend(seeds.plot()) == ["mean of 3"]


def with_maps(file):
    """Return a scene of a measured map, beside which there is another, and the heights of both."""
    heights = np.random.default_rng(2).normal(scale=1e-3, size=(8, 8))
    for name in ("one.npy", "other.npy"):
        np.save(file.with_name(name), heights)
    base = Scene.load(file).with_({"surface": {"file": "one.npy", "lengths": [1.0, 1.0]}})
    return base, heights


def test_what_is_doubtful_of_cases_is_noted(file, tmp_path, capsys):
    """Heights in m that are taken in mm like those of the others, as one key says for all."""
    _, heights = with_maps(file)
    np.save(file.with_name("other.npy"), 1e-3 * heights)
    words = ["sweep", str(file), "--vary", "surface.file=one.npy, other.npy", "--out"]
    given = "surface={file='one.npy', lengths=['1 mm', '1 mm']}"
    for _ in range(2):  # also when nothing is left to run
        assert main([*words, str(tmp_path / "out"), "--set", given]) == 0
        (note,) = (one for one in capsys.readouterr().out.splitlines() if "machined" in one)
        assert note.startswith('note: 1 of 2 cases, as {"surface.file": "other.npy"}: the rms grad')


def test_a_sweep_does_not_go_on_over_another_map(file, tmp_path):
    base, heights = with_maps(file)
    vary = {MODULUS: ["1 GPa", "2 GPa"]}
    first = sweep(base, vary, folder=tmp_path / "out")
    np.save(file.with_name("one.npy"), 2.0 * heights)
    with pytest.raises(InputError, match=r"content of surface\.file was '.*--overwrite"):
        sweep(base, vary, folder=tmp_path / "out")
    np.save(file.with_name("one.npy"), heights)
    again = sweep(base, vary, folder=tmp_path / "out", observe=lambda *_: pytest.fail("run again"))
    np.testing.assert_array_equal(again.force_N, first.force_N)


def test_cases_of_a_map_that_has_changed_are_run_again(file, tmp_path):
    base, heights = with_maps(file)
    vary, again = {"surface.file": ["one.npy", "other.npy"]}, []
    first = sweep(base, vary, folder=tmp_path / "out").force_N
    np.testing.assert_array_equal(first[0], first[1])
    np.save(file.with_name("other.npy"), 2.0 * heights)
    found = sweep(
        base, vary, folder=tmp_path / "out", observe=lambda case, _: again.append(case.number)
    )
    assert again == [1]
    np.testing.assert_array_equal(found.force_N[0], first[0])
    alone = run(base.with_({"surface.file": "other.npy"}))
    np.testing.assert_array_equal(found.force_N[1], alone.force_N)


def test_cases_of_another_version_are_refused(scene, tmp_path):
    sweep(scene, {SEED: [1]}, folder=tmp_path)
    journal = tmp_path / "cases" / "1-of-1" / "rank-0.cases"
    (head, _), (case, _) = unsealed(journal.read_bytes())
    journal.write_bytes(sealed(head) + sealed({**case, "files": {}}))
    with pytest.raises(InputError, match="another patchlaw; remove it, and its cases are computed"):
        sweep(scene, {SEED: [1]}, folder=tmp_path)


def test_cases_of_another_scene_are_not_mixed_in(scene, tmp_path):
    sweep(scene, {SEED: [1]}, folder=tmp_path)
    with pytest.raises(InputError, match=r"holds the cases of another scene.*--overwrite"):
        sweep(scene.with_({"load.steps": 3}), {SEED: [1]}, folder=tmp_path)


def test_parts_make_the_whole(scene, tmp_path):
    one = sweep(scene, {SEED: range(5)}, folder=tmp_path, part=(1, 2))
    assert one.unfinished == 2
    both = sweep(scene, {SEED: range(5)}, folder=tmp_path, part=(2, 2))
    np.testing.assert_array_equal(both.force_N, sweep(scene, {SEED: range(5)}).force_N)
    with pytest.raises(InputError, match="is no part of a sweep"):
        sweep(scene, {SEED: range(5)}, part=(3, 2))


def test_no_other_run_of_a_part_shares_its_folder(scene, file, tmp_path, capsys):
    """A sweep in Python holds the locks that the command holds."""
    out, met = tmp_path / "out", []

    def meet(case, result):
        with pytest.raises(InputError, match="another run is writing to this folder"):
            sweep(scene, {SEED: [1, 2]}, folder=out, part=(1, 2))
        met.append(sweep(scene, {SEED: [1, 2]}, folder=out, part=(2, 2)).unfinished)
        for words in (["run"], ["sweep", "--vary", f"{SEED}=1..2", "--overwrite"]):
            assert main([words[0], str(file), *words[1:], "--out", str(out)]) == 2
            assert "another run is writing to this folder" in capsys.readouterr().err

    sweep(scene, {SEED: [1, 2]}, folder=out, part=(1, 2), observe=meet)
    assert met == [0]  # the case that is observed is stored already
    with pytest.raises(ValueError, match="ended"):  # an error gives the folder back
        sweep(scene, {SEED: [3]}, folder=out, observe=lambda *_: float("ended"))
    assert not sweep(scene, {SEED: [1, 2, 3]}, folder=out).unfinished


def test_tables_have_what_parts_did_while_they_were_written(file, tmp_path, monkeypatch):
    """The other part ends, tables and all, when this one has read what is done."""
    words = ["sweep", str(file), "--vary", f"{SEED}=1..3", "--out", str(tmp_path / "out")]
    write, codes = studies._write_sweep, []

    def late(*of):
        if not codes:
            codes.append(None)
            codes[0] = main([*words, "--part", "2/2"])
        return write(*of)

    monkeypatch.setattr(studies, "_write_sweep", late)
    assert main([*words, "--part", "1/2"]) == 0 and codes == [0]
    assert [row["status"] for row in rows(tmp_path / "out" / "cases.csv")] == 3 * ["done"]
    assert rows(tmp_path / "out" / "statistics.csv")


def test_a_case_that_fails_does_not_end_the_others(scene, tmp_path, monkeypatch):
    whole = Run.load_steps

    def failing(run):
        yield next(whole(run))
        if run.scene.surface.spectrum.seed == 1:
            raise NotConverged("load step 2", reason="LOST", iterations=3, remedy="smaller steps")
        yield from whole(run)

    monkeypatch.setattr(Run, "load_steps", failing)
    found = sweep(scene, {SEED: range(3)})
    (name,) = found.failures
    assert json.loads(name) == {SEED: 1}
    assert np.isnan(found.force_N).tolist() == [[False, False], [False, True], [False, False]]
    assert found.mean("force_N")[1] == pytest.approx(np.mean(found.force_N[[0, 2], 1]), rel=1e-14)
    assert [record["status"][:11] for record in found.case_records()] == [
        "done", "load step 2", "done"
    ]  # fmt: skip


def test_command_says_which_cases_failed(file, tmp_path, capsys, monkeypatch):
    def failing(run):
        raise NotConverged("load step 1", reason="LOST", iterations=3, remedy="smaller steps")

    monkeypatch.setattr(Run, "load_steps", failing)
    out = tmp_path / "out"
    assert main(["sweep", str(file), "--vary", f"{SEED}=0..1", "--out", str(out)]) == 3
    assert "2 of 2 cases, the first with" in capsys.readouterr().err
    assert all("LOST" in case["status"] for case in rows(out / "cases.csv"))


def test_command_writes_cases_histories_and_statistics(file, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    words = ["sweep", str(file), "--vary", f"{SEED}=0..2", "--out", str(out)]
    assert main([*words, "--set", "output.figures=true"]) == 0
    shown = capsys.readouterr().out
    assert "3 cases on 1 rank\n" in shown
    assert "3 of 3 cases are done" in shown
    cases, steps, found = (rows(out / f"{name}.csv") for name in ("cases", "history", "statistics"))
    assert [case["status"] for case in cases] == 3 * ["done"]
    assert len(steps) == 6
    mean = np.mean([float(case["force_N"]) for case in cases])
    (last,) = (one for one in found if (one["step"], one["column"]) == ("2", "force_N"))
    assert float(last["mean"]) == pytest.approx(mean, rel=1e-14)
    assert sum(map(int, last["histogram"].split())) == int(last["cases"]) == 3
    assert (out / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert main(words) == 0  # whether figures are drawn makes no other scene of it
    capsys.readouterr()
    assert main([*words, "--set", "load.steps=1"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*words, "--set", "load.steps=1", "--overwrite"]) == 0
    assert len(rows(out / "history.csv")) == 3


@pytest.mark.parametrize(
    ("first", "second"), [("run", "sweep"), ("sweep", "run"), ("run", "compare")]
)
def test_runs_and_cases_do_not_replace_each_other(file, tmp_path, capsys, first, second):
    """Both write a history.csv or a report.html."""
    out = tmp_path / "out"
    more = {"run": [], "sweep": ["--vary", f"{SEED}=0..1"], "compare": []}
    assert main([first, str(file), "--out", str(out), *more[first]]) == 0
    before = {path: path.read_bytes() for path in out.iterdir() if path.is_file()}
    assert main([second, str(file), "--out", str(out), *more[second]]) == 2
    held = "cases of a sweep or a comparison" if first == "sweep" else "a run"
    assert f"out': holds {held} (allowed: another folder" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in out.iterdir() if path.is_file()} == before
    assert main([first, str(file), "--out", str(out), *more[first]]) == 0


def test_command_runs_the_part_of_a_slurm_task(file, tmp_path, capsys, monkeypatch):
    words = ["sweep", str(file), "--vary", f"{SEED}=0..2", "--out", str(tmp_path / "out")]
    for task in ("4", "6"):
        environment = {"ID": task, "MIN": "4", "COUNT": "2", "STEP": "2"}
        for name, value in environment.items():
            monkeypatch.setenv(f"SLURM_ARRAY_TASK_{name}", value)
        assert main(words) == 0
    shown = capsys.readouterr().out
    assert "1 of 3 cases are left to other parts" in shown
    assert "3 of 3 cases are done" in shown


@pytest.mark.parametrize(
    ("environment", "words"),
    [
        ({"ID": "x", "MIN": "1", "COUNT": "2"}, "SLURM_ARRAY_TASK_ID = 'x': is no whole number"),
        ({"ID": "1", "MIN": "1", "COUNT": "2e3"}, "SLURM_ARRAY_TASK_COUNT = '2e3'"),
        ({"ID": "1", "MIN": "1", "COUNT": "2", "STEP": ""}, "SLURM_ARRAY_TASK_STEP = ''"),
        ({"ID": "1", "MIN": "1", "COUNT": "2", "STEP": "0"}, "no task of an evenly spaced array"),
        ({"ID": "9", "MIN": "1", "COUNT": "3", "MAX": "9"}, "no task of an evenly spaced array"),
        ({"ID": "1", "MIN": "1", "COUNT": "3", "MAX": "9"}, "no task of an evenly spaced array"),
        ({"ID": "2", "MIN": "1", "COUNT": "3", "STEP": "2"}, "no task of an evenly spaced array"),
    ],
)
def test_arrays_of_slurm_that_are_not_even_are_refused(
    file, tmp_path, capsys, monkeypatch, environment, words
):
    """Of an array such as 1,5,9 no task knows its place: Slurm states first, last, step, count."""
    for name, value in environment.items():
        monkeypatch.setenv(f"SLURM_ARRAY_TASK_{name}", value)
    out = tmp_path / "out"
    assert main(["sweep", str(file), "--vary", f"{SEED}=0..2", "--out", str(out)]) == 2
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1 and not out.exists()


@pytest.mark.parametrize(("words", "problem"), [
    (["--part", "3/2"], "is no part of a sweep"), (["--part", "x"], "is no part of a sweep"),
    (["--vary", "surface.spectrum.seed=-3..-1"], "surface.spectrum.seed"),
])  # fmt: skip
def test_wrong_words_write_nothing(file, tmp_path, capsys, words, problem):
    out = tmp_path / "out"
    assert main(["sweep", str(file), "--vary", f"{MODULUS}=1,2", "--out", str(out), *words]) == 2
    assert problem in capsys.readouterr().err
    assert not out.exists()
