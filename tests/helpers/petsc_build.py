"""What the PETSc under the tests was built with."""

from patchlaw.macro.linear_solvers.options import has_hypre

ALGEBRAIC = "hypre" if has_hypre() else "gamg"
"""The algebraic multigrid of linear elements without a lattice."""
