"""Checks what is installed, and the ranks, threads and memory of the machine.

The checks of the compiled forms are in `multiscale.compiled_forms`.
"""

from __future__ import annotations

import importlib
import os
import platform
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import threadpoolctl

from multiscale.installation import removal, shadows, versions
from multiscale.machine import control_group_memory, cores_statement, detached_processes
from support.cores import place
from support.errors import InputError, PatchlawError
from support.packages import optional_packages

_SEVERITY = {"ok": 0, "warning": 1, "fail": 2}
_LAUNCHERS = {"Open MPI": "Open MPI", "HYDRA": "MPICH", "MPICH": "MPICH", "Intel": "Intel"}
"""Words by which launchers of MPI are known, and those by which the libraries of each are."""
_LEAST_MEMORY = 1e9  # per rank, below which a warning is given [B]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check.

    Args:
        state: ``"ok"``; ``"warning"``: runs work but slowly, or may fail elsewhere; ``"fail"``:
            runs cannot work.
        text: What was found, in one line.
        remedy: What to do; empty when all is well.
    """

    state: str
    text: str
    remedy: str = ""


Check = Callable[[Any], CheckResult]
"""A check takes the MPI communicator, or None, and is called on all ranks."""


def examine(comm: Any, checks: Mapping[str, Check]) -> dict[str, CheckResult]:
    """Make checks; one that raises an error has failed.

    Args:
        comm: MPI communicator; None for a process on its own.
        checks: The checks by topic.

    Returns:
        For each topic the worst result of all ranks, the same on every rank.

    Note:
        Collective.
    """

    def made(check: Check) -> CheckResult:
        try:
            with optional_packages():
                return check(comm)
        except PatchlawError as failure:  # its text holds the remedy
            return CheckResult("fail", str(failure))
        except Exception as failure:
            text = f"{type(failure).__name__}: {failure}"
            found = shadows()
            advice = removal(found) if found else "please report this with the lines above"
            return CheckResult("fail", text, advice)

    return {
        topic: max(gathered(comm, made(check)), key=lambda result: _SEVERITY[result.state])
        for topic, check in checks.items()
    }


def refuse_failures(results: Mapping[str, CheckResult]) -> None:
    """Raise when a check failed: a run would end with the same exit code or a worse one.

    Args:
        results: What `examine` returned.

    Raises:
        InputError: Naming the failed checks.
    """
    if failed := [topic for topic, result in results.items() if result.state == "fail"]:
        raise InputError(f"not fit to run: {', '.join(failed)}", key="doctor")


def gathered(comm: Any, value: Any) -> list[Any]:
    """Return the values of all ranks.

    Args:
        comm: MPI communicator, or None.
        value: This rank's value.
    """
    return [value] if comm is None else comm.allgather(value)


def packages(comm: Any, load: Callable[[str], Any] = importlib.import_module) -> CheckResult:
    """Import every package and compare its version with the oldest that is tested.

    Args:
        comm: MPI communicator, or None.
        load: Imports a package by its name.
    """
    found, wrong = versions(load)
    if shadowing := shadows():
        text = "; ".join([*map(str, shadowing), *wrong.values()])
        return CheckResult("fail" if wrong else "warning", text, removal(shadowing))
    if not wrong:
        return CheckResult("ok", ", ".join([f"python {platform.python_version()}", *found]))
    state = "warning" if set(wrong) == {"matplotlib"} else "fail"  # it draws figures alone
    return CheckResult(state, "; ".join(wrong.values()), "take Debian 12 or newer, run ./setup.sh")


def petsc(comm: Any) -> CheckResult:
    """Check the solvers and number types that patchlaw needs of PETSc.

    Args:
        comm: MPI communicator, or None.
    """
    from petsc4py import PETSc

    version = ".".join(map(str, PETSc.Sys.getVersion()))
    have = [name for name in ("mumps", "hypre", "ptscotch") if PETSc.Sys.hasExternalPackage(name)]
    bits = 8 * PETSc.IntType(0).itemsize
    text, remedy = f"{version} with {', '.join(have) or 'no package'}, {bits}-bit indices", ""
    if PETSc.ScalarType(0).dtype.kind == "c":
        text = f"{version} computes with complex numbers"
        remedy = "take a PETSc of real numbers (Debian: python3-petsc4py-real)"
    elif "mumps" not in have:
        remedy = "take a PETSc with MUMPS; decomposed blocks are factorised by it"
    return CheckResult("fail" if remedy else "ok", text, remedy)


def blas(comm: Any, libraries: Sequence[dict[str, Any]] | None = None) -> CheckResult:
    """Name the BLAS that this process has loaded.

    Args:
        comm: MPI communicator, or None.
        libraries: What threadpoolctl finds of loaded libraries; by default those of this process.
    """
    importlib.import_module("scipy.linalg")  # loads it
    for library in threadpoolctl.threadpool_info() if libraries is None else libraries:
        if library["user_api"] == "blas":
            name = Path(library["filepath"]).name
            return CheckResult("ok", f"{name}, {library['num_threads']} thread(s)")
    remedy = "apt-get install libopenblas0-pthread (factorisations are 5 to 8 times faster)"
    return CheckResult("warning", "the reference BLAS", remedy)


def launcher(comm: Any) -> CheckResult:
    """Compare the MPI that mpi4py was built with and the launcher on PATH.

    Args:
        comm: MPI communicator, or None.
    """
    from mpi4py import MPI

    library = MPI.Get_library_version().strip().partition(",")[0].splitlines()[0]
    if detached := detached_processes():
        text = f"started as one of {detached[1]} processes, but each stands alone ({library})"
        remedy = f"start with the mpirun of {library}, or srun --mpi=pmix; see docs/hpc.md"
        return CheckResult("fail", text, remedy)
    if comm is not None and comm.rank > 0:  # rank 0 alone looks for the command
        return CheckResult("ok", library)
    shown = ""
    if command := shutil.which("mpirun"):
        done = subprocess.run([command, "--version"], capture_output=True, text=True, timeout=30)
        shown = " ".join(done.stdout.split())[:200]
    return launcher_of(library, shown)


def launcher_of(library: str, shown: str) -> CheckResult:
    """Compare an MPI library and what its launcher says of itself.

    Args:
        library: What MPI calls itself, such as ``Open MPI v4.1.4``.
        shown: What ``mpirun --version`` prints; empty without mpirun.
    """
    if not shown:
        remedy = "for parallel runs: apt-get install mpi-default-bin"
        return CheckResult("warning", f"{library}, no mpirun on PATH", remedy)
    mark = next((mark for mark in _LAUNCHERS if mark in shown), "")
    family = _LAUNCHERS.get(mark, shown)
    if family not in library:
        text = f"mpi4py runs on {library}, but mpirun belongs to {family}"
        return CheckResult("fail", text, f"put the mpirun of {library} first on PATH")
    built, found = (re.search(r"(\d+)\.\d+", text) for text in (library, shown))
    if built and found and built[1] != found[1]:
        text = f"{library}, but mpirun is version {found[0]}"
        return CheckResult("warning", text, "put the mpirun of the same version on PATH")
    return CheckResult("ok", f"{library}, mpirun of the same family")


def ranks(comm: Any) -> CheckResult:
    """Count the ranks on every host.

    Args:
        comm: MPI communicator, or None.
    """
    hosts = Counter(gathered(comm, platform.node()))
    places = ", ".join(f"{count} on {host}" for host, count in hosts.items())
    return CheckResult("ok", f"{hosts.total()}: {places}")


def threads(comm: Any) -> CheckResult:
    """Compare the threads of all ranks with the cores that each host gives.

    Args:
        comm: MPI communicator, or None.
    """
    wanted: Counter[str] = Counter()
    offered: dict[str, set[int]] = {}
    for host, cores, number in gathered(comm, place()):
        wanted[host] += number
        offered.setdefault(host, set()).update(cores)
    for host, number in wanted.items():
        if number > len(offered[host]):
            text = f"{number} threads of all ranks on {len(offered[host])} core(s) of {host}"
            remedy = "export OMP_NUM_THREADS=1 and start no more ranks than cores"
            return CheckResult("warning", text, remedy)
    stated = os.environ.get("OMP_NUM_THREADS") or "not set"
    return CheckResult("ok", f"{cores_statement(comm)} (OMP_NUM_THREADS {stated})")


def memory(comm: Any, free: float | None = None) -> CheckResult:
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
        return CheckResult("warning", text, "take fewer ranks per node or a larger node")
    return CheckResult("ok", text)


def free_memory(groups: Iterable[tuple[float, float]]) -> float:
    """Return the free memory of this host, or of a control group where that is less [B].

    Args:
        groups: Limit and used memory of every control group that this process is in [B].
    """
    available = re.search(r"MemAvailable:\s*(\d+)", Path("/proc/meminfo").read_text("utf-8"))
    assert available is not None
    return min([1024.0 * float(available[1]), *(limit - used for limit, used in groups)])
