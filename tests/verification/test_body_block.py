"""The block's compliance in modes beside the half-space, against meshes that know of neither."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.random_bodies import drawn, mesh_of, problem_on, stated_and_true
from patchlaw.geometry import BlockShape, Control, PatchGrid
from patchlaw.macro import Block, LoadedFace, Material, block_mesh, displacements_under
from patchlaw.micro import FreeSides
from patchlaw.micro.boundary_elements.body_modes import BodyPoints
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

COMM = MPI.COMM_SELF


def body(shape, nu=0.15, known=True, sides="free"):
    decay_length = 0.25 * min(*shape.interface, shape.height)
    free = (
        FreeSides(lengths=shape.interface, poisson_ratio=nu, decay_length=decay_length)
        if known
        else None
    )
    material = Material(young_modulus=1.0, poisson_ratio=nu)
    return FaceTerms((block_term(shape, material, sides, free),))


@pytest.mark.long
@pytest.mark.parametrize("margin", [{}, {"margin": 0.25, "margin_cells": 2}])
def test_block_sinks_as_quadratic_elements_do(margin):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 6), **margin)
    patches = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
    whole = body(shape, known=not margin).patch_compliance(patches, COMM)
    mesh = block_mesh(replace(shape, element="Q2"), COMM)
    plain = Block(mesh, Material(young_modulus=1.0, poisson_ratio=0.15))
    interface = LoadedFace.of_block(plain, patches)
    load = interface.load(np.ones(16))
    load.array[:] = plain.solve(load).x.array[: plain.owned_dofs]
    sunk = interface.patch_displacements(load).mean()
    # with a margin, pressures end within the top: these elements leave 0.17 % there
    assert whole.sum(axis=1).mean() == pytest.approx(sunk, rel=3e-3 if margin else 3e-4)


@pytest.mark.slow
def test_single_patches_are_the_limit_of_quadratic_elements():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 6), element="Q2", grading=4.0)
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    whole = body(shape, nu=0.3).patch_compliance(patches, COMM)
    block = Block(block_mesh(shape, COMM), Material(young_modulus=1.0, poisson_ratio=0.3))
    found = displacements_under(LoadedFace.of_block(block, patches), np.eye(patches.count)).T
    # elements are stiff below a patch's own edges: 0.33 % here, 0.16 % with 16, 16, 8
    assert np.all(np.diag(found) < np.diag(whole))
    np.testing.assert_allclose(found, whole, atol=0.005 * whole.max())


@pytest.mark.long
@pytest.mark.parametrize("count", [1, 2, 4, 8])
def test_known_sides_leave_the_same_whole(count):
    """What the sides' term knows and what is left to the modes is the block, on every grid."""
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1))
    patches = PatchGrid(grid=(count, count), lengths=(1.0, 1.0))
    one = body(shape).patch_compliance(patches, COMM)
    other = body(shape, known=False).patch_compliance(patches, COMM)
    # 0.02 % on one patch, from the sides' interpolation; 0.11 % on 8 × 8, of 8 modes and of 16
    np.testing.assert_allclose(one, other, atol=2e-3 * one.max())
    np.testing.assert_allclose(one, one.T, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    ("height", "miss"), [pytest.param(0.1, 3e-3, marks=pytest.mark.slow), (1.0, 6e-4), (10.0, 8e-4)]
)
def test_modes_of_a_shape_resolve_points(height, miss):
    """Beside the own compliance of a contact of radius 0.02 mm more modes change little."""
    shape = BlockShape(interface=(1.0, 1.0), height=height, cells=(1, 1, 1))
    block = body(shape)
    places = np.array([0.5, 0.31, 0.02, 0.5, 0.9]), np.array([0.5, 0.44, 0.5, 0.97, 0.85])
    points = [
        BodyPoints.at(block.term(face), *places)
        for face in (block.face(COMM), block.face(COMM, modes=block.modes + 5))
    ]
    usual, more = (each.by(each) for each in points)
    own = 1.0 / (2.0 * 0.02 * block.bodies[0].material.contact_modulus)
    # 0.16, 0.03 and 0.04 %
    assert np.abs(usual - more).max() < miss * own


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4, 12, 14])  # P2, P1, Q2, Q1; foot, wedge, pad
def test_the_true_error_is_within_one_and_a_half_times_the_stated(seed):
    found = stated_and_true(drawn(seed, coarser=1.4), MPI.COMM_SELF, refinements=1)
    # one refinement leaves a quarter to a third of the error
    true = 1.5 * abs(found.forces[1] - found.forces[0])
    assert 1e-4 * found.load < true < 1.5 * (found.mesh + found.quadrature)
    assert found.mesh < 6.0 * true


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_creases_of_a_faceted_side_are_errors_that_no_degree_resolves(order):
    """A ring of tetrahedra one cell wide under a level plane has a nearly uniform stress.

    Linear elements, which have a uniform one exactly, tell 3 % of the error of either.
    """
    found = stated_and_true(replace(drawn(8), order=order), MPI.COMM_SELF)
    true = abs(found.forces[2] - found.forces[0])
    assert 5e-4 * found.load < true < 1.5 * (found.mesh + found.quadrature)
    assert found.mesh < 6.0 * true


@pytest.mark.slow
def test_quadrature_matters_where_a_plane_touches_a_part_of_the_face():
    body = drawn(3)  # held in a tilt
    face, problem_of = problem_on(body, mesh_of(body, MPI.COMM_SELF))
    load = body.pressure * float(face.areas.sum())
    state = problem_of(face).solve(Control(force=load, tilt=body.tilt))
    assert 0.05 < np.mean(state.sample_pressure == 0.0) < 0.95
    found = stated_and_true(body, MPI.COMM_SELF, refinements=0)
    many = problem_of(replace(face, degree=28))
    true = abs(many.solve(Control(approach=state.approach, tilt=body.tilt)).force - state.force)
    assert 1e-6 * load < true < 1.5 * found.quadrature
    assert found.quadrature < 6.0 * true
