"""The solver that a user chooses does not change forces, on any element and any ranks."""

import numpy as np
import pytest


@pytest.mark.parametrize(
    ("choice", "ranks"),
    [
        ("mumps", 1),
        *(pytest.param(one, 2, marks=pytest.mark.long) for one in ("superlu", "mumps", "bjacobi")),
    ],
)
def test_forces_are_those_of_multigrid(on_ranks, choice, ranks):
    usual, found = on_ranks[1]["usual"], on_ranks[ranks][choice]
    assert len(found) == (8 if ranks == 1 else 4 if choice == "mumps" else 2)
    for name in found:
        # Newton's method and the equilibrium of the plane end at 1e-9 of the force
        least = 1e-8 * max(usual[name])
        np.testing.assert_allclose(found[name], usual[name], rtol=0.0, atol=least, err_msg=name)
