"""The solver that a user chooses does not change forces, on any element and any ranks."""

import numpy as np
import pytest
from helpers.on_ranks import OnRanks


@pytest.fixture(scope="module")
def forces(waiting_ranks):
    """Return the forces by every solver, on every number of ranks."""
    return OnRanks(waiting_ranks, "direct_solvers_script.py")


@pytest.mark.parametrize(
    ("choice", "ranks"),
    [
        ("mumps", 1),
        *(pytest.param(one, 2, marks=pytest.mark.long) for one in ("superlu", "mumps", "bjacobi")),
    ],
)
def test_forces_are_those_of_multigrid(forces, choice, ranks):
    usual, found = forces[1]["usual"], forces[ranks][choice]
    assert len(found) == (8 if ranks == 1 else 4 if choice == "mumps" else 2)
    for name in found:
        # Newton's method and the equilibrium of the plane end at 1e-9 of the force
        least = 1e-8 * max(usual[name])
        np.testing.assert_allclose(found[name], usual[name], rtol=0.0, atol=least, err_msg=name)
