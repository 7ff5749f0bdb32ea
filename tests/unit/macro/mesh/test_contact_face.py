"""Quadrature on the top, cut along the borders of patches."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import block_mesh, compat
from patchlaw.macro.mesh.contact_face import Opposite, facet_quadrature, top_facets
from patchlaw.macro.mesh.facet_parts import _near, cut_triangles, triangle_areas


def points_on(patches, degree=2, **changes):
    shape = {"interface": (2.0, 1.0), "height": 0.4, "cells": (4, 3, 1)} | changes
    mesh = block_mesh(BlockShape(**shape), MPI.COMM_SELF)
    space = compat.vector_space(mesh.mesh, mesh.shape.degree)
    return facet_quadrature(top_facets(mesh), space, patches, degree=degree), space


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
@pytest.mark.parametrize("grid", [(2, 3), (5, 2), (7, 7), (1, 1)])
def test_polynomials_are_integrated_exactly_over_every_patch(element, grid):
    patches = PatchGrid(grid=grid, lengths=(2.0, 1.0))
    points, _ = points_on(patches, element=element, margin=0.5, margin_cells=2)
    values = points.weight * points.x * (1.0 + points.y)
    sums = np.bincount(points.patch, weights=values, minlength=patches.count)
    (x0, x1), (y0, y1) = np.transpose([patches.bounds(i) for i in range(patches.count)], (1, 2, 0))
    exact = 0.5 * (x1**2 - x0**2) * ((y1 - y0) + 0.5 * (y1**2 - y0**2))
    np.testing.assert_allclose(sums, exact, rtol=1e-10)  # gmsh places nodes to 1e-11
    assert (np.diff(points.patch) >= 0).all()


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_basis_interpolates_positions(element):
    points, space = points_on(PatchGrid(grid=(3, 2), lengths=(2.0, 1.0)), element=element)
    places = space.tabulate_dof_coordinates()[points.nodes]
    found = np.einsum("nk,nkj->nj", points.values, places)
    expected = np.column_stack([points.x, points.y, np.zeros_like(points.x)])
    np.testing.assert_allclose(found, expected, atol=1e-12)  # round-off


def test_patches_may_cover_a_part():
    patches = PatchGrid(grid=(1, 2), lengths=(0.7, 0.3), origin=(0.9, 0.2))
    points, _ = points_on(patches)
    areas = np.bincount(points.patch, weights=points.weight)
    np.testing.assert_allclose(areas, patches.area, rtol=1e-10)  # as above
    assert points.x.min() > 0.9
    assert points.y.max() < 0.5


@pytest.mark.parametrize("border", [-1.0, 0.0, 0.3, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_cutting_keeps_the_area_and_separates_the_sides(border, axis):
    random = np.random.default_rng(2)
    triangles = np.concatenate(
        [random.uniform(0.0, 1.0, (200, 3, 2)), [[[0, 0], [1, 1], [0.5, 0.5 + 0.25]]]]
    )
    facet = np.arange(201)
    pieces, owner = cut_triangles(triangles, facet, triangles[..., axis] - border, 1e-12)
    areas = np.bincount(owner, weights=triangle_areas(pieces))
    np.testing.assert_allclose(areas, triangle_areas(triangles), rtol=1e-9, atol=1e-15)  # round-off
    height = pieces[:, :, axis] - border
    assert ((height > -1e-12).all(axis=1) | (height < 1e-12).all(axis=1)).all()
    turned, _ = cut_triangles(
        triangles[:, ::-1], facet, triangles[:, ::-1, axis] - border, 1e-12
    )  # cells inside out: the same pieces
    middles = (np.sort(one.mean(axis=1) @ (1.0, np.pi)) for one in (pieces, turned))
    np.testing.assert_allclose(*middles, rtol=1e-12)


def grid_triangles(nodes):
    """Return the two triangles of every cell of a grid with such nodes on both axes."""
    at = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    return np.concatenate([np.stack(one, 2).reshape(-1, 3, 2) for one in ((a, b, c), (a, c, d))])


def test_points_on_pieces_integrate_what_jumps_between_the_facets_opposite():
    """Or lie where they did, where several facets lie opposite; and nowhere, where none does."""
    mesh = block_mesh(
        BlockShape(interface=(1.0, 1.0), height=0.4, cells=(4, 3, 1), element="P1"), MPI.COMM_SELF
    )
    facets, space = top_facets(mesh), compat.vector_space(mesh.mesh, 1)
    alone, whole = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)), grid_triangles([0.0, 0.37, 1.0])

    def points(corners):
        counter = None if corners is None else Opposite(corners, 1)
        return facet_quadrature(facets, space, alone, degree=2, counter=counter)

    found, area = points(whole), 0.37**2 / 2
    inside = (found.x < 0.37) & (found.y < found.x)  # the first of them
    assert found.weight[inside].sum() == pytest.approx(area, rel=1e-9)
    assert found.weight.sum() == pytest.approx(1.0, rel=1e-9)
    old = points(None)
    assert abs(old.weight[(old.x < 0.37) & (old.y < old.x)].sum() / area - 1.0) > 0.01
    np.testing.assert_array_equal(points(np.concatenate((whole, whole))).x, old.x)
    for others in (whole + 5.0, whole[:0]):
        assert not len(points(others).x)
    part = points(0.7 * whole + 0.11)
    assert part.weight.sum() == pytest.approx(0.49, rel=1e-9)
    assert min(part.x.min(), part.y.min()) > 0.11


def test_facets_of_all_sizes_are_paired_with_few():
    """Cells from 2 µm to 1.6 mm: circles as large as the largest facets paired 4 million."""
    first, second = (grid_triangles(np.append(0.0, np.geomspace(0.01, 10.0, n))) for n in (40, 37))
    one, other, _ = _near(first, second)
    assert len(one) < 100 * len(first)
    middles, around = first.mean(axis=1), second.mean(axis=1)
    pairs = set(zip(one.tolist(), other.tolist(), strict=True))
    for k in range(0, len(first), 97):  # none is missed whose boxes overlap
        low, high = first[k].min(axis=0), first[k].max(axis=0)
        meets = ((second.min(axis=1) < high) & (second.max(axis=1) > low)).all(axis=1)
        radii = [
            np.linalg.norm(t - t.mean(axis=-2, keepdims=True), axis=-1).max(axis=-1)
            for t in (first[k], second)
        ]
        meets &= np.linalg.norm(around - middles[k], axis=1) < sum(radii)
        assert {(k, m) for m in np.flatnonzero(meets).tolist()} <= pairs
