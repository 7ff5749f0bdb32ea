"""The solvers of blocks are the same methods on 1, 2 and 3 ranks."""

import pytest
from helpers.petsc_build import ALGEBRAIC

pytestmark = pytest.mark.slow
RANKS = [3]
"""Two ranks share what three do; odd numbers cut meshes less evenly."""


KINDS = {
    **dict.fromkeys(["graded", "margin", "quadratic", "tetrahedra", "column"], "mg"),
    **{"stiff volume": "mg", "incompressible": "cholesky"},
    **{"refined": "mg", "refined, linear": ALGEBRAIC, "refined, incompressible": "cholesky"},
    **{"part, linear": ALGEBRAIC, "part, quadratic": "mg", "part, hexahedra": ALGEBRAIC},
    **{"part, quadratic hexahedra": "mg", "part, flat": ALGEBRAIC, "part, without hypre": "gamg"},
}


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("case", KINDS)
def test_solves_do_not_depend_on_the_ranks(on_ranks, case, ranks):
    serial, parallel = (on_ranks[n][case] for n in (1, ranks))
    assert serial["preconditioner"] == parallel["preconditioner"] == KINDS[case]
    # residuals of 1e-10 on both sides, seen through the condition of a small block
    assert parallel["norm"] == pytest.approx(serial["norm"], rel=1e-8)
    # geometric: the same method, eigenvalues from a random start; aggregates follow the ranks
    assert abs(parallel["iterations"] - serial["iterations"]) <= (
        4 if "refined" in case or "part" in case else 2
    )


@pytest.mark.parametrize("ranks", [1, *RANKS])
@pytest.mark.parametrize(
    "case", [case for case in KINDS if "refined" not in case and "part" not in case]
)
def test_coarser_matrices_are_galerkin_products(on_ranks, case, ranks):
    assert on_ranks[ranks][case]["missed"] < 1e-13  # rounding of a few hundred terms
