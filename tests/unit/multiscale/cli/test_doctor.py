"""The doctor: what it names, and what it makes of machines that are not well."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from patchlaw.macro import disk_caches as jit
from patchlaw.multiscale.cli import about
from patchlaw.multiscale.cli.command_line import main
from patchlaw.support import InputError


@pytest.mark.long
def test_of_a_machine_that_is_well_versions_are_named(capsys):
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    lines = [line.partition(" ")[0] for line in shown.splitlines()]
    assert lines[:2] == ["python", "PETSc"] and len(lines) == 3, shown
    assert ", dolfinx " in shown and "mpirun" in shown and "fails" not in shown


def test_a_check_that_raises_has_failed(monkeypatch, capsys):
    def broken(comm):
        raise RuntimeError("no [such] device")

    def refused(comm):
        raise InputError("has none", key="HOME")

    checks = {"PETSc": broken, "solve": lambda comm: "", "form cache": refused}
    monkeypatch.setattr(about, "CHECKS", checks)
    assert main(["doctor"]) == 2
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "PETSc fails: RuntimeError: no [such] device; please report this",
        "form cache fails: HOME: has none",
    ]
    assert told.err == "patchlaw: doctor: not fit to run: PETSc, form cache\n"


def test_the_mpirun_of_the_environment_is_named(monkeypatch, tmp_path, capsys):
    own = tmp_path / "bin" / "mpirun"
    own.parent.mkdir()
    own.touch(mode=0o755)
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert about.launcher(None) == ""
    assert f"{own}; one process" in capsys.readouterr().out


def test_singletons_under_a_foreign_launcher_are_seen(monkeypatch):
    monkeypatch.setenv("PMI_SIZE", "4")
    problem = about.launcher(None)
    assert problem.startswith("one of 4 processes, each alone; start with the mpirun of ")


def test_old_and_missing_packages_are_seen():
    def load(name):
        if name in ("h5py", "matplotlib"):  # of which figures alone need the second
            raise ImportError(f"no module named {name}")
        return SimpleNamespace(__version__="0.1")

    _, wrong = about.versions(load)
    assert "h5py: no module named h5py" in wrong and "matplotlib" not in wrong
    assert "scipy 0.1 is older than 1.10" in wrong


def test_a_wrong_force_fails(monkeypatch):
    steps = [SimpleNamespace(force_N=8.0)]
    monkeypatch.setattr("patchlaw.multiscale.runs.scene_run.run", lambda scene, comm: steps)
    assert about.known_solve(None).startswith("a force is off by ")


def test_left_lock_fails_and_names_the_command(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "form_folder", lambda: tmp_path)
    assert about.form_cache(None) == ""
    left = tmp_path / "libffcx_forms_1.c"
    left.touch()
    os.utime(left, (0, 0))
    assert about.form_cache(None) == f"{left} was cut short; clear it with: patchlaw warm"


def test_a_folder_that_may_not_be_entered_has_no_locks(monkeypatch, tmp_path):
    def refused(path, pattern=""):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "exists", refused)
    monkeypatch.setattr(Path, "glob", refused)
    monkeypatch.setattr(jit, "form_folder", lambda: tmp_path)
    assert about.form_cache(None) == ""


@pytest.mark.parametrize("words", [["--json"], ["scene.toml"]])
def test_the_doctor_takes_no_words(words, capsys):
    assert main(["doctor", *words]) == 2
    assert "unrecognized arguments" in capsys.readouterr().err
