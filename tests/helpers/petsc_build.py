"""What the PETSc under the tests was built with."""

from patchlaw.macro.linear_solvers.options import has_hypre

ALGEBRAIC = "mg" if has_hypre() else "gamg"
"""Preconditioner of linear elements without a lattice: cycles on hypre's grids, or GAMG."""
