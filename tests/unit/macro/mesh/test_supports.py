"""Rigid motions that supports leave free."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers.mesh_files import SIDES, tagged_box
from mpi4py import MPI
from scipy.sparse import csr_array

from patchlaw.macro import Traction, check_loads, check_supports, compat
from patchlaw.macro.mesh.supports import free_motions
from patchlaw.support import InputError

COMM = MPI.COMM_SELF
LENGTHS = (2.0, 3.0, 0.5)
ALL = ["translation along x", "translation along y", "translation along z"]
ALL += ["rotation about x", "rotation about y", "rotation about z"]


def held(**sides):
    """Return supports: the letters of the axes that each side is held along."""
    return [
        SimpleNamespace(
            tag=SIDES[side], displacement=tuple(0.0 if axis in axes else None for axis in "xyz")
        )
        for side, axes in sides.items()
    ]


@pytest.mark.parametrize(
    ("sides", "left"),
    [
        ({}, ALL),
        ({"below": "xyz"}, []),
        ({"left": "x", "front": "y", "below": "z"}, []),
        ({"below": "z"}, [*ALL[:2], ALL[5]]),
        ({"below": "z", "left": "x"}, [ALL[1]]),
        ({"below": "xy"}, ALL[2:5]),  # it may rise, and tilt about lines in the plane below
        ({"left": "yz"}, [ALL[0], *ALL[4:]]),
        ({"left": "yz", "front": "x"}, ["rotation about the line along z through (0, 0, 0.25) mm"]),
        (
            {"right": "yz", "behind": "x"},
            ["rotation about the line along z through (2, 3, 0.25) mm"],
        ),
    ],
)
@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e5])
def test_motions_left(sides, left, scale):
    box = tagged_box(COMM, lengths=tuple(scale * length for length in LENGTHS))
    found = free_motions(box, held(**sides))
    if scale == 1.0:
        assert found == left
    assert len(found) == len(left)


def test_rotation_about_a_slanted_line():
    box = tagged_box(COMM)
    turn = np.array([[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    box.mesh.geometry.x[:] = box.mesh.geometry.x @ turn.T
    # a motion keeps x and z of a plane upright on (1, 1, 0): along y alone
    assert free_motions(box, held(left="xz")) == ["translation along y"]
    # rollers along z under it: it slides, and turns about z
    assert free_motions(box, held(below="z")) == [*ALL[:2], ALL[5]]


def test_stiffness_agrees():
    """The motions left are as many as the singular directions of the stiffness."""
    from patchlaw.geometry import Material
    from patchlaw.macro.elastic_body import stiffness_form

    box = tagged_box(COMM, cells=(2, 2, 1))
    space = compat.vector_space(box.mesh, 1)
    form = stiffness_form(space, Material(young_modulus=1.0, poisson_ratio=0.3).lame, 0)
    whole = compat.assemble_matrix(compat.compile_form(form), [])
    whole = csr_array(whole.getValuesCSR()[::-1]).toarray()
    x = space.tabulate_dof_coordinates()
    at = {side: np.isclose(x[:, (tag - 1) // 2], (tag - 1) % 2) for side, tag in SIDES.items()}
    letters = ("", "x", "y", "z", "xy", "xz", "yz", "xyz")
    random = np.random.default_rng(4)
    for _ in range(25):
        chosen = random.choice(list(SIDES), 2, replace=False)
        sides = {side: letters[random.integers(8)] for side in chosen}
        free = np.ones((len(x), 3), bool)
        for side, axes in sides.items():
            for axis in axes:
                free[at[side], "xyz".index(axis)] = False
        part = whole[np.ix_(free.ravel(), free.ravel())]
        singular = np.linalg.eigvalsh(part) < 1e-10  # the others are above 1e-3
        assert len(free_motions(box, held(**sides))) == singular.sum(), sides


def test_supports_are_checked():
    box = tagged_box(COMM)
    check_supports(box, held(below="xyz"), SIDES["above"])
    match = r"^the supports leave the body free to move: translation along x \(allowed"
    with pytest.raises(InputError, match=match):
        check_supports(box, held(below="yz", left="z"), SIDES["above"])
    with pytest.raises(InputError, match="the surface 'below' is the contact face and cannot be"):
        check_supports(box, held(below="xyz"), SIDES["below"])
    twice = [*held(below="xyz"), SimpleNamespace(tag=5, displacement=(None, 0.1, None))]
    with pytest.raises(InputError, match=r"'below' is held twice along y, with .* 0 and 0\.1"):
        check_supports(box, twice)
    with pytest.raises(InputError, match="the surface '9' has no facets that belong to cells"):
        check_supports(box, [SimpleNamespace(tag=9, displacement=(0.0, 0.0, 0.0))])


def test_supports_agree_where_they_meet():
    """The edge between two surfaces has one displacement."""
    box, below, left = tagged_box(COMM), SIDES["below"], SIDES["left"]
    pulled = [
        SimpleNamespace(tag=below, displacement=(0.0, 0.0, 0.0)),
        SimpleNamespace(tag=left, displacement=(None, None, 0.01)),
    ]
    with pytest.raises(
        InputError, match=r"'below' and 'left' share nodes .* along z, 0 and 0\.01 mm"
    ):
        check_supports(box, pulled)
    pulled[1] = SimpleNamespace(tag=SIDES["above"], displacement=(None, None, 0.01))
    check_supports(box, pulled)  # these two do not meet


def test_tractions_are_loads():
    box, supports = tagged_box(COMM), held(below="xyz", left="x")
    contact = SIDES["above"]

    def refused(side, stress, match):
        load = [Traction(tag=SIDES.get(side, 9), stress=stress)]
        with pytest.raises(InputError, match=match):
            check_loads(box, supports, load, contact)

    refused("above", (0, 0, 1), "'above' is the contact face and cannot be loaded too")
    refused("below", (0, 0, 1), "'below' is held along z, where a traction of 1 MPa does nothing")
    refused("left", (2, 1, 1), "'left' is held along x")
    refused("nowhere", (1, 0, 0), "'9' has no facets")
    fine = [Traction(tag=SIDES[side], stress=(0, 1, 1)) for side in ("left", "right")]
    check_loads(box, supports, fine, contact)
    with pytest.raises(InputError, match="'below' is held, where a pressure of 2 MPa does nothing"):
        check_loads(box, supports, [Traction(tag=SIDES["below"], pressure=2.0)], contact)
    check_loads(box, supports, [Traction(tag=SIDES["left"], pressure=2.0)], contact)
