"""The doctor: what it finds, and what it makes of machines that are not well."""

import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from patchlaw.multiscale.cli import doctor
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.cli.doctor import CheckResult, examine
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.support.errors import InputError


def test_a_tested_machine_is_well(capsys):
    assert main(["doctor", "--json"]) == 0
    findings = {found["topic"]: found for found in json.loads(capsys.readouterr().out)}
    assert {"packages", "PETSc", "ranks", "threads", "form cache"} <= set(findings)
    assert all(found["state"] != "fail" for found in findings.values())
    assert findings["test solve"]["state"] == "ok"
    assert "dolfinx" in findings["packages"]["text"]


def test_lines_come_with_remedies(capsys):
    doctor.show("threads", CheckResult("warning", "the reference [BLAS]", "apt-get install it"))
    shown = capsys.readouterr().out
    assert "the reference [BLAS]" in shown  # no markup
    assert "→ apt-get install it" in shown


def test_a_check_that_raises_has_failed(monkeypatch, capsys):
    def broken(comm):
        raise RuntimeError("no such device")

    def refused(comm):
        raise InputError("has none", key="HOME")

    checks = {"PETSc": broken, "ranks": doctor.ranks, "form cache": refused}
    petsc, ranks, cache = dict(examine(None, checks)).values()
    assert (petsc.state, petsc.text) == ("fail", "RuntimeError: no such device")
    assert ranks.text.startswith("1: 1 on ")
    assert (cache.state, cache.text) == ("fail", "HOME: has none")
    monkeypatch.setattr(doctor, "CHECKS", checks)
    assert main(["doctor"]) == 2
    assert capsys.readouterr().err == "patchlaw: doctor: not fit to run: PETSc, form cache\n"


def test_a_warning_is_no_failure(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "CHECKS", {"threads": lambda comm: CheckResult("warning", "slow")})
    assert main(["doctor"]) == 0
    assert "slow" in capsys.readouterr().out


def test_a_launcher_that_is_missing_is_a_warning(monkeypatch):
    assert doctor.launcher(None).state == "ok"
    monkeypatch.setattr(doctor.sys, "prefix", "/nowhere")  # a launcher beside Python is named
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    found = doctor.launcher(None)
    assert (found.state, "no mpirun on PATH" in found.text) == ("warning", True)


def test_the_mpirun_of_another_mpi_is_a_warning(monkeypatch, tmp_path):
    """As where an environment has its MPI from a wheel, and the system one of its own."""
    own, other = tmp_path / "bin" / "mpirun", tmp_path / "other" / "mpirun"
    for each in (own, other):
        each.parent.mkdir()
        each.touch(mode=0o755)
    monkeypatch.setattr(doctor.sys, "prefix", str(tmp_path))
    monkeypatch.setenv("PATH", str(other.parent))
    found = doctor.launcher(None)
    assert (found.state, f"{other} comes first on PATH" in found.text) == ("warning", True)
    assert found.remedy.endswith(f"start ranks with {own}")
    monkeypatch.setenv("PATH", f"{own.parent}{os.pathsep}{other.parent}")
    assert doctor.launcher(None).state == "ok"


@pytest.mark.parametrize(("there", "by"), [(True, "by hypre"), (False, "by PETSc's GAMG")])
def test_the_multigrid_of_meshes_is_named(monkeypatch, there, by):
    monkeypatch.setattr("patchlaw.macro.linear_solvers.options.has_hypre", lambda: there)
    found = doctor.petsc(None)
    assert (found.state, f"coarsen {by}" in found.text) == ("ok", True)


def test_singletons_under_a_foreign_launcher_are_seen(monkeypatch):
    monkeypatch.setenv("PMI_SIZE", "4")
    found = doctor.launcher(None)
    assert found.state == "fail"
    assert "one of 4 processes" in found.text
    assert "Open MPI" in found.remedy or "MPICH" in found.remedy


def test_too_many_threads_are_seen(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", str(4 * os.cpu_count()))
    found = doctor.threads(None)
    assert found.state == "warning"


class Ranks:
    """Two ranks of one host, both saying what this one says."""

    size, rank = 2, 0

    @staticmethod
    def allgather(value):
        return [value, value]


def test_threads_of_all_ranks_count(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", str(len(os.sched_getaffinity(0))))
    assert doctor.threads(None).state == "ok"
    assert doctor.threads(Ranks).state == "warning"
    monkeypatch.delenv("OMP_NUM_THREADS")  # every rank would take all cores
    assert doctor.threads(Ranks).state == "warning"


@pytest.mark.parametrize(
    ("ranks", "state", "text"),
    [((1,), "ok", "1.5 GB of memory for each"), ((1, 2), "warning", "0.8 GB")],
)
def test_memory_is_shared_by_the_ranks_of_a_host(monkeypatch, ranks, state, text):
    nodes = ClusterNodes(ranks=ranks, memory=1.5e9)
    monkeypatch.setattr(doctor, "cluster_nodes", lambda comm: nodes)
    found = doctor.ranks(None)
    assert (found.state, text in found.text) == (state, True)


def test_reference_blas_is_told():
    found = doctor.threads(None, libraries=[])
    assert "libopenblas0" in found.remedy


def test_old_and_missing_packages_are_seen():
    def load(name):
        if name == "h5py":
            raise ImportError("no module named h5py")
        return SimpleNamespace(__version__="0.1")

    found = doctor.packages(None, load)
    assert found.state == "fail"
    assert "h5py: no module named h5py" in found.text
    assert "scipy 0.1 is older than 1.10" in found.text


def test_missing_pictures_are_a_warning():
    def load(name):
        if name == "matplotlib":
            raise ImportError("no module named matplotlib")
        return SimpleNamespace(__version__="99.0")

    assert doctor.packages(None, load).state == "warning"


def test_the_worst_result_of_all_ranks_counts():
    class OtherRank:
        """A rank beside one that lacks a package."""

        @staticmethod
        def allgather(value):
            return [value, CheckResult("fail", "h5py: no module named h5py")]

    found = dict(examine(OtherRank, {"packages": lambda comm: CheckResult("ok", "all")}))
    assert found["packages"].state == "fail"


def test_left_lock_fails_and_names_the_command(tmp_path):
    assert doctor.form_cache(None, tmp_path).state == "ok"
    left = tmp_path / "libffcx_forms_1.c"
    left.touch()
    os.utime(left, (0, 0))
    found = doctor.form_cache(None, tmp_path)
    assert (found.state, "patchlaw warm" in found.remedy) == ("fail", True)


def test_cache_that_may_not_be_entered_is_a_warning(monkeypatch, tmp_path):
    def refused(path, pattern=""):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "exists", refused)
    monkeypatch.setattr(Path, "glob", refused)
    found = doctor.form_cache(None, tmp_path)
    assert (found.state, "XDG_CACHE_HOME" in found.remedy) == ("warning", True)


def test_compiler_that_is_missing_is_a_warning(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    found = doctor.form_cache(None, tmp_path)
    assert (found.state, "patchlaw warm" in found.remedy) == ("warning", True)
