"""Both solvers of the contact problem: agreement, starts, rate, failure."""

import numpy as np
import pytest
from helpers import truncated_newton as paper
from helpers.asperity_states import places
from helpers.truncated_newton import truncated_newton

from patchlaw import NotConverged
from patchlaw.micro.asperities import hertz_pairs
from patchlaw.micro.asperities.hertz_pairs import HertzPairs, SummitProblem, active_set, damped_step
from patchlaw.micro.closed_forms import shape_factors


def problem(asperities, approach):
    shape = shape_factors(asperities.radius_major, asperities.radius_minor)
    kernel = HertzPairs(**places(asperities), shape=shape, circular=False)
    interference = np.maximum(approach + asperities.z, 1e-9)
    return SummitProblem(interaction=kernel.evaluate, interference=interference)


@pytest.mark.parametrize("approach", [1e-4, 5e-3, 5e-2])
def test_solvers_agree_from_any_start(cluster, approach):
    case = problem(cluster, approach)
    reference = active_set(case, np.zeros(7)).indentation
    rng = np.random.default_rng(1)
    starts = [
        case.interference,
        5 * approach * rng.random(7),
        np.where(rng.random(7) < 0.5, approach, 0),
    ]
    for method in (active_set, truncated_newton):
        for start in starts:
            # Both stop at 1e-10 of the scale; the Jacobian's inverse is below 10 here.
            found = method(case, start).indentation
            assert found == pytest.approx(reference, abs=1e-9 * case.scale)


def test_newton_is_fast(cluster):
    assert active_set(problem(cluster, 5e-3), np.zeros(7)).iterations <= 6


@pytest.mark.parametrize(
    ("method", "limit", "what", "reason"),
    [
        (active_set, "_MOST_STEPS", "Newton's method on the active set", "MAX_ITERAT"),
        (truncated_newton, "_MOST_MINIMISING", "the truncated Newton minimisation", "MAX_ITERAT"),
        (truncated_newton, "_MOST_SETS", "the truncated Newton minimisation", "CONTACTING_SET"),
    ],
)
def test_running_out_is_an_error(cluster, monkeypatch, method, limit, what, reason):
    monkeypatch.setattr(hertz_pairs if method is active_set else paper, limit, 1)
    with pytest.raises(NotConverged, match=f"^{what} did not converge: {reason}.* after"):
        method(problem(cluster, 5e-3), np.zeros(7))


def test_step_that_never_gains_is_an_error():
    def worse(point):
        return None, 1.0 + np.abs(point)

    message = "^a damped Newton step did not converge: LINE_SEARCH after 1 iterations; lower load"
    with pytest.raises(NotConverged, match=message):
        damped_step(worse, np.zeros(2), np.ones(2), np.full(2, 0.3))
