"""The basis of a facet's shape, and the parts that curved facets are cut into."""

import numpy as np
import pytest

from patchlaw.macro.mesh.facet_parts import lattice_triangles
from patchlaw.macro.mesh.facets import BETWEEN, facet_basis

CORNERS = {3: [(0, 0), (1, 0), (0, 1)], 4: [(0, 0), (1, 0), (0, 1), (1, 1)]}
POWERS = {
    3: [(0, 0), (1, 0), (0, 1)],
    4: [(0, 0), (1, 0), (0, 1), (1, 1)],
    6: [(i, j) for i in range(3) for j in range(3 - i)],
    9: [(i, j) for i in range(3) for j in range(3)],
}
"""Powers of both coordinates whose products the basis reproduces."""


def nodes_of(count):
    """Return the local coordinates of a facet's nodes: corners, then what lies between them."""
    corners = np.array(CORNERS[3 if count in (3, 6) else 4], float)
    if count in CORNERS:
        return corners
    return np.array(
        [*corners, *(corners[list(ends)].mean(axis=0) for ends in BETWEEN[len(corners)])]
    )


@pytest.mark.parametrize("count", POWERS)
def test_polynomials_are_those_of_their_values_at_the_nodes(count):
    random = np.random.default_rng(count)
    s, t = points = random.dirichlet((1.0, 1.0, 1.0), 30)[:, :2].T
    factors = dict(zip(POWERS[count], random.normal(size=len(POWERS[count])), strict=True))
    at_nodes = sum(c * x**i * y**j for (i, j), c in factors.items() for x, y in [nodes_of(count).T])
    values, slopes = facet_basis(count, points.T)
    expected = sum(c * s**i * t**j for (i, j), c in factors.items())
    along_s = sum(c * i * s ** max(i - 1, 0) * t**j for (i, j), c in factors.items())
    along_t = sum(c * j * s**i * t ** max(j - 1, 0) for (i, j), c in factors.items())
    np.testing.assert_allclose(values @ at_nodes, expected, rtol=0.0, atol=1e-13)
    found = np.einsum("pnd,n->pd", slopes, at_nodes)
    np.testing.assert_allclose(found, np.column_stack([along_s, along_t]), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("count", POWERS)
def test_a_rank_may_have_no_points(count):
    values, slopes = facet_basis(count, np.empty((0, 2)))
    assert values.shape == (0, count) and slopes.shape == (0, count, 2)


@pytest.mark.parametrize(("corners", "count"), [(3, 1), (3, 4), (4, 1), (4, 3)])
def test_parts_fill_the_facet_once(corners, count):
    parts = lattice_triangles(corners, count)
    (a, b), (c, d) = (parts[:, 1] - parts[:, 0]).T, (parts[:, 2] - parts[:, 0]).T
    assert len(parts) == (corners - 2) * count**2
    np.testing.assert_allclose(0.5 * (a * d - b * c), 0.5 / count**2, rtol=1e-12)  # of one hand
    assert len(np.unique(parts.mean(axis=1).round(9), axis=0)) == len(parts)
    assert parts.min() == 0.0 and parts.sum(axis=2).max() == (1.0 if corners == 3 else 2.0)
