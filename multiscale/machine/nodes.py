"""The nodes that a run has, and whether what it needs fits into their memory."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geometry.checks import address_space

_OWN, _GROUPS = Path("/proc/self/cgroup"), Path("/sys/fs/cgroup")


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryRequest:
    """Memory that something takes.

    Attributes:
        shared: Divided over all ranks [B].
        held: Held by every rank [B].
        once: Taken on rank 0 alone, beyond what it holds as every rank does [B].
    """

    shared: float = 0.0
    held: float = 0.0
    once: float = 0.0

    @property
    def alone(self) -> float:
        """Memory that a process on its own takes [B]."""
        return self.shared + self.held + self.once


def node_memory() -> float:
    """Return the memory of this node, or of a control group of this process if that is less [B]."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return min([float(physical), *(limit for limit, _ in group_memory())])


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterNodes:
    """The nodes of a run; by default this one, for a process on its own.

    Attributes:
        ranks: Ranks on each node.
        memory: Memory of a node, the least of all [B].
        process: Address space that a process may fill with data, rank 0's for all [B].
        more: Whether a run could have more nodes like these, which a plan supposes.
    """

    ranks: tuple[int, ...] = (1,)
    memory: float = field(default_factory=node_memory)
    process: float = field(default_factory=address_space)
    more: bool = False

    def fit(self, need: MemoryRequest) -> bool:
        """Tell whether there is room for something, on the fullest node and on that of rank 0.

        Args:
            need: What it takes.
        """
        most = max(self.ranks)
        taken = most * (need.shared / sum(self.ranks) + need.held) + need.once
        of_one = need.shared / sum(self.ranks) + need.held + need.once
        fits = taken <= self.memory and of_one <= self.process
        return fits or (self.more and self.enough(need) is not None)

    def enough(self, need: MemoryRequest) -> int | None:
        """Return the least number of nodes like the fullest that there is room on; None if on none.

        Args:
            need: What it takes.
        """
        most = max(self.ranks)
        left = min(
            self.memory - most * need.held - need.once,
            most * (self.process - need.held - need.once),
        )
        return max(math.ceil(need.shared / left), 1) if left > 0.0 else None

    def room(self, need: MemoryRequest) -> str:
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
        enough = self.enough(need)
        if enough is not None:
            return (
                f"{text}; {enough} such nodes would do, filled evenly by mpirun over several hosts"
            )
        if need.once + need.held > self.process:
            return text
        left = self.memory - need.once - need.shared / len(self.ranks)
        fewer = int(left / need.held) if need.held else 0
        ranks = "1 rank" if fewer == 1 else f"{fewer} ranks"
        return f"{text}; {ranks} on a node would do, for each holds it all" if fewer > 0 else text


def nodes_of(comm: Any) -> ClusterNodes:
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
    told = comm.allgather((ranks, node_memory()))
    return ClusterNodes(
        ranks=tuple(ranks for ranks, _ in told if ranks), memory=min(memory for _, memory in told)
    )


def group_memory() -> Iterator[tuple[float, float]]:
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
