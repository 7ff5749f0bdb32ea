"""The MPI job of this process, and whether it came together as its launcher meant it."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from geometry.checks import PROGRAM, address_space
from geometry.errors import InputError

_LEAST_DATA = 0.5e9
"""Address space that a small run takes beside the program: 64 × 64 heights do with 0.3 GB [B]."""

# what launchers tell every process of the number of processes: Open MPI's mpirun; Hydra (MPICH,
# Intel MPI) and others that speak PMI; Hydra, of one node; Slurm's srun, inside which the others
# may have been started: the first that is set counts
_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS")


def petsc_leaves_signals() -> None:
    """Keep PETSc from taking SIGHUP, and without Open MPI SIGTERM, from who watches for them.

    Its handlers end the process with exit code 59. It must be told before it starts.
    """
    option, given = "-no_signal_handler", os.environ.get("PETSC_OPTIONS", "")
    if option not in given.split():
        os.environ["PETSC_OPTIONS"] = f"{given} {option}".strip()


def check_address_space() -> None:
    """Refuse to start where MPI or the matrix products would not find room for themselves.

    OpenBLAS asks for its buffers at its first product, and for ever where the system has none: let
    it have them before data fill the address space.

    Raises:
        InputError: When the limit of the address space is too low.
    """
    left = address_space()
    if left < _LEAST_DATA:
        raise InputError(
            "the address space of a process is limited to less than this program needs",
            key="ulimit -v",
            value=round((left + PROGRAM) / 1024.0),
            allowed=f"at least {round((_LEAST_DATA + PROGRAM) / 1024.0)} kB, or unlimited",
        )
    if left < math.inf:
        some = np.ones((512, 512))
        np.matmul(some, some)


def world() -> Any:
    """Return the communicator of an MPI job, or None for a process on its own.

    Raises:
        InputError: When this user has no home, without which neither Open MPI nor dolfinx starts.
    """
    try:
        Path.home()
    except RuntimeError:
        raise InputError(
            "this user has no home folder, and MPI does not start without",
            key="HOME",
            allowed="set it to any folder",
        ) from None
    from mpi4py import MPI

    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None


def for_large(comm: Any) -> Any:
    """Return a communicator for what may be larger than MPI can count, 2 GB in one message.

    Large arrays travel beside the pickle, so that neither end holds them twice; small messages
    take longer than through the communicator itself.

    Args:
        comm: MPI communicator; None for a process on its own.
    """
    if comm is None:
        return None
    from mpi4py.util import pkl5

    return pkl5.Intracomm(comm)


def detached_processes() -> tuple[str, int] | None:
    """Tell whether a launcher started several processes that do not know of each other.

    Returns:
        The variable by which the launcher says so, and how many they are; None when all is well.
    """
    if world() is not None:
        return None
    told = ((name, os.environ.get(name, "")) for name in _SIZES)
    name, count = next(((name, int(text)) for name, text in told if text.isdigit()), ("", 1))
    return (name, count) if count > 1 else None


def refuse_detached_processes() -> None:
    """Refuse to compute what every other process of this start computes as well.

    Raises:
        InputError: When the launcher is not the one of the MPI that mpi4py was built with.
    """
    found = detached_processes()
    if found is None:
        return
    name, count = found
    raise InputError(
        f"this is one of {count} processes, but each stands alone and would compute the whole "
        "scene: the launcher is not that of mpi4py's MPI; start with the mpirun that `patchlaw "
        f"doctor` names. For {count} independent runs, unset {name}",
        key=name,
        value=count,
    )
