"""Compliance of a rectangle on a meshed body's face, against the block's by spectral elements."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

from patchlaw import InputError
from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.geometry.face_frame import UPWARD, FaceFrame
from patchlaw.macro import (
    BOTTOM,
    SIDES,
    TOP,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    block_mesh,
    contact_facets,
    face_compliance,
    face_tractions,
)
from patchlaw.macro.compliance.mesh_face import (
    from_outside,
    mesh_face_compliance,
    mesh_face_tractions,
    turned,
)
from patchlaw.macro.compliance.surroundings import FaceMoments, surroundings
from patchlaw.micro import RectangleFields

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.2)
COMM = MPI.COMM_SELF
SQUARE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
HELD = (Support(tag=BOTTOM),)


def meshed(cells=4, *, element="Q1", height=1.0, materials=MATERIAL, supports=HELD, turn=None):
    """Return a cube on a mesh, turned where wished, and its top."""
    shape = BlockShape(
        interface=(1.0, 1.0), height=height, cells=(cells, cells, cells), element=element
    )
    mesh = block_mesh(shape, COMM)
    frame = UPWARD
    cell_tags = None
    if isinstance(materials, dict):  # by height
        number = mesh.mesh.topology.index_map(3).size_local
        middle = dmesh.compute_midpoints(mesh.mesh, 3, np.arange(number, dtype=np.int32))
        values = np.where(middle[:, 2] < -0.5 * height, 2, 1).astype(np.int32)
        cell_tags = dmesh.meshtags(mesh.mesh, 3, np.arange(number, dtype=np.int32), values)
    if turn is not None:
        mesh.mesh.geometry.x[:] = mesh.mesh.geometry.x @ turn + [3.0, -2.0, 5.0]
        frame = FaceFrame(origin=np.array([3.0, -2.0, 5.0]), axes=turn)
    tagged = TaggedMesh(mesh=mesh.mesh, facet_tags=mesh.facet_tags, cell_tags=cell_tags)
    body = MeshedBody(tagged, materials, supports)
    return body, contact_facets(mesh.mesh, mesh.facet_tags.find(TOP), frame)


def solved(body, facets, count, rectangle=SQUARE, *, whole=False):
    """Return the compliance by the half-space and a correction, or of the mesh as a whole."""
    around = surroundings(body, facets, rectangle)
    fields = RectangleFields(
        lengths=rectangle.lengths, count=count, material=around.material, extended=around.free_sides
    )
    loads = None if whole else fields
    moments = FaceMoments(replace(body, order=2), facets, rectangle, count)
    return mesh_face_compliance(moments, around.material, loads)


@pytest.fixture(scope="module")
def cube():
    return meshed()


@pytest.fixture(scope="module")
def of_cube(cube):
    return solved(*cube, 3)


def apart(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.mark.long
@pytest.mark.parametrize("way", ["correction", "whole"])
def test_a_cube_is_the_block(cube, of_cube, way):
    found = of_cube if way == "correction" else solved(*cube, 3, whole=True)
    exact = face_compliance((1.0, 1.0), 1.0, MATERIAL, "free", 3, COMM)
    # four quadratic elements a side; the third mode is 1.3 waves
    assert found.normal[0, 0] == pytest.approx(exact.normal[0, 0], rel=1e-3)
    assert apart(found.normal, exact.normal) < (2e-3 if way == "correction" else 1e-2)
    assert apart(found.growth, exact.growth) < 0.4  # its finest modes
    assert apart(found.stresses, exact.stresses) < 0.1
    assert found.count == 3


def tractions(body, facets, count, *, whole=False):
    """Return displacements by tractions, by half-spaces and a correction or of the mesh alone."""
    around = surroundings(body, facets, SQUARE)
    fields = [
        RectangleFields(
            lengths=SQUARE.lengths,
            count=count,
            material=around.material,
            extended=around.free_sides,
            axis=axis,
        )
        for axis in range(2)
    ]
    loads = None if whole else fields
    return mesh_face_tractions(FaceMoments(replace(body, order=2), facets, SQUARE, count), loads)


@pytest.mark.long
@pytest.mark.parametrize("way", ["correction", "whole"])
def test_tractions_displace_a_cube_as_they_do_the_block(cube, way):
    found = tractions(*cube, 3, whole=way == "whole")
    exact = face_tractions((1.0, 1.0), 1.0, MATERIAL, "free", 3, COMM)
    # the edge of the clamped bottom is singular: eight elements a side leave 9e-4 and 1e-3
    assert apart(found, exact) < (4e-3 if way == "correction" else 6e-3)


@pytest.mark.long
def test_tractions_on_two_materials_by_either_way():
    soft = replace(MATERIAL, young_modulus=1500.0)
    case = meshed(materials={1: MATERIAL, 2: soft})
    found, direct = tractions(*case, 2), tractions(*case, 2, whole=True)
    assert apart(found, direct) < 2e-3  # what four quadratic elements a side leave of two modes
    alone = tractions(*meshed(), 2, whole=True)
    assert apart(alone, direct) > 0.2  # the second material counts


def test_a_turned_cube_is_the_cube(of_cube):
    axis, angle = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0), 0.8
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    found = solved(*meshed(turn=turn), 3)
    # rounding of coordinates, on points beside logarithms
    assert apart(found.normal, of_cube.normal) < 1e-7
    assert apart(found.stresses, of_cube.stresses) < 1e-6


def test_seen_from_the_other_side(cube, of_cube):
    """A counter-body's face in a frame of its own, and turned back."""
    body, facets = cube
    behind = replace(UPWARD, axes=np.diag([-1.0, 1.0, -1.0]), origin=np.array([1.0, 0.0, 0.0]))
    opposed = contact_facets(body.mesh.mesh, body.mesh.facet_tags.find(TOP), behind, opposed=True)
    own = from_outside(opposed, 1.0)
    np.testing.assert_allclose(own.frame.axes, facets.frame.axes, atol=1e-15)
    np.testing.assert_allclose(own.corners, facets.corners, atol=1e-15)
    again = turned(turned(of_cube))
    np.testing.assert_array_equal(again.normal, of_cube.normal)
    # a cube is alike from both sides
    assert apart(turned(of_cube).normal, of_cube.normal) < 1e-6
    assert apart(turned(of_cube).stresses, of_cube.stresses) < 1e-5


