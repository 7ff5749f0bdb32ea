"""A few of the random scenes of ``benchmarks/scene_campaign.py``, with all invariants."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.random_scenes import KINDS, drawn
from helpers.scene_invariants import Found, checks

SEEDS = (3, 8, 12, 39, 56, 74, 126)


@pytest.mark.long
@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=[pytest.mark.long] * (seed != 12)) for seed in SEEDS],
)
def test_what_must_hold_of_any_scene(seed, tmp_path):
    # tables of few rows: what holds of any scene holds whatever their error
    found = list(checks(replace(drawn(seed), tolerance=1e-2), tmp_path))
    assert len(found) > 8
    assert "force hit" in {one.invariant for one in found}  # something touches
    assert [one for one in found if not one.holds] == []


@pytest.mark.long
def test_a_plane_that_may_turn_on_two_cells_does_not_touch_a_third_with_rounding(tmp_path):
    """Two cells opposite each other hold half the approach, whatever the tilt about their line."""
    case = drawn(48022)
    half, whole = 0.5 * case.approach, case.approach
    history = case.history(tmp_path, approach=[half, whole, half], steps=1)
    np.testing.assert_allclose(history.force_N[2], history.force_N[0], rtol=1e-8)  # the residual
    assert history.tilt_x[2] != history.tilt_x[0]  # which nothing determines
    assert history.contact_area_fraction[2] == history.contact_area_fraction[0]


def test_the_scenes_are_of_all_kinds():
    assert {drawn(seed).kind for seed in SEEDS} == set(KINDS)
    assert any(drawn(seed).story.startswith("caps") for seed in SEEDS)
    assert any(drawn(seed).friction is not None and drawn(seed).leak for seed in SEEDS)


def test_a_scene_is_drawn_again():
    one, other = drawn(3), drawn(3)
    assert str(one) == str(other)
    np.testing.assert_array_equal(one.heights, other.heights)


def test_what_is_missed_does_not_hold():
    assert not Found("sums", 2e-12, 1e-12).holds
    assert not Found("sums", float("nan"), 1e-12).holds
