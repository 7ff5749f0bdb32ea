"""The command line: exit codes, one message, nothing written when the input is wrong."""

import csv
import json
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import read_history
from patchlaw.multiscale.cli.command_line import main
from patchlaw.support.files import LIST, csv_text

PAPER = str(Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml")
SMALL = [
    "surface.grid=[64, 64]", "block.cells=[8, 8, 4]", "patches.grid=[2, 2]", "load.steps=2",
]  # fmt: skip


def call(capsys, *words):
    code = main(list(words))
    shown = capsys.readouterr()
    return code, shown.out, shown.err


def missing(distribution):
    raise metadata.PackageNotFoundError(distribution)


@pytest.fixture
def heights(tmp_path):
    """A scene that reads heights from a file, which the test writes."""
    scene = tmp_path / "scan.toml"
    text = Path(PAPER).read_text(encoding="utf-8").splitlines()
    text = [line for line in text if not line.startswith(("spectrum", "grid = [256"))]
    text.insert(text.index("[surface]") + 1, 'file = "heights.npy"')
    scene.write_text("\n".join(text), encoding="utf-8")
    return scene, tmp_path / "heights.npy"


@pytest.mark.long
def test_run_writes_everything(capsys, tmp_path):
    out = tmp_path / "out"
    code, shown, err = call(capsys, "run", PAPER, "--out", str(out), "--set", *SMALL)
    assert (code, err) == (0, "")
    assert "results in" in shown
    assert {"[µm]", "[N]", "[s]"} <= set(shown.split())  # no unit is taken for markup
    names = {path.name for path in out.iterdir()}
    assert names == {
        "history.csv", "patches.csv", "laws.h5", "provenance.json", "report.html",
        "overview.png", "surface.png", "curves.png", "pressures.png", "laws.png", LIST,
        "over_pressure.png",
    }  # fmt: skip
    with (out / "history.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["approach_mm"]) for row in rows] == [0.004, 0.008]
    facts = json.loads((out / "provenance.json").read_text(encoding="utf-8"))
    assert facts["scene"]["surface"]["spectrum"]["seed"] == 1
    assert facts["steps"] == 2
    report = (out / "report.html").read_text(encoding="utf-8")
    assert report.count("data:image/png;base64,") == 6
    assert "://" not in report  # it needs no network


def test_nothing_unasked_is_written(capsys, tmp_path):
    out = tmp_path / "out"
    extra = ["coupling.kind=analytic", "output.figures=false", "output.report=false"]
    extra.append("output.contact=none")
    code, _, _ = call(capsys, "run", PAPER, "--out", str(out), "--set", *SMALL, *extra)
    assert code == 0
    assert {path.name for path in out.iterdir()} == {
        "history.csv", "patches.csv", "provenance.json", LIST,
    }  # fmt: skip


@pytest.mark.long
def test_files_of_an_earlier_scene_do_not_stay(capsys, tmp_path):
    words = ("run", PAPER, "--out", str(tmp_path), "--set", *SMALL, "output.figures=false")
    assert call(capsys, *words, "output.fields=true")[0] == 0
    assert {"laws.h5", "fields.xdmf", "fields.h5"} <= {path.name for path in tmp_path.iterdir()}
    bare = (
        "coupling.kind=analytic", "output.report=false", "output.contact=none", "--overwrite",
    )  # fmt: skip
    assert call(capsys, *words, *bare)[0] == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"history.csv", "patches.csv", "provenance.json", LIST}


@pytest.mark.parametrize(("overrides", "text"), [
    (["block.cells=[4, 4, 3]"], "2 cells along a patch"),
    (["patches.grid=[3, 3]", "block.cells=[16, 16, 3]"], "patch borders cut elements"),
    (["patches.grid=[1, 1]"], "the patches are not small against the block"),
    (["patches.grid=[4, 4]"], "maxima on the surface's border"),
    (["block.margin='3 mm'"], "3 mm beyond it in 8 cells"),
    (["coupling.kind=analytic", "output.fields=true"],
     "output.fields: there is no block, and no fields are written; the analytic coupling"),
    (["output.figures=all"], "output.figures = 'all': no block.png is drawn, for no pressures"),
    (["block.young_modulus=210"], "numbers without a unit: block.young_modulus = 210 taken in MPa"),
    (["block.young_modulus='210 GPa'"], "E = 210 GPa, ν = 0.15; a surface of 1 mm × 1 mm on a"),
])  # fmt: skip
def test_plan_says_what_is_doubtful(capsys, overrides, text):
    code, shown, _ = call(capsys, "plan", PAPER, "--set", *SMALL, *overrides)
    assert code == 0
    assert text in " ".join(shown.split())


def test_large_block_is_no_reason_for_a_warning(capsys):
    extra = ["block.margin='3 mm'", "block.height='8 mm'"]
    _, shown, _ = call(capsys, "plan", PAPER, "--set", *SMALL, *extra)
    assert "not small against the block" not in shown


def test_noisy_border_is_said(capsys, heights):
    scene, path = heights
    np.save(path, 1e-3 * np.random.default_rng(3).normal(size=(16, 16)))
    _, shown, _ = call(capsys, "plan", str(scene), "--set", "load.approach='0.2 um'")
    shown = " ".join(shown.split())
    assert "above the highest of the given heights" in shown
    assert "nothing lies within the largest approach" in shown


def test_plan_runs_and_writes_nothing(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, shown, _ = call(capsys, "plan", PAPER)
    assert code == 0
    for word in ("circular", "isolated", "4 × 4 patches", "40 × 40 × 25 hexahedra"):
        assert word in " ".join(shown.split())
    assert not list(tmp_path.iterdir())
    (tmp_path / "results").touch()  # where nothing can be written does not matter
    assert call(capsys, "plan", PAPER, "--set", *SMALL)[0] == 0
    words = ("--out", "results/x", "--resume", "--max-time", "1h", "-q", "--open", "--overwrite")
    code, of_a_run, _ = call(capsys, "plan", PAPER, *words)  # those of a run can be reused
    of_a_run, shown = (text.partition("\nmemory")[0] for text in (of_a_run, shown))
    assert (code, of_a_run) == (0, shown)
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


@pytest.mark.parametrize(
    ("command", "folder"),
    [("run", "results/SCENE"), ("compare", "results/SCENE-compare"), ("laws", "results/SCENE")],
)
def test_help_names_the_folder(capsys, command, folder):
    assert main([command, "--help"]) == 0
    assert f"(default: {folder}, by the" in " ".join(capsys.readouterr().out.split())


def test_version(capsys, monkeypatch):
    assert main(["--version"]) == 0
    patchlaw, dolfinx = capsys.readouterr().out.strip().split(", ")
    assert patchlaw == f"patchlaw {metadata.version('patchlaw')}"
    assert re.fullmatch(r"dolfinx \d+\.\d+.*", dolfinx)
    monkeypatch.setattr(metadata, "version", missing)
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == "patchlaw not installed, dolfinx not installed\n"


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["run", "--help"]])
def test_help_and_version_load_the_standard_library_alone(root, words):
    code = (
        "import gc, sys; from patchlaw.__main__ import main\n"
        f"sys.argv[1:] = {words}\n"
        "code = main()\n"
        "assert gc.isenabled()\n"
        "heavy = {'numpy', 'scipy', 'pydantic', 'rich', 'mpi4py', 'dolfinx',"
        "'patchlaw.geometry', 'patchlaw.micro'}\n"
        "print(code, sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "0 []"), done.stderr


def test_schema_is_json(capsys):
    code, shown, _ = call(capsys, "schema")
    assert code == 0
    assert "surface" in json.loads(shown)["properties"]


@pytest.mark.parametrize("kind", ["concurrent", "analytic"])
def test_laws_of_a_coupling_without_laws_are_refused(capsys, tmp_path, kind):
    words = ("laws", PAPER, "--out", str(tmp_path), "--set", f"coupling.kind={kind}")
    code, shown, err = call(capsys, *words)
    assert (code, shown) == (2, "")  # no plan of what will not be done
    assert "has no laws (allowed: isolated, consistent)" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("run", "nowhere.toml"), "nowhere.toml: there is no such file"),
        (("run", PAPER, "--set", "block.young=3"), "did you mean 'young_modulus'"),
        (("run", PAPER, "--set", "patches.grid=[41, 2]"), "patches.grid = [41, 2]: more patches"),
        (("run", PAPER, "--set", "surface.grid=[1, 256]"), "surface.grid.0 = 1: must be greater"),
        (("run", PAPER, "--out", PAPER), "is not a folder"),
        (("run", PAPER, "--out", PAPER + "/x"), "is not a folder"),
        (("run", PAPER, "--set", "surface.grid=[1000000, 1000000]"), "GB of memory"),
        (("run", PAPER, "--out", "x" * 300), "cannot be written to: File name too long"),
        (("run", "x" * 300), "cannot be read: File name too long"),
        (("run", "/dev/zero"), "/dev/zero: is no regular file"),
        (("run", PAPER, "--fast"), "unrecognized arguments: --fast (see: patchlaw --help)"),
        (("fly",), "invalid choice: 'fly'"),
        (("run", PAPER, "two\nlines\r"), "unrecognized arguments: two lines"),
        (("run", "no\nwhere.toml"), "no where.toml: there is no such file"),
        ((), "the following arguments are required: COMMAND"),
    ],
)
def test_wrong_input_exits_2_with_one_message(capsys, tmp_path, monkeypatch, words, text):
    monkeypatch.chdir(tmp_path)
    code, shown, err = call(capsys, *words)
    assert (code, shown) == (2, "")
    assert err.startswith("patchlaw: ")
    assert text in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_surface_without_summit_needs_another_model(capsys, heights):
    scene, path = heights
    np.save(path, np.zeros((16, 16)))
    code, shown, err = call(capsys, "run", str(scene), "--out", str(path.parent / "out"))
    assert (code, shown) == (2, "")
    assert "micro.model = 'circular': the surface has no summit" in err
    words = (
        "--set", "micro.model=half-space", "coupling.kind=analytic", "load.steps=1",
        "output.figures=false",
    )  # fmt: skip
    code, shown, _ = call(capsys, "run", str(scene), "--out", str(path.parent / "out"), *words)
    assert code == 0
    assert " 100 " in shown  # full contact, in per cent


