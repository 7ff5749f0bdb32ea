"""Checkpoints: what is kept, what is refused, and that a resumed run meets the undisturbed one."""

import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import asdict, dataclass, fields, replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs import resolving
from patchlaw.multiscale.runs.output.results import write_fields
from patchlaw.multiscale.runs.output.results_folder import (
    CheckpointWriter,
    FolderLock,
    find_checkpoint,
    read_checkpoint,
)
from patchlaw.support import InputError, NotConverged, NotWritten
from patchlaw.support.files import LIST, write_record

PAPER = Path(__file__).parents[5] / "demos" / "scenes" / "paper.toml"
ALONE = {"coupling": {"kind": "analytic"}, "micro": {"model": "half-space"}}
CUBE = {"block": {"cells": [3, 3, 2]}, "patches": {"grid": [2, 2]}}
FORCE = {"force": ["3 N", "1 N", "2 N"], "steps": 1, "tilt": "free"}
COUPLINGS = {
    "half-space": ALONE,
    "half-space, balanced force": ALONE | {"load": FORCE},
    "asperities": ALONE | {"micro": {"model": "elliptic"}},
    "condensed, halved steps": CUBE
    | {"coupling": {"kind": "isolated"}}
    | {"load": {"approach": "8 um", "steps": 2, "force_change": 0.4}},
    "consistent laws": CUBE
    | {"surface": {"grid": [32, 32]}, "micro": {"model": "half-space"}}
    | {"coupling": {"kind": "consistent", "table_tolerance": 0.05}},
    "concurrent": CUBE
    | {"surface": {"grid": [72, 72]}, "coupling": {"kind": "concurrent"}}
    | {"micro": {"model": "half-space"}},
    "rough blocks, balanced force": {"block": {"grading": 4.0}}
    | {"reference": {"fine": 0.08}, "coupling": {"kind": "reference"}}
    | {"patches": {"grid": [2, 2]}, "load": FORCE},
    "on the mesh, at points, balanced force": CUBE
    | {"coupling": {"kind": "isolated", "interface": "pointwise"}, "load": FORCE},
}


def scene(changes):
    """Return the paper's scene, small, with some sections changed."""
    data = tomllib.loads(PAPER.read_text(encoding="utf-8"))
    data["surface"]["grid"] = [48, 48]
    data["load"] = {"approach": ["8 um", "4 um"], "steps": 2}
    data["output"] = {"check": "none"}
    for name, section in changes.items():
        data[name] = section if name == "load" else data.get(name, {}) | section
    return Scene.from_dict(data)


def columns(steps):
    """Return what a resumed run has to meet, a row per step."""
    return np.array([
        [s.approach_mm, s.force_N, s.contact_area_fraction, s.mean_separation_mm, *s.tilt,
         *s.moment_N_mm, *s.patches.pressure_MPa, *s.patches.closure_mm,
         *s.patches.contact_area_fraction]
        for s in steps
    ])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param(one, id=name, marks=[pytest.mark.long] * name.startswith("rough"))
        for name, one in COUPLINGS.items()
    ],
)
def test_resumed_run_is_as_if_never_stopped(tmp_path, changes):
    whole = Run(scene(changes))
    for step in whole.load_steps():
        path = tmp_path / f"{step.step}.h5"
        write_record(path, whole.checkpoint(whole.coupling.state()))
    count = len(whole.steps)
    assert count >= 3
    wanted = columns(whole.steps)
    scale = np.abs(wanted).max(axis=0)
    scale[6:8] = scale[1]  # moments vanish: they count relative to force times 1 mm
    # on the mesh a step is solved to 1e-10 of the load from other first guesses; else bit for bit
    exact = whole.coupling.unknowns is None
    for done in (1, count - 1):
        again = Run(whole.scene)
        kept = read_checkpoint(tmp_path / f"{done}.h5")
        again.resume(kept)
        list(again.load_steps())
        off = np.abs(columns(again.steps) - wanted)
        assert np.all(off <= (0.0 if exact else 1e-10) * scale)
        assert again.finished


