"""Tags of surfaces and volumes by name and number."""

import pytest
from helpers.mesh_files import tagged_box
from mpi4py import MPI

from patchlaw.macro import TaggedMesh
from patchlaw.support import InputError


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
