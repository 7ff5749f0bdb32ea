"""The critical constriction of a flow: the narrowest place on the widest path between its sides.

Near percolation nearly all of the fluid pressure falls there, and what passes through it is the
leak (Dapp, Lücke, Persson & Müser 2012, doi 10.1103/PhysRevLett.108.244301).

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from support.arrays import Array
from support.network import Network, NetworkFlow


@dataclass(frozen=True, slots=True, kw_only=True)
class Constriction:
    """The narrowest place on the widest path.

    Args:
        place: Centre (x, y) of the cell there [mm].
        gap: Gap of that cell [mm].
        share: Part of the whole flow that passes through its channel.
    """

    place: tuple[float, float]
    gap: float
    share: float

    @property
    def turned(self) -> Constriction:
        """The constriction of a map whose axes are swapped."""
        return replace(self, place=(self.place[1], self.place[0]))


def critical_constriction(
    network: Network, solution: NetworkFlow, gap: Array, lengths: tuple[float, float]
) -> Constriction:
    """Return the critical constriction of a flow along x.

    What passes through its channel is seen along the line of equal fluid pressure through it, from
    contact to contact.

    Args:
        network: The network of the cells; its inlet and outlet are linked.
        solution: The flow through it.
        gap: Gaps of the cells, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
    """
    link = network.narrowest
    ends = [int(one) for one in (network.tail[link], network.head[link]) if one < network.count]
    cell = min(ends, key=lambda one: float(gap.flat[one]))
    potential, flow = solution.potential, solution.flow
    level = 0.5 * (potential[network.tail[link]] + potential[network.head[link]])
    above = potential > level
    crossing = above[network.tail] != above[network.head]
    beside = np.zeros(network.count + 2, bool)
    beside[network.tail[crossing]] = beside[network.head[crossing]] = True
    beside[network.count :] = False  # all cells of a side are joined by its terminal
    joined = network.only(beside[network.tail] & beside[network.head]).joined
    channel = joined == joined[cell]
    crossing &= channel[network.tail] | channel[network.head]
    downwards = np.where(above[network.tail], flow, -flow)
    index = np.unravel_index(cell, gap.shape)
    x, y = (
        float((i + 0.5) * length / n)
        for i, length, n in zip(index, lengths, gap.shape, strict=True)
    )
    share = float(downwards[crossing].sum()) / solution.total
    return Constriction(place=(x, y), gap=float(gap.flat[cell]), share=min(share, 1.0))
