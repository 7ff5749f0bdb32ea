"""Faces of a body's mesh: their tags by name and number, their planes and measures."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from helpers.mesh_files import SIDES, tagged_box
from mpi4py import MPI

from patchlaw.macro import TaggedMesh, planar_face
from patchlaw.support import InputError

COMM = MPI.COMM_SELF
LENGTHS = (2.0, 3.0, 0.5)


def with_tags(tagged, where):
    """Return the mesh with all facets tagged 1 at whose middles a condition holds."""
    mesh = tagged.mesh
    mesh.topology.create_connectivity(2, 0)
    mesh.topology.create_entities(2)
    facets = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    found = facets[where(dmesh.compute_midpoints(mesh, 2, facets).T)]
    tags = dmesh.meshtags(mesh, 2, found, np.ones(len(found), np.int32))
    return TaggedMesh(mesh=mesh, facet_tags=tags)


@pytest.mark.parametrize("kind", ["tetrahedron", "hexahedron"])
@pytest.mark.parametrize("side", SIDES)
def test_faces_of_a_box(kind, side):
    box = tagged_box(COMM, lengths=LENGTHS, kind=kind)
    face = planar_face(box, SIDES[side])
    axis, end = divmod(SIDES[side] - 1, 2)
    assert face.frame.normal.tolist() == ((2 * end - 1) * np.eye(3)[axis]).tolist()
    sides = [LENGTHS[k] for k in range(3) if k != axis]
    assert sorted(face.lengths) == sides if sides[0] < sides[1] else sides[::-1]
    assert face.area == pytest.approx(np.prod(sides), rel=1e-13)  # sums of products
    assert face.deviation == 0.0
    corners = face.frame.in_plane(
        box.mesh.geometry.x[box.mesh.geometry.x[:, axis] == end * LENGTHS[axis]]
    )
    assert corners.min(axis=0).tolist() == [0.0, 0.0]
    assert corners.max(axis=0).tolist() == list(face.lengths)


def test_turned_and_shifted_faces_have_the_same_measures():
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    box = tagged_box(COMM, lengths=LENGTHS)
    box.mesh.geometry.x[:] = box.mesh.geometry.x @ turn.T + [30.0, -20.0, 10.0]
    face = planar_face(box, SIDES["above"])
    np.testing.assert_allclose(face.frame.normal, turn[:, 2], atol=1e-14)  # round-off near 30
    assert face.area == pytest.approx(6.0, rel=1e-13)
    assert face.deviation < 1e-13


def test_a_face_may_be_in_pieces_of_any_outline():
    box = tagged_box(COMM, cells=(10, 10, 2), kind="hexahedron")
    pads = with_tags(box, lambda x: (x[2] > 1 - 1e-9) & (np.abs(x[0] - 0.5) > 0.16))
    face = planar_face(pads, 1)
    assert face.area == pytest.approx(0.6, rel=1e-12)
    assert face.lengths == (1.0, 1.0)


def crowned(height):
    box = tagged_box(COMM, cells=(8, 8, 2), kind="hexahedron")
    x = box.mesh.geometry.x
    x[:, 2] *= 1.0 - 4.0 * height * (x[:, 0] - 0.5) ** 2
    return box


def test_curved_faces_are_refused_with_their_deviation():
    match = (
        r"body\.contact: the surface 'pad' is not planar: its nodes are up to 0\.01 mm off the "
        r"plane through it, and its facets up to 4° from it \(allowed: a planar face\)"
    )
    with pytest.raises(InputError, match=match):
        planar_face(crowned(0.02), SIDES["above"], name="pad", key="body.contact")


def test_slightly_curved_faces_are_taken_on_request():
    face = planar_face(crowned(0.02), SIDES["above"], deviation=0.0101)
    assert face.deviation == pytest.approx(0.01, rel=1e-12)
    assert face.frame.origin[2] == 1.0  # the plane goes through the crown
    with pytest.raises(InputError, match=r"allowed: at most 0\.009 mm"):
        planar_face(crowned(0.02), SIDES["above"], deviation=0.009)


def test_rounding_of_coordinates_is_no_curvature():
    box = tagged_box(COMM, lengths=(100.0, 100.0, 10.0))
    box.mesh.geometry.x[:] = box.mesh.geometry.x.astype(np.float32)
    box.mesh.geometry.x[:, 2] += 1e-5 * np.sin(np.arange(len(box.mesh.geometry.x)))
    assert planar_face(box, SIDES["above"]).deviation < 1.1e-5


@pytest.mark.parametrize(
    ("where", "match"),
    [
        (lambda x: np.abs(x[2] - 0.5) > 0.49, "facets face different ways and close around"),
        (
            lambda x: (x[2] > 0.99) | (x[0] > 0.99),
            r"nodes are up to 0\.3536 mm off .* facets up to 45° from it",
        ),
        (lambda x: np.abs(x[2] - 0.5) < 1e-9, "has 18 of 18 facets inside the body"),
        (lambda x: x[2] > 2.0, "the surface '1' has no facets that belong to cells"),
    ],
    ids=["two faces", "an edge", "inside", "none"],
)
def test_other_faces_are_refused(where, match):
    box = tagged_box(COMM, cells=(3, 3, 2))
    with pytest.raises(InputError, match=match):
        planar_face(with_tags(box, where), 1)


@pytest.fixture(scope="module")
def tagged():
    box = tagged_box(MPI.COMM_SELF)
    names = {"pad face": 5, "back": 6, "7": 7}
    return TaggedMesh(
        mesh=box.mesh, facet_tags=box.facet_tags, facet_names=names, cell_names={"lining": 2}
    )


@pytest.mark.parametrize(("wanted", "tag"), [("pad face", 5), ("7", 7), (6, 6), ("6", 6)])
def test_names_and_numbers_are_found(tagged, wanted, tag):
    assert tagged.facet_tag(wanted) == tag


def test_other_names_are_refused_with_the_nearest(tagged):
    expected = (
        "body.contact = 'Pad_face': the mesh has no surface of this name; did you mean 'pad face'?"
        " (allowed: 'pad face', 'back', 7)"
    )
    with pytest.raises(InputError) as raised:
        tagged.facet_tag("Pad_face", key="body.contact")
    assert str(raised.value) == expected
    with pytest.raises(InputError, match=r"8: the mesh has no surface of this name \(allowed"):
        tagged.facet_tag(8)
    with pytest.raises(InputError, match=r"the mesh has no volume of this name \(allowed: 'lini"):
        tagged.cell_tag("steel")


def test_many_names_are_shortened(tagged):
    many = TaggedMesh(
        mesh=tagged.mesh,
        facet_tags=tagged.facet_tags,
        facet_names={f"face {k}": k for k in range(30)},
    )
    with pytest.raises(InputError, match=r"'face 11' and 18 more\)"):
        many.facet_tag("bore")


def test_without_names_any_number_is_taken(tagged):
    bare = TaggedMesh(mesh=tagged.mesh, facet_tags=tagged.facet_tags)
    assert bare.facet_tag(3) == 3
    with pytest.raises(InputError, match=r"the mesh has no named surfaces \(allowed: a number\)"):
        bare.facet_tag("top")


def test_box_around_the_nodes():
    box = tagged_box(MPI.COMM_SELF, lengths=(2.0, 3.0, 0.5))
    lower, upper = box.bounding_box()
    assert lower.tolist() == [0.0, 0.0, 0.0] and upper.tolist() == [2.0, 3.0, 0.5]
    assert box.comm.size == 1
