"""The nodes that a run has, and whether what it needs fits into their memory."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geometry.memory import address_space

_OWN, _GROUPS = Path("/proc/self/cgroup"), Path("/sys/fs/cgroup")


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryRequest:
    """Memory that something takes.

    Attributes:
        shared: Divided over all ranks [B].
        per_rank: Held by every rank [B].
        root_only: Taken on rank 0 alone, beyond what it holds as every rank does [B].
    """

    shared: float = 0.0
    per_rank: float = 0.0
    root_only: float = 0.0

    @property
    def total(self) -> float:
        """Memory that a process on its own takes [B]."""
        return self.shared + self.per_rank + self.root_only


def memory_of_this_node() -> float:
    """Return the memory of this node, or of a control group of this process if that is less [B]."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return min([float(physical), *(limit for limit, _ in control_group_memory())])


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterNodes:
    """The nodes of a run; by default this one, for a process on its own.

    Attributes:
        ranks: Ranks on each node.
        memory: Memory of a node, the least of all [B].
        process: Address space that a process may fill with data, rank 0's for all [B].
        extensible: Whether a run could have more nodes like these, which a plan supposes.
    """

    ranks: tuple[int, ...] = (1,)
    memory: float = field(default_factory=memory_of_this_node)
    process: float = field(default_factory=address_space)
    extensible: bool = False

    def fits(self, need: MemoryRequest) -> bool:
        """Tell whether there is room for something, on the fullest node and on that of rank 0.

        Args:
            need: What it takes.
        """
        most = max(self.ranks)
        taken = most * (need.shared / sum(self.ranks) + need.per_rank) + need.root_only
        of_one = need.shared / sum(self.ranks) + need.per_rank + need.root_only
        fits = taken <= self.memory and of_one <= self.process
        return fits or (self.extensible and self.nodes_needed(need) is not None)

    def nodes_needed(self, need: MemoryRequest) -> int | None:
        """Return the least number of nodes like the fullest that there is room on; None if on none.

        Args:
            need: What it takes.
        """
        most = max(self.ranks)
        left = min(
            self.memory - most * need.per_rank - need.root_only,
            most * (self.process - need.per_rank - need.root_only),
        )
        return max(math.ceil(need.shared / left), 1) if left > 0.0 else None

    def remedy(self, need: MemoryRequest) -> str:
        """Say what room there is, and what would make enough of it.

        Args:
            need: What there is not room for.
        """
        most = max(self.ranks)
        text = f"{len(self.ranks)} nodes" if len(self.ranks) > 1 else "one node"
        text += f" of {self.memory / 1e9:.3g} GB"
        text += f" with {most} ranks" if most > 1 else ""
        if self.process < self.memory:
            text += f", {max(self.process, 0.0) / 1e9:.3g} GB for a process (ulimit -v)"
        enough = self.nodes_needed(need)
        if enough is not None:
            return (
                f"{text}; {enough} such nodes would do, filled evenly by mpirun over several hosts"
            )
        if need.root_only + need.per_rank > self.process:
            return text
        left = self.memory - need.root_only - need.shared / len(self.ranks)
        fewer = int(left / need.per_rank) if need.per_rank else 0
        ranks = "1 rank" if fewer == 1 else f"{fewer} ranks"
        return f"{text}; {ranks} on a node would do, for each holds it all" if fewer > 0 else text


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
    told = comm.allgather((ranks, memory_of_this_node()))
    return ClusterNodes(
        ranks=tuple(ranks for ranks, _ in told if ranks), memory=min(memory for _, memory in told)
    )


def control_group_memory() -> Iterator[tuple[float, float]]:
    """Yield limit and use of memory of the control groups that this process is in [B].

    A batch system limits its jobs by them, of either generation; groups without a limit are left
    out.
    """
    try:
        lines = _OWN.read_text(encoding="utf-8").splitlines()
    except OSError:  # no Linux
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if not controllers:
            top, files = _GROUPS, ("memory.max", "memory.current")
        elif "memory" in controllers.split(","):
            top, files = _GROUPS / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes")
        else:
            continue
        group = top / path.strip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(top):
                yield from _limit(*(folder / name for name in files))


def _limit(limit: Path, used: Path) -> Iterator[tuple[float, float]]:
    try:
        yield float(limit.read_text(encoding="utf-8")), float(used.read_text(encoding="utf-8"))
    except (OSError, ValueError):  # the group is another namespace's, or its limit is "max"
        return
