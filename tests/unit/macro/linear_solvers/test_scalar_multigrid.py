"""Multigrid for networks of conductances, against the factorisation."""

import numpy as np
import pytest
from petsc4py import PETSc

from patchlaw.macro.linear_solvers import solvers as module
from patchlaw.macro.linear_solvers.options import has_hypre
from patchlaw.micro.transport import gap_flow


@pytest.mark.skipif(not has_hypre(), reason="PETSc without hypre")
def test_flows_are_those_of_a_factorisation():
    """Gaps from 1 to 10⁻⁵, whose g³ differ by 10¹⁵."""
    rng = np.random.default_rng(4)
    x = np.linspace(0.0, 6.0, 96)
    bumps = np.sin(x[:, None] + rng.random()) * np.cos(1.7 * x)
    gap = 10.0 ** (-2.5 + 2.5 * bumps) * (rng.random((96, 96)) > 0.1)
    direct = gap_flow(gap, (1.0, 1.0))
    found = gap_flow(gap, (1.0, 1.0), preconditioner=module.scalar_multigrid)
    assert found.transmissivity == pytest.approx(direct.transmissivity, rel=1e-9)
    assert found.solution.imbalance < 1e-10
    assert found.solution.iterations < 40
    assert not [name for name in PETSc.Options().getAll() if "leak" in name]
