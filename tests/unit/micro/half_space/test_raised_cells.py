"""Cells that finite slopes raise by more than the plane presses them are told."""

import numpy as np
import pytest

from patchlaw.micro.half_space.read_off import raised_by_slopes


@pytest.mark.parametrize(
    ("pressures", "yields", "told"),
    [
        ([10.0, 0.15, 0.0], False, False),  # they bear 1.5 % of the force
        ([10.0, 0.25, 0.0], False, True),
        ([10.0, 0.0, 9.0], False, False),  # raised by less than the plane presses it
        ([100.0] * 99 + [60.0, 0.0], False, True),  # a small share, at more than half the largest
        ([100.0] * 99 + [60.0, 0.0], True, False),
    ],
)
def test_it_takes_a_share_of_the_force_or_of_the_largest_pressure(pressures, yields, told):
    pressure = np.array(pressures)[None]
    by_slopes, interference = np.full(pressure.shape, -1e-3), np.full(pressure.shape, 2e-3)
    interference[0, -2] = 0.5e-3
    yielding = np.zeros(pressure.shape, bool)
    yielding[0, -2] = yields
    warning = raised_by_slopes(pressure, yielding, by_slopes, interference)
    assert ("finite slopes raise 1 cells" in warning) is told
    assert bool(warning) is told
