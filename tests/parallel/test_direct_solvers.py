"""The solver that a user chooses does not change forces, on any element and any ranks."""

import json
from functools import cache

import numpy as np
import pytest

CHOICES = {
    "mumps": "-patchlaw_pc_type cholesky -patchlaw_pc_factor_mat_solver_type mumps",
    "lu": "-patchlaw_pc_type lu -patchlaw_pc_factor_mat_solver_type mumps",
    "superlu": "-patchlaw_ksp_type preonly -patchlaw_pc_type lu "
    "-patchlaw_pc_factor_mat_solver_type superlu_dist",
    "bjacobi": "-patchlaw_pc_type bjacobi -patchlaw_ksp_max_it 9999",
}


@pytest.fixture(scope="module")
def forces(mpirun, root):
    @cache
    def of(choice, ranks):
        script = root / "tests" / "parallel" / "direct_solvers_script.py"
        done = mpirun(ranks, script, *CHOICES.get(choice, "").split())
        assert done.returncode == 0, done.stdout + done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    return of


@pytest.mark.parametrize(("choice", "ranks"), [("mumps", 1), *((one, 2) for one in CHOICES)])
def test_forces_are_those_of_multigrid(forces, choice, ranks):
    usual, found = forces("usual", 1), forces(choice, ranks)
    for name in usual:
        # Newton's method and the equilibrium of the plane end at 1e-9 of the force
        least = 1e-8 * max(usual[name])
        np.testing.assert_allclose(found[name], usual[name], rtol=0.0, atol=least, err_msg=name)
