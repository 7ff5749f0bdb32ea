"""Two elastic bodies on each other: halves of one another's compliance, and columns in series."""

from itertools import product

import numpy as np
import pytest
from helpers.body_meshes import HIGH, LOW, box, hanging, standing
from helpers.contact_laws import PowerLaw, Spring
from helpers.faces import at, tagged

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import (
    FacePair,
    LawContactProblem,
    Loads,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    Traction,
    compat,
    largest_rise,
)
from patchlaw.macro.mesh.facet_parts import straight_parts, triangle_areas
from patchlaw.support import InputError

SOFT = Material(young_modulus=2000.0, poisson_ratio=0.3)
HARD = Material(young_modulus=4000.0, poisson_ratio=0.3)
SLIDING = Material(young_modulus=3000.0, poisson_ratio=0.0)
PATCHES = PatchGrid(grid=(3, 2), lengths=(1.0, 1.0))
WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def pair(first, second):
    return FacePair(first, second)


def laws_of(patches):
    return [PowerLaw(1e5 * (1 + i), touch=1e-4 * i) for i in range(patches.count)]


@pytest.mark.long
@pytest.mark.parametrize(("order", "mode"), [(1, "patchwise"), (1, "pointwise"), (2, "pointwise")])
def test_two_equal_bodies_are_one_of_half_the_modulus(order, mode):
    """Mirror images on each other: the plane between them stays where a rigid plane would be."""
    below, above = box((0, 0, -1), (1, 1, 0), (4, 4, 3)), box((0, 0, 0), (1, 1, 1), (4, 4, 3))
    control = Control(approach=2e-3, tilt=(1e-4, -2e-4))
    both = pair(standing(below, HARD, PATCHES, order), hanging(above, HARD, PATCHES, order))
    found = LawContactProblem(both, laws_of(PATCHES), mode).solve(control)
    single = LawContactProblem(standing(below, SOFT, PATCHES, order), laws_of(PATCHES), mode)
    expected = single.solve(control)
    assert found.force == pytest.approx(expected.force, rel=1e-9)
    np.testing.assert_allclose(found.patch_pressure, expected.patch_pressure, rtol=1e-8)
    np.testing.assert_allclose(found.patch_closure, expected.patch_closure, rtol=1e-8)
    assert found.reaction == pytest.approx(found.force, rel=1e-8)


def series(first, second, mode, orders=(1, 1)):
    """Return the relative error of two columns on each other, whose meshes do not match.

    Without lateral strain δ = p/k + p h₁/E₁ + p h₂/E₂.
    """
    stiff = Material(young_modulus=9000.0, poisson_ratio=0.0)
    below = box((0, 0, -0.5), (1, 1, 0), (3, 4, 2), first)
    above = box((0, 0, 0.1), (1, 1, 1.1), (5, 3, 2), second)
    one, other = orders
    faces = pair(standing(below, SLIDING, WHOLE, one), hanging(above, stiff, WHOLE, other))
    faces.second.facets.depth[:] -= 0.1  # the bodies stand apart, and approach from first touch
    state = LawContactProblem(faces, [Spring(2e4)], mode).solve(Control(approach=3e-3))
    return state.force / (3e-3 / (1 / 2e4 + 0.5 / 3000.0 + 1.0 / 9000.0)) - 1.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("first", "second"), product(["hexahedron", "tetrahedron"], ["tetrahedron", "hexahedron"])
)
def test_columns_in_series(first, second):
    # facets that cut each other: the points lie on the pieces of both
    for mode in ("patchwise", "pointwise"):
        assert abs(series(first, second, mode)) < 1e-9


@pytest.mark.long
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_points_are_enough_for_quadratic_bodies_on_linear_ones(cell):
    for orders in ((1, 2), (2, 1)):
        assert abs(series(cell, cell, "pointwise", orders)) < 1e-9


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_facets_that_nearly_match_give_about_the_force_of_those_that_do(cell):
    """Large pieces keep the points of whole facets: with fewer on all the force changed by 2e-3."""
    forces = []
    for aside in (0.0, 1e-5):
        below, above = (box((0, 0, z), (1, 1, z + 0.5), (4, 3, 1), cell) for z in (-0.5, 0.0))
        x = above.mesh.geometry.x
        x[:, :2] += aside * (np.abs(x[:, :2] - 0.5) < 0.4)
        faces = pair(standing(below, SOFT, WHOLE), hanging(above, SOFT, WHOLE))
        problem = LawContactProblem(faces, [PowerLaw(3e5, power=2.0)], "pointwise")
        forces.append(problem.solve(Control(approach=7e-3, tilt=(1.6e-2, -3e-3))).force)
    assert forces[1] == pytest.approx(forces[0], rel=2e-4)