def test_checkpoint_keeps_every_bit(tmp_path):
    load = {"approach": "8 um", "steps": 2, "tilt": [1e-3, 0.0]}
    run = Run(scene(CUBE | {"load": load, "output": {"check": "last"}}))
    list(run.load_steps())
    kept = run.checkpoint(run.coupling.state())
    found = read_checkpoint(write_record(tmp_path / "c.h5", kept))
    assert (found.identity, found.resolved) == (kept.identity, kept.resolved)
    assert (found.position, found.laws) == (kept.position, kept.laws)
    for one, other in zip(found.steps, kept.steps, strict=True):
        for field in fields(one):
            if field.name != "patches":
                mine, its = (getattr(step, field.name) for step in (one, other))
                assert mine == its or (mine != mine and its != its)  # errors not measured are nan
        for field in fields(one.patches):
            mine, its = (getattr(step.patches, field.name) for step in (one, other))
            np.testing.assert_array_equal(mine, its)


@pytest.fixture(scope="module")
def ended():
    """A small run that came to its end."""
    run = Run(scene(ALONE))
    list(run.load_steps())
    return run


@pytest.fixture
def at_once(monkeypatch):
    """Let checkpoints be written in the first second, too."""
    monkeypatch.setattr("patchlaw.multiscale.runs.output.results_folder.LEAST_INTERVAL", 0.0)


def interrupted(folder, ended, steps=2):
    """Leave in a folder what a run leaves that is stopped after some steps."""
    run = Run(ended.scene)
    lock = FolderLock(folder)
    with CheckpointWriter(folder, run, lock.hold) as writer:
        writer.accept()
        for step in run.load_steps():
            writer.accept()
            if step.step == steps:
                break
    lock.release()
    return folder / "checkpoint.state"


def resumed(folder, changed):
    """Return a run that goes on from the checkpoint in a folder; None without one."""
    found = find_checkpoint(folder, changed)
    if found is None:
        return None
    run = Run(changed, stated=changed.with_(found.resolved))
    run.resume(found)
    return run


def test_load_steps_of_the_last_second_are_written_when_the_run_ends(tmp_path, ended, monkeypatch):
    monkeypatch.setattr("patchlaw.multiscale.runs.output.results_folder.LEAST_INTERVAL", 1e9)
    run, lock = Run(ended.scene), FolderLock(tmp_path / "out")
    path = tmp_path / "out" / "checkpoint.state"
    with (
        pytest.raises(RuntimeError, match="a bug"),
        CheckpointWriter(path.parent, run, lock.hold) as w,
    ):
        w.accept()
        for _ in run.load_steps():
            w.accept()
            if len(run.steps) == 2:
                break
        assert not path.exists()  # a kill would leave nothing here
        raise RuntimeError("a bug")
    lock.release()
    np.testing.assert_array_equal(columns(read_checkpoint(path).steps), columns(ended.steps[:2]))
    assert len(resumed(path.parent, ended.scene).steps) == 2


@pytest.mark.usefixtures("at_once")
def test_checkpoint_is_replaced_whole_and_removed(tmp_path, ended):
    run, lock = Run(ended.scene), FolderLock(tmp_path / "out")
    with CheckpointWriter(tmp_path / "out", run, lock.hold) as writer:
        for step in run.load_steps():
            writer.accept(step)
            writer.finish()
            assert len(read_checkpoint(writer.path).steps) == step.step
        writer.remove()
    lock.release()
    assert not (tmp_path / "out").exists()


def flip(path):
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.write_bytes(content)


@dataclass
class Gone:
    """A record that this version does not know."""

    number: int = 1


def in_another_layout(path):
    """Replace a checkpoint by one of the layout of 0.9: facts, and the shapes of arrays."""
    line = b'[{"format": "patchlaw checkpoint 8"}, {}]\n'
    path.write_bytes(f"{sha256(line).hexdigest()} {len(line)}\n".encode() + line)


