"""Networks of conductances between two terminals: narrowest links, and the flow through them.

A network has n nodes, the inlet and the outlet. Flow from a node to its neighbour is their
conductance times the difference of their potentials, as with resistors.

Where conductances differ by many powers of ten, potentials in double precision do not tell the
flow: between two wide neighbours they differ by less than rounding. The flows themselves are
therefore what conjugate gradients improve, and their balance at every node is checked.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse import csgraph, linalg

from patchlaw.support.checks import Array, Flags, Indices
from patchlaw.support.errors import NotConverged

MOST_IMBALANCE = 1e-10
"""Largest sum of what does not balance at all nodes, over the flow through the network."""
_GOAL = 0.1 * MOST_IMBALANCE
"""Imbalance at which the iteration stops. Potentials lie between those of the terminals, so that
the flow errs by as much of itself at most."""
_MOST_ITERATIONS = 500
_FEW = 10_000
"""Largest number of links whose spanning tree is made without halving them before."""
_GROWTH = 2.0
"""Growth of the imbalance over its least at which the iteration begins anew from where it is."""

Numbers: TypeAlias = NDArray[np.integer]
Inverse = Callable[[Array], Array]
"""Returns an approximate solution of a linear system for its right side."""
Preconditioner = Callable[[sparse.csr_matrix], Inverse]
"""Returns what approximately solves systems with a symmetric positive definite M-matrix."""
_WIDEST_STEP = 1e12
"""Largest conductance that counts, over that of the widest path from there to a terminal. What lies
beyond resists a factorisation in double precision. It resists flow by 1e-12 of what lies on its way
out for every link that is narrowed."""


_WIDEST_BAND, _MOST_SQUARED = 160, 2.0
"""Width of a matrix's band, and its square over the rows, 1 on square maps, up to which the band is
factorised: two flows through 64² and 128² cells took 12 and 67 ms of CPU so, 19 and 90 ms by
SuperLU, and one through 192² and 256² cells 0.13 to 0.4 s so, 0.08 and 0.15 s by SuperLU. On 512²
and 1024² cells, whose bands take 1 and 9 GB, SuperLU takes 1.7 and 19 s, 0.24 and 1.1 GB."""


@dataclass(frozen=True, eq=False)
class Network:
    """Links between nodes 0 … n − 1, the inlet n and the outlet n + 1.

    Args:
        count: Number n of nodes without the terminals.
        tail: Node where each of m links begins, shape (m,).
        head: Node where it ends, shape (m,).
        conductance: Conductance of each link, > 0, shape (m,).
    """

    count: int
    tail: Indices
    head: Indices
    conductance: Array

    @property
    def inlet(self) -> int:
        """Number of the inlet."""
        return self.count

    @property
    def outlet(self) -> int:
        """Number of the outlet."""
        return self.count + 1

    def divergence(self, flow: Array) -> Array:
        """Return what flows out of every node, the terminals included, shape (n + 2,).

        Args:
            flow: Flow through every link from tail to head, shape (m,).
        """
        size = self.count + 2
        out, into = (np.bincount(ends, flow, minlength=size) for ends in (self.tail, self.head))
        return np.subtract(out, into, dtype=float)

    def flow(self, potential: Array) -> Array:
        """Return the flow through every link under potentials of all nodes, shape (m,).

        Args:
            potential: Shape (n + 2,).
        """
        return self.conductance * (potential[self.tail] - potential[self.head])

    @cached_property
    def joined(self) -> NDArray[np.integer]:
        """Number of the connected component that each node is in, shape (n + 2,)."""
        return joined(self.tail, self.head, self.count + 2)

    @property
    def percolates(self) -> bool:
        """Whether a path of links leads from the inlet to the outlet."""
        return bool(self.joined[self.inlet] == self.joined[self.outlet])

    def only(self, links: Flags) -> Network:
        """Return the network of some links.

        Args:
            links: Which, shape (m,).
        """
        return replace(
            self, tail=self.tail[links], head=self.head[links], conductance=self.conductance[links]
        )

    def within_reach(self) -> Network:
        """Return the network with conductances that double precision resolves side by side.

        Larger ones are lowered to the `limits` of their nodes.
        """
        limits = self.limits
        if np.isinf(limits).all():
            return self
        limit = np.minimum(limits[self.tail], limits[self.head])
        return replace(self, conductance=np.minimum(self.conductance, limit))

    @property
    def limits(self) -> Array:
        """Largest conductance beside each node that double precision resolves, shape (n + 2,).

        It is `_WIDEST_STEP` times what the widest path to a terminal lets through, or infinite
        where that exceeds the conductances there, and where no path leads to a terminal.
        """
        # with wide links alone most nodes reach a terminal, and stand for it here
        wide = self.only(_WIDEST_STEP * self.conductance >= self.conductance.max())
        out = np.isin(wide.joined, wide.joined[[self.inlet, self.outlet]])
        tail, head = (np.where(out[ends], self.inlet, ends) for ends in (self.tail, self.head))
        order = np.flatnonzero(tail != head)
        among = self.conductance[order]
        if among.max(initial=0.0) <= _WIDEST_STEP * among.min(initial=np.inf):
            return np.full(self.count + 2, np.inf)
        rest = Network(self.count, tail[order], head[order], self.conductance[order])
        return _WIDEST_STEP * rest._widest_ways_out

    @property
    def _widest_ways_out(self) -> Array:
        """Smallest conductance on the widest path from nodes to the inlet, ∞ at it, (n + 2,)."""
        width = np.full(self.count + 2, np.inf)
        if not len(self.tail):
            return width
        before, link = _widest_paths(self.tail, self.head, self.conductance, self.inlet, len(width))
        nodes = np.flatnonzero(before >= 0)
        width[nodes] = self.conductance[link[nodes]]
        before = np.where(before < 0, np.arange(len(width)), before)
        while (before != before[before]).any():  # each pass doubles the way looked along
            width, before = np.minimum(width, width[before]), before[before]
        return width


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NetworkFlow:
    """The flow through a network whose inlet has the potential 1 and whose outlet has 0.

    Args:
        total: Flow from the inlet to the outlet, the conductance of the whole network.
        potential: Potential of every node, shape (n + 2,); NaN where no link leads.
        flow: Flow through every link from tail to head, shape (m,).
        imbalance: Sum of the absolute differences of what enters and what leaves over all nodes,
            and of that between inlet and outlet, over the total.
        iterations: Iterations of the solver.
    """

    total: float
    potential: Array
    flow: Array
    imbalance: float = 0.0
    iterations: int = 0


def joined(tail: Numbers, head: Numbers, count: int) -> Numbers:
    """Return the number of the connected component that each node is in, shape (count,).

    Args:
        tail: Node where each of m links begins, shape (m,).
        head: Node where it ends, shape (m,).
        count: Number of nodes.
    """
    links = sparse.coo_matrix((np.ones(len(tail)), (tail, head)), (count, count)).tocsr()
    found: Numbers = csgraph.connected_components(links, directed=False)[1]
    return found


def narrowest_link(
    tail: Numbers, head: Numbers, conductance: Array, ends: tuple[int, int]
) -> int | None:
    """Return the number of the narrowest link on the widest path between two nodes.

    None where no path joins them. Its conductance is the largest that the narrowest link of a path
    has. Many links are halved: where the wider half joins both nodes, the others are left out;
    where not, the nodes that it joins are merged. The path lies in the maximum spanning tree of the
    links that are left.

    Args:
        tail: Node where each of m links begins, shape (m,).
        head: Node where it ends, shape (m,).
        conductance: Conductance of each link, shape (m,).
        ends: Both nodes.

    Source:
        Camerini 1978, doi 10.1016/0020-0190(78)90030-3 (halves).
    """
    number = np.arange(len(tail))
    while len(number) > _FEW:
        half, size = len(number) // 2, int(max(tail.max(), head.max(), *ends)) + 1
        order = np.argpartition(-conductance[number], half - 1)
        number, tail, head = number[order], tail[order], head[order]
        node = joined(tail[:half], head[:half], size)
        if node[ends[0]] == node[ends[1]]:
            number, tail, head = number[:half], tail[:half], head[:half]
        else:
            ends, tail, head = (node[ends[0]], node[ends[1]]), node[tail], node[head]
            apart = tail != head
            number, tail, head = number[apart], tail[apart], head[apart]
    size = int(max(tail.max(initial=0), head.max(initial=0), *ends)) + 1
    before, link = _widest_paths(tail, head, conductance[number], ends[0], size)
    if before[ends[1]] < 0:
        return None
    path = [ends[1]]
    while path[-1] != ends[0]:
        path.append(int(before[path[-1]]))
    along = number[link[path[:-1]]]
    return int(along[conductance[along].argmin()])


def _widest_paths(
    tail: Numbers, head: Numbers, conductance: Array, root: int, size: int
) -> tuple[Numbers, Numbers]:
    """Return the next node on the widest path from each node to a root, and the link to it.

    The paths are those of the maximum spanning tree. Shapes (size,); nodes are < 0 at the root and
    where no path leads.

    Source:
        Hu 1961, doi 10.1287/opre.9.6.898.
    """
    order = np.argsort(-conductance, kind="stable")
    pairs = np.minimum(tail, head).astype(np.int64) * size + np.maximum(tail, head)
    order = order[np.sort(np.unique(pairs[order], return_index=True)[1])]  # the widest of each pair
    rank = np.arange(1.0, len(order) + 1.0)
    links = sparse.coo_matrix((rank, (tail[order], head[order])), (size, size)).tocsr()
    tree = csgraph.minimum_spanning_tree(links)
    before: Numbers = csgraph.breadth_first_order(tree, root, directed=False)[1]
    edges, link = tree.tocoo(), np.full(size, -1)
    child = np.where(before[edges.col] == edges.row, edges.col, edges.row)
    link[child] = order[edges.data.astype(int) - 1]
    return before, link


def factorised(matrix: sparse.csr_matrix) -> Inverse:
    """Return what solves systems with a symmetric positive definite matrix by its factors.

    Args:
        matrix: The matrix.
    """
    factors = linalg.splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return factors.solve


def banded(matrix: sparse.csr_matrix) -> Inverse:
    """Return the same by Cholesky factors of a band, of small maps not much wider than long.

    Others have the factors of `factorised`.

    Args:
        matrix: The matrix.
    """
    entries = matrix.tocoo()
    below = entries.row - entries.col
    width = int(below.max(initial=0))
    if width > _WIDEST_BAND or width**2 > _MOST_SQUARED * matrix.shape[0]:
        return factorised(matrix)
    lower, band = below >= 0, np.zeros((width + 1, matrix.shape[0]))
    band[below[lower], entries.col[lower]] = entries.data[lower]
    try:
        factor = cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False)
    except LinAlgError:  # by rounding, where conductances differ by 10¹² and more
        return factorised(matrix)
    return lambda right: cho_solve_banded((factor, True), right, check_finite=False)


def network_flow(
    network: Network, preconditioner: Preconditioner = factorised, *, limited: bool = False
) -> NetworkFlow:
    """Solve for the flow through a network.

    Args:
        network: The network.
        preconditioner: Makes what solves for the potentials approximately.
        limited: Whether its conductances are known to be within `Network.limits`. They may then
            have any sign, as those of finite elements, if the whole is positive definite.

    Raises:
        NotConverged: When what enters and leaves the nodes does not balance.
    """
    if not network.percolates:
        return _closed(network)
    reached = network.joined[network.tail] == network.joined[network.inlet]
    part = network.only(reached)
    part = part if limited else part.within_reach()
    nodes = np.flatnonzero(network.joined[: network.count] == network.joined[network.inlet])
    potential, flow, iterations = _solved(part, nodes, preconditioner)
    out = part.divergence(flow)
    entering, leaving = out[part.inlet], -out[part.outlet]
    total = 0.5 * (entering + leaving)
    imbalance = (float(np.abs(out[nodes]).sum()) + abs(entering - leaving)) / abs(total)
    if not (imbalance <= MOST_IMBALANCE and total > 0.0):
        raise NotConverged(
            "the flow through the gaps",
            reason=f"{imbalance:.1e} of it does not balance, more than {MOST_IMBALANCE:g}",
            iterations=iterations,
            remedy="take other cells: twice as many, or fewer",
        )
    everywhere = np.zeros(len(network.tail))
    everywhere[reached] = flow
    return NetworkFlow(
        total=float(total),
        potential=potential,
        flow=everywhere,
        imbalance=imbalance,
        iterations=iterations,
    )


def _closed(network: Network) -> NetworkFlow:
    """Return that nothing flows; what is joined to a terminal has its potential."""
    potential = np.full(network.count + 2, np.nan)
    for terminal, value in ((network.inlet, 1.0), (network.outlet, 0.0)):
        potential[network.joined == network.joined[terminal]] = value
    return NetworkFlow(total=0.0, potential=potential, flow=np.zeros(len(network.tail)))


def _solved(
    network: Network, nodes: Indices, preconditioner: Preconditioner
) -> tuple[Array, Array, int]:
    """Return potentials of all nodes, flows of all links, and the iterations.

    Args:
        network: A network whose links are all joined to both terminals.
        nodes: Its nodes without the terminals.
        preconditioner: See `network_flow`.
    """
    potential = np.full(network.count + 2, np.nan)
    potential[nodes], potential[network.inlet], potential[network.outlet] = 0.0, 1.0, 0.0
    flow = network.flow(potential)
    if not len(nodes):  # all links join the terminals, as those of a ring one element wide
        return potential, flow, 0
    solve = preconditioner(_matrix(network, nodes))
    change, direction, before, least = np.zeros(network.count + 2), None, 1.0, np.inf
    for iteration in range(_MOST_ITERATIONS):
        out = network.divergence(flow)
        residual = -out[nodes]
        missed = float(np.abs(residual).sum())
        if iteration and missed <= _GOAL * abs(out[network.inlet]):
            return potential, flow, iteration
        if missed > _GROWTH * least:  # by rounding, directions are no longer conjugate
            direction, least = None, missed
        least = min(least, missed)
        step = solve(residual)
        now = float(residual @ step)
        direction = step if direction is None else step + now / before * direction
        change[nodes], before = direction, now
        along = network.flow(change)
        length = now / float(along @ (change[network.tail] - change[network.head]))
        potential[nodes] += length * direction
        flow += length * along
    return potential, flow, _MOST_ITERATIONS


def _matrix(network: Network, nodes: Indices) -> sparse.csr_matrix:
    """Return the matrix of the flows out of nodes under their potentials."""
    size, k = network.count + 2, network.conductance
    diagonal = np.bincount(network.tail, k, size) + np.bincount(network.head, k, size)
    number = np.full(size, -1)
    number[nodes] = own = np.arange(len(nodes))
    tail, head = number[network.tail], number[network.head]
    inside = (tail >= 0) & (head >= 0)
    tail, head, beside = tail[inside], head[inside], -k[inside]
    rows, columns = np.concatenate([own, tail, head]), np.concatenate([own, head, tail])
    entries = np.concatenate([diagonal[nodes], beside, beside])
    return sparse.coo_matrix((entries, (rows, columns)), (len(nodes), len(nodes))).tocsr()
