"""The machine that a run is on: its MPI job, the memory of its nodes, and the time it takes."""

from __future__ import annotations

import math
import os
import re
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.support import PROGRAM, InputError, address_space, node_cores, physical_memory
from patchlaw.support.packages import away
from patchlaw.support.readable import ProgressObserver, unobserved

_LEAST_DATA = 0.5e9
"""Address space that a small run takes beside the program: 64 × 64 heights do with 0.3 GB [B]."""

_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS")
"""Variables by which launchers tell processes how many they are. The first that is set counts.
They belong to Open MPI's mpirun; to Hydra (MPICH, Intel MPI) and others that use PMI; to Hydra on
one node; to Slurm's srun, inside which the others may have been started."""

_LAUNCHED = re.compile("RANK|PMI|PROCID|ALPS_APP_PE")
"""Parts of the variables by which every launcher tells a process which of its ranks it is."""


def share_petsc_options(comm: Any) -> None:
    """Give all processes the PETSc options of the first one, as PETSc does when it starts.

    Launchers do not send the environment to other nodes, and what is computed depends on options.

    Args:
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if comm is not None:
        os.environ["PETSC_OPTIONS"] = comm.bcast(os.environ.get("PETSC_OPTIONS", ""))


def keep_libraries_from_signals() -> None:
    """Keep PETSc and UCX from handling SIGHUP and SIGTERM, which end a run in time.

    PETSc's handlers would end the process with exit code 59. UCX, by which MPICH communicates,
    would go on after SIGHUP and print all that it does. Call this before either is loaded.
    """
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")
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

    MPI takes half a second to start, which a process that no launcher started is spared until it
    needs finite elements. Alone it starts no daemon for processes to come.
    """
    if not any(map(_LAUNCHED.search, os.environ)):
        os.environ.setdefault("OMPI_MCA_ess_singleton_isolated", "1")
        return None
    try:
        with away():  # UCX reads a file of the working folder
            from mpi4py import MPI
    except ModuleNotFoundError:  # scenes without finite elements need none
        return None
    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None


def cores_statement(comm: Any) -> str:
    """Say how many ranks a job has, and how many threads they may start.

    Args:
        comm: MPI communicator; None for a process on its own.

    Note:
        Collective.
    """
    here = node_cores(comm)
    threads = f"{here.own} thread{'s' * (here.own != 1)}"
    if comm is None or comm.size == 1:
        return f"one process with {threads}"
    on = f" on {here.nodes} nodes" * (here.nodes > 1)
    return (
        f"{comm.size} ranks{on} with {threads} each; what one rank does for all takes {here.alone}"
    )


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
    for name in _SIZES:
        if (text := os.environ.get(name, "")).isdigit():
            return (name, int(text)) if int(text) > 1 else None
    return None


