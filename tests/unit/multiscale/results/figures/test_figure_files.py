"""Figures are drawn once, by another process where one can, with room for every label."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from patchlaw.geometry import PatchGrid, Spectrum, synthesise
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.surface import surface_figure
from patchlaw.multiscale.runs.output.figures import (
    Drawing,
    FigureProcesses,
    file_kinds,
    pictures_of,
)

HERE = Path(__file__)
PAPER = "demos/scenes/paper.toml"


def surface_drawing(**changes):
    surface = synthesise(
        Spectrum(hurst=0.8, waves=(2, 6), rms_height=1e-3), grid=(24, 24), lengths=(1.0, 1.0)
    )
    about = surface, None, PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    given = {"name": "s", "function": "figures.surface.surface_figure", "arguments": about}
    return Drawing(**(given | changes))


@pytest.fixture
def processes():
    made = FigureProcesses(2)
    yield made
    made.close()


def test_other_processes_draw_the_same_bytes(processes):
    drawing = surface_drawing(kinds=("png", "svg"))
    drawn = [processes.draw(drawing) for _ in range(3)]
    assert [one.result() for one in drawn] == [pictures_of(drawing)] * 3


def test_an_error_while_drawing_is_told(processes):
    wrong = surface_drawing(function="figures.surface.no_figure")
    for drawn in (processes.draw(wrong).result(), pictures_of(wrong)):
        assert drawn.files == {} and "no_figure" in drawn.problem
    assert set(processes.draw(surface_drawing()).result().files) == {"s.png"}


def has_ended(status):
    """Tell whether a process is gone, or waits to be collected by the system."""
    try:
        return "State:\tZ" in status.read_text()
    except OSError:
        return True


SCRIPT = """
import os, signal, time
from mpi4py import MPI
from petsc4py import PETSc  # which handles signals
from multiprocessing.forkserver import _forkserver as server
from patchlaw.multiscale.runs.output.figures import FigureProcesses
from helpers_here import surface_drawing

def forks():
    number = server._forkserver_pid
    try:
        with open(f"/proc/{number}/task/{number}/children") as file:
            return list(map(int, file.read().split()))
    except FileNotFoundError:  # it begins anew
        return []

def forked():
    while not forks():
        time.sleep(1e-3)
    return forks()

if __name__ == "__main__":
    for victim in (forked, lambda: [server._forkserver_pid]):
        processes = FigureProcesses(2)
        drawn = [processes.draw(surface_drawing(name=name)) for name in "abc"]
        os.kill(victim()[0], signal.SIGKILL)
        print(*(name for one in drawn for name in one.result().files))
    processes = FigureProcesses(2)
    last = processes.draw(surface_drawing(name="e"))
    print(*forked(), server._forkserver_pid, flush=True)
    {end}
"""


@pytest.mark.slow
@pytest.mark.parametrize("end", ["os.kill(os.getpid(), signal.SIGKILL)", "processes.close()"])
def test_processes_that_have_ended_are_done_without_and_others_end_with_this_one(end, tmp_path):
    """Figures are drawn here then; the processes end with this one, however that ends."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(number="{number}", end=end).replace("helpers_here", HERE.stem))
    paths = os.pathsep.join([str(HERE.parent), *filter(None, sys.path)])
    ended = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=120,
        env=os.environ | {"PYTHONPATH": paths},
    )  # fmt: skip
    assert ended.returncode == (-signal.SIGKILL if "SIGKILL" in end else 0), ended.stderr
    first, second, numbers = ended.stdout.splitlines()
    assert first == second == "a.png b.png c.png", ended.stderr
    statuses = [Path(f"/proc/{int(number)}/status") for number in numbers.split()]
    assert len(statuses) >= 2
    until = time.monotonic() + 60.0
    while time.monotonic() < until and not all(map(has_ended, statuses)):
        time.sleep(0.05)
    assert all(map(has_ended, statuses))


def test_closed_processes_draw_no_more(processes):
    begun = [processes.draw(surface_drawing()) for _ in range(9)]
    processes.close()
    assert begun[-1].cancelled()


def test_other_values_are_refused(tmp_path, capsys):
    words = ["run", PAPER, "--out", str(tmp_path / "x"), "--set", 'output.figures="pdf"']
    assert main(words) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "output.figures" in told and "'all' or 'svg'" in told


def test_kinds_of_files():
    assert file_kinds(True) == file_kinds("all") == ("png",)
    assert file_kinds("svg") == ("png", "svg")


@pytest.mark.long
@pytest.mark.parametrize("lengths", [(1.0, 1.0), (0.2, 0.9), (4.0, 0.7), (1e-3, 1e-3)])
@pytest.mark.parametrize("size", [1e-6, 1.0])
def test_no_label_is_cut(lengths, size):
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_height=size * min(lengths))
    surface = synthesise(spectrum, grid=(96, 96), lengths=lengths)
    figure = surface_figure(surface, None, PatchGrid(grid=(2, 2), lengths=lengths), spectrum)
    figure.draw_without_rendering()
    width, height = figure.get_size_inches() * figure.dpi
    for axes in figure.axes:
        labels = axes.xaxis.label, axes.yaxis.label  # not in the box of axes before matplotlib 3.8
        for box in (axes.get_tightbbox(), *(label.get_window_extent() for label in labels)):
            assert box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= width and box.y1 <= height
    assert figure.get_size_inches()[0] == style.FULL_WIDTH and figure.get_size_inches()[1] < 8.0


@pytest.mark.parametrize("stated", [None, "3"])
def test_what_is_started_later_has_the_environment_of_before(monkeypatch, stated):
    for name in ("PYTHONSAFEPATH", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
        if stated is not None:
            monkeypatch.setenv(name, stated)
    before = dict(os.environ)
    FigureProcesses(1).close()
    assert dict(os.environ) == before


def test_processes_that_draw_let_go_of_the_streams(processes):
    """Who reads the output of a command would wait for their end, too."""
    before = set(multiprocessing.active_children())  # those of tests before may be about to end
    assert processes.draw(surface_drawing()).result().files
    children = set(multiprocessing.active_children()) - before
    assert children
    for child in children:
        streams = {os.readlink(f"/proc/{child.pid}/fd/{stream}") for stream in range(3)}
        assert streams == {os.devnull}
