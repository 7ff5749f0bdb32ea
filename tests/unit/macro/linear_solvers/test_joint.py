"""One multigrid of two bodies and the laws between them: iterations, whatever stiffness."""

import numpy as np
import pytest
from helpers.body_meshes import box, hanging, standing
from helpers.contact_laws import Spring

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import FacePair, LawContactProblem, Material
from patchlaw.macro.linear_solvers import selection
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, springs_at
from patchlaw.macro.linear_solvers.selection import body_solver

STEEL = Material(young_modulus=210e3, poisson_ratio=0.3)
SOFT = Material(young_modulus=5e3, poisson_ratio=0.3)
RUBBER = Material(young_modulus=5e2, poisson_ratio=0.49)
WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def faces(cells=("tetrahedron", "tetrahedron"), orders=(1, 1), materials=(STEEL, SOFT)):
    below, above = (
        box(lower, upper, count, cell)
        for lower, upper, count, cell in (
            ((0, 0, -1), (1, 1, 0), (9, 8, 7), cells[0]),
            ((0, 0, 0), (1, 1, 1), (7, 9, 8), cells[1]),
        )
    )
    first = standing(below, materials[0], WHOLE, orders[0])
    return FacePair(first, hanging(above, materials[1], WHOLE, orders[1]))


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [1e2, 1e7], ids=["soft", "stiffer than elements"])
@pytest.mark.parametrize(
    ("cells", "orders"),
    [
        (("tetrahedron", "hexahedron"), (1, 1)),
        (("tetrahedron", "tetrahedron"), (2, 2)),
        (("hexahedron", "tetrahedron"), (1, 2)),
    ],
)
def test_iterations_do_not_depend_on_the_stiffness_of_the_laws(cells, orders, stiffness):
    problem = LawContactProblem(faces(cells, orders), [Spring(stiffness)], "pointwise")
    state = problem.solve(Control(approach=1e-3))
    assert state.linear_iterations <= 21 * state.iterations


def test_without_hypre_laws_are_known_as_well(monkeypatch):
    monkeypatch.setattr(selection, "has_hypre", lambda: False)
    problem = LawContactProblem(faces(), [Spring(1e5)], "pointwise")
    state = problem.solve(Control(approach=1e-3))
    assert state.linear_iterations <= 50  # 46, in two or three Newton steps


def test_nearly_incompressible_bodies_are_factorised_together():
    pair = faces(materials=(STEEL, RUBBER))
    points = pair.points_by_dofs
    springs = springs_at(points, np.full(points.getLocalSize()[0], 1e8))
    stiffened = Stiffened(pair.body.stiffness, pair.body.stiffnesses, springs)
    bodies = pair.body.body, pair.body.counter
    solver = body_solver(bodies, pair.body.stiffness, stiffened)
    assert solver.method == "cholesky"
    load, found = points.createVecRight(), points.createVecRight()
    load.array[:] = np.random.default_rng(7).standard_normal(load.local_size)
    solver.pc.apply(load, found)
    residual = load.duplicate()
    stiffened.product.mult(found, residual)
    residual.axpy(-1.0, load)
    assert residual.norm() < 1e-9 * load.norm()
