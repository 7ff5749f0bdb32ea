"""Flat blocks are the same meshes on any number of ranks."""

import numpy as np
import pytest
from scipy import ndimage

CASES = {  # volume, bottom, sides; areas of the top and the patches follow
    "wide hexahedra": (0.7 * 1.8 * 2.8, 1.8 * 2.8, 0.7 * 2.0 * (1.8 + 2.8)),
    "quadratic hexahedra": (1.4, 2.0, 4.2),
    "wide tetrahedra": (0.7 * 1.8 * 2.8, 1.8 * 2.8, 0.7 * 2.0 * (1.8 + 2.8)),
    "quadratic tetrahedra": (1.4, 2.0, 4.2),
    "rod": (1.4, 2.0, 4.2),
    "box": (1.4, 2.0, 4.2),
}
MORE = [2, pytest.param(4, marks=pytest.mark.slow)]
"""Two ranks, and so many that some have no cells."""


@pytest.mark.parametrize("ranks", MORE)
@pytest.mark.parametrize("case", CASES)
def test_meshes_are_the_same(on_ranks, case, ranks):
    meshes = [on_ranks[n][case] for n in (1, ranks)]
    assert all(mesh["exact"] == meshes[0]["exact"] for mesh in meshes)
    volume, bottom, sides = CASES[case]
    for mesh in meshes:
        measures = mesh["measures"]
        # sums of products: round-off
        assert measures["volume"] == pytest.approx(volume, rel=1e-13)
        assert measures["areas"] == pytest.approx([bottom, bottom, sides], rel=1e-13)
        assert measures["patches"] == pytest.approx([0.5] * 4, rel=1e-13)
        assert measures["unknowns"] == meshes[0]["measures"]["unknowns"]


@pytest.mark.parametrize("ranks", MORE)
@pytest.mark.parametrize("case", CASES)
def test_solutions_are_the_same(on_ranks, case, ranks):
    work = [on_ranks[n][case]["measures"]["work"] for n in (1, ranks)]
    # the same matrix but for the order of sums; the solver leaves 1e-10, the work its square
    np.testing.assert_allclose(work, work[0], rtol=1e-12)
    assert work[0] > 0.0


@pytest.mark.parametrize("ranks", MORE)
def test_supports_hold_nodes_on_every_rank(on_ranks, ranks):
    # dealt out, a rank can meet a support in a node alone, whose facets all belong to others
    whole = on_ranks[1]["box"]["measures"]
    for measures in on_ranks[ranks]["dealt"]:
        assert measures["unknowns"] == whole["unknowns"]
        assert measures["work"] == pytest.approx(whole["work"], rel=1e-12)  # as above


@pytest.mark.parametrize("ranks", MORE)
@pytest.mark.parametrize("case", CASES)
def test_cells_are_spread_without_ghosts(on_ranks, case, ranks):
    lattice = on_ranks[ranks][case]
    assert lattice["ghosts"] == 0 and len(lattice["cells_of_ranks"]) == ranks


def test_cells_are_spread_in_boxes(on_ranks):
    assert on_ranks[2]["quadratic hexahedra"]["cells_of_ranks"] == [8, 4]


@pytest.mark.slow
def test_some_of_four_ranks_have_no_cells(on_ranks):
    assert sorted(on_ranks[4]["rod"]["cells_of_ranks"]) == [0, 0, 1, 1]
    assert sorted(on_ranks[4]["box"]["cells_of_ranks"]) == [0, 0, 0, 6]


@pytest.mark.parametrize("ranks", [1, *MORE])
def test_regions_of_contact_go_on_across_ranks(on_ranks, ranks):
    result = on_ranks[ranks]["regions"]
    # facets connect all of their four nodes: each node to the eight around it
    expected = [ndimage.label(pattern, np.ones((3, 3)))[1] for pattern in result["patterns"]]
    assert result["found"] == expected
    assert max(expected) > 5 and min(expected) == 1
