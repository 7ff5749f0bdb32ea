"""Two volumes of one mesh in a user's problem: laws between faces that need not match."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from helpers.contact_laws import Exponential, PowerLaw, RangedLaw, Spring
from helpers.faces import at, tagged
from helpers.user_problems import (
    APART,
    DISC,
    DISC_HEIGHT,
    DISC_YOUNG,
    HIGH,
    LOW,
    PAD,
    PAD_HEIGHT,
    PAD_YOUNG,
    SIDES,
    cells_of,
    clamped,
    elastic,
    pressed_face,
    stacked,
    work,
)
from mpi4py import MPI

from patchlaw.geometry import Control, Friction, PatchGrid, RigidPlane
from patchlaw.macro import Interface, LawsAtPoints, compat
from patchlaw.support import InputError


def pressed(law, moved, face=DISC, opposite=PAD, disc=(6, 4, 2), poisson=0.0, **options):
    """Press the pad on the disc by moving its back, and return interface and problem."""
    mesh, tags = stacked(disc)
    space = compat.vector_space(mesh, 1)
    held = [clamped(space, tags, tag=LOW), clamped(space, tags, (0.0, 0.0, -moved), tag=HIGH)]
    own = {"work": lambda u: work(u, poisson), "held": held, "opposite": opposite}
    return pressed_face(space, tags, face, laws=law, **own, **options)


@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
def test_two_bars_and_a_spring_are_in_series(mode):
    """Without Poisson's effect: U = gap + p (H₁/E₁ + H₂/E₂ + 1/k), the meshes nested."""
    patches = PatchGrid(grid=(2, 1), lengths=SIDES)
    rough, problem = pressed(Spring(7e3), 9e-3, mode=mode, patches=patches)
    problem.solve()
    known = (9e-3 - APART) / (DISC_HEIGHT / DISC_YOUNG + PAD_HEIGHT / PAD_YOUNG + 1.0 / 7e3)
    # the solver leaves 1e-9 of the force
    np.testing.assert_allclose(rough.patch_pressure, known, rtol=1e-8)
    assert rough.force == pytest.approx(known * SIDES[0] * SIDES[1], rel=1e-8)
    assert rough.force == pytest.approx(rough.patch_pressure.mean() * 6.0, rel=1e-12)
    fields = rough.fields()
    assert fields["pressure"].x.array.max() == pytest.approx(known, rel=1e-8)


def test_the_pressure_is_that_under_either_face():
    """Faces that do not match: what one body bears, the other does."""
    law = PowerLaw(3e4)
    one, problem = pressed(law, 9e-3, disc=(5, 3, 2), poisson=0.3)
    problem.solve()
    back = problem.reaction()  # of both supports together
    assert np.abs(back).max() < 1e-8 * one.force
    other, problem = pressed(law, 9e-3, PAD, DISC, disc=(5, 3, 2), poisson=0.3)
    problem.solve()
    # quadrature on one or the other of two coarse, non-matching faces
    assert one.force == pytest.approx(other.force, rel=2e-3)


@pytest.mark.parametrize("in_matrix", [True, False])
def test_stiff_laws_between_two_faces_take_few_steps(in_matrix):
    solver = {"in_matrix": in_matrix}
    rough, problem = pressed(Exponential(0.1e-3), 12e-3, poisson=0.3, solver=solver)
    assert problem.solve() <= 6
    assert np.abs(problem.reaction()).max() < 1e-7 * rough.force
    # nearly rigid: the bars alone, within Poisson's effect of flat bars
    bars = 6.0 * (12e-3 - APART) / (DISC_HEIGHT / DISC_YOUNG + PAD_HEIGHT / PAD_YOUNG)
    assert rough.force == pytest.approx(bars, rel=0.3)


def test_a_pad_held_by_contact_and_friction_alone():
    mesh, tags = stacked()
    space = compat.vector_space(mesh, 1)
    v, back = ufl.TestFunction(space), ufl.Measure("ds", domain=mesh, subdomain_data=tags)(HIGH)
    rough, problem = pressed_face(
        space, tags, DISC, opposite=PAD, laws=RangedLaw(3e4, end=1.0),
        friction=Friction(coefficient=0.5, poisson_ratio=0.0), indenter=RigidPlane(approach=3e-3),
        work=lambda u: work(u) + 4.0 * v[2] * back - 0.3 * v[0] * back,
        held=[clamped(space, tags, tag=LOW)],
    )  # fmt: skip
    problem.solve()
    assert rough.force == pytest.approx(4.0 * 6.0, rel=1e-7)
    # what shears the pad is borne by the disc, along the axes of its face
    axes = rough.frame.axes[:2]
    np.testing.assert_allclose(np.abs(rough.shear_force @ axes), [1.8, 0.0, 0.0], atol=1e-5)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"opposite": HIGH}, "opposite.*not parallel"),
        ({"opposite": 17}, "the surface '17' has no facets"),
        ({"opposite": None}, "indenter: nothing presses"),
    ],
)
def test_opposite_faces_that_do_not_fit(options, problem):
    mesh, tags = stacked()
    space = compat.vector_space(mesh, 1)
    with pytest.raises(InputError, match=problem):
        Interface(space, tags, DISC, laws=PowerLaw(1e4), **options)


