"""Preconditioner of bodies under contact laws: with the stiffness of the laws where that matters.

The preconditioner of the body alone serves every tangent as long as the laws are softer than the
elements under them. Stiffer laws hold the nodes of the face, which it knows nothing of: iterations
grow to ten times as many and more. Laws at points couple no other nodes than the elements do, so
that their stiffness fits into the matrix, and multigrid is set up with it. On quadratic elements
that takes no second matrix: only the coarser grid has the sum's entries.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat
from macro.contact.equilibrium import Equilibrium
from macro.contact.loaded_face import LoadedFace
from macro.linear_solvers.stiffened import Stiffened, springs_at
from macro.meshed_body import MeshedBody

Array = NDArray[np.float64]

_STIFF = 1.0
"""Stiffness of laws over that of the elements, at the node where it is largest, from which on the
preconditioner has it."""
_MOVED = 0.5
"""Change of the stiffness, relative to the largest, after which the preconditioner is set up anew.
"""


class ContactPreconditioner:
    """The preconditioner of a body's tangents.

    Args:
        equilibrium: The equations.
        face: The contact face that laws stand on at points; None for other laws. Only those on the
            face of one meshed body enter the matrix.
        solver: Linear solver of the body alone.

    Note:
        Everything is collective.
    """

    def __init__(self, equilibrium: Equilibrium, face: Any, solver: PETSc.KSP) -> None:
        self._equilibrium, self._face, self._alone = equilibrium, face, solver
        body = equilibrium.body
        self._body: MeshedBody | None = None
        if isinstance(face, LoadedFace) and isinstance(body, MeshedBody):
            self._body = body
        self._with_laws: PETSc.KSP | None = None
        self._stiffened: Stiffened | None = None
        self._slope: Array | None = None

    def update(self) -> None:
        """Follow the tangent, where the laws are stiff."""
        body, slope = self._body, self._equilibrium.forces.slope
        if body is None:
            return
        comm = self._face.comm
        if self._slope is not None:
            both = (np.abs(slope - self._slope).max(initial=0.0), slope.max(initial=0.0))
            change, largest = (comm.allreduce(each, op=MPI.MAX) for each in both)
            if change <= _MOVED * largest:
                return
        self._slope = slope.copy()
        if self._with_laws is not None:
            self._with_laws.destroy()
            self._with_laws = self._stiffened = None
        if self._largest(slope) > _STIFF:
            springs = springs_at(self._face.points_by_dofs, slope)
            self._stiffened = Stiffened(body.stiffness, springs)
            self._with_laws = body.solver_of(self._stiffened)
        compat.collect_garbage(body.stiffness.comm)

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x; PETSc calls this."""
        (self._with_laws or self._alone).pc.apply(x, y)

    def _largest(self, slope: Array) -> float:
        """Return the largest ratio of the laws' to the body's stiffness at an unknown."""
        own = self._equilibrium.body.stiffness.getDiagonal()
        starts, columns, entries = self._face.points_by_dofs.getValuesCSR()
        springs = own.duplicate()
        springs.set(0.0)
        springs.setValues(columns, np.repeat(slope, np.diff(starts)) * entries**2, addv=True)
        springs.assemble()
        springs.pointwiseDivide(springs, own)
        return float(springs.max()[1])
