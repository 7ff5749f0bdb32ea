"""A body from a mesh with its roughness meshed: the same wherever its face looks."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.body_meshes import HIGH, LOW, box

from patchlaw import InputError
from patchlaw.geometry import Control, Material, RefinedShape, Spectrum, synthesise
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import MeshedBody, Support, TaggedMesh, UnilateralContactProblem, planar_face
from patchlaw.macro.contact.rough_face import FlatBody

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(1, 3), rms_slope=0.1, seed=2), grid=(32, 32), lengths=(1.0, 1.0)
)
SHAPE = RefinedShape(
    interface=(1.0, 1.0),
    height=1.0,
    places=np.array([SURFACE.highest_point]),
    fine=0.03,
    coarse=0.4,
    growth=0.8,
    element="P2",
)
SLIDING = (None, None, 0.0)


UPRIGHT = np.eye(3)


def flat(turn=UPRIGHT, cell="tetrahedron", supports=None, lower=(0.0, 0.0, -1.0), contact=HIGH):
    """Return a box on its lower face, turned about the origin."""
    mesh = box(lower, (1.0, 1.0, 0.0), (3, 3, 3), cell)
    mesh.mesh.geometry.x[:] = mesh.mesh.geometry.x @ np.transpose(turn)
    body = MeshedBody(mesh, MATERIAL, supports or [Support(tag=LOW)])
    frame = FaceFrame(origin=np.zeros(3), axes=np.transpose(turn))
    return FlatBody(body=body, contact=contact, frame=frame, lengths=SURFACE.lengths)


def pressed(body):
    face, quality = body.rough(SHAPE, SURFACE)
    assert quality.thinnest > 0.3
    problem = UnilateralContactProblem(face, SURFACE.highest - SURFACE.mean_height)
    return problem.solve(Control(approach=4e-3)), problem


@pytest.fixture(scope="module")
def upright():
    return pressed(flat())


def test_plane_bears_what_the_support_does(upright):
    state, problem = upright
    assert state.force > 0.1
    assert state.reaction == pytest.approx(state.force, rel=1e-8)
    assert problem.top.area.sum() == pytest.approx(1.0, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("angle", [0.5 * np.pi, 0.3])
def test_a_body_may_look_anywhere(upright, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    state, _ = pressed(flat(turn))
    assert state.nodes == upright[0].nodes
    assert state.force == pytest.approx(upright[0].force, rel=1e-6)  # rounding of coordinates


def test_hexahedra_are_divided():
    state, problem = pressed(flat(cell="hexahedron"))
    assert not problem.body.hexahedral
    assert state.force > 0.1
    assert problem.top.area.sum() == pytest.approx(1.0, rel=1e-9)


def test_supports_turn_with_the_face():
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # looks along x
    stated = Support(tag=LOW, displacement=(0.1, None, 0.0))
    (turned,) = flat(turn, supports=[stated]).supports
    assert turned.displacement == (None, 0.0, 0.1)
    c, s = np.cos(0.3), np.sin(0.3)
    oblique = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    with pytest.raises(InputError, match="free component does not go with a meshed roughness"):
        _ = flat(oblique, supports=[Support(tag=LOW, displacement=SLIDING)]).supports
    along = Support(tag=LOW, displacement=(None, 0.0, 0.1))  # free along the axis of the turn
    assert flat(oblique, supports=[along]).supports[0].displacement == pytest.approx(
        (None, 0.1 * s, 0.1 * c)
    )


def test_depth_is_that_of_the_bottom():
    assert flat().depth == pytest.approx(1.0)
    assert flat(lower=(0.0, 0.0, -0.4)).depth == pytest.approx(0.4)
    assert flat(lower=(0.0, 0.0, -7.0)).depth == pytest.approx(1.0)  # the longer side at most


def test_tags_of_the_mesh_stay(upright):
    _, problem = upright
    tags = problem.body.mesh.facet_tags
    assert planar_face(problem.body.mesh, LOW).area == pytest.approx(1.0, rel=1e-12)
    assert len(tags.find(HIGH)) == 0  # the whole face is rough


def test_volumes_keep_their_materials():
    body = flat()
    mesh = body.body.mesh.mesh
    from dolfinx import mesh as dmesh

    count = mesh.topology.index_map(3).size_local
    where = dmesh.compute_midpoints(mesh, 3, np.arange(count, dtype=np.int32))[:, 2] > -0.5
    tags = dmesh.meshtags(mesh, 3, np.arange(count, dtype=np.int32), where.astype(np.int32) + 1)
    tagged = TaggedMesh(mesh=mesh, facet_tags=body.body.mesh.facet_tags, cell_tags=tags)
    softer = replace(MATERIAL, young_modulus=400.0)
    two = replace(body.body, mesh=tagged, materials={1: MATERIAL, 2: softer})
    face, _ = replace(body, body=two).rough(SHAPE, SURFACE)
    assert face.modulus == pytest.approx(softer.contact_modulus)