@pytest.fixture
def small(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(SMALL_SCENE, encoding="utf-8")
    return file


@pytest.mark.long
@pytest.mark.parametrize(("kind", "later"), [
    *((kind, 'hold = "force"') for kind in ("analytic", "consistent")),
    pytest.param("reference", 'hold = "force"', marks=pytest.mark.long),
    *((kind, 'force = "0 N"') for kind in ("analytic", "consistent")),
])  # fmt: skip
def test_an_approach_alone_presses(capsys, tmp_path, small, kind, later):
    """What follows it may keep the force that it found, or take it away."""
    text = SMALL_SCENE.replace('approach = "8 um"\n', "").replace("analytic", kind)
    small.write_text(
        text.replace(
            "[output]", f'[[load.stage]]\napproach = "4 um"\n[[load.stage]]\n{later}\n[output]'
        )
    )
    code, _, err = call(capsys, "run", str(small), "--out", str(tmp_path / "out"))
    assert (code, err) == (0, "")
    found = read_history(tmp_path / "out").force_N
    end = found[1] if "hold" in later else 0.0
    # equilibria of laws and of meshes are found to 1e-8 of the force
    assert found[1] > 0.0 and found[-1] == pytest.approx(end, rel=1e-8, abs=1e-12)


@pytest.mark.parametrize(("key", "value", "words"), [
    ("approach", '"2 mm"', r"load.stage.1.approach = .*: leaves no gap on the periodic"),
    ("force", '"1e9 N"', None),
])  # fmt: skip
def test_stages_beyond_full_contact_are_refused_by_key(capsys, tmp_path, small, key, value, words):
    text = SMALL_SCENE.replace('approach = "8 um"\n', "").replace(
        "grid = [16", "periodic = true\ngrid = [16"
    )
    stages = f'[[load.stage]]\nforce = "1 N"\n[[load.stage]]\n{key} = {value}\n[output]'
    small.write_text(text.replace("[output]", stages).replace("[patches]\ngrid = [2, 4]\n", ""))
    code, _, err = call(capsys, "run", str(small), "--out", str(tmp_path / "out"))
    if words is None:  # a force presses further, to the end of finite slopes
        assert code == 3 and "load.stage.1.force" in err
        assert (tmp_path / "out" / "history.csv").is_file()
    else:
        assert code == 2 and re.search(words, err) and not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["x" * 300 + ".npy", ".", "small.toml/in.npy"])
