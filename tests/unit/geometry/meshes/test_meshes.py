import numpy as np
import pytest

from geometry import BlockShape, InputError, PatchGrid, alignment, flat_block

SHAPE = {"interface": (1.0, 2.0), "height": 1.5, "cells": (4, 6, 3)}
MARGIN = {"margin": 0.7, "margin_cells": 2, "margin_grading": 3.0}
NODES = {4: 4, 5: 8, 2: 3, 3: 4}  # gmsh's element types: tetrahedron, hexahedron, triangle, square


class Mesh:
    """The contents of a gmsh model as arrays with nodes counted from 0."""

    def __init__(self, model):
        tags, points, _ = model.mesh.getNodes()
        assert sorted(tags) == list(range(1, len(tags) + 1))  # dolfinx relies on it
        self.points = np.empty((len(tags), 3))
        self.points[np.asarray(tags) - 1] = np.reshape(points, (-1, 3))
        self.names = {
            (dim, tag): model.getPhysicalName(dim, tag) for dim, tag in model.getPhysicalGroups()
        }
        self.groups, self.owners = {}, {}
        for dim, tag in self.names:
            entities = model.getEntitiesForPhysicalGroup(dim, tag)
            kinds, parts, owners = set(), [], []
            for entity in entities:
                types, elements, nodes = model.mesh.getElements(dim, entity)
                kinds.update(types)
                parts += [np.reshape(n, (-1, NODES[t])) for t, n in zip(types, nodes, strict=True)]
                owners += [number for numbers in elements for number in numbers]
            assert len(kinds) == 1
            self.groups[dim, tag] = np.concatenate(parts).astype(int) - 1
            self.owners[dim, tag] = owners


def mesh_of(**change):
    shape = BlockShape(**{**SHAPE, **change})
    with flat_block(shape) as model:
        return shape, Mesh(model)


def volumes(points, cells):
    """Return signed volumes of tetrahedra, or of hexahedra with plane faces."""
    p = points[cells]
    if cells.shape[1] == 4:
        return np.linalg.det(p[:, 1:] - p[:, :1]) / 6.0
    return np.linalg.det(p[:, [1, 3, 4]] - p[:, :1])


def areas(points, faces):
    p = points[faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return area if faces.shape[1] == 4 else 0.5 * area


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
    shape, mesh = mesh_of(**change)
    cells = mesh.groups[3, 1]
    assert len(cells) == shape.cell_count
    assert len(set(mesh.owners[3, 1])) == len(cells)  # each cell in the group once
    assert cells.shape[1] == (8 if shape.hexahedral else 4)
    assert len(mesh.points) == np.prod([len(ticks) for ticks in shape.ticks])
    size = np.prod([ticks[-1] - ticks[0] for ticks in shape.ticks])
    # gmsh places graded lines to 1e-8
    assert volumes(mesh.points, cells).min() > 0.0
    assert volumes(mesh.points, cells).sum() == pytest.approx(size, rel=1e-7)


@pytest.mark.parametrize("change", CASES)
def test_nodes_lie_on_the_grid_planes(change):
    shape, mesh = mesh_of(**change)
    for axis, ticks in enumerate(shape.ticks):
        nearest = np.abs(mesh.points[:, axis, None] - ticks)
        # gmsh integrates the grading numerically: 1e-8 of the block, exact enough for borders
        assert nearest.min(axis=1).max() < 2e-8
        assert nearest.min(axis=0).max() < 2e-8
    flat = np.isclose(mesh.points[:, 2], 0.0, atol=1e-3)
    assert np.all(mesh.points[flat, 2] == 0.0)


@pytest.mark.parametrize("change", CASES)
def test_named_faces_are_faces_of_cells(change):
    shape, mesh = mesh_of(**change)
    assert mesh.names == {(3, 1): "block", (2, 1): "bottom", (2, 2): "top", (2, 3): "sides"}
    x, y, z = shape.ticks
    wide, deep = x[-1] - x[0], y[-1] - y[0]
    around = 2.0 * (wide + deep) * shape.height
    expected = {1: wide * deep, 2: wide * deep, 3: around}
    for tag, area in expected.items():
        assert areas(mesh.points, mesh.groups[2, tag]).sum() == pytest.approx(area, rel=1e-7)
    # outer planes are exact to the rounding of gmsh's transfinite interpolation, the top exact
    np.testing.assert_allclose(mesh.points[mesh.groups[2, 1], 2], z[0], rtol=1e-14)
    assert np.all(mesh.points[mesh.groups[2, 2], 2] == 0.0)
    sides = mesh.points[mesh.groups[2, 3]]
    planes = [(0, x[0]), (0, x[-1]), (1, y[0]), (1, y[-1])]
    on_plane = [np.all(np.abs(sides[..., k] - at) < 1e-14, axis=1) for k, at in planes]
    assert np.all(np.sum(on_plane, axis=0) == 1)
    assert boundary(mesh.groups[3, 1]) == {
        tuple(sorted(face)) for tag in expected for face in mesh.groups[2, tag].tolist()
    }


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


def test_interface_nodes_are_even_to_rounding():
    _, mesh = mesh_of(cells=(40, 40, 2))
    top = mesh.points[np.unique(mesh.groups[2, 2])]
    even = np.round(top[:, :2] * (40, 20)) / (40, 20)
    # gmsh's own accuracy on even lines; patch borders are compared with 1e-6 of a cell
    assert np.abs(top[:, :2] - even).max() < 1e-11


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"interface": (1.0, 0.0)}, "lengths of the interface do not fit"),
        ({"height": 0.0}, r"0\.0: the block's height is out of range \(allowed: height > 0\)"),
        ({"height": float("nan")}, "the block's height"),
        ({"cells": (4, 4)}, r"\(4, 4\): the block does not fit \(allowed: 3 whole numbers"),
        ({"cells": (4, 4, 0)}, "each at least 1"),
        ({"element": "Q3"}, r"'Q3': this element is unknown \(allowed: Q1, Q2, P1, P2\)"),
        ({"grading": 0.5}, "grading is out of range.*grading ≥ 1"),
        ({"margin": -1.0}, "margin is out of range"),
        ({"margin": 1.0}, r"\(1\.0, 0\): the block's margin and its cells"),
        ({"margin_cells": 3}, "margin > 0 with margin_cells ≥ 1, or both 0"),
        ({"margin_grading": 0.0}, "margin grading is out of range"),
        (
            MARGIN | {"margin": 1e-7},
            "margin is too narrow to be meshed .*0, or at least 0.001",
        ),
        (MARGIN | {"margin_grading": 1e6}, "too narrow to be meshed .*a smaller margin_grading"),
        (MARGIN | {"margin_cells": 10**400}, "margin has cells of .* fewer margin_cells"),
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
    found = alignment(BlockShape(**SHAPE), PatchGrid(grid=grid, lengths=(1.0, 2.0)))
    assert (found.x, found.y, bool(found)) == (x, y, x and y)
    assert (f"x ({grid[0]} patches on 4 cells)" in found.sentence) is not x
    assert (f"y ({grid[1]} patches on 6 cells)" in found.sentence) is not y


def test_alignment_of_a_single_patch():
    whole = PatchGrid(grid=(4, 4), lengths=(1.0, 2.0))
    shape = BlockShape(**SHAPE)
    assert alignment(shape, whole.single(0)).x and not alignment(shape, whole.single(0)).y
    with pytest.raises(InputError, match="patches reach beyond the interface along x"):
        alignment(shape, PatchGrid(grid=(1, 1), lengths=(1.1, 2.0)))
