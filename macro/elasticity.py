"""Linear isotropic elasticity: stiffness form and rigid body modes.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat

Array = NDArray[np.float64]


def strain(displacement: Any) -> Any:
    """Return the small strain ε = sym ∇u as a UFL expression."""
    return ufl.sym(ufl.grad(displacement))


def stress(displacement: Any, lame: tuple[Any, Any]) -> Any:
    """Return Cauchy's stress σ = λ tr(ε) I + 2 μ ε as a UFL expression [MPa].

    Args:
        displacement: UFL expression of the displacement.
        lame: Lamé's constants (λ, μ), numbers or UFL constants.
    """
    first, shear = lame
    eps = strain(displacement)
    return first * ufl.tr(eps) * ufl.Identity(3) + 2.0 * shear * eps


def stiffness_form(space: Any, lame: tuple[Any, Any], quadrature_degree: int) -> Any:
    """Return the bilinear form a(u, v) = ∫ σ(u) : ε(v) dV as UFL.

    Lamé's constants enter as UFL constants, so that one compiled form serves every material, or as
    functions that are constant on every cell.

    Args:
        space: Vector space of the displacements.
        lame: Lamé's constants (λ, μ), or arrays of those of this rank's cells [MPa].
        quadrature_degree: Polynomial degree that is integrated exactly.
    """
    mesh = space.mesh
    constants = (
        compat.cell_constant(mesh, values)
        if np.ndim(values)
        else fem.Constant(mesh, PETSc.ScalarType(values))
        for values in lame
    )
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": quadrature_degree})
    first, shear = constants
    return ufl.inner(stress(trial, (first, shear)), strain(test)) * dx


def rigid_body_modes(points: Array, comm: Any) -> PETSc.NullSpace:
    """Return the six rigid body modes of nodes, the near-nullspace for algebraic multigrid.

    Args:
        points: Coordinates of the nodes of this rank, shape (n, 3) [mm].
        comm: MPI communicator.

    Note:
        Collective.
    """
    coordinates = PETSc.Vec().createMPI((points.size, None), bsize=3, comm=comm)
    coordinates.array[:] = points.ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)
