"""Uniform refinement of meshes with tags: volumes, faces, shapes of cells."""

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.random_bodies import FACES, drawn, mesh_of
from patchlaw.macro import compat
from patchlaw.macro.mesh.from_file import check_cells, check_connected, refined
from patchlaw.macro.mesh.tagged import surface_area


def volumes(mesh):
    """Return the volume of every cell, of parallelepipeds exactly."""
    corners = mesh.mesh.geometry.x[compat.cell_vertices(mesh.mesh)]
    corners = corners if corners.shape[1] == 4 else corners[:, [0, 1, 2, 4]]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))


@pytest.mark.parametrize("seed", [5, 6, 7])  # hexahedra on feet, tetrahedra, two materials
def test_every_cell_becomes_eight_and_every_facet_four(seed):
    once = mesh_of(drawn(seed, coarser=1.3), MPI.COMM_SELF)
    twice = refined(once)
    check_cells(twice)
    check_connected(twice)
    assert refined(once, 0) is once
    before, after = volumes(once), volumes(twice)
    assert len(after) == 8 * len(before)
    for tag in np.unique(once.cell_tags.values):  # materials stay where they are
        parts = [found[mesh.cell_tags.values == tag].sum()
                 for found, mesh in ((before, once), (after, twice))]  # fmt: skip
        assert parts[1] == pytest.approx(parts[0], rel=1e-12)
    for name, tag in FACES.items():
        assert len(twice.facet_tags.find(tag)) == 4 * len(once.facet_tags.find(tag)), name
        if len(once.facet_tags.find(tag)) and name in ("support", "contact"):
            expected = surface_area(once, tag)
            assert surface_area(twice, tag) == pytest.approx(expected, rel=1e-12)
    assert twice.facet_names == once.facet_names and twice.cell_names == once.cell_names


def test_tetrahedra_stay_as_well_shaped_as_they_were():
    """Always the same diagonal: shapes repeat from the second refinement on (Bey 1995)."""
    mesh = mesh_of(drawn(0, coarser=2.5), MPI.COMM_SELF)

    def worst(mesh):
        corners = mesh.mesh.geometry.x[compat.cell_vertices(mesh.mesh)]
        longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
        return float((volumes(mesh) / longest**3).min())

    once, twice, thrice = (worst(refined(mesh, times)) for times in (1, 2, 3))
    assert 0.2 * worst(mesh) < once
    assert twice == pytest.approx(thrice, rel=1e-9)
