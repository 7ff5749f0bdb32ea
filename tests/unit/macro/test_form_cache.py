"""The cache of compiled forms: locks left behind, folders that refuse, remedies."""

import os
import subprocess
import sys
import time

import pytest

from macro import form_cache as jit
from support.errors import InputError


def age(path, seconds):
    os.utime(path, (time.time() - seconds,) * 2)


@pytest.fixture
def folder(tmp_path):
    """A cache with a compiled form, one at work for 30 s and one cut short 10 minutes ago."""
    for name, seconds in (("done", 600), ("working", 30), ("cut", 600)):
        source = tmp_path / f"libffcx_forms_{name}.c"
        source.touch()
        age(source, seconds)
    (tmp_path / "libffcx_forms_done.c.cached").touch()
    return tmp_path


def test_only_old_sources_without_mark_are_left_locks(folder):
    assert [path.name for path in jit.stale_locks(folder)] == ["libffcx_forms_cut.c"]
    assert len(jit.stale_locks(folder, older_than=0.0)) == 2
    assert jit.stale_locks(folder / "nowhere") == []


def test_writable_asks_the_nearest_folder_that_exists(tmp_path):
    assert jit.writable(tmp_path / "a" / "b")
    (tmp_path / "file").touch()
    assert not jit.writable(tmp_path / "file" / "below")


def test_folder_that_may_not_be_entered_is_not_writable_and_has_no_locks(monkeypatch, folder):
    monkeypatch.setattr(jit.Path, "exists", refused)
    assert not jit.writable(folder)
    assert jit.stale_locks(folder) == []


def refused(path):
    raise PermissionError(13, "Permission denied", str(path))


def test_compiler_follows_the_environment(monkeypatch):
    monkeypatch.setenv("CC", "/bin/false -O2")
    assert jit.compiler() == "/bin/false"
    monkeypatch.setenv("CC", "no-such-compiler")
    assert jit.compiler() is None


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (PermissionError(13, "Permission denied"), "set XDG_CACHE_HOME"),
        (
            RuntimeError("Failed just-in-time compilation of form: [Errno 30] Read-only"),
            "XDG_CACHE",
        ),
        (RuntimeError("Failed just-in-time compilation of form: CompileError"), "patchlaw doctor"),
    ],
)
def test_errors_come_with_their_remedy(tmp_path, error, text):
    with (
        pytest.raises(InputError, match=rf"a form cannot be compiled \(.*{text}"),
        jit.explained(tmp_path),
    ):
        raise error


def test_a_wait_in_vain_names_the_command_that_clears(folder):
    with pytest.raises(InputError, match="patchlaw warm clears it"), jit.explained(folder):
        raise TimeoutError("JIT compilation timed out")


def test_bugs_stay_bugs(tmp_path):
    with pytest.raises(RuntimeError, match="shapes differ"), jit.explained(tmp_path):
        raise RuntimeError("shapes differ")


COMPILE = (
    "from mpi4py import MPI; from geometry.meshes.block import BlockShape;"
    "from macro import Block, Material, block_mesh;"
    "shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1));"
    "material = Material(young_modulus=1.0, poisson_ratio=0.3);"
    "print(Block(block_mesh(shape, MPI.COMM_SELF), material).stiffness.norm())"
)


def test_processes_that_compile_the_same_form_wait_for_each_other(root, tmp_path):
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path), "OMP_NUM_THREADS": "1"}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", COMPILE],
            cwd=root, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    shown = [process.communicate(timeout=120) for process in started]
    assert [process.returncode for process in started] == [0, 0], shown
    assert shown[0][0] == shown[1][0]
