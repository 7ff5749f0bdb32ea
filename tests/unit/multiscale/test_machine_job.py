"""What MPI cannot start without, and processes of one start that do not know of each other."""

import pytest

from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.machine import detached_processes, refuse_detached_processes
from patchlaw.support import InputError

PAPER = "demos/scenes/paper.toml"


@pytest.mark.parametrize(
    ("variables", "found"),
    [
        ({}, None),
        ({"PMI_SIZE": "1"}, None),
        ({"SLURM_NTASKS": "16"}, None),  # of the batch script itself, which starts no rank
        ({"PMI_SIZE": "4"}, ("PMI_SIZE", 4)),
        ({"PMI_SIZE": "4", "MPI_LOCALNRANKS": "2"}, ("PMI_SIZE", 4)),
        ({"SLURM_STEP_NUM_TASKS": "3", "PMI_SIZE": ""}, ("SLURM_STEP_NUM_TASKS", 3)),
        ({"OMPI_COMM_WORLD_SIZE": "2"}, ("OMPI_COMM_WORLD_SIZE", 2)),
        # mpirun -n 1 in a step of four
        ({"OMPI_COMM_WORLD_SIZE": "1", "SLURM_STEP_NUM_TASKS": "4"}, None),
    ],
)
def test_variables_of_launchers(monkeypatch, variables, found):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert detached_processes() == found


@pytest.mark.parametrize("command", ["run", "plan", "laws", "surface"])
def test_nothing_is_computed_many_times(monkeypatch, tmp_path, capsys, command):
    monkeypatch.setenv("PMI_SIZE", "64")
    out = tmp_path / "out"
    words = [] if command == "plan" else ["--out", str(out)]
    assert main([command, PAPER, *words, "--set", "surface.grid=[16, 16]"]) == 2
    printed = capsys.readouterr().err
    assert "PMI_SIZE = 64: this is one of 64 processes, but each stands alone" in printed
    assert "For 64 independent runs, unset PMI_SIZE" in printed
    assert not out.exists()


def test_one_process_is_not_refused():
    refuse_detached_processes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PMI_SIZE", "2")
        with pytest.raises(
            InputError, match="the launcher is not that of mpi4py's MPI; start with"
        ):
            refuse_detached_processes()
