"""Forms compiled ahead: runs afterwards need no compiler."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from patchlaw.multiscale.cli.command_line import main

pytestmark = pytest.mark.long
SCENE = "demos/scenes/paper.toml"
SMALL = [
    "surface.grid=[32, 32]", "block.cells=[4, 4, 2]", "patches.grid=[2, 2]", "load.steps=1",
    "output.figures=false", "output.fields=true",
]  # fmt: skip
COUPLINGS = {
    "embedded": ["block.element=P2"],
    "condensed": ["coupling.kind=consistent", "micro.model=half-space"],
}


def begin(home, *words, compiler=None):
    environment = os.environ | {"XDG_CACHE_HOME": str(home), "OMP_NUM_THREADS": "1"}
    if compiler:
        environment["CC"] = compiler
    return subprocess.Popen(
        [sys.executable, "-m", "patchlaw", *map(str, words)],
        cwd=Path(__file__).parents[3], env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def end(process):
    told, complaint = process.communicate(timeout=150)
    return SimpleNamespace(returncode=process.returncode, stdout=told, stderr=complaint)


def call(home, *words, compiler=None):
    return end(begin(home, *words, compiler=compiler))


@pytest.fixture(scope="module")
def warmed(tmp_path_factory):
    """A cache that two `patchlaw warm` filled at once, and how they ended."""
    home = tmp_path_factory.mktemp("cache")
    left = home / "patchlaw" / "forms" / "libffcx_forms_left.c"
    left.parent.mkdir(parents=True)
    left.touch()
    os.utime(left, (0, 0))
    begun = [begin(home, "warm", "--element", "Q1", "P2") for _ in range(2)]
    ended = [end(process) for process in begun]
    assert not left.exists()
    return home, ended


@pytest.mark.parametrize("scene", COUPLINGS.values(), ids=COUPLINGS)
def test_runs_need_no_compiler_afterwards(warmed, tmp_path, scene):
    words = ("run", SCENE, "--out", tmp_path / "out", "--set", *SMALL, *scene)
    done = call(warmed[0], *words, compiler="/bin/false")
    assert done.returncode == 0, done.stderr


def test_processes_that_want_the_same_forms_at_once_do_not_harm_each_other(warmed):
    home, ended = warmed
    assert [done.returncode for done in ended] == [0, 0], [done.stderr for done in ended]
    assert len({done.stdout for done in ended}) == 1  # as many forms for all
    assert not list((home / "patchlaw" / "forms").glob("*.tmp*"))


def test_without_warming_the_same_run_says_what_to_do(tmp_path):
    words = ("run", SCENE, "--out", tmp_path / "out", "--set", *SMALL)
    done = call(tmp_path, *words, compiler="/bin/false")
    assert done.returncode == 2
    assert "run patchlaw warm where there is one" in done.stderr


def test_home_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").touch()
    done = call(tmp_path / "file", "warm", "--element", "Q1")
    assert done.returncode == 2
    assert "set XDG_CACHE_HOME to a folder that can" in done.stderr


def test_unknown_element(capsys):
    assert main(["warm", "--element", "Q3"]) == 2
    assert "--element = 'Q3': this element is unknown" in capsys.readouterr().err
