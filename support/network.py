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
_GROWTH = 2.0
"""Growth of the imbalance over its least at which the iteration begins anew from where it is."""

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
        """A number for each node that those share which links join, shape (n + 2,)."""
        links = self._matrix(np.ones(len(self.tail)))
        joined: NDArray[np.integer] = csgraph.connected_components(links, directed=False)[1]
        return joined

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
            self,
            tail=self.tail[links],
            head=self.head[links],
            conductance=self.conductance[links],
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
        where that exceeds the conductances there. All links must be joined to a terminal.
        """
        # with wide links alone most nodes reach a terminal, and stand for it here
        wide = self.only(_WIDEST_STEP * self.conductance >= self.conductance.max())
        out = np.isin(wide.joined, wide.joined[[self.inlet, self.outlet]])
        tail, head = (np.where(out[ends], self.inlet, ends) for ends in (self.tail, self.head))
        order = np.flatnonzero(tail != head)
        among = self.conductance[order]
        if among.max(initial=0.0) <= _WIDEST_STEP * among.min(initial=np.inf):
            return np.full(self.count + 2, np.inf)
        order = order[np.argsort(-self.conductance[order], kind="stable")]
        ends = np.minimum(tail, head)[order] * (self.count + 2) + np.maximum(tail, head)[order]
        order = order[np.unique(ends, return_index=True)[1]]  # the widest of links side by side
        rest = Network(self.count, tail[order], head[order], self.conductance[order])
        return _WIDEST_STEP * rest._widest_ways_out

    @cached_property
    def _tree(self) -> tuple[sparse.csr_matrix, Indices]:
        """The maximum spanning tree, and the node before each on the way from the inlet."""
        # of the minimum spanning tree, whose weights must be positive
        weight = np.log(self.conductance.max() / self.conductance) + 1.0
        tree = csgraph.minimum_spanning_tree(self._matrix(weight))
        return tree, csgraph.breadth_first_order(tree, self.inlet, directed=False)[1]

    @property
    def _widest_ways_out(self) -> Array:
        """Smallest conductance on the widest path from nodes to the inlet, ∞ at it, (n + 2,)."""
        if not len(self.tail):
            return np.full(self.count + 2, np.inf)
        before = self._tree[1]
        nodes = np.flatnonzero(before >= 0)
        width = np.full(self.count + 2, np.inf)
        width[nodes] = self.conductance[self._numbers(before[nodes], nodes)]
        before = np.where(before < 0, np.arange(self.count + 2), before)
        while (before != before[before]).any():  # each pass doubles the way looked along
            width, before = np.minimum(width, width[before]), before[before]
        return width

    def _numbers(self, first: Indices, second: Indices) -> Indices:
        """Return the numbers of the links between pairs of nodes."""
        ends, order = self._sorted_ends
        wanted = np.minimum(first, second) * (self.count + 2) + np.maximum(first, second)
        return np.asarray(order[np.searchsorted(ends, wanted)])

    @cached_property
    def _sorted_ends(self) -> tuple[Indices, Indices]:
        """Both ends of the links as one number, rising, and the numbers of the links."""
        ends = np.minimum(self.tail, self.head) * (self.count + 2)
        ends += np.maximum(self.tail, self.head)
        order = np.argsort(ends, kind="stable")
        return ends[order], order

    def _matrix(self, values: Array) -> sparse.csr_matrix:
        """Return values of links as a sparse matrix, each with an entry from tail to head."""
        size = self.count + 2
        return sparse.coo_matrix((values, (self.tail, self.head)), (size, size)).tocsr()


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


def narrowest_link(
    tail: NDArray[np.integer],
    head: NDArray[np.integer],
    conductance: Array,
    ends: tuple[int, int],
) -> int:
    """Return the number of the narrowest link on the widest path between two nodes.

    Its conductance is the largest that the narrowest link of a path has. Where the wider half of
    the links joins both nodes, the others are left out; otherwise nodes that it joins count as one.

    Args:
        tail: Node where each of m links begins, shape (m,).
        head: Node where it ends, shape (m,).
        conductance: Conductance of each link, shape (m,).
        ends: Both nodes, which links join.

    Source:
        Camerini 1978, doi 10.1016/0020-0190(78)90030-3.
    """
    link = np.arange(len(tail))
    while len(link) > 1:
        half, size = len(link) // 2, int(max(tail.max(), head.max(), *ends)) + 1
        order = np.argpartition(-conductance[link], half - 1)
        link, tail, head = link[order], tail[order], head[order]
        wide = sparse.coo_matrix((np.ones(half), (tail[:half], head[:half])), (size, size))
        joined = csgraph.connected_components(wide, directed=False)[1]
        if joined[ends[0]] == joined[ends[1]]:
            link, tail, head = link[:half], tail[:half], head[:half]
        else:
            ends, tail, head = (joined[ends[0]], joined[ends[1]]), joined[tail], joined[head]
            apart = tail != head
            link, tail, head = link[apart], tail[apart], head[apart]
    return int(link[0])


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
