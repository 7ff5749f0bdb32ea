"""Errors of worn depths where a share of the force is not known, or there is no force."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw.multiscale.models.measured_errors.errors import MeasuredErrors, WearErrors


def step(force, mean, *, by_force):
    return SimpleNamespace(
        force_N=force, mean_worn_depth_mm=mean, worn_depth_mm=4.0 * mean, by_force=by_force,
        contact_area_fraction=0.1, errors=(),
    )  # fmt: skip


def worn(here, past=(), zero=0.0, **parts):
    known = {cause: np.array([error, 0.0, 0.0]) for cause, error in parts.items()}
    errors = MeasuredErrors(by_cause=known, stiffness=0.0, zero=zero)
    return errors.with_wear(here, past, WearErrors((0.0,) * 6)).worn


def test_a_mean_depth_under_a_force_is_exact_where_a_cause_is_not_known():
    found = worn(step(20.0, 1e-4, by_force=True), slopes=math.inf)
    assert found["slopes"].tolist() == [0.0, math.inf]


@pytest.mark.parametrize("force", [0.0, np.float64(0.0)])
def test_a_surface_that_has_worn_clear_of_the_plane_errs_by_no_more_than_the_zero(force):
    """What it bore before is known; what its force erred by then is not."""
    past = [step(5.0, 1e-4, by_force=False)]
    found = worn(step(force, 2e-4, by_force=False), past, zero=1e-5, body=0.0, grid=0.1)
    assert found["body"].tolist() == found["wear"].tolist() == [0.0, 0.0]
    assert found["grid"].tolist() == [math.inf, math.inf]
    only_zero = MeasuredErrors(by_cause={"zero": np.array([0.1, 0, 0])}, stiffness=0.0, zero=1e-5)
    here = step(force, 2e-4, by_force=False)
    nearer = only_zero.with_wear(here, past, WearErrors((0.0,) * 6)).worn["zero"]
    assert nearer.tolist() == [1e-5, 1e-5]
