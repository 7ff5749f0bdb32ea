"""The frontier against brute force, and the comparison as plain records."""

import tomllib

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Comparison, Scene
from patchlaw.multiscale.runs.cases import CaseResult
from patchlaw.multiscale.runs.comparison import NO_ERRORS, Row
from patchlaw.support import InputError

SCENE = Scene.from_dict(tomllib.loads(SMALL_SCENE))


def row(name, seconds, error, status="done"):
    result = CaseResult(status=status, measured={"seconds": seconds})
    errors = NO_ERRORS | {"force_max": error, "approach_max": 2 * error}
    return Row(name=name, scene=SCENE, result=result, errors=errors)


def comparison(rows, bar=float("nan"), response="force"):
    return Comparison(
        scene="some", rows=tuple(rows), response=response, measure="best",
        uncertainty=NO_ERRORS | {"force_max": bar},
    )  # fmt: skip


def beaten(one, other, bar):
    """Tell whether another level is at least as good in both, and better in one."""
    mine = one.seconds, max(one.errors["force_max"], bar)
    theirs = other.seconds, max(other.errors["force_max"], bar)
    return theirs != mine and theirs[0] <= mine[0] and theirs[1] <= mine[1]


@pytest.mark.parametrize("bar", [0.0, 3.0])
def test_frontier_is_that_of_brute_force(bar):
    rng = np.random.default_rng(1)
    for _ in range(20):
        # few different values: many ties in time, in error and in both
        values = rng.integers(1, 8, size=(25, 2)).astype(float)
        rows = [row(str(number), *value) for number, value in enumerate(values)]
        oracle = {one.name for one in rows if not any(beaten(one, other, bar) for other in rows)}
        found = comparison(rows, bar).frontier()
        assert {one.name for one in found} == oracle
        assert [one.seconds for one in found] == sorted(one.seconds for one in found)


def test_frontier_leaves_out_what_did_not_end_or_is_unknown():
    rows = [
        row("stopped", 1.0, 0.01, "not converged"),
        row("unmeasured", 1.0, float("nan")),
        row("untimed", float("nan"), 0.01),
        row("slow", 3.0, 0.1),
    ]
    assert [one.name for one in comparison(rows).frontier()] == ["slow"]


def test_an_error_that_is_unknown_is_not_the_uncertainty():
    # such as the distribution of the pressures of a level that carries nothing
    found = comparison([row("unmeasured", 1.0, float("nan")), row("slow", 3.0, 0.1)], bar=0.02)
    assert np.isnan(found.error(found["unmeasured"]))
    assert [one.name for one in found.frontier()] == ["slow"]


def test_response_is_what_the_load_does_not_prescribe():
    rows = [row("one", 1.0, 0.1)]
    assert comparison(rows).error(rows[0]) == 0.1
    assert comparison(rows, response="approach").error(rows[0]) == 0.2


def test_unknown_measure_is_refused():
    with pytest.raises(InputError, match=r"'speed': is no error measure \(allowed: force_max"):
        comparison([row("one", 1.0, 0.1)]).frontier("speed")


def test_records_are_plain():
    found = comparison([row("one", 1.0, 0.1), row("two", 2.0, 0.2)])
    records = found.records()
    assert records[0]["error_force_max"] == 0.1
    assert records[0]["error_area_max"] is None
    assert {type(value) for record in records for value in record.values()} <= {
        str, float, int, bool, type(None),
    }  # fmt: skip
    assert list(records[1]) == list(records[0])
    assert found["two"].seconds == 2.0
    with pytest.raises(KeyError, match="three"):
        found["three"]
