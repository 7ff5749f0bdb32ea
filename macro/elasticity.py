"""Linear isotropic elasticity: the material, its stiffness form and the rigid body modes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Linear, isotropic, elastic material.

    Args:
        young_modulus: Young's modulus E [MPa], positive.
        poisson_ratio: Poisson's ratio ν, −1 < ν < 0.5.

    Raises:
        InputError: When a constant is outside its range.
    """

    young_modulus: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.young_modulus) and self.young_modulus > 0.0):
            raise InputError(
                "Young's modulus must be positive", value=self.young_modulus, allowed="E > 0 MPa"
            )
        if not -1.0 < self.poisson_ratio < 0.5:
            raise InputError(
                "Poisson's ratio is impossible", value=self.poisson_ratio, allowed="-1 < ν < 0.5"
            )

    @property
    def contact_modulus(self) -> float:
        """E* = E / (1 − ν²) against a rigid plane [MPa]."""
        return self.young_modulus / (1.0 - self.poisson_ratio**2)

    @property
    def confined_modulus(self) -> float:
        """E (1 − ν) / ((1 + ν)(1 − 2ν)) = λ + 2μ: stress over strain without side strain [MPa]."""
        first, shear = self.lame
        return first + 2.0 * shear

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's constants (λ, μ) [MPa]."""
        e, nu = self.young_modulus, self.poisson_ratio
        return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))


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


def stiffness_form(space: Any, material: Material, quadrature_degree: int) -> Any:
    """Return the bilinear form a(u, v) = ∫ σ(u) : ε(v) dV as UFL.

    Lamé's constants enter as UFL constants, so that one compiled form serves every material.

    Args:
        space: Vector space of the displacements.
        material: Elastic constants [MPa].
        quadrature_degree: Polynomial degree that is integrated exactly.
    """
    first, shear = (fem.Constant(space.mesh, PETSc.ScalarType(value)) for value in material.lame)
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=space.mesh, metadata={"quadrature_degree": quadrature_degree})
    return ufl.inner(stress(trial, (first, shear)), strain(test)) * dx


def rigid_body_modes(space: Any) -> PETSc.NullSpace:
    """Return the six rigid body modes, which algebraic multigrid needs as near-nullspace.

    Args:
        space: Vector Lagrange space, three components per node.

    Note:
        Collective.
    """
    owned = space.dofmap.index_map.size_local
    return rigid_body_modes_at(space.tabulate_dof_coordinates()[:owned], space.mesh.comm)


def rigid_body_modes_at(points: NDArray[np.float64], comm: Any) -> PETSc.NullSpace:
    """Return the six rigid body modes of nodes.

    Args:
        points: Coordinates of the nodes of this rank, shape (n, 3) [mm].
        comm: MPI communicator.

    Note:
        Collective.
    """
    coordinates = PETSc.Vec().createMPI((points.size, None), bsize=3, comm=comm)
    coordinates.array[:] = points.ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)
