"""Residual, continuation and refusal of the complementarity problem."""

import numpy as np
import pytest

from geometry import NotConverged
from micro.closed_forms.ellipse import shape_factors
from micro.complementarity.active_set import active_set
from micro.complementarity.contact_problem import TOLERANCE, ContactProblem, solve
from micro.pairs.interaction import Interaction, Lift


@pytest.fixture
def problem(cluster):
    shape = shape_factors(cluster.radius_major, cluster.radius_minor)
    kernel = Interaction.among(cluster, shape, circular=False)
    return ContactProblem(interaction=kernel, required=5e-3 + cluster.z)


def refusing(limit):
    """Return a method that cannot take steps beyond a share of the scale, and its calls."""
    calls = []

    def method(problem, start):
        grown = problem.required.max() - calls[-1] if calls else problem.required.max()
        if grown > limit:
            raise NotConverged("test", reason="TOO_FAR", iterations=3, remedy="none")
        calls.append(problem.required.max())
        return active_set(problem, start)

    return method, calls


def test_residual_measures_every_condition(problem):
    none = Lift(np.array([], int), np.zeros(7), np.zeros((7, 0)))
    one = problem.scale
    met = problem.required.copy()
    assert problem.residual(met, none) == 0.0
    assert problem.residual(np.zeros(7), none) == 1.0  # penetration
    pulled = none._replace(displacement=problem.required + 0.5 * one)
    assert problem.residual(np.full(7, 0.25 * one), pulled) == pytest.approx(0.25)  # force at a gap
    assert problem.residual(np.full(7, -one), pulled) == 0.0  # pushed off by the others


def test_continuation_reaches_the_same_solution(problem):
    direct = active_set(problem, np.zeros(7))
    method, loads = refusing(0.2 * problem.scale)
    found = solve(problem, method, np.zeros(7))
    assert found.indentation == pytest.approx(direct.indentation, abs=1e-9 * problem.scale)
    assert found.residual <= TOLERANCE
    assert len(loads) >= 5 and loads[-1] == problem.scale
    assert found.iterations > direct.iterations


def test_gives_up_loudly(problem):
    method, _ = refusing(0.0)
    message = r"7 interacting asperities .*reached 0.0% of it\) did not converge: TOO_FAR after"
    with pytest.raises(NotConverged, match=message):
        solve(problem, method, np.zeros(7))
