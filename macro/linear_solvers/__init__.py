"""Linear solvers for blocks: PETSc's by options, multigrid, factorisation, constraints."""