def test_one_plane_on_two_faces_has_their_total_force_and_no_moment():
    """Zones apart from each other, on bodies that are not joined, share one plane."""
    lengths = 0.4, 2.0
    one, first = cells_of((0, 0, -1.0), (lengths[0], lengths[1], 0.0), (2, 4, 2))
    other, second = cells_of((2.0, 0, -1.0), (2.0 + lengths[0], lengths[1], 0.0), (2, 3, 2))
    cells, points = np.vstack([one, other + len(first)]), np.vstack([first, second])
    mesh = compat.mesh_from_cells(cells.astype(np.int64), points, None, MPI.COMM_SELF)
    feet = {DISC: at(mesh, 2, 0.0, among=lambda x: x[0] < 1.0),
            PAD: at(mesh, 2, 0.0, among=lambda x: x[0] > 1.0)}  # fmt: skip
    tags = tagged(mesh, feet | {LOW: at(mesh, 2, -1.0)})
    space = compat.vector_space(mesh, 1)
    both, problem = pressed_face(
        space, tags, None, laws={DISC: Spring(2e3), PAD: Spring(9e3)},
        indenter=Control(force=3.7, tilt=None), held=[clamped(space, tags, tag=LOW)],
        work=lambda u: elastic(u, young=3000.0, poisson=0.0),
    )  # fmt: skip
    problem.solve()
    assert both.force == pytest.approx(3.7, rel=1e-9)
    np.testing.assert_allclose(both.moment, 0.0, atol=1e-9)
    # alike areas at alike distances from the middle bear half of it each, but for the moments that
    # the tilt leaves on each, (width / distance)² times its share
    np.testing.assert_allclose(both.state.patch_force, 1.85, rtol=0.02)
    pressure, area = 1.85 / 0.8, 1.0
    closer = pressure * (1.0 / 2e3 + area / 3000.0), pressure * (1.0 / 9e3 + area / 3000.0)
    # as feet under uniform pressure; the forces differ by 0.6 % from half of the whole
    assert both.plane.approach == pytest.approx(np.mean(closer), rel=5e-3)


def test_patches_are_as_large_as_what_both_faces_have_in_common():
    """A face on three quarters of the other: one patch whole, one half, on whole facets."""
    disc, pad = (4, 2, 1), (3, 2, 1)
    one, first = cells_of((0, 0, 0), (4.0, 2.0, 1.0), disc)
    other, second = cells_of((0, 0, 1.0), (3.0, 2.0, 2.0), pad)
    cells, points = np.vstack([one, other + len(first)]), np.vstack([first, second])
    mesh = compat.mesh_from_cells(cells.astype(np.int64), points, None, MPI.COMM_SELF)
    level = at(mesh, 2, 1.0)
    cell_of = mesh.topology.connectivity(2, 3)
    below = np.array([cell_of.links(f)[0] for f in level])
    heights = dmesh.compute_midpoints(mesh, 3, below)[:, 2]
    lower, upper = level[heights < 1.0], level[heights > 1.0]
    space = compat.vector_space(mesh, 1)
    patches = PatchGrid(grid=(4, 1), lengths=(4.0, 2.0))
    options = {"opposite": upper, "indenter": RigidPlane(approach=2e-3)}
    laws = {"laws": [Spring(7e3)] * 4, "patches": patches}
    rough = Interface(space, None, lower, mode="pointwise", **options, **laws)
    rough.evaluate(fem.Function(space))
    bears = rough.patch_pressure > 0.0
    assert bears.sum() == 3
    np.testing.assert_allclose(rough.patch_pressure[bears], 14.0, rtol=1e-12)
    np.testing.assert_allclose(rough.patch_closure[bears], 2e-3, rtol=1e-12)
    assert np.isnan(rough.patch_closure[~bears]).all()
    halves = PatchGrid(grid=(2, 1), lengths=(4.0, 2.0))
    options |= {"laws": [Spring(7e3)] * 2, "patches": halves}
    rough = Interface(space, None, lower, mode="pointwise", **options)
    rough.evaluate(fem.Function(space))
    np.testing.assert_allclose(rough.patch_pressure, 14.0, rtol=1e-12)
    with pytest.raises(InputError, match="do not cover the patches alike"):
        Interface(space, None, lower, mode="patchwise", **options)


def test_room_for_both_faces_keeps_the_rigid_motions_of_the_matrix():
    _, problem = pressed(PowerLaw(1e4), 9e-3)
    assert problem._equations.matrix.getNearNullSpace().handle
    assert len(problem._equations.matrix.getNearNullSpace().getVecs()) == 6


def test_external_operators_refuse_a_second_face():
    rough, _ = pressed(PowerLaw(1e4), 9e-3)
    with pytest.raises(InputError, match=f"opposite = {PAD}: .*one face"):
        LawsAtPoints(rough, np.zeros((1, 1, 3)))
