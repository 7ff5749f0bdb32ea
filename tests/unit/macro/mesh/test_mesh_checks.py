"""Checks of a body's mesh."""

from itertools import permutations

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from helpers.mesh_files import tagged_box
from mpi4py import MPI

from patchlaw.macro import TaggedMesh, compat
from patchlaw.macro.mesh.facets import parts
from patchlaw.macro.mesh.from_file import _volumes, check_cells, check_connected, size_note
from patchlaw.support import InputError

COMM = MPI.COMM_SELF
CUBE = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
FIVE = [(0, 1, 2, 4), (1, 3, 2, 7), (1, 5, 4, 7), (2, 6, 7, 4), (1, 2, 4, 7)]


def tagged(points, cells):
    mesh = compat.mesh_from_cells(np.array(cells, np.int64), np.array(points, float), None, COMM)
    none = np.empty(0, np.int32)
    return TaggedMesh(mesh=mesh, facet_tags=dmesh.meshtags(mesh, 2, none, none))


def moved(corner, place):
    """Return the cube's corners, one of them elsewhere."""
    points = CUBE.copy()
    points[corner] = place
    return points


def test_flat_tetrahedra_are_as_flat_whichever_vertex_is_first():
    points = np.array([(0, 0, 0), (0, 0, 1.0), (0, 1e-5, 0), (1e-5, 0, 0)])
    found = [_volumes(points[list(order)][None])[0][0] for order in permutations(range(4))]
    np.testing.assert_allclose(found, found[0], rtol=1e-12)
    assert found[0] == pytest.approx(1.0 / np.prod([1.0, 1.0, 1.0]), rel=1e-4)


@pytest.mark.parametrize("kind", ["tetrahedron", "hexahedron"])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_boxes_and_their_mirror_images_are_sound(kind, mirror):
    box = tagged_box(COMM, lengths=(1e-3, 50.0, 2.0), kind=kind)
    box.mesh.geometry.x[:, 0] *= mirror
    check_cells(box)
    check_connected(box)


def test_the_hand_of_single_cells_does_not_matter():
    check_cells(tagged(CUBE, FIVE))
    for turned in range(5):
        cells = [cell[::-1] if k == turned else cell for k, cell in enumerate(FIVE)]
        check_cells(tagged(CUBE, cells))


@pytest.mark.parametrize(
    ("points", "cells", "count"),
    [
        # the corner goes through the opposite facet of its one cell: that cell and its neighbour
        # lie on one side of a facet
        (moved(0, (0.9, 0.9, 0.9)), FIVE, 2),
        (moved(0, (1 / 3, 1 / 3, 1 / 3)), FIVE, 1),  # in the plane of the other three
        (moved(0, CUBE[1]), FIVE, 1),  # an edge without length
        (moved(7, (0.1, 0.1, 0.1)), [range(8)], 1),  # a corner pushed in
        (moved(7, CUBE[6]), [range(8)], 1),  # an edge without length
        (CUBE[[1, 0, 2, 3, 4, 5, 6, 7]], [range(8)], 1),  # crossed edges
    ],
    ids=["folded", "flat", "collapsed", "pushed in", "collapsed hexahedron", "crossed"],
)
def test_bad_cells_are_counted(points, cells, count):
    with pytest.raises(InputError, match=f"{count} of {len(cells)} cells .* are inside out or"):
        check_cells(tagged(points, cells))


def test_place_of_a_bad_cell_is_shown():
    box = tagged_box(COMM, cells=(4, 4, 4), kind="hexahedron")
    x = box.mesh.geometry.x
    inner = np.flatnonzero(np.isclose(x, [0.75, 0.75, 0.75]).all(axis=1))
    x[inner] = [0.3, 0.75, 0.75]  # through the four cells to its left
    with pytest.raises(
        InputError, match=r"4 of 64 cells .* one is at \(0\.5\d*, 0\.625, 0\.625\) mm"
    ):
        check_cells(box)


def test_nodes_have_finite_coordinates():
    box = tagged_box(COMM)
    box.mesh.geometry.x[3, 1] = np.nan
    with pytest.raises(InputError, match="coordinates are not finite"):
        check_cells(box)


def test_parts_hang_together_by_facets():
    box = tagged_box(COMM, cells=(3, 3, 3))
    assert parts(box.mesh) == [162]
    far = CUBE + np.array([3.0, 0.0, 0.0])
    apart = np.vstack([CUBE, far]), [*FIVE, *np.add(FIVE, 8)[2:]]
    assert parts(tagged(*apart).mesh) == [5, 3]
    # two tetrahedra at an edge, the others at a facet
    hinged = tagged(CUBE, [(0, 1, 2, 4), (1, 3, 2, 7), (4, 5, 7, 1)])
    assert parts(hinged.mesh) == [1, 1, 1]
    with pytest.raises(InputError, match=r"in 3 parts .* of 1, 1, 1 cells; .* fragment them"):
        check_connected(hinged)


def test_many_parts_are_shortened():
    points = np.vstack([CUBE[[0, 1, 2, 4]] + np.array([2.0 * k, 0, 0]) for k in range(7)])
    with pytest.raises(
        InputError, match="in 7 parts that share no facets, of 1, 1, 1, 1, 1, … cells"
    ):
        check_connected(tagged(points, np.arange(28).reshape(7, 4)))


@pytest.mark.parametrize(
    ("lengths", "note"),
    [
        ((0.1, 0.05, 0.015), '0.1 × 0.05 × 0.015 mm large; is its unit right? (mesh_unit = "m"?)'),
        ((1.0, 1.0, 1.0), None),
        ((120.0, 50.0, 15.0), None),
        (
            (1e5, 5e4, 2e4),
            '1e+05 × 5e+04 × 2e+04 mm large; is its unit right? (mesh_unit = "mm" or "um"?)',
        ),
    ],
)
def test_size_is_noted_where_the_unit_may_be_wrong(lengths, note):
    found = size_note(tagged_box(COMM, lengths=lengths, cells=(1, 1, 1)))
    assert found == (note and f"the mesh of the body is {note}")
