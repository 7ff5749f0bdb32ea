"""What counts on few ranks mean for many: time of an iteration of the block's solver, in a model.

An iteration on P ranks with n unknowns each takes

    T = n w / M  +  e (λ + k o) + v n^(2/3) / β  +  r λ log₂ P  +  λ + (P − 1) o + f / M

that is memory traffic of w bytes per unknown; e exchanges with k neighbours, and the bytes sent
in them; r reductions; and the coarsest grid, which every rank gets whole, from its owners one by
one, and solves with a factor of f bytes. λ + k o is LogGP's cost of k messages that overlap
(Alexandrov et al. 1995, doi 10.1145/215399.215427), λ log₂ P that of a reduction by recursive
doubling (Thakur, Rabenseifner & Gropp 2005, doi 10.1177/1094342005051521). e grows with the number
of grids, which an eightfold problem has one more of.
"""

import math
from dataclasses import dataclass, replace

INSIDE = 26  # neighbours of a box among boxes
FACES = 2.0  # times as many faces as one of 2 × 2 × 2 boxes
FLOP_BYTES = 3.0  # of a triangular solve: 12 bytes for an entry, two operations, twice used


@dataclass(frozen=True, kw_only=True)
class Machine:
    """A cluster.

    Args:
        memory: What a core gets of its node's memory while all cores work [B/s].
        latency: λ, from rank to rank [s].
        overhead: o, of a rank for each further message [s].
        network: β, what a rank gets of its node's network [B/s].
    """

    memory: float = 5e9
    latency: float = 2e-6
    overhead: float = 0.4e-6
    network: float = 1e9


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """What an iteration does, whatever the machine.

    Args:
        traffic: w, bytes moved per unknown, on all grids.
        exchanges: Exchanges with neighbours on a grid.
        outside: Exchanges outside of the multigrid, on the finest grid.
        volume: v, of a rank inside a large job [B].
        reductions: r.
        coarsest: Unknowns below which a grid is solved directly.
        factor: f, bytes that the coarsest solve moves.
        gathered: Whether the coarsest grid goes to few ranks along a tree, not to all.
    """

    traffic: float
    exchanges: float
    outside: float
    volume: float
    reductions: float
    coarsest: float
    factor: float
    gathered: bool = False

    def grids(self, unknowns: float) -> int:
        """Return the number of grids above the coarsest."""
        return max(1, math.ceil(math.log(unknowns / self.coarsest, 8.0)))

    def messages(self, unknowns: float, ranks: int) -> float:
        """Return the messages that the busiest rank sends to neighbours and for the coarsest."""
        rounds = self.exchanges * self.grids(unknowns) + self.outside
        return rounds * min(ranks - 1, INSIDE) + (ranks - 1)

    def seconds(self, n: float, ranks: int, on: Machine) -> dict[str, float]:
        """Return the seconds of its parts.

        Args:
            n: Unknowns per rank.
            ranks: P.
            on: The machine.
        """
        rounds = self.exchanges * self.grids(n * ranks) + self.outside
        doublings = math.log2(ranks)
        spread = on.latency * doublings * 2 if self.gathered else (ranks - 1) * on.overhead
        return {
            "work": n * self.traffic / on.memory,
            "neighbours": rounds * (on.latency + min(ranks - 1, INSIDE) * on.overhead),
            "faces": self.volume * n ** (2.0 / 3.0) / on.network,
            "reductions": self.reductions * on.latency * doublings,
            "coarsest": on.latency + spread + self.factor / on.memory,
        }

    def least(self, efficiency: float, ranks: int, on: Machine) -> float:
        """Return the unknowns per rank from which work is a given share of the time."""
        for k in range(20, 181):
            n = 10.0 ** (k / 20)
            parts = self.seconds(n, ranks, on)
            if parts["work"] >= efficiency * sum(parts.values()):
                return n
        return math.inf


def traffic(fact: dict) -> float:
    """Return the bytes per unknown that an iteration's products move at least.

    Of a level the multigrid takes as many products as it has exchanges but for the two transfers;
    conjugate gradients take one more of the finest.
    """
    finest, *coarser = fact["levels"]
    inside = exchanges(fact) - 2.0
    moved = (1.0 + inside) * finest["product_bytes"]
    moved += inside * sum(level["product_bytes"] for level in coarser[:-1])
    return moved / fact["dofs"]


def exchanges(fact: dict) -> float:
    """Return the exchanges of a cycle on its finest grid, from a run on two ranks."""
    return fact["levels"][0]["messages"]


def observed(two: dict, most: dict) -> Iteration:
    """Return the iteration that was seen.

    Args:
        two: Facts on 2 ranks, where an exchange is one message.
        most: Facts on 8 ranks, each of which has 3 of its 6 faces inside.
    """
    inside = exchanges(two)
    coarsest = most["levels"][-1]
    grids = len(two["levels"]) - 1
    n = most["dofs"] / most["ranks"]
    return Iteration(
        traffic=traffic(two),
        exchanges=inside,
        outside=two["messages"] - inside * grids - two["levels"][-1]["messages"],
        volume=FACES * (most["bytes"] - coarsest["bytes"]) / n ** (2.0 / 3.0),
        reductions=most["reductions"],
        coarsest=1500.0,
        factor=FLOP_BYTES * coarsest["flops"],
    )


def improved(iteration: Iteration) -> Iteration:
    """Return it with the coarsest grid on few ranks and one reduction for each iteration."""
    return replace(iteration, gathered=True, reductions=1.0)
