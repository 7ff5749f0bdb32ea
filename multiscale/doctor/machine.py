"""Checks of what is installed, and of the ranks, threads and memory of the machine."""

from __future__ import annotations

import importlib
import os
import platform
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import threadpoolctl

from multiscale.doctor.examination import CheckResult, State, gathered
from multiscale.machine.installation import removal, shadows
from multiscale.machine.mpi_job import detached_processes
from multiscale.machine.nodes import control_group_memory

_OLDEST = {
    "numpy": (1, 24),
    "scipy": (1, 10),
    "dolfinx": (0, 5),
    "petsc4py": (3, 18),
    "mpi4py": (3, 1),
    "h5py": (3, 7),
    "gmsh": (4, 8),
    "pydantic": (2, 7),
}
"""The oldest release of every package that patchlaw is tested with."""

_OPTIONAL = ("matplotlib",)
_LAUNCHERS = {"Open MPI": "Open MPI", "HYDRA": "MPICH", "MPICH": "MPICH", "Intel": "Intel MPI"}
_LEAST_MEMORY = 1e9  # per rank, below which a warning is given [B]


def packages(comm: Any, load: Callable[[str], Any] = importlib.import_module) -> list[CheckResult]:
    """Import every package and compare its version with the oldest that is tested.

    Args:
        comm: MPI communicator, or None.
        load: Imports a package by its name.
    """
    found = [f"python {platform.python_version()}"]
    results = []
    for name in (*_OLDEST, *_OPTIONAL):
        try:
            version = str(getattr(load(name), "__version__", "?"))
        except ImportError as error:
            state: State = "fail" if name in _OLDEST else "warning"
            results.append(CheckResult(name, state, str(error), "run ./setup.sh"))
            continue
        found.append(f"{name} {version}")
        oldest = _OLDEST.get(name, ())
        numbers = re.match(r"(\d+)\.(\d+)", version)
        if numbers and tuple(map(int, numbers.groups())) < oldest:
            text = f"{version} is older than {'.'.join(map(str, oldest))}"
            remedy = "take Debian 12 or newer and ./setup.sh"
            results.append(CheckResult(name, "fail", text, remedy))
    for shadow in shadows():
        results.append(CheckResult(shadow.name, "warning", str(shadow), removal([shadow])))
    return [CheckResult("packages", "ok", ", ".join(found)), *results]


def petsc(comm: Any) -> list[CheckResult]:
    """Check the solvers and number types that patchlaw needs of PETSc.

    Args:
        comm: MPI communicator, or None.
    """
    from petsc4py import PETSc

    version = ".".join(map(str, PETSc.Sys.getVersion()))
    names = ("mumps", "hypre", "ptscotch")
    have = [name for name in names if PETSc.Sys.hasExternalPackage(name)]
    bits = 8 * PETSc.IntType(0).itemsize
    text = f"{version} with {', '.join(have) or 'no package'}, {bits}-bit indices"
    if PETSc.ScalarType(0).dtype.kind == "c":
        remedy = "take a PETSc of real numbers (Debian: python3-petsc4py-real)"
        return [CheckResult("PETSc", "fail", f"{version} computes with complex numbers", remedy)]
    if "mumps" not in have:
        remedy = "take a PETSc with MUMPS; decomposed blocks are factorised by it"
        return [CheckResult("PETSc", "fail", text, remedy)]
    return [CheckResult("PETSc", "ok", text)]


def blas(comm: Any, libraries: Sequence[dict[str, Any]] | None = None) -> list[CheckResult]:
    """Name the BLAS that this process has loaded.

    Args:
        comm: MPI communicator, or None.
        libraries: What threadpoolctl finds of loaded libraries; by default those of this process.
    """
    if libraries is None:
        importlib.import_module("scipy.linalg")  # loads it
        libraries = threadpoolctl.threadpool_info()
    for library in libraries:
        if library["user_api"] == "blas":
            name = Path(library["filepath"]).name
            return [CheckResult("BLAS", "ok", f"{name}, {library['num_threads']} thread(s)")]
    remedy = "apt-get install libopenblas0-pthread (factorisations are 5 to 8 times faster)"
    return [CheckResult("BLAS", "warning", "the reference BLAS", remedy)]


