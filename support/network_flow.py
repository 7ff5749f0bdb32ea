"""The flow through a network of conductances, by conjugate gradients on its flows.

Where conductances differ by many powers of ten, potentials in double precision do not tell the
flow: between two wide neighbours they differ by less than rounding. The flows themselves are
therefore what the iteration improves, and their balance at every node is checked.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from support.arrays import Array, Indices
from support.errors import NotConverged
from support.network import Network

MOST_IMBALANCE = 1e-10
"""Largest sum of what does not balance at all nodes, over the flow through the network."""
_GOAL = 1e-12
"""Imbalance at which the iteration stops."""
_MOST_ITERATIONS = 500
_GROWTH = 2.0
"""Growth of the imbalance over its least at which the iteration begins anew from where it is."""

Inverse = Callable[[Array], Array]
"""Returns an approximate solution of a linear system for its right side."""
Preconditioner = Callable[[sparse.csr_matrix], Inverse]
"""Returns what approximately solves systems with a symmetric positive definite M-matrix."""


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
            remedy="take other options of its multigrid (-patchlaw_leak_pc_type), or fewer cells",
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
    rows = np.concatenate([network.tail, network.head, network.tail, network.head])
    columns = np.concatenate([network.tail, network.head, network.head, network.tail])
    entries = np.concatenate([k, k, -k, -k])
    whole = sparse.coo_matrix((entries, (rows, columns)), (size, size)).tocsr()
    return whole[nodes][:, nodes]
