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

from geometry.materials import Material


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


def stiffness_form(space: Any, material: Material | tuple[Any, Any], quadrature_degree: int) -> Any:
    """Return the bilinear form a(u, v) = ∫ σ(u) : ε(v) dV as UFL.

    Lamé's constants enter as UFL constants, so that one compiled form serves every material.

    Args:
        space: Vector space of the displacements.
        material: Elastic constants [MPa], or Lamé's constants as functions on the mesh.
        quadrature_degree: Polynomial degree that is integrated exactly.
    """
    first, shear = (
        (fem.Constant(space.mesh, PETSc.ScalarType(value)) for value in material.lame)
        if isinstance(material, Material)
        else material
    )
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=space.mesh, metadata={"quadrature_degree": quadrature_degree})
    return ufl.inner(stress(trial, (first, shear)), strain(test)) * dx


def rigid_body_modes(points: NDArray[np.float64], comm: Any) -> PETSc.NullSpace:
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