def refuse_detached_processes() -> None:
    """Refuse several processes that are no MPI job, each of which would compute the whole scene.

    Raises:
        InputError: When the launcher is not that of the MPI that mpi4py was built with, or there is
            no mpi4py.
    """
    if found := detached_processes():
        name, count = found
        raise InputError(
            f"this is one of {count} processes, but each stands alone and would compute the whole "
            "scene: the launcher is not that of mpi4py's MPI; start with the mpirun that `patchlaw "
            f"doctor` names. For {count} independent runs, unset {name}",
            key=name,
            value=count,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryRequest:
    """Memory that something takes.

    Attributes:
        shared: Divided over all ranks [B].
        per_rank: Taken by every rank [B].
        root_only: Taken on rank 0 alone, beyond what it takes like every rank [B].
        key: Key of the scene that asks for it.
        value: The value of this key; None where it was not stated.
        purpose: What takes the memory; empty where the key tells.
        alternative: What would take less; empty where the key tells.
    """

    shared: float = 0.0
    per_rank: float = 0.0
    root_only: float = 0.0
    key: str = ""
    value: Any = None
    purpose: str = ""
    alternative: str = ""

    @property
    def total(self) -> float:
        """Memory that a process on its own takes [B]."""
        return self.shared + self.per_rank + self.root_only

    @property
    def sentence(self) -> str:
        """How much memory is needed, and for what."""
        return f"{self.purpose} needs about {self.total / 1e9:.3g} GB of memory".lstrip()


def memory_of_this_node(groups: Iterable[float] | None = None) -> float:
    """Return the memory of this node, or of this process's control groups if that is less [B].

    Args:
        groups: Limits of memory of the control groups; by default `control_group_memory`.
    """
    return min([physical_memory(), *(control_group_memory() if groups is None else groups)])


def peak_memory() -> float:
    """Return the largest resident memory of this process so far [B]; 0 where nothing says it.

    Linux counts the memory of the parent at the fork into ``ru_maxrss``. The high-water mark of
    the process itself starts with the program.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return 1024.0 * int(status.split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        with suppress(ImportError):  # Windows has none
            import resource

            unit = 1.0 if sys.platform == "darwin" else 1024.0
            return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterNodes:
    """The nodes of a run; by default this node, for a process on its own.

    Attributes:
        ranks: Ranks on each node.
        memory: Memory of a node, the least of all nodes [B].
        process: Address space that a process may fill with data; that of rank 0 for all [B].
        extensible: Whether the run could have more nodes like these, as a plan supposes.
    """

    ranks: tuple[int, ...] = (1,)
    memory: float = field(default_factory=memory_of_this_node)
    process: float = field(default_factory=address_space)
    extensible: bool = False

    def fits(self, request: MemoryRequest) -> bool:
        """Tell whether a request fits into the fullest node, taken to hold rank 0 as well.

        Args:
            request: The memory that is needed.
        """
        nodes, filled = sum(self.ranks) / max(self.ranks), self._nodes_filled(request)
        return filled <= nodes or (self.extensible and math.isfinite(filled))

    def nodes_needed(self, request: MemoryRequest) -> int | None:
        """Return the least number of nodes like the fullest that a request fits into.

        Args:
            request: The memory that is needed.

        Returns:
            The number; None where the request fits into no number of such nodes.
        """
        filled = self._nodes_filled(request)
        return max(math.ceil(filled), 1) if math.isfinite(filled) else None

    def _nodes_filled(self, request: MemoryRequest) -> float:
        """Return how many nodes a request fills; infinity where what is not shared does not fit."""
        ranks = max(self.ranks)
        left = min(
            self.memory - ranks * request.per_rank - request.root_only,
            ranks * (self.process - request.per_rank - request.root_only),
        )
        return request.shared / left if left > 0.0 else math.inf

    def remedy(self, request: MemoryRequest) -> str:
        """Say what memory there is, and which nodes or ranks would do.

        Args:
            request: The memory that is needed and does not fit.
        """
        ranks = max(self.ranks)
        text = f"{len(self.ranks)} nodes" if len(self.ranks) > 1 else "one node"
        text += f" of {self.memory / 1e9:.3g} GB{f' with {ranks} ranks' if ranks > 1 else ''}"
        if self.process < self.memory:
            text += f", {max(self.process, 0.0) / 1e9:.3g} GB for a process (ulimit -v)"
        enough = self.nodes_needed(request)
        if enough is not None:
            return (
                f"{text}; {enough} such nodes would do, filled evenly by mpirun over several hosts"
            )
        fewer = 0
        if 0.0 < request.per_rank <= self.process - request.root_only:
            left = self.memory - request.root_only - request.shared / len(self.ranks)
            fewer = int(left / request.per_rank)
        if fewer > 0:
            text += f"; {fewer} rank{'s' * (fewer > 1)} on a node would do, for each holds it all"
        return text


def cluster_nodes(comm: Any) -> ClusterNodes:
    """Return the nodes of a run.

    Args:
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if comm is None or comm.size == 1:
        return ClusterNodes()
    from mpi4py import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    ranks = node.size if node.rank == 0 else 0
    node.Free()
    found = comm.allgather((ranks, memory_of_this_node()))
    return ClusterNodes(
        ranks=tuple(ranks for ranks, _ in found if ranks), memory=min(memory for _, memory in found)
    )


def control_group_memory(
    own: Path = Path("/proc/self/cgroup"), groups: Path = Path("/sys/fs/cgroup")
) -> Iterator[float]:
    """Yield the limits of memory of the control groups that this process is in [B].

    Batch systems limit their jobs by control groups of either version. Groups without a limit are
    left out.

    Args:
        own: File that lists the groups of the process, as Linux gives it.
        groups: Folder of all groups.
    """
    for line in own.read_text(encoding="utf-8").splitlines() if own.exists() else ():
        _, controllers, path = line.split(":", 2)
        if not controllers:
            top, name = groups, "memory.max"
        elif "memory" in controllers.split(","):
            top, name = groups / "memory", "memory.limit_in_bytes"
        else:
            continue
        group = top / path.strip("/")
        for folder in (group, *group.parents):
            with suppress(OSError, ValueError):  # above all groups, or the limit is "max"
                yield float((folder / name).read_text("utf-8"))


class Clock:
    """Measures the wall time of phases from now on, each without that of phases within it.

    Attributes:
        seconds: Wall time of each phase that ended [s].
        observe: Told what the run is at.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.observe: ProgressObserver = unobserved
        self._began = self._until = time.perf_counter()

    def add(self, seconds: Mapping[str, float]) -> None:
        """Add phases that were measured elsewhere and end now.

        Args:
            seconds: Their wall times by name [s].
        """
        self.seconds |= seconds
        self._until = time.perf_counter()

    def tell(self, what: str, done: int = 0, most: int = 0) -> None:
        """Tell the observer what the run is at; see `ProgressObserver`."""
        self.observe(what, done, most)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure the wall time of a phase.

        Args:
            name: Its name in `seconds`.
        """
        self.tell(name)
        start = time.perf_counter() - sum(self.seconds.values())
        try:
            yield
        finally:
            self._until = time.perf_counter()
            spent = self._until - sum(self.seconds.values()) - start
            self.seconds[name] = self.seconds.get(name, 0.0) + spent

    @property
    def times(self) -> dict[str, float]:
        """Wall time of each phase that ended, and of all else until then as ``other`` [s]."""
        rest = self._until - self._began - sum(self.seconds.values())
        return {**self.seconds, "other": max(rest, 0.0)}
