"""Heat through a circular spot, solved by finite elements of heat conduction in dolfinx."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import Control, Surface
from patchlaw.macro.compat import assemble_matrix, assemble_vector, compile_form, scalar_space
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import total_conductance

RADIUS, APPROACH, MODULUS, CONDUCTIVITY = 5.0, 6e-3, 1000.0, 40.0
SPOT, FAR = np.sqrt(RADIUS * APPROACH), 5.0
"""Radius of Hertz' contact [mm], and the outer boundary at about 74 times of it, as μ below."""


def conducted(cells):
    """Return the heat [W/K] into an isothermal spot on a body that is held at zero far away.

    Axisymmetric, on cells between confocal spheroids r = a cosh μ cos θ, z = −a sinh μ sin θ.
    """
    mesh = dmesh.create_rectangle(
        MPI.COMM_SELF,
        [[0.0, 0.0], [FAR, 0.5 * np.pi]],
        [3 * cells, cells],
        dmesh.CellType.quadrilateral,
    )
    space = scalar_space(mesh, 1)
    spot, outer = (
        fem.locate_dofs_geometrical(space, lambda x, at=at: np.isclose(x[0], at))
        for at in (0.0, FAR)
    )
    mu, theta = mesh.geometry.x[:, 0].copy(), mesh.geometry.x[:, 1].copy()
    mesh.geometry.x[:, 0] = SPOT * np.cosh(mu) * np.cos(theta)
    mesh.geometry.x[:, 1] = -SPOT * np.sinh(mu) * np.sin(theta)
    hot, cold = (
        fem.dirichletbc(PETSc.ScalarType(value), nodes, space)
        for value, nodes in ((1.0, spot), (0.0, outer))
    )
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    around = 2.0 * np.pi * ufl.SpatialCoordinate(mesh)[0]
    form = around * ufl.inner(ufl.grad(trial), ufl.grad(test)) * ufl.dx
    free, held = assemble_matrix(compile_form(form), []), assemble_matrix(
        compile_form(form), [hot, cold]
    )  # fmt: skip
    given = fem.Function(space)
    given.x.array[spot] = 1.0
    load = -assemble_vector(compile_form(ufl.action(form, given)))
    load.array[spot], load.array[outer] = 0.0, 0.0
    solver, found = PETSc.KSP().create(mesh.comm), held.createVecRight()
    solver.setOperators(held)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.solve(load, found)
    found.array[:] += given.x.array
    return CONDUCTIVITY * 1e-3 * found.dot(free * found)  # twice the least energy; W/m/K on mm


@pytest.mark.slow
def test_heat_through_a_meshed_spot_is_that_of_its_stiffness():
    coarse, fine = conducted(32), conducted(64)
    bar = abs(coarse - fine)
    # with the outer boundary at infinity; in these coordinates the temperature is that of a layer
    finite = 0.5 * np.pi / (2.0 * np.arctan(np.tanh(0.5 * FAR)))
    assert bar < 2e-3 * fine
    assert fine / finite == pytest.approx(4.0 * CONDUCTIVITY * 1e-3 * SPOT, abs=bar)
    x = (np.arange(192) + 0.5) / 192 - 0.5
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2) / (2 * RADIUS), lengths=(1.0, 1.0))
    model = HalfSpaceModel(sphere, contact_modulus=MODULUS, highest=0.0)
    stiffness = model.stiffness(model.press(Control(approach=APPROACH))).approach
    by_stiffness = total_conductance(stiffness, MODULUS, CONDUCTIVITY)
    # cells at the edge of the contact: 0.5 % (test_conductance)
    assert by_stiffness == pytest.approx(fine / finite, abs=bar + 5e-3 * fine)
