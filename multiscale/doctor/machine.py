"""The doctor's look at the machine: BLAS, launcher, ranks, threads and memory."""

from __future__ import annotations

import ctypes
import importlib
import os
import platform
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

from multiscale.doctor.finding import Finding
from multiscale.machine.mpi_job import detached_processes
from multiscale.machine.nodes import control_group_memory

_LAUNCHERS = {"Open MPI": "Open MPI", "HYDRA": "MPICH", "MPICH": "MPICH", "Intel": "Intel MPI"}


def blas(comm: Any) -> list[Finding]:
    """Name the BLAS that this process has loaded.

    Args:
        comm: MPI communicator, or None.
    """
    importlib.import_module("scipy.linalg")  # loads it
    fast = [path for path in _loaded() if re.search("openblas|mkl|blis", path.name)]
    if not fast:
        remedy = "apt-get install libopenblas0-pthread (factorisations are 5 to 8 times faster)"
        return [Finding("BLAS", "warning", "the reference BLAS", remedy)]
    name = fast[0].name
    return [Finding("BLAS", "ok", f"{name}, {_blas_threads(fast[0])}")]


def _loaded() -> list[Path]:
    """Return the shared libraries of this process."""
    lines = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    return sorted({Path(line.split()[-1]) for line in lines if ".so" in line})


def _blas_threads(library: Path) -> str:
    count = getattr(ctypes.CDLL(str(library)), "openblas_get_num_threads", None)
    return "threads unknown" if count is None else f"{count()} thread(s)"


def launcher(comm: Any) -> list[Finding]:
    """Compare the MPI that mpi4py was built with and the launcher on PATH.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    library = MPI.Get_library_version().strip().partition(",")[0].splitlines()[0]
    found = detached_processes()
    if found is not None:
        text = f"started as one of {found[1]} processes, but each stands alone ({library})"
        remedy = f"start with the mpirun of {library}, or srun --mpi=pmix; see demos/hpc/README.md"
        return [Finding("launcher", "fail", text, remedy)]
    if comm is not None and comm.rank > 0:
        return []  # rank 0 alone looks for the command
    return [_match(library, _launcher_version())]


def _launcher_version() -> str:
    """Return the first line with a version that mpirun prints; empty without mpirun."""
    command = shutil.which("mpirun")
    if command is None:
        return ""
    shown = subprocess.run(
        [command, "--version"], capture_output=True, text=True, check=False, timeout=30
    ).stdout
    return " ".join(shown.split())[:200]


def _match(library: str, shown: str) -> Finding:
    """Return the finding on a library and what its launcher says of itself.

    Args:
        library: What MPI calls itself, such as ``Open MPI v4.1.4``.
        shown: What ``mpirun --version`` prints; empty without mpirun.
    """
    if not shown:
        text = f"{library}, no mpirun on PATH"
        return Finding(
            "launcher", "warning", text, "for parallel runs: apt-get install mpi-default-bin"
        )
    theirs = next((name for mark, name in _LAUNCHERS.items() if mark in shown), shown)
    if theirs not in library and not (theirs == "Intel MPI" and "Intel" in library):
        text = f"mpi4py runs on {library}, but mpirun belongs to {theirs}"
        return Finding("launcher", "fail", text, f"put the mpirun of {library} first on PATH")
    ours, other = (re.search(r"\d+\.\d+", text) for text in (library, shown))
    if ours and other and ours[0].split(".")[0] != other[0].split(".")[0]:
        text = f"{library}, but mpirun is version {other[0]}"
        return Finding("launcher", "warning", text, "put the mpirun of the same version on PATH")
    return Finding("launcher", "ok", f"{library}, mpirun of the same family")


def ranks(comm: Any) -> list[Finding]:
    """Tell ranks and hosts.

    Args:
        comm: MPI communicator, or None.
    """
    hosts = Counter(_gathered(comm, platform.node()))
    size = sum(hosts.values())
    places = ", ".join(f"{count} on {host}" for host, count in hosts.items())
    return [Finding("ranks", "ok", f"{size}: {places}")]


def threads(comm: Any) -> list[Finding]:
    """Compare threads × ranks with the cores that each host gives.

    Args:
        comm: MPI communicator, or None.
    """
    said = os.environ.get("OMP_NUM_THREADS", "")
    cores = len(os.sched_getaffinity(0))
    mine = int(said) if said.isdigit() else cores
    given = _gathered(comm, (platform.node(), sorted(os.sched_getaffinity(0)), mine))
    wanted: Counter[str] = Counter()
    offered: dict[str, set[int]] = {}
    for host, allowed, count in given:
        wanted[host] += count
        offered.setdefault(host, set()).update(allowed)
    for host, count in wanted.items():
        if count > len(offered[host]) and len(given) > 1:
            text = f"{count} threads of all ranks on {len(offered[host])} cores of {host}"
            remedy = "export OMP_NUM_THREADS=1 and start no more ranks than cores"
            return [Finding("threads", "warning", text, remedy)]
        if count > len(offered[host]):
            text = f"OMP_NUM_THREADS={said} on {cores} cores"
            return [Finding("threads", "warning", text, f"export OMP_NUM_THREADS={cores}")]
    text = f"OMP_NUM_THREADS={said or 'not set'}, {cores} core(s) for this process"
    return [Finding("threads", "ok", text)]


def memory(comm: Any) -> list[Finding]:
    """Tell the memory that each rank can still have, at the worst host.

    Args:
        comm: MPI communicator, or None.
    """
    given = _gathered(comm, (platform.node(), _free_bytes()))
    shares = Counter(host for host, _ in given)
    least = min(free / shares[host] for host, free in given)
    text = f"{least / 1e9:.1f} GB free per rank"
    if least < 1e9:
        return [Finding("memory", "warning", text, "take fewer ranks per node or a larger node")]
    return [Finding("memory", "ok", text)]


def _free_bytes() -> float:
    """Return the free memory of this host, or of a control group where that is less [B]."""
    lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
    fields = {name: rest.split()[0] for name, _, rest in (line.partition(":") for line in lines)}
    free = 1024.0 * float(fields["MemAvailable"])
    return min([free, *(limit - used for limit, used in control_group_memory())])


def _gathered(comm: Any, value: Any) -> list[Any]:
    return [value] if comm is None else comm.allgather(value)
