"""Networks of conductances against resistors by hand, a search of paths, and exact fractions."""

from fractions import Fraction

import numpy as np
import pytest
from scipy import sparse

from patchlaw.support import NotConverged
from patchlaw.support.network import (
    MOST_IMBALANCE,
    Network,
    banded,
    factorised,
    narrowest_link,
    network_flow,
)

IN, OUT = -2, -1


def network(count, *links):
    """Return a network of links (tail, head, conductance)."""
    tail, head, conductance = zip(*links, strict=True)
    ends = [
        np.array([one if one >= 0 else count + 2 + one for one in each]) for each in (tail, head)
    ]
    return Network(
        count=count, tail=ends[0], head=ends[1], conductance=np.array(conductance, float)
    )


def lattice(seed, nx=4, ny=3, powers=12.0):
    """Return a lattice whose conductances are spread over powers of ten, some links left out."""
    rng = np.random.default_rng(seed)
    cells = np.arange(nx * ny).reshape(nx, ny)
    links = [(IN, one) for one in cells[0]] + [(one, OUT) for one in cells[-1]]
    links += list(zip(cells[:-1].ravel(), cells[1:].ravel(), strict=True))
    links += list(zip(cells[:, :-1].ravel(), cells[:, 1:].ravel(), strict=True))
    kept = [one for one in links if rng.random() > 0.15]
    return network(nx * ny, *((a, b, 10.0 ** (-powers * rng.random())) for a, b in kept))


def exact_total(net):
    """Return the conductance between the terminals, by elimination of fractions node by node."""
    links = {node: {} for node in range(net.count + 2)}
    for a, b, k in zip(net.tail.tolist(), net.head.tolist(), net.conductance.tolist(), strict=True):
        links[a][b] = links[b][a] = links[a].get(b, Fraction(0)) + Fraction(k)
    for node in range(net.count):  # star to mesh
        star = links.pop(node)
        whole = sum(star.values())
        for a in star:
            del links[a][node]
        for a in star:
            for b in star:
                if a != b:
                    links[a][b] = links[a].get(b, Fraction(0)) + star[a] * star[b] / whole
    return float(links[net.inlet].get(net.outlet, 0))


def widest(net):
    """Return the largest conductance above which links still join the terminals, one by one."""
    for least in sorted(net.conductance, reverse=True):
        if net.only(net.conductance >= least).percolates:
            return least
    return None


def test_resistors_in_series_and_in_parallel():
    net = network(2, (IN, 0, 1.0), (0, OUT, 3.0), (IN, 1, 2.0), (1, OUT, 2.0))
    found = network_flow(net)
    assert found.total == pytest.approx(0.75 + 1.0, rel=1e-14)
    np.testing.assert_allclose(found.flow, [0.75, 0.75, 1.0, 1.0], rtol=1e-14)
    np.testing.assert_allclose(found.potential[:2], [0.25, 0.5], rtol=1e-14)


@pytest.mark.parametrize("powers", [2.0, 12.0, 21.0, 40.0])
@pytest.mark.parametrize("seed", range(8))
def test_flows_are_those_of_exact_fractions(seed, powers):
    """Also where conductances differ by 10⁴⁰, which no factorisation in double precision bears."""
    net = lattice(seed, powers=powers)
    found, expected = network_flow(net), exact_total(net)
    if powers <= 21.0:  # as between gaps
        assert network_flow(net, banded).total == pytest.approx(expected, rel=1e-10)
    assert net.percolates == (expected > 0.0)
    # links beyond 10¹² times their way out count as that much
    assert found.total == pytest.approx(expected, rel=1e-10)
    assert found.imbalance <= MOST_IMBALANCE
    out = net.divergence(found.flow)
    assert np.abs(out[: net.count]).sum() <= MOST_IMBALANCE * found.total


@pytest.mark.parametrize("few", [1, 10_000])
@pytest.mark.parametrize("seed", range(12))
def test_the_narrowest_link_is_that_of_a_search_link_by_link(seed, few, monkeypatch):
    monkeypatch.setattr("patchlaw.support.network._FEW", few)
    net = lattice(seed)
    if not net.percolates:
        assert widest(net) is None
        return
    ends = net.inlet, net.outlet
    link = narrowest_link(net.tail, net.head, net.conductance, ends)
    assert net.conductance[link] == widest(net)
    # also where many are alike
    alike = np.minimum(net.conductance, 1e-3)
    link = narrowest_link(net.tail, net.head, alike, ends)
    assert alike[link] == min(widest(net), 1e-3)


def test_wide_links_count_as_much_as_can_pass_them():
    """A pool behind a needle's eye: 10³⁰ beside 1."""
    net = network(2, (IN, 0, 1.0), (0, 1, 1e30), (1, OUT, 2.0))
    assert net.within_reach().conductance.tolist() == [1.0, 2e12, 2.0]
    assert network_flow(net).total == pytest.approx(2.0 / 3.0, rel=1e-11)


def test_without_a_path_nothing_flows():
    net = network(4, (IN, 0, 1.0), (0, 1, 1.0), (2, OUT, 1.0), (3, 3, 1.0))
    found = network_flow(net)
    assert not net.percolates
    assert found.total == 0.0 and not found.flow.any()
    np.testing.assert_array_equal(found.potential, [1.0, 1.0, 0.0, np.nan, 1.0, 0.0])


def test_pockets_beside_the_path_have_no_potential():
    net = network(3, (IN, 0, 1.0), (0, OUT, 1.0), (1, 2, 5.0))
    found = network_flow(net)
    assert found.total == pytest.approx(0.5)
    np.testing.assert_array_equal(np.isnan(found.potential), [False, True, True, False, False])
    assert found.flow[2] == 0.0


def test_what_does_not_balance_is_refused():
    """A preconditioner that sees no links between nodes leaves slow modes in hundreds of nodes."""
    count = 4000
    chain = [(IN, 0, 1.0), *((i, i + 1, 1.0 + 1e5 * (i % 7)) for i in range(count - 1))]
    net = network(count, *chain, (count - 1, OUT, 1.0))

    def diagonal(matrix):
        return lambda residual: residual / matrix.diagonal()

    with pytest.raises(NotConverged, match="of it does not balance, more than 1e-10 after 500 it"):
        network_flow(net, diagonal)
    with pytest.raises(NotConverged, match="the flow through the gaps did not converge"):
        network_flow(net, lambda matrix: lambda residual: -1e30 * residual)
    assert network_flow(net).imbalance <= MOST_IMBALANCE


@pytest.mark.parametrize("shape", [(9, 8), (2, 40)])  # the latter too wide for a band
def test_bands_solve_as_factors(shape):
    net, matrices = lattice(3, *shape, powers=3.0), []

    def kept(matrix):
        matrices.append(matrix)
        return factorised(matrix)

    network_flow(net, kept)
    right = np.sin(np.arange(matrices[0].shape[0]))
    expected = factorised(matrices[0])(right)
    np.testing.assert_allclose(banded(matrices[0])(right), expected, rtol=1e-9)


def test_factors_solve():
    matrix = sparse.csr_matrix([[3.0, -1.0], [-1.0, 2.0]])
    np.testing.assert_allclose(factorised(matrix)(np.array([5.0, 0.0])), [2.0, 1.0], rtol=1e-14)
