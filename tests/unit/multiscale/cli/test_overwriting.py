"""Results of another scene are kept unless they are given up; those of the same scene are not."""

import json

import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs.output.results_folder import FILE_NAME, CheckpointWriter
from patchlaw.support.files import OwnFiles

STIFFER = "block.young_modulus=5 GPa"


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(SMALL_SCENE, encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.parametrize("command", ["run", "surface", "laws"])
def test_results_of_another_scene_are_kept(scene, capsys, command):
    kind = "isolated" if command == "laws" else "analytic"
    words = [command, "scene.toml", "--out", "results/scene", "--set", f"coupling.kind={kind}"]
    words += ["patches.grid=[1, 1]", "block.cells=[4, 4, 3]", "load.steps=1"]
    assert main(["run", *words[1:]]) == 0
    capsys.readouterr()
    files = [path for path in (scene.parent / "results").rglob("*") if path.is_file()]
    before = [path.stat().st_mtime_ns for path in files]
    assert main([*words, STIFFER, "load.steps=2"]) == 2
    error = capsys.readouterr().err
    assert "--out = 'results/scene': holds results of another scene, where" in error
    assert "block.young_modulus was 4000.0, load.steps was 1 (allowed: another folder, " in error
    assert error.rstrip().endswith("or --overwrite)")
    assert before == [path.stat().st_mtime_ns for path in files]
    assert main([*words, STIFFER, "load.steps=2", "--overwrite"]) == 0


def test_keys_that_are_set_make_folders_of_their_own(scene, capsys):
    for changes in ([], [STIFFER], ["load.steps=1", STIFFER], [STIFFER, "load.steps=1"]):
        assert main(["run", "scene.toml", "--set", *changes, "output.figures=false"]) == 0
    assert {path.name for path in (scene.parent / "results").iterdir()} == {
        "scene",
        "scene-block.young_modulus=5_GPa",
        "scene-block.young_modulus=5_GPa-load.steps=1",  # in whatever order
    }


def test_the_same_scene_is_run_again_until_somebody_changes_its_results(scene, capsys):
    assert main(["run", "scene.toml"]) == 0
    words = ("--out", "results/scene", "--set", "block.young_modulus=4000")
    assert main(["run", "scene.toml", *words]) == 0
    # what is written beside the results makes no other scene of it
    assert main(["run", "scene.toml", "--set", "output.report=true"]) == 0
    assert (scene.parent / "results" / "scene" / "report.html").is_file()
    changed = scene.parent / "results" / "scene" / "history.csv"
    changed.write_bytes(changed.read_bytes() + b" ")
    assert main(["run", "scene.toml"]) == 2
    assert "holds history.csv, which is no result" in capsys.readouterr().err


def test_what_an_earlier_version_did_not_know_is_no_difference(scene):
    assert main(["run", "scene.toml"]) == 0
    path = scene.parent / "results" / "scene" / "provenance.json"
    facts = json.loads(path.read_text(encoding="utf-8"))
    del facts["scene_given"]["surface"]["periodic"], facts["scene_given"]["reference"]
    with OwnFiles(path.parent).writing([path.name]):
        path.write_text(json.dumps(facts), encoding="utf-8")
    assert main(["run", "scene.toml"]) == 0


@pytest.mark.parametrize("content", ["", "[1]", '{"scene_given": 3}', "{}"])
def test_what_is_no_result_is_replaced_when_that_is_asked_for(scene, content):
    folder = scene.parent / "results" / "scene"
    folder.mkdir(parents=True)
    (folder / "provenance.json").write_text(content, encoding="utf-8")
    assert main(["run", "scene.toml"]) == 2
    assert main(["run", "scene.toml", "--overwrite"]) == 0


def test_a_killed_run_of_another_scene_is_kept(scene, capsys):
    folder = scene.parent / "results" / "scene"
    folder.mkdir(parents=True)
    run = Run(Scene.load(scene))
    with CheckpointWriter(folder, run, lambda: None) as checkpoints:
        checkpoints.accept()
    assert (folder / FILE_NAME).is_file()
    assert main(["run", "scene.toml", "--out", "results/scene", "--set", STIFFER]) == 2
    error = capsys.readouterr().err
    assert "block.young_modulus = 5000.0: is not what the run in results/scene began with" in error
    assert "--overwrite (allowed: 4000.0)" in error
    assert main(["run", "scene.toml"]) == 0
    assert "goes on after load step 0" in capsys.readouterr().out
    assert not (folder / FILE_NAME).exists()
