"""Preconditioner of bodies under contact laws.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.contact.newton import Equilibrium
from patchlaw.macro.contact.sampling import Sampling
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, springs_at
from patchlaw.macro.linear_solvers.slow_modes import Balanced


class ContactPreconditioner:
    """The preconditioner of a body's tangents, with the stiffness of laws at points.

    Laws hold the nodes of the face, which the preconditioner of the body alone knows nothing of:
    iterations grow with the root of the laws' stiffness over the elements'. Laws at points couple
    no other nodes than the elements do, so that their stiffness fits into the matrix, and multigrid
    is set up with it. On quadratic elements that takes no second matrix: only the coarser grid has
    the sum's entries.

    A plane that is free to turn takes stiffness away that this knows of, −B E Eᵀ Bᵀ. The modes that
    become soft are its responses to the columns of B E, and are solved for exactly: mixed laws on a
    pad took 7 to 10 iterations a solve with them, 14 to 20 without. A plane that is free along its
    normal alone costs less than the modes do.

    Args:
        equilibrium: The equations.
        face: The contact face that laws stand on at points; None for other laws. On a lattice,
            whose multigrid is geometric, laws do not enter the matrix.
        sampling: The samples that laws are evaluated at.

    Note:
        Everything is collective.
    """

    def __init__(self, equilibrium: Equilibrium, face: Any, sampling: Sampling) -> None:
        self._equilibrium, self._face, self._sampling = equilibrium, face, sampling
        self._knows_laws = face is not None and equilibrium.body.lattice is None
        self._rubs = equilibrium.forces.sliders is not None
        self._with_laws: PETSc.KSP | None = None
        self._stiffened: Stiffened | None = None
        self._turning: Balanced | None = None
        self._slope = np.zeros_like(equilibrium.forces.slope)

    @cached_property
    def _elements(self) -> float:
        """Stiffness of the elements at the face [MPa/mm]."""
        return self._sampling.stiffness_of_elements(self._equilibrium.matrix)

    def update(self) -> None:
        """Follow the tangent."""
        if not self._knows_laws:
            return
        forces = self._equilibrium.forces
        if forces.moved_from(self._slope, self._elements):
            self._take_laws()
        turns = forces.control.tilt is None and not self._rubs
        self._turning = self._with_motions() if turns else None

    def _take_laws(self) -> None:
        """Make the preconditioner of the body with the laws as they are."""
        body, forces = self._equilibrium.body, self._equilibrium.forces
        slope = self._slope = forces.slope.copy()
        self._turning = None
        if self._with_laws is not None:
            self._with_laws.destroy()
            self._with_laws = self._stiffened = None
        if forces.comm.allreduce(slope.any(), op=MPI.LOR):
            face = self._face
            body.release_solver()
            compat.collect_garbage(body.stiffness.comm)
            points = face.points_in_all_directions if self._rubs else face.points_by_dofs
            springs = springs_at(points, slope)
            self._stiffened = Stiffened(body.stiffness, body.stiffnesses, springs)
            self._with_laws = body.solver_of(self._stiffened)
        compat.collect_garbage(body.stiffness.comm)

    def _with_motions(self) -> Balanced:
        """Return the preconditioner beside an exact solution for motions of the plane."""
        tangent = self._equilibrium.tangent
        loads = self._equilibrium.forces.loads_of_motions
        load, moved = tangent.createVecs()
        modes = np.empty_like(loads)
        for k, column in enumerate(loads.T):
            load.array[:] = column
            self._fixed.apply(load, moved)
            modes[:, k] = moved.array_r
        return Balanced(tangent, self._fixed, modes)

    @property
    def _fixed(self) -> PETSc.PC:
        """The preconditioner under a plane in a given place."""
        return (self._with_laws or self._equilibrium.body.solver).pc

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x; PETSc calls this."""
        if self._turning is None:
            self._fixed.apply(x, y)
        else:
            self._turning.apply(pc, x, y)
