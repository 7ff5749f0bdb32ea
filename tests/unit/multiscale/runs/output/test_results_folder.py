"""One run at a time writes to a folder, and a lock leaves nothing behind."""

import errno
import fcntl
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs.output.results_folder import FolderLock
from patchlaw.support import InputError

PAPER = Path(__file__).parents[5] / "demos" / "scenes" / "paper.toml"


VARY = ("--vary", "surface.spectrum.seed=0..3")
WRITING = (("laws",), ("surface",), ("run",), ("compare",), ("sweep", *VARY))


def refused(words, folder, capsys):
    """Tell whether a command on the paper's scene is refused as another one writes there."""
    name, *more = words
    small = ("--set", "surface.grid=[32, 32]")
    code = main([name, str(PAPER), "--out", str(folder), *more, *small])
    return code == 2 and "another run is writing to this folder" in capsys.readouterr().err


@pytest.mark.parametrize("words", WRITING)
def test_no_command_writes_where_a_run_does(tmp_path, capsys, words):
    out = tmp_path / "out"
    lock = FolderLock(out)
    lock.hold()
    assert refused(words, out, capsys)
    assert not list(out.iterdir())
    lock.release()


@pytest.mark.parametrize("words", [*WRITING[:-1], ("sweep", *VARY, "--overwrite")])
def test_no_command_but_other_parts_writes_where_a_sweep_does(tmp_path, capsys, words):
    """--overwrite removes the cases of parts that are running."""
    out = tmp_path / "out"
    lock = FolderLock(out, shared=True)
    lock.hold()
    (out / "result").touch()
    assert refused(words, out, capsys)
    other = FolderLock(out, shared=True)
    other.hold()
    other.release()
    lock.release()


def test_empty_folder_that_was_there_stays(tmp_path):
    lock = FolderLock(tmp_path)
    lock.hold()
    lock.release()
    assert tmp_path.is_dir() and not list(tmp_path.iterdir())


@pytest.fixture
def network(monkeypatch):
    """Let folders be without locks, as on NFS, where flock wants a file that is open to write."""
    flock = fcntl.flock

    def of_files(handle, operation):
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(errno.EBADF, "Bad file descriptor")
        return flock(handle, operation)

    monkeypatch.setattr(fcntl, "flock", of_files)


@pytest.mark.parametrize("locked", ["folder", "file"])
def test_two_runs_do_not_share_a_folder(tmp_path, locked, request):
    """A file is locked where folders cannot be."""
    if locked == "file":
        request.getfixturevalue("network")
    one, other = FolderLock(tmp_path / "out"), FolderLock(tmp_path / "out")
    one.hold()
    there = [".lock"] * (locked == "file")
    assert [path.name for path in (tmp_path / "out").iterdir()] == there
    with pytest.raises(InputError, match=r"--out = '.*out': another run is writing to this folder"):
        other.hold()
    one.release()
    other.hold()
    other.release()
    assert not (tmp_path / "out").exists()  # neither wrote anything


@pytest.mark.usefixtures("network")
def test_the_first_to_leave_a_shared_folder_leaves_it_locked(tmp_path):
    one, other = (FolderLock(tmp_path, shared=True) for _ in range(2))
    one.hold()
    other.hold()
    one.release()
    with pytest.raises(InputError, match="another run is writing to this folder"):
        FolderLock(tmp_path).hold()
    other.release()
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("network")
def test_lock_is_lifted_where_its_file_must_stay(tmp_path, monkeypatch):
    def refused(path, missing_ok=False):
        raise PermissionError(13, "Permission denied", str(path))

    lock, other = FolderLock(tmp_path), FolderLock(tmp_path)
    lock.hold()
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", refused)
        lock.release()
    other.hold()
    other.release()
    assert not (tmp_path / ".lock").exists()


def test_nothing_is_locked_where_there_are_no_locks(tmp_path, monkeypatch):
    def none(handle, operation):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    lock, other = FolderLock(tmp_path / "out"), FolderLock(tmp_path / "out")
    lock.hold()
    other.hold()
    (tmp_path / "out" / "result").touch()
    other.release()
    lock.release()


def test_folder_of_a_file_cannot_be_locked(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(InputError, match=f"--out = '{path}': is not a folder"):
            FolderLock(path).hold()


def test_folder_that_cannot_be_made_is_refused():
    with pytest.raises(InputError, match="'/proc/nothing': cannot be written to"):
        FolderLock(Path("/proc/nothing")).hold()


def test_folders_above_are_removed_as_well(tmp_path):
    lock = FolderLock(tmp_path / "results" / "scene")
    lock.hold()
    assert not list((tmp_path / "results" / "scene").iterdir())
    lock.release()
    assert not list(tmp_path.iterdir())


def test_lock_of_a_killed_process_is_lifted(tmp_path, root):
    code = (
        "import os, signal, sys; from pathlib import Path\n"
        "from patchlaw.multiscale.runs.output.results_folder import FolderLock\n"
        "lock = FolderLock(Path(sys.argv[1])); lock.hold()\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    words = [sys.executable, "-c", code, str(tmp_path / "out")]
    assert subprocess.run(words, cwd=root, check=False).returncode == -signal.SIGKILL
    assert not list((tmp_path / "out").iterdir())  # not even a file of the lock
    lock = FolderLock(tmp_path / "out")
    lock.hold()
    lock.release()
