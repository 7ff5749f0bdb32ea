"""The MPI job of this process, and whether its launcher started it as one job."""

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

_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS")
"""Variables by which launchers tell processes how many they are. The first that is set counts.
They belong to Open MPI's mpirun; to Hydra (MPICH, Intel MPI) and others that use PMI; to Hydra on
one node; to Slurm's srun, inside which the others may have been started."""


def keep_petsc_from_signals() -> None:
    """Keep PETSc from handling SIGHUP and SIGTERM, which end a run in time.

    Its handlers would end the process with exit code 59. Call this before PETSc is imported.
    """
    option, given = "-no_signal_handler", os.environ.get("PETSC_OPTIONS", "")
    if option not in given.split():
        os.environ["PETSC_OPTIONS"] = f"{given} {option}".strip()


def check_address_space() -> None:
    """Refuse to start where the address space is too small for MPI and matrix products.

    OpenBLAS allocates its buffers at the first product, and waits for ever where there is no memory
    left. A product here makes it allocate them before data fill the address space.

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


def large_object_comm(comm: Any) -> Any:
    """Return a communicator for pickled objects that may exceed the 2 GB of an MPI message.

    Large arrays are sent beside the pickle, so that neither end holds them twice. Small objects
    take longer than through the communicator itself.

    Args:
        comm: MPI communicator; None for a process on its own.
    """
    if comm is None:
        return None
    from mpi4py.util import pkl5

    return pkl5.Intracomm(comm)


def detached_processes() -> tuple[str, int] | None:
    """Find out whether a launcher started several processes that are no MPI job.

    Returns:
        The launcher's variable with the number of processes, and this number; None for an MPI job
        or a process on its own.
    """
    if world() is not None:
        return None
    values = ((name, os.environ.get(name, "")) for name in _SIZES)
    name, count = next(((name, int(text)) for name, text in values if text.isdigit()), ("", 1))
    return (name, count) if count > 1 else None


def refuse_detached_processes() -> None:
    """Refuse several processes that are no MPI job, each of which would compute the whole scene.

    Raises:
        InputError: When the launcher is not that of the MPI that mpi4py was built with.
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