def test_only_common_parts_of_the_faces_touch():
    """A counter-body over part of the face presses there, though it cuts the facets below."""
    below = box((0, 0, -1), (1, 1, 0), (4, 3, 1))
    for lower, cell, turn in (((0.5, 0.0), "hexahedron", 0.0), ((0.31, 0.17), "tetrahedron", 0.3)):
        above = box((*lower, 0), (0.93, 0.79, 1), (3, 4, 1), cell)
        x = above.mesh.geometry.x
        x[:, :2] = (x[:, :2] - 0.5) @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        x[:, :2] += 0.5
        faces = pair(standing(below, SLIDING, WHOLE), hanging(above, SLIDING, WHOLE))
        state = LawContactProblem(faces, [Spring(1e-6)], "pointwise").solve(Control(approach=1e-3))
        area = (0.93 - lower[0]) * (0.79 - lower[1])
        assert state.force == pytest.approx(1e-9 * area, rel=1e-8)  # no deformation to speak of
        assert faces.areas == pytest.approx(1.0)
    with pytest.raises(InputError, match="do not cover the patches alike"):
        LawContactProblem(faces, [Spring(1e-3)], "patchwise")


@pytest.mark.parametrize(("cell", "least"), [("hexahedron", 1e-3), ("tetrahedron", 2e-4)])
def test_a_round_body_of_curved_cells_presses_on_what_it_covers(cell, least):
    """Its outline counts as 16 chords an edge: 0.01 % of the disc on 16 edges."""
    square = box((0, 0, 0), (1, 1, 1), (4, 4, 1), cell)
    nodes = compat.vector_space(square.mesh, 2)
    places = nodes.tabulate_dof_coordinates().copy()
    x, y = (2.0 * places[:, :2] - 1.0).T
    places[:, 0], places[:, 1] = 0.4 * x * np.sqrt(1.0 - y**2 / 2), 0.4 * y * np.sqrt(1 - x**2 / 2)
    places[:, :2] += 0.5
    cells = compat.cell_nodes(nodes).astype(np.int64)
    mesh = compat.mesh_from_cells(cells, places, None, square.mesh.comm)
    faces = {LOW: at(mesh, 2, 0.0), HIGH: at(mesh, 2, 1.0)}
    above = TaggedMesh(mesh=mesh, facet_tags=tagged(mesh, faces))
    below = standing(box((0, 0, -1), (1, 1, 0), (3, 4, 1)), SLIDING, WHOLE)
    disc = hanging(above, SLIDING, WHOLE, 2)
    faces = pair(below, disc)
    assert faces.pointwise.weight.sum() == pytest.approx(float(disc.areas[0]), rel=least)
    assert straight_parts(disc.facets.corners[:0]).shape[2] == 2  # a rank may have none
    area = triangle_areas(straight_parts(disc.facets.corners)).sum()
    assert area == pytest.approx(float(disc.areas[0]), rel=2e-4)


def test_force_on_both_with_a_free_tilt():
    below, above = box((0, 0, -1), (1, 1, 0), (4, 4, 3)), box((0, 0, 0), (1, 1, 1), (3, 5, 2))
    faces = pair(standing(below, HARD, PATCHES), hanging(above, SOFT, PATCHES))
    problem = LawContactProblem(faces, laws_of(PATCHES), "pointwise")
    state = problem.solve(Control(force=2.0, tilt=None))
    assert state.force == pytest.approx(2.0, rel=1e-9)
    np.testing.assert_allclose(state.moment, 0.0, atol=1e-9)
    assert state.reaction == pytest.approx(2.0, rel=1e-7)


def test_tractions_and_moved_supports_close_the_gap():
    """A column pulled by σ at its upper face, and lifted by a moved support, meets the plane."""
    mesh = box((0, 0, -0.5), (1, 1, 0), (3, 3, 2))
    upward = Loads(tractions=(Traction(tag=HIGH, stress=(0, 0, 6.0)),))
    pulled = standing(mesh, SLIDING, WHOLE, loads=[upward])
    assert largest_rise(pulled, 0) == pytest.approx(6.0 * 0.5 / 3000.0, rel=1e-8)
    state = LawContactProblem(pulled, [Spring(2e4)]).solve(Control(approach=0.0))
    assert state.force == pytest.approx(1e-3 / (1 / 2e4 + 0.5 / 3000.0), rel=1e-8)
    supports = [Support(tag=1, displacement=(0.0, 0.0, 1e-3))]
    lifted = standing(mesh, SLIDING, WHOLE)
    body = MeshedBody(lifted.body.mesh, SLIDING, supports)
    face = type(lifted)(body, lifted.facets, WHOLE)
    assert largest_rise(face, 0) == pytest.approx(1e-3, rel=1e-8)
    state = LawContactProblem(face, [Spring(2e4)]).solve(Control(approach=0.0))
    assert state.force == pytest.approx(1e-3 / (1 / 2e4 + 0.5 / 3000.0), rel=1e-8)


def test_a_gap_of_either_face_is_one_of_both():
    def force(approach, first=0.0, second=0.0):
        below, above = box((0, 0, -1), (1, 1, 0), (2, 2, 2)), box((0, 0, 0), (1, 1, 1), (2, 3, 2))
        faces = pair(standing(below, HARD, WHOLE), hanging(above, SOFT, WHOLE))
        faces.first.facets.depth[:] += first
        faces.second.facets.depth[:] += second
        return LawContactProblem(faces, [Spring(2e4)], "pointwise").solve(
            Control(approach=approach)
        ).force  # fmt: skip

    expected = force(1.3e-3)
    assert expected > 1.0
    for gaps in ((4e-4, 0.0), (0.0, 4e-4), (1e-4, 3e-4)):
        assert force(1.7e-3, *gaps) == pytest.approx(expected, rel=1e-8)
