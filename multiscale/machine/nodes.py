"""The memory of the nodes that a run has, and whether what a scene requests fits into it."""

from __future__ import annotations

import math
import os
import resource
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geometry.checks import address_space


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
    key: str = field(default="", compare=False)
    value: Any = field(default=None, compare=False)
    purpose: str = field(default="", compare=False)
    alternative: str = field(default="", compare=False)

    @property
    def total(self) -> float:
        """Memory that a process on its own takes [B]."""
        return self.shared + self.per_rank + self.root_only

    @property
    def sentence(self) -> str:
        """How much memory is needed, and for what."""
        need = f"needs about {self.total / 1e9:.3g} GB of memory"
        return f"{self.purpose} {need}" if self.purpose else need


def memory_of_this_node(groups: Iterable[tuple[float, float]] | None = None) -> float:
    """Return the memory of this node, or of this process's control groups if that is less [B].

    Args:
        groups: Limit and use of memory of the control groups; by default `control_group_memory`.
    """
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limits = control_group_memory() if groups is None else groups
    return min([float(physical), *(limit for limit, _ in limits)])


def peak_memory() -> float:
    """Return the largest resident memory of this process so far [B].

    Linux counts the memory of the parent at the fork into ``ru_maxrss``. The high-water mark of
    the process itself starts with the program.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return 1024.0 * int(status.split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        unit = 1 if sys.platform == "darwin" else 1024
        return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)


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
        process = request.shared / sum(self.ranks) + request.per_rank
        node = max(self.ranks) * process + request.root_only
        fits = node <= self.memory and process + request.root_only <= self.process
        return fits or (self.extensible and self.nodes_needed(request) is not None)

    def nodes_needed(self, request: MemoryRequest) -> int | None:
        """Return the least number of nodes like the fullest that a request fits into.

        Args:
            request: The memory that is needed.

        Returns:
            The number; None where the request fits into no number of such nodes.
        """
        ranks = max(self.ranks)
        left = min(
            self.memory - ranks * request.per_rank - request.root_only,
            ranks * (self.process - request.per_rank - request.root_only),
        )
        return max(math.ceil(request.shared / left), 1) if left > 0.0 else None

    def remedy(self, request: MemoryRequest) -> str:
        """Say what memory there is, and which nodes or ranks would do.

        Args:
            request: The memory that is needed and does not fit.
        """
        ranks = max(self.ranks)
        text = f"{len(self.ranks)} nodes" if len(self.ranks) > 1 else "one node"
        text += f" of {self.memory / 1e9:.3g} GB"
        text += f" with {ranks} ranks" if ranks > 1 else ""
        if self.process < self.memory:
            text += f", {max(self.process, 0.0) / 1e9:.3g} GB for a process (ulimit -v)"
        enough = self.nodes_needed(request)
        if enough is not None:
            text += f"; {enough} such nodes would do, filled evenly by mpirun over several hosts"
            return text
        if request.root_only + request.per_rank > self.process or not request.per_rank:
            return text
        left = self.memory - request.root_only - request.shared / len(self.ranks)
        fewer = int(left / request.per_rank)
        if fewer < 1:
            return text
        return f"{text}; {fewer} rank{'s' * (fewer > 1)} on a node would do, for each holds it all"


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
) -> Iterator[tuple[float, float]]:
    """Yield limit and use of memory of the control groups that this process is in [B].

    Batch systems limit their jobs by control groups of either version. Groups without a limit are
    left out.

    Args:
        own: File that lists the groups of the process, as Linux gives it.
        groups: Folder of all groups.
    """
    try:
        lines = own.read_text(encoding="utf-8").splitlines()
    except OSError:  # this is not Linux
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if not controllers:
            top, names = groups, ("memory.max", "memory.current")
        elif "memory" in controllers.split(","):
            top, names = groups / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes")
        else:
            continue
        group = top / path.strip("/")
        for folder in (group, *group.parents):
            if not folder.is_relative_to(top):
                break
            try:
                limit, used = (float((folder / n).read_text(encoding="utf-8")) for n in names)
            except (OSError, ValueError):  # another namespace's group, or its limit is "max"
                continue
            yield limit, used
