"""What goes wrong on one rank ends all within seconds, with one message."""

import csv
import os
import signal
import subprocess
import sys
import time

import pytest
from helpers.mpi_environment import MPI_ENVIRONMENT

from benchmarks.killed_runs import largest_difference, members

SCRIPT = "tests/parallel/fault_script.py"
WORDS = (
    "run", "demos/scenes/paper.toml", "--set", "surface.grid=[32, 32]", "block.cells=[4, 4, 2]",
    "patches.grid=[2, 2]", "coupling.kind=isolated", "load.steps=3",
    "output.figures=false", "output.report=false", "output.fields=true", "--out",
)  # fmt: skip


@pytest.mark.parametrize(("rank", "place"), [
    pytest.param(1, "surface", marks=pytest.mark.long), (1, "load step"),
    pytest.param(0, "writing on rank 0", marks=pytest.mark.long),
])  # fmt: skip
def test_bug_on_one_rank_ends_all(mpirun, tmp_path, rank, place):
    done = mpirun(2, SCRIPT, rank, "bug", place, *WORDS, tmp_path / "out", timeout=100)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("RuntimeError: something broke") == 1, done.stderr


@pytest.mark.long
def test_error_that_one_rank_alone_meets_ends_all(mpirun, tmp_path):
    """Errors of ours come on all ranks alike; one that does not must not leave the others."""
    done = mpirun(2, SCRIPT, 1, "one-sided", "load step", *WORDS, tmp_path / "out", timeout=100)
    assert done.returncode == 3, done.stderr
    assert done.stderr.count("did not converge: DIVERGED after 1 iterations") == 1


@pytest.mark.long
def test_full_disk_ends_all_with_5(mpirun, tmp_path):
    """Files of dolfinx that cannot be closed end a process that drops them."""
    out = tmp_path / "out"
    fine = [word.replace("4, 4, 2", "16, 16, 8") for word in WORDS]
    done = mpirun(2, SCRIPT, 1, "full", "output", *fine, out, timeout=100)
    assert done.returncode == 5, done.stderr
    assert done.stderr.count("cannot be written: Failed to ") == 1, done.stderr
    assert not list(out.glob("*fields*"))


@pytest.mark.long
def test_signal_to_one_rank_stops_all_and_any_number_goes_on(mpirun, tmp_path):
    out = tmp_path / "out"
    done = mpirun(2, SCRIPT, 1, "signal", "checkpoint", *WORDS, out, timeout=100)
    assert done.returncode == 4, done.stderr
    assert done.stderr.count("(SIGUSR1): stopped after load step 2; go on with --resume") == 1
    done = mpirun(1, "-m", "patchlaw", *WORDS, out, "--resume", timeout=100)
    assert done.returncode == 0, done.stderr
    assert "goes on after load step 2" in done.stdout
    with (out / "history.csv").open(encoding="utf-8") as file:
        assert [row["step"] for row in csv.DictReader(file)] == ["1", "2", "3"]


LONG = [word.replace("steps=3", "steps=60") for word in WORDS]


@pytest.fixture(scope="module")
def undisturbed(mpirun, tmp_path_factory):
    """Folder of a run that nobody disturbed."""
    out = tmp_path_factory.mktemp("undisturbed")
    assert mpirun(1, "-m", "patchlaw", *LONG, out, timeout=100).returncode == 0
    return out


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGUSR1], ids=["SIGTERM", "SIGUSR1"])
def test_mpirun_that_is_told_to_end_loses_no_load_step(mpirun, root, tmp_path, undisturbed, sent):
    """It hands SIGUSR1 on and waits; after SIGTERM it kills the ranks within a second or two."""
    command = ["mpirun", "-n", "2", sys.executable, SCRIPT, "1", "slow", "load step", *LONG]
    out, log = tmp_path / "out", tmp_path / "log"
    with log.open("wb") as file:
        started = subprocess.Popen(
            [*command, str(out)], cwd=root, env=os.environ | MPI_ENVIRONMENT, stdout=file,
            stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        until = time.monotonic() + 60.0
        while "load step 2/60" not in log.read_text(encoding="utf-8"):
            assert time.monotonic() < until, log.read_text(encoding="utf-8")
            time.sleep(0.05)
        started.send_signal(sent)
        code = started.wait(timeout=60)
    assert code == 4 if sent == signal.SIGUSR1 else code not in (0, 2, 3, 5), log.read_text()
    until = time.monotonic() + 20.0
    while members(started.pid):  # mpirun of Open MPI 5 does not wait for those it has signalled
        assert time.monotonic() < until
        time.sleep(0.05)
    done = mpirun(1, "-m", "patchlaw", *LONG, out, "--resume", timeout=100)
    assert done.returncode == 0, done.stderr
    shown = done.stdout
    assert "goes on after load step " in shown and "goes on after load step 60" not in shown
    assert largest_difference(out, undisturbed) <= 1e-10  # the tolerance of the Newton iteration
