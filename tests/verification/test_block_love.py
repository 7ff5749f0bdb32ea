"""Uniform pressure on a patch of a large block against Love's half-space solution."""

from functools import cache

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from helpers.block_cases import block_of, interface_of

from patchlaw.macro import Material, compat
from patchlaw.macro.elastic_body import stiffness_form, stress
from patchlaw.macro.linear_solvers.solvers import linear_solver, solve_linear
from patchlaw.micro.closed_forms import love_mutual


@cache
def patch_displacements(element, n, *, width, grid, interface, fineness):
    """Return E*/p times the patches' mean displacements under pressure p on the first patch."""
    block = block_of(
        element=element,
        interface=interface,
        cells=(n, n, 5 * fineness),
        height=width,
        margin=width,
        margin_cells=3 * fineness,
        grading=20.0,
        margin_grading=10.0,
    )
    patches = interface_of(block, grid)
    load = patches.load(np.eye(patches.patches.count)[0])
    load.array[:] = block.solve(load).x.array[: block.owned_dofs]
    return patches.patch_displacements(load) * block.material.contact_modulus


def on_a_block(element, n, *, width, grid=(1, 1), interface=(1.0, 1.0), fineness=1):
    """Return the same, one patch on a square by default; solved for once."""
    options = {"width": width, "grid": grid, "interface": interface, "fineness": fineness}
    return patch_displacements(element, n, **options)


def half_space_displacements(patches):
    """Return the same by Love's solution, averaged over every patch."""
    dx, dy = (patches.centres - patches.centres[0]).T
    return love_mutual(dx, dy, *patches.half_sizes) / np.pi


def extrapolated(small, large):
    """Remove the leading error of a finite block, inverse to its width, from L and 2 L."""
    return 2.0 * large - small


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grid", "sides"),
    [
        ((1, 1), (1.0, 1.0)),
        pytest.param((1, 1), (1.0, 0.5), marks=pytest.mark.slow),
        pytest.param((2, 2), (1.0, 1.0), marks=pytest.mark.slow),
    ],
)
def test_large_block_tends_to_love(grid, sides):
    block = block_of(interface=sides, cells=(2, 2, 1))
    exact = half_space_displacements(interface_of(block, grid).patches)
    computed = extrapolated(
        *(on_a_block("Q2", 4, width=width, grid=grid, interface=sides) for width in (2.0, 4.0))
    )
    # two to four quadratic elements across a patch: 1-2 % of the largest, 0.5 % at twice as many
    np.testing.assert_allclose(computed, exact, atol=0.025 * exact[0])


@pytest.mark.long
def test_distance_to_love_halves_when_the_block_doubles():
    exact = half_space_displacements(interface_of(block_of(cells=(1, 1, 1)), (1, 1)).patches)
    small, large = (on_a_block("Q2", 4, width=width) for width in (2.0, 4.0))
    # the leading term is inverse to the width; the mesh adds 1 % of the displacement to both
    assert (exact - small) / (exact - large) == pytest.approx(2.0, abs=0.2)


MATERIAL = Material(young_modulus=2.0, poisson_ratio=0.3)
ELEMENTS = ["Q1", "Q2", "P1", "P2"]


def dirichlet_solution(block, boundary_values, load=None):
    """Solve with given displacements on the whole boundary; return solution and boundary dofs."""
    mesh, space = block.mesh.mesh, block.space
    mesh.topology.create_connectivity(2, 3)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    dofs = fem.locate_dofs_topological(space, 2, facets)
    fixed = fem.dirichletbc(np.zeros(3), dofs, space)
    degree = 2 * block.degree if block.mesh.shape.hexahedral else 2 * block.degree - 2
    form = compat.compile_form(stiffness_form(space, MATERIAL.lame, degree))
    whole, constrained = compat.assemble_matrix(form, []), compat.assemble_matrix(form, [fixed])
    given = fem.Function(space)
    given.interpolate(boundary_values)
    at_boundary = (3 * dofs[:, None] + np.arange(3)).ravel()
    lift = whole.createVecRight()
    lift.array[at_boundary] = given.x.array[at_boundary]
    right = whole.createVecLeft()
    whole.mult(-1.0 * lift, right)
    if load is not None:
        right.axpy(1.0, compat.assemble_vector(load))
    right.array[at_boundary] = 0.0
    solution = right.duplicate()
    solver = linear_solver(constrained)
    solver.setTolerances(rtol=1e-13)
    solve_linear(solver, right, solution)
    solution.axpy(1.0, lift)
    return block.function(solution.array_r), given


@pytest.mark.parametrize("element", ELEMENTS)
def test_linear_displacement_is_exact_on_distorted_graded_meshes(element):
    block = block_of(
        element=element, cells=(2, 3, 3), grading=3.0, margin=0.3, margin_cells=1, height=0.8
    )
    x = block.mesh.mesh.geometry.x
    inside = (np.abs(x[:, :2] - 0.5) < 0.79).all(axis=1) & (x[:, 2] > -0.79) & (x[:, 2] < -0.01)
    x[inside] += np.random.default_rng(3).uniform(-0.04, 0.04, (inside.sum(), 3))
    gradient = np.array([[1.0, -0.5, 0.3], [0.2, 0.7, -1.1], [0.4, 0.6, -0.9]])
    solution, exact = dirichlet_solution(block, lambda points: gradient @ points)
    # round-off, and the linear solver's 1e-13
    assert inside.sum() >= 12
    np.testing.assert_allclose(solution.x.array, exact.x.array, atol=1e-11)


def exact_field(x, functions):
    """Return a smooth displacement; `functions` is numpy or ufl."""
    sin, exp = functions.sin, functions.exp
    return [
        sin(1.3 * x[0] + 0.4 * x[1]) * (1.0 + 0.5 * x[2]),
        0.7 * exp(0.8 * x[2]) * sin(x[0] - x[1]),
        sin(1.1 * x[1] + 0.9 * x[2] - 0.3 * x[0]),
    ]


def manufactured_errors(element, n):
    """Return the errors in L² and in the H¹ seminorm under the body force of the exact field."""
    block = block_of(element=element, cells=(n, n, n))
    mesh = block.mesh.mesh
    x = ufl.SpatialCoordinate(mesh)
    exact = ufl.as_vector(exact_field(x, ufl))
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 * block.degree + 3})
    force = -ufl.div(stress(exact, MATERIAL.lame))
    load = compat.compile_form(ufl.inner(force, ufl.TestFunction(block.space)) * dx)
    solution, _ = dirichlet_solution(block, lambda p: np.array(exact_field(p, np)), load)
    error = solution - exact
    squares = (ufl.inner(error, error) * dx, ufl.inner(ufl.grad(error), ufl.grad(error)) * dx)
    return np.sqrt([fem.assemble_scalar(compat.compile_form(square)) for square in squares])


@pytest.mark.long
@pytest.mark.parametrize(
    ("element", "sizes"), [("Q1", (4, 8)), ("Q2", (2, 4)), ("P1", (4, 8)), ("P2", (2, 4))]
)
def test_manufactured_solution_converges_at_the_elements_rate(element, sizes):
    coarse, fine = (manufactured_errors(element, n) for n in sizes)
    degree = int(element[1])
    # k + 1 in L² and k in H¹; meshes this coarse reach them within 0.2
    np.testing.assert_allclose(np.log2(coarse / fine), [degree + 1, degree], atol=0.2)