UNFIT, NONE, OTHER = "its bytes do not fit their", "is no checkpoint", "written by another patchlaw"
DAMAGE = {
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:3000]), UNFIT),
    "foreign": (lambda path: path.write_bytes(b"nothing of the kind\n"), UNFIT),
    "no checkpoint": (lambda path: write_record(path, ["a list"]), NONE),
    "its content alone": (lambda path: write_record(path, asdict(read_checkpoint(path))), NONE),
    "a bit flipped": (flip, UNFIT),
    "another layout": (in_another_layout, OTHER),
    "another class": (lambda path: write_record(path, Gone()), OTHER),
    "states of another layout": (
        lambda path: write_record(path, replace(read_checkpoint(path), layout=1)), OTHER
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_checkpoint_is_refused_and_stays(tmp_path, ended, name):
    path = interrupted(tmp_path / "out", ended)
    damage, text = DAMAGE[name]
    damage(path)
    before = {each.name: each.read_bytes() for each in path.parent.iterdir()}
    with pytest.raises(InputError, match=text) as error:
        resumed(path.parent, ended.scene)
    assert str(path) in str(error.value)
    assert "remove it, or begin anew with --overwrite" in str(error.value)
    assert {each.name: each.read_bytes() for each in path.parent.iterdir()} == before


def test_an_interrupted_run_goes_on_unless_it_is_to_begin_anew(tmp_path, ended, capsys):
    path = interrupted(tmp_path / "out", ended, steps=3)
    (tmp_path / "scene.toml").write_text(PAPER.read_text(encoding="utf-8"), encoding="utf-8")
    words = ["run", str(tmp_path / "scene.toml"), "--out", str(path.parent), "--set",
             "surface.grid=[48, 48]", "coupling.kind=analytic", "micro.model=half-space",
             "load.approach=['8 um', '4 um']", "load.steps=2", "output.figures=false"]  # fmt: skip
    shutil.copytree(path.parent, tmp_path / "copy")
    assert main(words) == 0
    assert "goes on after load step 3" in capsys.readouterr().out
    words[words.index(str(path.parent))] = str(tmp_path / "copy")
    assert main([*words, "--overwrite"]) == 0
    assert "replaces the interrupted run in" in capsys.readouterr().out
    tables = [(each / "patches.csv").read_text() for each in (path.parent, tmp_path / "copy")]
    assert tables[0] == tables[1]


def test_results_of_a_run_to_the_end_outlive_one_that_ends_early(tmp_path, monkeypatch, capsys):
    words = ["run", *WORDS[1:2], "--out", str(tmp_path), *WORDS[2:]]
    assert main(words) == 0
    before = (tmp_path / "history.csv").read_bytes()
    capsys.readouterr()
    whole = Run.load_steps

    def failing(run):
        yield next(whole(run))
        raise NotConverged("load step 2", reason="LOST", iterations=3, remedy="smaller steps")

    with monkeypatch.context() as patch:
        patch.setattr(Run, "load_steps", failing)
        assert main(words) == 3
    told = capsys.readouterr()
    assert "the results of an earlier run to the end stay in" in told.out
    # a remedy is to change the scene, whose results then stand in the way
    assert "smaller steps; a changed scene needs --overwrite, or another folder than" in told.err
    assert (tmp_path / "history.csv").read_bytes() == before
    assert main(words) == 0
    assert "goes on after load step 1" in capsys.readouterr().out


@pytest.mark.parametrize(("changes", "text"), [
    ({"load": {"approach": "8 um", "steps": 2}}, r"load.approach = .*allowed: \[0.008, 0.004\]"),
    ({"block": {"poisson_ratio": 0.2}}, r"block.poisson_ratio = 0.2: .*allowed: 0.15"),
    ({"surface": {"detrend": "plane"}}, r"surface.detrend = 'plane': .*allowed: 'none'"),
])  # fmt: skip
def test_changed_scene_is_refused_with_the_key(tmp_path, ended, changes, text):
    interrupted(tmp_path / "out", ended)
    with pytest.raises(InputError, match=text):
        resumed(tmp_path / "out", scene(ALONE | changes))


def test_choices_for_another_scene_are_not_taken(tmp_path, ended):
    # they may not fit it: a micro model on a grid that the new surface does not have
    interrupted(tmp_path / "out", ended)
    assert find_checkpoint(tmp_path / "out", ended.scene).resolved == {}
    other = scene(ALONE | {"surface": {"grid": [32, 32]}})
    with pytest.raises(InputError, match=r"surface.grid = \[32, 32\].*allowed: \[48, 48\]"):
        find_checkpoint(tmp_path / "out", other)
    assert find_checkpoint(tmp_path / "elsewhere", other) is None


def test_other_outputs_may_be_asked_for(tmp_path, ended):
    interrupted(tmp_path / "out", ended)
    assert resumed(tmp_path / "out", scene(ALONE | {"output": {"figures": False}}))


def test_changed_heights_are_refused(tmp_path):
    heights = np.random.default_rng(1).normal(scale=1e-3, size=(16, 16))
    np.save(tmp_path / "h.npy", heights)
    surface = {"file": str(tmp_path / "h.npy"), "lengths": [1.0, 1.0]}
    data = tomllib.loads(PAPER.read_text(encoding="utf-8"))
    data |= {"surface": surface, **ALONE, "load": {"approach": "1 um", "steps": 2}}
    run = Run(Scene.from_dict(data))
    interrupted(tmp_path / "out", run, steps=1)
    np.save(tmp_path / "h.npy", heights * 1.01)
    with pytest.raises(InputError, match=r"content of surface.file = .*: is not what the run"):
        resumed(tmp_path / "out", run.scene)


def test_folder_that_vanishes_comes_back_whole(tmp_path, ended):
    run, folder = Run(ended.scene), tmp_path / "out"
    lock = FolderLock(folder)
    lock.hold()
    with CheckpointWriter(folder, run, lock.hold) as writer:
        writer.accept()
        for step in run.load_steps():
            if step.step == 2:
                shutil.rmtree(folder)
            writer.accept()
    lock.release()
    assert len(resumed(folder, ended.scene).steps) == len(ended.steps)


@pytest.mark.usefixtures("at_once")
def test_folder_that_becomes_a_file_under_way_ends_with_5(tmp_path, ended):
    path = interrupted(tmp_path / "out", ended)
    lock = FolderLock(path.parent)
    lock.hold()
    shutil.rmtree(path.parent)
    path.parent.touch()
    with pytest.raises(NotWritten, match="out: is not a folder") as error:
        CheckpointWriter(path.parent, ended, lock.hold).accept()
    assert error.value.exit_code == 5
    lock.release()


def test_folder_that_cannot_be_written_to_is_refused_before_anything_is_made(capsys):
    assert main([*WORDS[:2], "--out", "/proc/out", *WORDS[2:]]) == 2
    told = capsys.readouterr()
    assert "--out = '/proc/out': cannot be written to: " in told.err
    assert not told.out
    assert main(["plan", *WORDS[1:2], "--out", "/proc/out", *WORDS[2:]]) == 0  # writes nothing


@pytest.mark.usefixtures("at_once")
def test_full_disk_leaves_the_earlier_checkpoint(tmp_path, ended, monkeypatch):
    path = interrupted(tmp_path / "out", ended)
    before = path.read_bytes()

    def full(self, data):
        with self.open("wb") as file:
            file.write(data[:100])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    run = Run(ended.scene)
    with pytest.raises(
        NotWritten, match=r"checkpoint.state: cannot be written: No space left"
    ) as error:
        CheckpointWriter(path.parent, run, FolderLock(path.parent).hold).accept()
    assert error.value.exit_code == 5
    assert path.read_bytes() == before
    names = {"checkpoint.state"}
    assert {each.name for each in path.parent.iterdir()} == names
    assert len(read_checkpoint(path).steps) == 2


WORDS = [
    "run", str(PAPER), "--set", "surface.grid=[32, 32]", "coupling.kind=analytic", "load.steps=2",
    "micro.model=half-space", "output.figures=false", "output.report=false",
]  # fmt: skip


def test_finished_run_is_done(capsys, tmp_path):
    words = [*WORDS[:2], "--out", str(tmp_path / "out"), "--resume", *WORDS[2:]]
    assert main(words) == 0
    assert "nothing to resume in" in capsys.readouterr().out
    before = (tmp_path / "out" / "history.csv").stat().st_mtime_ns
    assert main(words) == 0
    assert "this run is finished" in capsys.readouterr().out
    assert (tmp_path / "out" / "history.csv").stat().st_mtime_ns == before
    other = [*words, "load.approach=4 um"]
    assert main(other) == 2  # of another scene: not lost
    assert "load.approach was [0.008]" in capsys.readouterr().err
    assert main([*other, "--overwrite"]) == 0
    assert "nothing to resume in" in capsys.readouterr().out


LIMITED = (
    "import resource, sys; from mpi4py import MPI;"
    "from patchlaw.multiscale.cli.command_line import main;"
    "resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY));"
    "sys.dont_write_bytecode = True;"  # which would stay cut off for all tests to come
    "sys.exit(main(sys.argv[2:]))"
)  # MPI writes files of its own when it starts


@pytest.mark.long
@pytest.mark.parametrize(
    ("size", "file", "left"),
    [
        (2_000, "history.csv", set()),
        pytest.param(40_000, "surface.png", {"history.csv", "patches.csv"}, marks=pytest.mark.long),
    ],
)
def test_run_on_a_full_disk_ends_with_5_and_goes_on(capsys, tmp_path, size, file, left):
    """The limit on the size of files stands for a disk that is full."""
    out = tmp_path / "out"
    words = [*WORDS[:2], "--out", str(out), "--resume", *WORDS[2:]]
    if file.endswith("png"):
        words[words.index("output.figures=false")] = "output.contact=none"  # larger than 60 kB
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(size), *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == f"patchlaw: {out / file}: cannot be written: File too large\n"
    assert done.returncode == 5
    kept = {path.name for path in out.iterdir()} - {LIST} if out.exists() else set()
    kept_of_run = {"checkpoint.state"}
    assert kept == (left | kept_of_run if left else set())
    assert main(words) == 0
    assert ("goes on after load step 2" in capsys.readouterr().out) == bool(left)
    assert (out / "history.csv").exists() and (out / "surface.png").exists() == bool(left)
    assert not list(out.glob("checkpoint*"))


@pytest.mark.long
def test_fields_on_a_full_disk_end_with_5_and_leave_nothing_half_written(tmp_path):
    out = tmp_path / "out"
    on_block = ["coupling.kind=concurrent", "block.cells=[16, 16, 8]", "output.fields=true"]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, "150000", *WORDS, *on_block, "--out", str(out)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 5, done.stderr
    assert f"patchlaw: {out}/fields.xdmf: cannot be written: " in done.stderr
    assert {path.name for path in out.iterdir()} == {
        "history.csv", "patches.csv", "provenance.json", "checkpoint.state",
        "contacts.csv", "contact.h5", LIST,
    }  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", ["fields.h5", "fields.xdmf"])
def test_fields_cut_short_in_silence_are_told(tmp_path, monkeypatch, name):
    def cut(path, *arguments):
        write(path, *arguments)
        os.truncate(path.with_name(name), path.with_name(name).stat().st_size // 2)

    from patchlaw.macro import fields as macro_fields

    write = macro_fields.write_fields
    monkeypatch.setattr(macro_fields, "write_fields", cut)
    fields = {"output": {"fields": True}}
    run = Run(scene({"coupling": {"kind": "concurrent"}, "block": {"cells": [6, 6, 4]}} | fields))
    next(run.load_steps())
    with pytest.raises(NotWritten, match=rf"{name}: cannot be written: "):
        write_fields(tmp_path, run)
    assert not list(tmp_path.iterdir())


def test_folders_under_names_of_results_are_nobody_elses_to_remove(tmp_path, capsys):
    kept = tmp_path / "history.csv" / "kept"
    kept.mkdir(parents=True)
    words = [*WORDS[:2], "--out", str(tmp_path), *WORDS[2:]]
    assert main(words) == 2
    assert "holds history.csv, which is no result of patchlaw" in capsys.readouterr().err
    assert main([*words, "--overwrite"]) == 5
    assert "history.csv: cannot be written: Is a directory" in capsys.readouterr().err
    assert kept.exists()


@pytest.mark.long
def test_a_plan_stands_though_a_later_release_would_choose_otherwise(tmp_path, monkeypatch):
    stated = ("micro", "patches", "coupling")
    data = {key: part for key, part in scene({}).written.items() if key not in stated}
    data |= {"accuracy": 0.4, "block": {**data["block"], "cells": None}}
    del data["block"]["cells"]
    left_open = Scene.from_dict(data)
    whole = Run(left_open)
    next(steps := whole.load_steps())
    path = write_record(tmp_path / "c.h5", whole.checkpoint(whole.coupling.state()))
    list(steps)
    kept = read_checkpoint(path)

    monkeypatch.setattr(resolving, "SOLUTIONS_OF_LAWS", 0)
    assert Run(left_open).scene != whole.scene  # the plan would be another one here
    again = Run(left_open, stated=left_open.with_(kept.resolved))
    assert again.scene == whole.scene
    assert again.coupling.parts.micro.surface.grid == whole.coupling.parts.micro.surface.grid
    again.resume(kept)
    list(again.load_steps())
    np.testing.assert_allclose(columns(again.steps), columns(whole.steps), rtol=0.0, atol=0.0)
