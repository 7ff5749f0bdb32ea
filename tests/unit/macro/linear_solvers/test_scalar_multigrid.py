"""Multigrid and CHOLMOD for networks of conductances, against SuperLU."""

import numpy as np
import pytest
from petsc4py import PETSc

from patchlaw.macro.linear_solvers import solvers as module
from patchlaw.macro.linear_solvers.options import has_cholmod, has_hypre
from patchlaw.micro.transport import gap_flow


@pytest.mark.parametrize(
    ("solver", "known", "most"),
    [("scalar_multigrid", has_hypre, 40), ("scalar_cholesky", has_cholmod, 4)],
)
def test_flows_are_those_of_a_factorisation(solver, known, most):
    """Gaps from 1 to 10⁻⁵, whose g³ differ by 10¹⁵."""
    if not known():
        pytest.skip("PETSc without the package")
    rng = np.random.default_rng(4)
    x = np.linspace(0.0, 6.0, 96)
    bumps = np.sin(x[:, None] + rng.random()) * np.cos(1.7 * x)
    gap = 10.0 ** (-2.5 + 2.5 * bumps) * (rng.random((96, 96)) > 0.1)
    direct = gap_flow(gap, (1.0, 1.0))
    found = gap_flow(gap, (1.0, 1.0), preconditioner=getattr(module, solver))
    assert found.transmissivity == pytest.approx(direct.transmissivity, rel=1e-9)
    assert found.solution.imbalance < 1e-10
    assert found.solution.iterations < most
    assert not [name for name in PETSc.Options().getAll() if "leak" in name]
