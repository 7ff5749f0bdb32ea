"""Scenes without finite elements run where a system lacks what Linux has: macOS and Windows."""

import os
import subprocess
import sys

import pytest
from helpers.small_scene import SMALL_SCENE

MACOS = """
import os
for name in ("O_PATH", "sched_getaffinity", "sched_setaffinity"):
    delattr(os, name)
"""
WINDOWS = """
import multiprocessing, os, signal
import platformdirs  # of pint's, which is another one there
for name in ("fcntl", "resource", "termios", "pwd", "grp", "multiprocessing.forkserver"):
    sys.modules[name] = None
for name in ("O_PATH", "O_NONBLOCK", "sched_getaffinity", "sched_setaffinity", "sysconf", "geteuid",
             "getuid", "fork", "fchdir", "fchmod", "fchown", "getloadavg"):
    delattr(os, name)
for name in ("SIGHUP", "SIGUSR1", "SIGPIPE", "pthread_sigmask"):
    delattr(signal, name)

def context(kind=None):
    if kind != "spawn":
        raise ValueError(f"cannot find context for {kind!r}")

multiprocessing.get_context = context
opened = os.open

def open_file(path, flags, *given, **others):  # there folders cannot be opened
    if os.path.isdir(path):
        raise PermissionError(13, "Permission denied", path)
    return opened(path, flags, *given, **others)

os.open, fsync = open_file, os.fsync

def to_disk(handle):  # nor does a file that is read reach the disk
    os.truncate(handle, os.fstat(handle).st_size)
    fsync(handle)

os.fsync = to_disk
"""
WITHOUT = """
import sys
for name in ("dolfinx", "petsc4py", "mpi4py", "ufl", "basix", "ffcx"):
    sys.modules[name] = None
"""
RUN = """
from patchlaw.multiscale.cli.command_line import main
for words in {words!r}:
    if code := main(words):
        sys.exit(code)
"""
WORN = ["wear.coefficient=1e-8 mm^2/N", 'load.sliding=["1 m"]', "output.check=last"]
LEAKS = ["leak.viscosity=1 mPa s", 'leak.pressures=["2 bar", "1 bar"]', "output.check=last"]


@pytest.mark.slow
@pytest.mark.parametrize("system", [MACOS, WINDOWS], ids=["macOS", "Windows"])
def test_commands_without_finite_elements(tmp_path, system):
    """With modules, functions and signals hidden that the system lacks, and without dolfinx."""
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(SMALL_SCENE)
    laws, block = (
        [f"coupling.kind={kind}", "output.fields=false", "block.height=1 mm"]
        for kind in ("consistent", "concurrent")
    )
    pictures = ["output.figures=true", "output.report=true"]
    words = [
        ["run", str(scene), "--out", str(out), "--set", *pictures],
        ["run", str(scene), "--out", str(tmp_path / "laws"), "--set", *laws, *pictures],
        ["run", str(scene), "--out", str(tmp_path / "block"), "--set", *block],
        ["run", str(scene), "--out", str(tmp_path / "worn"), "--set", *WORN],
        ["run", str(scene), "--out", str(tmp_path / "leak"), "--set", *LEAKS],
        ["surface", str(scene), "--out", str(tmp_path / "surface")],
        [
            "sweep",
            str(scene),
            "--out",
            str(tmp_path / "sweep"),
            "--vary",
            "surface.spectrum.seed=0,1",
        ],
        ["compare", str(out), str(tmp_path / "block"), "--out", str(tmp_path / "both")],
        ["init", "--out", str(tmp_path / "made.toml")],
        ["plan", str(scene)],
        ["doctor"],
    ]
    program = WITHOUT + system + RUN.format(words=words)
    environment = os.environ | {"PATCHLAW_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    for folder in (out, tmp_path / "laws"):
        assert {"history.csv", "overview.png", "report.html"} <= {
            one.name for one in folder.iterdir()
        }
    assert "half-spaces" in done.stdout.splitlines()[-1]