@pytest.mark.parametrize(
    "words", [["run"], ["plan"], ["sweep", "--vary", "load.steps=1,2"], ["compare"], ["surface"]]
)
def test_files_that_cannot_be_read_are_named(capsys, tmp_path, heights, words, name):
    scene, _ = heights
    command, *more = words
    out = ["--out", str(tmp_path / "out")] if command != "plan" else []
    code, _, err = call(capsys, command, str(scene), *out, *more, "--set", f"surface.file={name}")
    assert code == 2 and err.count("\n") == 1 and "surface.file" in err
    assert not (tmp_path / "out").exists()


def test_a_figure_that_fails_leaves_the_tables_and_a_note(capsys, tmp_path, small, monkeypatch):
    def fails(function, *arguments):
        raise RuntimeError("latex could not be found\nat all")

    monkeypatch.setattr("patchlaw.multiscale.runs.output.figures.by_matplotlib", fails)
    monkeypatch.setattr("patchlaw.multiscale.runs.output.figures.cores", lambda: 1)
    out = tmp_path / "out"
    drawn = ["--set", "output.figures=true", "output.report=true"]
    code, shown, err = call(capsys, "run", str(small), "--out", str(out), *drawn)
    assert (code, err) == (0, "")
    assert "figures are missing, as drawing them failed: RuntimeError: latex" in " ".join(
        shown.split()
    )
    assert {"history.csv", "report.html"} <= {one.name for one in out.iterdir()}
    other = ["--set", "load.steps=1", "--out", str(tmp_path / "other")]
    assert call(capsys, "run", str(small), *other)[0] == 0
    assert (
        call(capsys, "compare", str(out), str(tmp_path / "other"), "--out", str(tmp_path / "d"))[0]
        == 0
    )
    assert (tmp_path / "d" / "diff.csv").is_file()


