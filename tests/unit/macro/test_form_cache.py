"""The cache of compiled forms: locks left behind, folders that refuse, remedies."""

import os
import subprocess
import sys
import time

import pytest

from patchlaw.macro import disk_caches as jit
from patchlaw.support import InputError


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
    "from mpi4py import MPI; from patchlaw.geometry.meshes.block import BlockShape;"
    "from patchlaw.macro import Block, Material, block_mesh;"
    "shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1));"
    "material = Material(young_modulus=1.0, poisson_ratio=0.3);"
    "print(Block(block_mesh(shape, MPI.COMM_SELF), material).stiffness.norm())"
)


@pytest.mark.slow
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


def compile_in(home, root):
    """Compile the forms of a block in a process of its own, with its cache in a folder."""
    return subprocess.run(
        [sys.executable, "-c", COMPILE], cwd=root, capture_output=True, text=True, timeout=120,
        env=os.environ | {"XDG_CACHE_HOME": str(home), "OMP_NUM_THREADS": "1"}, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def filled(root, tmp_path_factory):
    """A home with a filled cache, its compiled forms, and what they make."""
    home = tmp_path_factory.mktemp("home")
    done = compile_in(home, root)
    assert done.returncode == 0, done.stderr
    forms = sorted((home / "patchlaw" / "forms").glob("libffcx_*.so"))
    assert forms and not (home / "fenics").exists()
    return home, forms, done.stdout


@pytest.mark.long
def test_a_damaged_form_is_compiled_anew(root, filled):
    home, forms, made = filled
    whole = {form: form.read_bytes() for form in forms}
    times = {form: form.stat().st_mtime_ns for form in forms}
    for form, content in whole.items():
        middle = len(content) // 2
        form.write_bytes(content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :])
    done = compile_in(home, root)
    assert (done.returncode, done.stdout) == (0, made), done.stderr
    assert all(form.stat().st_mtime_ns > times[form] for form in forms)


@pytest.mark.long
def test_a_form_without_its_checksum_is_compiled_anew_once_nobody_can_be_at_it(root, filled):
    home, (form, *_), made = filled
    form.with_suffix(".sha256").unlink()
    age(form, 600)
    done = compile_in(home, root)
    assert (done.returncode, done.stdout) == (0, made), done.stderr
    assert form.stat().st_mtime > time.time() - 300
    assert form.with_suffix(".sha256").exists()


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_a_folder_that_others_can_write_is_refused(tmp_path, mode):
    folder = tmp_path / "forms"
    with jit.trusted(folder):
        assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(mode)
    with (
        pytest.raises(InputError, match=r"forms': others can write to this folder, .*chmod 700"),
        jit.trusted(folder),
    ):
        raise AssertionError


def test_forms_that_others_can_write_are_removed(tmp_path):
    tmp_path.chmod(0o755)
    for name in ("own", "theirs"):
        (tmp_path / f"libffcx_forms_{name}.so").write_bytes(b"compiled")
        (tmp_path / f"libffcx_forms_{name}.c.cached").touch()
    with jit.trusted(tmp_path):
        pass
    (tmp_path / "libffcx_forms_theirs.so").chmod(0o666)
    with jit.trusted(tmp_path):
        assert [path.name for path in tmp_path.glob("*.so")] == ["libffcx_forms_own.so"]
        assert not (tmp_path / "libffcx_forms_theirs.c.cached").exists()


def test_forms_are_looked_at_again_where_files_came_or_others_may_enter(tmp_path, monkeypatch):
    folder, looked, scandir = tmp_path / "forms", [], os.scandir
    monkeypatch.setattr(jit.os, "scandir", lambda path: looked.append(path) or scandir(path))

    def looks(times):
        looked.clear()
        for _ in range(times):
            with jit.trusted(folder):
                pass
        return len(looked)

    assert looks(3) == 3  # what comes within a moment leaves the folder's time as it is
    age(folder, 600)
    assert looks(3) == 1
    cut = folder / "libffcx_forms_cut.so"
    cut.write_bytes(b"without a checksum")
    age(cut, 600)
    assert looks(1) == 1 and not cut.exists()
    folder.chmod(0o755)
    age(folder, 600)
    assert looks(3) == 3


def test_forms_of_others_are_not_loaded(tmp_path, monkeypatch):
    (tmp_path / "libffcx_forms_own.so").touch()
    monkeypatch.setattr(jit.os, "geteuid", lambda: 12345)
    monkeypatch.setattr(jit, "_ROOT", 54321)
    with pytest.raises(InputError, match="others can write to this folder"), jit.trusted(tmp_path):
        raise AssertionError
