"""Measured errors of bodies under laws against refined meshes; study: benchmarks/body_errors."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.random_bodies import drawn, mesh_of, problem_on, stated_and_true
from patchlaw.geometry import Control


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