def launcher(comm: Any) -> list[CheckResult]:
    """Compare the MPI that mpi4py was built with and the launcher on PATH.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    library = MPI.Get_library_version().strip().partition(",")[0].splitlines()[0]
    detached = detached_processes()
    if detached is not None:
        text = f"started as one of {detached[1]} processes, but each stands alone ({library})"
        remedy = f"start with the mpirun of {library}, or srun --mpi=pmix; see demos/hpc/README.md"
        return [CheckResult("launcher", "fail", text, remedy)]
    if comm is not None and comm.rank > 0:
        return []  # rank 0 alone looks for the command
    command, shown = shutil.which("mpirun"), ""
    if command is not None:
        words = [command, "--version"]
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=30)
        shown = " ".join(done.stdout.split())[:200]
    return [launcher_of(library, shown)]


def launcher_of(library: str, shown: str) -> CheckResult:
    """Compare an MPI library and what its launcher says of itself.

    Args:
        library: What MPI calls itself, such as ``Open MPI v4.1.4``.
        shown: What ``mpirun --version`` prints; empty without mpirun.
    """
    state: State = "ok"
    text, remedy = f"{library}, mpirun of the same family", ""
    mark = next((mark for mark in _LAUNCHERS if mark in shown), "")
    family = _LAUNCHERS.get(mark, shown)
    built, found = (re.search(r"(\d+)\.\d+", text) for text in (library, shown))
    if not shown:
        state, text = "warning", f"{library}, no mpirun on PATH"
        remedy = "for parallel runs: apt-get install mpi-default-bin"
    elif family not in library and not (mark == "Intel" and mark in library):
        state, text = "fail", f"mpi4py runs on {library}, but mpirun belongs to {family}"
        remedy = f"put the mpirun of {library} first on PATH"
    elif built and found and built[1] != found[1]:
        state, text = "warning", f"{library}, but mpirun is version {found[0]}"
        remedy = "put the mpirun of the same version on PATH"
    return CheckResult("launcher", state, text, remedy)


def ranks(comm: Any) -> list[CheckResult]:
    """Count the ranks on every host.

    Args:
        comm: MPI communicator, or None.
    """
    hosts = Counter(gathered(comm, platform.node()))
    places = ", ".join(f"{count} on {host}" for host, count in hosts.items())
    return [CheckResult("ranks", "ok", f"{hosts.total()}: {places}")]


def threads(comm: Any) -> list[CheckResult]:
    """Compare threads × ranks with the cores that each host gives.

    Args:
        comm: MPI communicator, or None.
    """
    stated = os.environ.get("OMP_NUM_THREADS", "")
    cores = os.sched_getaffinity(0)
    mine = int(stated) if stated.isdigit() else len(cores)
    everyone = gathered(comm, (platform.node(), sorted(cores), mine))
    wanted: Counter[str] = Counter()
    offered: dict[str, set[int]] = {}
    for host, allowed, count in everyone:
        wanted[host] += count
        offered.setdefault(host, set()).update(allowed)
    for host, count in wanted.items():
        if count > len(offered[host]) and len(everyone) > 1:
            text = f"{count} threads of all ranks on {len(offered[host])} cores of {host}"
            remedy = "export OMP_NUM_THREADS=1 and start no more ranks than cores"
            return [CheckResult("threads", "warning", text, remedy)]
        if count > len(offered[host]):
            text = f"OMP_NUM_THREADS={stated} on {len(cores)} cores"
            return [CheckResult("threads", "warning", text, f"export OMP_NUM_THREADS={len(cores)}")]
    text = f"OMP_NUM_THREADS={stated or 'not set'}, {len(cores)} core(s) for this process"
    return [CheckResult("threads", "ok", text)]


def memory(comm: Any, free: float | None = None) -> list[CheckResult]:
    """Find the memory that each rank can still have, on the host where it is least.

    Args:
        comm: MPI communicator, or None.
        free: Free memory of this host [B]; by default it is measured.
    """
    free = free_memory(control_group_memory()) if free is None else free
    hosts = gathered(comm, (platform.node(), free))
    sharing = Counter(host for host, _ in hosts)
    least = min(amount / sharing[host] for host, amount in hosts)
    text = f"{least / 1e9:.1f} GB free per rank"
    if least < _LEAST_MEMORY:
        remedy = "take fewer ranks per node or a larger node"
        return [CheckResult("memory", "warning", text, remedy)]
    return [CheckResult("memory", "ok", text)]


def free_memory(groups: Iterable[tuple[float, float]]) -> float:
    """Return the free memory of this host, or of a control group where that is less [B].

    Args:
        groups: Limit and used memory of every control group that this process is in [B].
    """
    available = re.search(r"MemAvailable:\s*(\d+)", Path("/proc/meminfo").read_text("utf-8"))
    assert available is not None
    return min([1024.0 * float(available[1]), *(limit - used for limit, used in groups)])
