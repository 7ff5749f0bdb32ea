"""Residual, continuation, refusals and memory of the contact problem."""

import numpy as np
import pytest
from helpers.asperity_states import places

from patchlaw import InputError, NotConverged
from patchlaw.micro.asperities import hertz_pairs
from patchlaw.micro.asperities.hertz_pairs import (
    BYTES_PER_PAIR,
    TOLERANCE,
    HertzPairs,
    SummitProblem,
    active_set,
    check_pairs,
    solve,
)
from patchlaw.micro.closed_forms import shape_factors


@pytest.fixture
def problem(cluster):
    shape = shape_factors(cluster.radius_major, cluster.radius_minor)
    kernel = HertzPairs(**places(cluster), shape=shape, circular=False)
    return SummitProblem(interaction=kernel.evaluate, interference=5e-3 + cluster.z)


def refusing(limit):
    """Return a method that cannot take steps beyond a share of the scale, and its calls."""
    calls = []

    def method(problem, start):
        grown = problem.interference.max() - calls[-1] if calls else problem.interference.max()
        if grown > limit:
            raise NotConverged("test", reason="TOO_FAR", iterations=3, remedy="none")
        calls.append(problem.interference.max())
        return active_set(problem, start)

    return method, calls


def test_residual_measures_every_condition(problem):
    none = np.zeros(7)
    one = problem.scale
    met = problem.interference.copy()
    assert problem.residual(met, none) == 0.0
    assert problem.residual(np.zeros(7), none) == 1.0  # penetration
    pulled = problem.interference + 0.5 * one
    assert problem.residual(np.full(7, 0.25 * one), pulled) == pytest.approx(0.25)  # force at a gap
    assert problem.residual(np.full(7, -one), pulled) == 0.0  # pushed off by the others


def test_continuation_reaches_the_same_solution(problem, monkeypatch):
    direct = active_set(problem, np.zeros(7))
    method, loads = refusing(0.2 * problem.scale)
    monkeypatch.setattr(hertz_pairs, "active_set", method)
    found = solve(problem, np.zeros(7))
    assert found.indentation == pytest.approx(direct.indentation, abs=1e-9 * problem.scale)
    assert found.residual <= TOLERANCE
    assert len(loads) >= 5 and loads[-1] == problem.scale
    assert found.iterations > direct.iterations


def test_gives_up_loudly(problem, monkeypatch):
    method, _ = refusing(0.0)
    monkeypatch.setattr(hertz_pairs, "active_set", method)
    message = r"7 interacting asperities .*reached 0.0% of it\) did not converge: TOO_FAR after"
    with pytest.raises(NotConverged, match=message):
        solve(problem, np.zeros(7))


def test_pairs_that_do_not_fit_into_the_memory_are_refused(monkeypatch):
    most = BYTES_PER_PAIR * 3000.0**2
    monkeypatch.setattr(hertz_pairs, "process_memory", lambda: most)
    check_pairs(3000)
    message = (
        r"^micro\.model: the interaction of 3001 asperities needs 0\.432 GB of memory and 0\.432 GB"
        r" are there \(allowed: half-space, "
    )
    with pytest.raises(InputError, match=message):
        check_pairs(3001)