ODD = b'a$x_{$ \xff\x1b[31m"\x7f.toml'


@pytest.mark.long
def test_names_of_any_bytes_are_names(capsys, tmp_path, small):
    """Of no encoding, with formulas of matplotlib and characters that steer terminals."""
    file = Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), ODD)))
    small.rename(file)
    drawn = ["--set", "output.figures=true", "output.report=true"]
    code, shown, err = call(capsys, "run", str(file), "--out", str(tmp_path / "out"), *drawn)
    assert (code, err) == (0, "") and "\x1b" not in shown and "missing" not in shown
    assert {"report.html", "curves.png"} <= {one.name for one in (tmp_path / "out").iterdir()}
    code, _, err = call(capsys, "plan", str(file), "--set", "load.\x1b[31mforce=1")
    assert code == 2 and "\x1b" not in err and r"\x1b" in err


def test_without_columns_lines_are_printed(capsys, small, monkeypatch):
    monkeypatch.setenv("COLUMNS", "0")
    code, shown, _ = call(capsys, "plan", str(small))
    assert code == 0 and "16 × 16" in shown


def test_a_hostile_region_is_no_formula_of_a_spreadsheet():
    rows = [["=1+1", "-2.5", "-1 um", "+cmd|' /C calc'!A0", "@SUM(1)", -3.0, "top"]]
    found = list(csv.reader(csv_text(list("abcdefg"), rows).splitlines()))[1]
    assert found == ["'=1+1", "-2.5", "-1 um", "'+cmd|' /C calc'!A0", "'@SUM(1)", "-3.0", "top"]
