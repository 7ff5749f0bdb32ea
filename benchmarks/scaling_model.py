"""What counts on few ranks mean for many: time of an iteration of the block's solver, in a model.

An iteration on P ranks with n unknowns each takes

    T = n w / M  +  e (λ + k o) + v n^(2/3) / β  +  r λ log₂ P  +  λ + c o + f / M

that is memory traffic of w bytes per unknown; e exchanges with k neighbours, and the bytes sent in
them; r reductions; and the coarsest grid, which its owners send to one rank that solves it with a
factor of f bytes and sends it back, c messages. λ + k o is LogGP's cost of k messages that overlap
(Alexandrov et al. 1995, doi 10.1145/215399.215427), λ log₂ P that of a reduction by recursive
doubling (Thakur, Rabenseifner & Gropp 2005, doi 10.1177/1094342005051521). e grows with the number
of grids, which an eightfold problem has one more of.
"""

import math
from dataclasses import dataclass, replace

INSIDE = 26  # neighbours of a box among boxes
FACES = 6.0  # of such a box
BOXES = {2: (2, 1, 1), 4: (2, 2, 1), 8: (2, 2, 2), 27: (3, 3, 3)}
"""Into how many boxes ranks divide a cube along each side."""

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
    network: float = 0.4e9


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """What an iteration does, whatever the machine.

    Args:
        traffic: w, bytes moved per unknown, on all grids.
        exchanges: Exchanges with neighbours on a grid.
        outside: Exchanges outside of the multigrid, on the finest grid.
        volume: v, of a rank inside a large job [B].
        reductions: r.
        unknowns: Of the block that was seen.
        grids: Its grids but for the coarsest.
        owners: Ranks that the nodes of the coarsest grid can lie on.
        factor: f, bytes that the coarsest solve moves.
        gathered: Ranks that the coarsest grid is gathered on and solved by each.
    """

    traffic: float
    exchanges: float
    outside: float
    volume: float
    reductions: float
    unknowns: float
    grids: int
    owners: float
    factor: float
    gathered: int = 1

    def rounds(self, unknowns: float) -> float:
        """Return e for a block of some unknowns."""
        more = max(0.0, math.log(unknowns / self.unknowns, 8.0))
        return self.exchanges * (self.grids + more) + self.outside

    def spread(self, ranks: int) -> float:
        """Return c, the messages that the busiest rank gets and sends for the coarsest grid."""
        return 2.0 * min(self.owners, ranks - 1.0) / self.gathered + self.gathered - 1.0

    def messages(self, unknowns: float, ranks: int) -> float:
        """Return the messages that the busiest rank sends."""
        back = 0.5 * self.spread(ranks)  # those that it gets are not counted
        return self.rounds(unknowns) * min(ranks - 1, INSIDE) + back

    def sent(self, unknowns: float, ranks: int) -> float:
        """Return the bytes that the busiest rank sends to neighbours.

        Args:
            unknowns: Of a cube.
            ranks: One of `BOXES`.
        """
        x, y, z = BOXES[ranks]
        area = sum(min(2, cuts - 1) * cuts for cuts in (x, y, z)) / (x * y * z)
        return self.volume / FACES * area * unknowns ** (2.0 / 3.0)

    def seconds(self, n: float, ranks: int, on: Machine) -> dict[str, float]:
        """Return the seconds of its parts.

        Args:
            n: Unknowns per rank.
            ranks: P.
            on: The machine.
        """
        exchange = on.latency + min(ranks - 1, INSIDE) * on.overhead
        coarsest = on.latency + self.spread(ranks) * on.overhead
        return {
            "work": n * self.traffic / on.memory,
            "neighbours": self.rounds(n * ranks) * exchange,
            "faces": self.volume * n ** (2.0 / 3.0) / on.network,
            "reductions": self.reductions * on.latency * math.log2(ranks),
            "coarsest": coarsest + self.factor / on.memory,
        }

    def efficiency(self, n: float, ranks: int, on: Machine) -> float:
        """Return the share of the time that is work."""
        parts = self.seconds(n, ranks, on)
        return parts["work"] / sum(parts.values())

    def least(self, efficiency: float, ranks: int, on: Machine) -> float:
        """Return the unknowns per rank from which work is a given share of the time."""
        for k in range(20, 181):
            n = 10.0 ** (k / 20)
            if self.efficiency(n, ranks, on) >= efficiency:
                return n
        return math.inf


def traffic(fact: dict) -> float:
    """Return the bytes per unknown that an iteration's products move at least.

    Conjugate gradients take one of the finest grid; the coarsest has a factor instead.
    """
    finest, *coarser = (level["product_bytes"] for level in fact["levels"][:-1])
    return (finest + fact["products"] * sum((finest, *coarser))) / fact["dofs"]


def observed(two: dict, most: dict) -> Iteration:
    """Return the iteration that was seen.

    Args:
        two: Facts on 2 ranks, where an exchange is one message.
        most: Facts on 8 ranks, each of which has 3 of its 6 faces inside.
    """
    *inside, last = (level["messages"] for level in two["levels"])
    coarsest = most["levels"][-1]
    n = most["dofs"] / most["ranks"]
    return Iteration(
        traffic=traffic(two),
        exchanges=sum(inside) / len(inside),
        outside=two["messages"] - sum(inside) - last,
        volume=FACES / 3.0 * (most["bytes"] - coarsest["bytes"]) / n ** (2.0 / 3.0),
        reductions=most["reductions"],
        unknowns=most["dofs"],
        grids=len(inside),
        owners=coarsest["unknowns"] / 3.0,
        factor=FLOP_BYTES * coarsest["flops"],
    )


def improved(iteration: Iteration) -> Iteration:
    """Return it with PETSc's remedies: coarsest grid on few ranks, dot products together."""
    on = max(1, round(math.sqrt(2.0 * iteration.owners)))  # the fewest messages
    return replace(iteration, gathered=on, reductions=iteration.reductions - 1.0)
