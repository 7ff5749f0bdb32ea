"""The cost of micro models: what it grows with, and the part of a grid that is solved."""

from __future__ import annotations

import numpy as np
import pytest

from micro.choice.models import contact_box_share, solution_seconds


def test_the_box_of_a_cap_grows_with_the_load():
    x = np.linspace(-1.0, 1.0, 101)
    cap = 0.25 - x[:, None] ** 2 - x**2  # touched within a radius of 0.5 at the largest load
    # at loads of 1/4, 1/2, 3/4 and 1 of it, squares of about twice the radii 0.5 √load
    expected = np.mean([load for load in (0.25, 0.5, 0.75, 1.0)]) * 0.25
    assert contact_box_share(cap) == pytest.approx(expected, rel=0.06)  # whole cells


def test_nothing_touched_is_one_cell():
    assert contact_box_share(np.full((8, 4), -1.0)) == 1 / 32


def test_asperities_interact_each_with_each():
    one, two = (solution_seconds("elliptic", 0, box=1.0, summits=n) for n in (10_000, 20_000))
    assert two == pytest.approx(4.0 * one, rel=0.05)


def test_half_spaces_cost_what_their_box_does():
    part, whole = (solution_seconds("half-space", 512**2, box=b, summits=0) for b in (0.1, 1.0))
    assert 5.0 * part < whole < 10.0 * part
    assert solution_seconds("half-space", 1024**2, box=1.0, summits=0) > 4.0 * whole
