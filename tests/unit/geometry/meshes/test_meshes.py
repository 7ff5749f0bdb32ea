import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import BlockShape, PatchGrid, misalignment
from patchlaw.geometry.meshes.block import lattice_cells, lattice_part, node_share

SHAPE = {"interface": (1.0, 2.0), "height": 1.5, "cells": (4, 6, 3)}
MARGIN = {"margin": 0.7, "margin_cells": 2, "margin_grading": 3.0}


def mesh_of(**change):
    """Return a shape, its nodes and its cells, in gmsh's order of vertices."""
    shape = BlockShape(**{**SHAPE, **change})
    counts = tuple(len(ticks) - 1 for ticks in shape.ticks)
    cells = lattice_cells(counts, lattice_part(counts, 1, 0), hexahedra=shape.hexahedral)
    if shape.hexahedral:
        cells = cells[:, [0, 1, 3, 2, 4, 5, 7, 6]]
    return shape, node_share(shape.ticks, 1, 0), cells


def volumes(points, cells):
    """Return signed volumes of tetrahedra, or of hexahedra with plane faces."""
    p = points[cells]
    if cells.shape[1] == 4:
        return np.linalg.det(p[:, 1:] - p[:, :1]) / 6.0
    return np.linalg.det(p[:, [1, 3, 4]] - p[:, :1])


CASES = [
    {},
    {"cells": (1, 1, 1)},
    {"cells": (5, 1, 7), "grading": 4.0},
    {"element": "Q2", "grading": 2.0, **MARGIN},
    {"element": "P1", "grading": 3.0},
    {"element": "P2", **MARGIN},
    {"element": "P1", "cells": (1, 1, 1)},
]


@pytest.mark.parametrize("change", CASES)
def test_cells_fill_the_block_once(change):
    shape, points, cells = mesh_of(**change)
    assert cells.shape == (shape.cell_count, 8 if shape.hexahedral else 4)
    assert len(points) == np.prod([len(ticks) for ticks in shape.ticks])
    size = np.prod([ticks[-1] - ticks[0] for ticks in shape.ticks])
    assert volumes(points, cells).min() > 0.0
    assert volumes(points, cells).sum() == pytest.approx(size, rel=1e-13)
    # the faces of one cell alone cover the outside and nothing else
    outer = np.array(sorted(boundary(cells)))
    on_plane = [
        np.all(points[outer][..., axis] == end, axis=1)
        for axis, ticks in enumerate(shape.ticks)
        for end in (ticks[0], ticks[-1])
    ]
    assert np.all(np.sum(on_plane, axis=0) == 1)


def boundary(cells):
    """Return the faces that belong to one cell only: with a mismatch there would be more."""
    local = (
        [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]
        if cells.shape[1] == 4
        else [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 3, 4, 7], [1, 2, 5, 6]]
    )
    faces = np.sort(np.concatenate([cells[:, corner] for corner in local]), axis=1)
    unique, count = np.unique(faces, axis=0, return_counts=True)
    assert count.max() <= 2
    return {tuple(face) for face in unique[count == 1].tolist()}


def test_layers_are_graded_towards_the_interface():
    x, y, z = BlockShape(**{**SHAPE, "cells": (4, 6, 5), "grading": 8.0, **MARGIN}).ticks
    layers = np.diff(z)
    assert z[0] == -1.5 and z[-1] == 0.0
    assert layers[0] / layers[-1] == pytest.approx(8.0, rel=1e-12)
    np.testing.assert_allclose(layers[1:] / layers[:-1], 8.0**-0.25, rtol=1e-12)
    widths = np.diff(x)
    assert x[0] == -0.7 and x[-1] == pytest.approx(1.7, abs=1e-15) and len(x) == 4 + 2 * 2 + 1
    assert widths[0] / widths[1] == pytest.approx(3.0, rel=1e-12)
    np.testing.assert_allclose(widths, widths[::-1], rtol=1e-12)  # alike on both sides
    np.testing.assert_allclose(x[2:7], np.linspace(0.0, 1.0, 5), atol=1e-15)
    assert y[-1] == pytest.approx(2.7, abs=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"interface": (1.0, 0.0)}, "interface = .*must be 2 numbers; 0.0 must be greater"),
        ({"height": 0.0}, r"height = 0\.0: must be greater than 0"),
        ({"height": float("nan")}, "height = nan: must be a finite number"),
        ({"cells": (4, 4)}, r"cells = \(4, 4\): must be 3 whole numbers"),
        ({"cells": (4, 4, 0)}, "3 whole numbers; 0 must be greater than or equal to 1"),
        ({"element": "Q3"}, r"'Q3': this element is unknown \(allowed: Q1, Q2, P1, P2\)"),
        ({"grading": 0.5}, "^grading = 0.5: must be greater than or equal to 1"),
        ({"margin": -1.0}, "margin = -1.0: must be greater than or equal to 0"),
        ({"margin_cells": 0}, "margin_cells = 0: must be greater than or equal to 1"),
        ({"margin_grading": 0.0}, "margin_grading = 0.0: must be greater than or equal to 1"),
        (MARGIN | {"margin": 1e-7}, "margin is too narrow to be meshed .*0, or at least 0.001"),
        (MARGIN | {"margin_grading": 1e6}, "too narrow to be meshed .*a smaller margin_grading"),
        (MARGIN | {"margin_cells": 10**400}, "margin_cells = .*must be less than or equal"),
    ],
)
def test_blocks_that_make_no_sense_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        BlockShape(**{**SHAPE, **change})


@pytest.mark.parametrize(
    ("grid", "x", "y"),
    [
        ((4, 3), True, True),
        ((2, 6), True, True),
        ((3, 6), False, True),
        ((1, 4), True, False),
        ((8, 5), False, False),
    ],
)
def test_alignment_says_where_patches_cut_elements(grid, x, y):
    found = misalignment(BlockShape(**SHAPE), PatchGrid(grid=grid, lengths=(1.0, 2.0)))
    assert (found == "") is (x and y)
    assert (f"x ({grid[0]} patches on 4 cells)" in found) is not x
    assert (f"y ({grid[1]} patches on 6 cells)" in found) is not y


def test_alignment_of_a_single_patch():
    whole = PatchGrid(grid=(4, 4), lengths=(1.0, 2.0))
    shape = BlockShape(**SHAPE)
    assert "along y (" in misalignment(shape, whole.single(0))
    with pytest.raises(InputError, match="patches reach beyond the top of the block"):
        misalignment(shape, PatchGrid(grid=(1, 1), lengths=(1.1, 2.0)))
