"""The doctor and the warming under mpirun: they speak once, for all ranks."""

import pytest


@pytest.mark.long
def test_doctor_names_the_ranks_once(waiting_ranks):
    done = waiting_ranks(2, "-m", "patchlaw", "doctor", timeout=100)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("; 2 ranks with ") == 1
    assert "fails" not in done.stdout


@pytest.mark.long
def test_a_check_that_fails_on_one_rank_fails_for_all(mpirun):
    code = (
        "import sys; from mpi4py import MPI; from patchlaw.multiscale.cli import about, main\n"
        "def broken(comm):\n"
        "    if comm.rank == 1: raise OSError('only here')\n"
        "    return ''\n"
        "about.CHECKS = {'BLAS': broken}\n"
        "sys.exit(main(['doctor']))"
    )
    done = mpirun(2, "-c", code, timeout=100)
    assert done.returncode == 2
    assert done.stdout.count("OSError: only here") == 1
    assert done.stderr.count("not fit to run: BLAS") == 1


@pytest.mark.long
def test_forms_are_compiled_ahead_by_a_job_too(mpirun):
    # PETSc starts on all ranks together: rank 0 alone would bring the others down
    done = mpirun(2, "-m", "patchlaw", "warm", "--element", "Q1", timeout=100)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("compiled forms in") == 1
