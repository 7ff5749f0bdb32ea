"""The doctor: what it finds, and what it makes of machines that are not well."""

import json
import os
from types import SimpleNamespace

import pytest

from geometry.errors import InputError
from multiscale.cli.command_line import main
from multiscale.doctor import forms as doctor_forms
from multiscale.doctor import machine as doctor_machine
from multiscale.doctor import packages as doctor_packages
from multiscale.doctor.examination import examine, verdict
from multiscale.doctor.finding import Finding

OPEN_MPI = "Open MPI v4.1.4"


def test_a_tested_machine_is_well(capsys):
    assert main(["doctor", "--json"]) == 0
    findings = {found["topic"]: found for found in json.loads(capsys.readouterr().out)}
    assert {"packages", "PETSc", "ranks", "threads", "memory", "form cache"} <= set(findings)
    assert all(found["state"] != "fail" for found in findings.values())
    assert findings["test solve"]["state"] == "ok"
    assert "dolfinx" in findings["packages"]["text"]


def test_lines_come_with_remedies(capsys, monkeypatch):
    finding = Finding("BLAS", "warning", "the reference [BLAS]", "apt-get install it")
    monkeypatch.setattr(doctor_machine, "blas", lambda comm: [finding])
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert "the reference [BLAS]" in shown  # no markup
    assert "→ apt-get install it" in shown


def test_a_failed_check_fails(capsys, monkeypatch):
    def broken(comm):
        raise RuntimeError("no such device")

    monkeypatch.setattr(doctor_machine, "memory", broken)
    assert main(["doctor"]) == 2
    shown = capsys.readouterr()
    assert "RuntimeError: no such device" in shown.out
    assert shown.err == "patchlaw: doctor: not fit to run: memory\n"


def test_verdict_names_all_failures():
    found = [Finding("a", "fail", ""), Finding("b", "warning", ""), Finding("c", "fail", "")]
    with pytest.raises(InputError, match=r"a, c$"):
        verdict(found)
    verdict(found[1:2])


@pytest.mark.parametrize(
    ("library", "shown", "state", "text"),
    [
        (OPEN_MPI, "mpirun (Open MPI) 4.1.4 Report bugs to", "ok", "same family"),
        (OPEN_MPI, "mpirun (Open MPI) 5.0.7", "warning", "mpirun is version 5.0"),
        (OPEN_MPI, "HYDRA build details: Version: 4.0.2", "fail", "belongs to MPICH"),
        (OPEN_MPI, "Intel(R) MPI Library for Linux* OS, Version 2021.5", "fail", "to Intel MPI"),
        ("MPICH Version: 4.0.2", "HYDRA build details: Version: 4.0.2", "ok", "same family"),
        (OPEN_MPI, "", "warning", "no mpirun on PATH"),
    ],
)
def test_launcher_is_compared_with_the_library(library, shown, state, text):
    found = doctor_machine._match(library, shown)
    assert (found.state, text in found.text) == (state, True), found


def test_singletons_under_a_foreign_launcher_are_seen(monkeypatch):
    monkeypatch.setenv("PMI_SIZE", "4")
    (found,) = doctor_machine.launcher(None)
    assert found.state == "fail"
    assert "one of 4 processes" in found.text
    assert "Open MPI" in found.remedy or "MPICH" in found.remedy


def test_too_many_threads_are_seen(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", str(4 * os.cpu_count()))
    (found,) = doctor_machine.threads(None)
    assert found.state == "warning"


class Ranks:
    """Two ranks of one host, both saying what this one says."""

    size, rank = 2, 0

    @staticmethod
    def allgather(value):
        return [value, value]


def test_threads_of_all_ranks_count(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", str(len(os.sched_getaffinity(0))))
    assert doctor_machine.threads(None)[0].state == "ok"
    assert doctor_machine.threads(Ranks)[0].state == "warning"
    monkeypatch.delenv("OMP_NUM_THREADS")  # every rank would take all cores
    assert doctor_machine.threads(Ranks)[0].state == "warning"


def test_memory_is_shared_by_the_ranks_of_a_host(monkeypatch):
    monkeypatch.setattr(doctor_machine, "_free_bytes", lambda: 1.5e9)
    assert doctor_machine.memory(None) == [Finding("memory", "ok", "1.5 GB free per rank")]
    assert doctor_machine.memory(Ranks)[0].state == "warning"


def test_memory_of_a_control_group_is_what_is_left_of_it(monkeypatch):
    monkeypatch.setattr(doctor_machine, "group_memory", lambda: [(9e18, 1e9), (3e9, 2.5e9)])
    assert doctor_machine.memory(None)[0].text == "0.5 GB free per rank"


def test_reference_blas_is_told(monkeypatch):
    monkeypatch.setattr(doctor_machine, "_loaded", list)
    (found,) = doctor_machine.blas(None)
    assert "libopenblas0" in found.remedy


def test_old_and_missing_packages_are_seen(monkeypatch):
    def load(name):
        if name == "gmsh":
            raise ImportError("no module named gmsh")
        return SimpleNamespace(__version__="0.1")

    monkeypatch.setattr(doctor_packages.importlib, "import_module", load)
    states = {found.topic: found.state for found in doctor_packages.versions(None)}
    assert states["gmsh"] == states["scipy"] == "fail"


def test_left_lock_fails_and_names_the_command(monkeypatch, tmp_path):
    monkeypatch.setattr("macro.compat.form_cache", lambda: tmp_path)
    assert doctor_forms.cache(None)[0].state == "ok"
    left = tmp_path / "libffcx_forms_1.c"
    left.touch()
    os.utime(left, (0, 0))
    (found,) = doctor_forms.cache(None)
    assert (found.state, "patchlaw warm" in found.remedy) == ("fail", True)


def test_cache_that_may_not_be_entered_is_a_warning(monkeypatch, tmp_path):
    def refused(path, pattern=""):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("macro.compat.form_cache", lambda: tmp_path)
    monkeypatch.setattr(doctor_forms.Path, "exists", refused)
    monkeypatch.setattr(doctor_forms.Path, "glob", refused)
    (found,) = doctor_forms.cache(None)
    assert (found.state, "XDG_CACHE_HOME" in found.remedy) == ("warning", True)


def test_compiler_that_fails_is_a_warning(monkeypatch):
    assert doctor_forms.compiler_works(None)[0].state == "ok"
    monkeypatch.setenv("CC", "/bin/false")
    (found,) = doctor_forms.compiler_works(None)
    assert (found.state, "patchlaw warm" in found.remedy) == ("warning", True)


def test_broken_check_is_a_finding(monkeypatch):
    monkeypatch.setattr(
        doctor_forms, "known_solve", lambda comm: verdict([Finding("x", "fail", "")])
    )
    last = examine(None)[-1]
    assert (last.topic, last.state) == ("test solve", "fail")