RECTANGLES = {
    "whole": ((0.0, 0.0), (1.0, 1.0), (True, True, True, True)),
    "corner": ((0.0, 0.5), (0.5, 0.5), (True, False, False, True)),
    "cells cut": ((0.55, 0.2), (0.45, 0.3), (False, True, False, False)),
    "inside": ((0.1, 0.2), (0.5, 0.5), (False, False, False, False)),
}


@pytest.mark.parametrize("name", RECTANGLES)
def test_free_sides_are_found(cube, name):
    origin, lengths, expected = RECTANGLES[name]
    around = surroundings(*cube, PatchGrid(grid=(2, 2), lengths=lengths, origin=origin))
    assert around.free_sides == expected
    assert around.below
    assert around.thickness == pytest.approx(1.0, rel=1e-12)
    assert around.material.young_modulus == pytest.approx(MATERIAL.young_modulus, rel=1e-12)
    assert around.material.poisson_ratio == pytest.approx(MATERIAL.poisson_ratio, rel=1e-12)


def test_supported_sides_are_not_free():
    held = (*HELD, Support(tag=SIDES, displacement=(0.0, 0.0, None)))
    body, facets = meshed(supports=held)
    assert surroundings(body, facets, SQUARE).free_sides == (False,) * 4


def test_a_body_above_its_face_is_noticed(cube):
    body, _ = cube
    bottom = FaceFrame(origin=np.array([0.0, 0.0, -0.5]), axes=np.eye(3))
    facets = contact_facets(body.mesh.mesh, body.mesh.facet_tags.find(TOP), UPWARD)
    lower = replace(facets, frame=bottom)
    assert surroundings(body, lower, SQUARE).above == pytest.approx(0.5)
    assert not surroundings(body, lower, SQUARE).below


@pytest.mark.long
def test_volumes_of_one_material_are_one(of_cube):
    body, facets = meshed(materials={1: MATERIAL, 2: MATERIAL})
    assert apart(solved(body, facets, 3).normal, of_cube.normal) < 1e-9


@pytest.mark.long
def test_a_stiffer_lower_half_stiffens_both_ways_alike(of_cube):
    stiff = Material(young_modulus=40000.0, poisson_ratio=0.3)
    body, facets = meshed(materials={1: MATERIAL, 2: stiff})
    found, whole = solved(body, facets, 2), solved(body, facets, 2, whole=True)
    assert found.normal[0, 0] < 0.7 * of_cube.normal[0, 0]
    assert apart(found.normal, whole.normal) < 5e-3  # the mesh, as on the cube


def test_a_rectangle_beyond_the_face_is_refused(cube):
    beyond = PatchGrid(grid=(1, 1), lengths=(0.6, 0.6), origin=(0.5, 0.0))
    with pytest.raises(
        InputError, match=r"0.3 of 0.36 mm² on the face.*reaches beyond the contact face"
    ):
        surroundings(*cube, beyond)
