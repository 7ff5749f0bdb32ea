"""Connected contacts and the correction of their area."""

import numpy as np
import pytest

from patchlaw.micro import find_spots
from patchlaw.micro.half_space.read_off import EDGE_EXCESS, true_area


def pressure_map():
    """Two contacts on a plain map that become one over the borders of a period."""
    pressure = np.zeros((6, 5))
    pressure[0, 1:3] = 1.0, 4.0
    pressure[5, 2] = 2.0
    pressure[3, 4] = 3.0
    return pressure


def test_contacts_of_a_plain_map():
    spots, _share = find_spots(pressure_map(), (0.5, 2.0), periodic=False)
    assert len(spots) == 3
    assert sorted(spots.force.tolist()) == [2.0, 3.0, 5.0]  # cells of 1 mm²
    large = int(np.argmax(spots.force))
    assert spots.peak_pressure[large] == 4.0
    assert spots.place[large].tolist() == [0.25, 5.0]  # centre of the cell (0, 2)


def test_contacts_join_over_the_border_of_a_period():
    spots, _share = find_spots(pressure_map(), (0.5, 2.0), periodic=True)
    assert len(spots) == 2
    assert sorted(spots.force.tolist()) == [3.0, 7.0]


@pytest.mark.parametrize("periodic", [False, True])
def test_sums_are_those_of_the_map(periodic):
    rng = np.random.default_rng(0)
    pressure = np.where(rng.random((20, 30)) < 0.4, rng.random((20, 30)), 0.0)
    spots, share = find_spots(pressure, (1.0, 1.0), periodic=periodic)
    assert spots.force.sum() == pytest.approx(pressure.sum())
    assert spots.area.sum() == pytest.approx(true_area(pressure > 0, periodic=periodic).sum())
    assert share.sum() == pytest.approx(spots.area.sum())
    assert not share[pressure == 0.0].any()


def test_nothing_in_contact():
    spots, _share = find_spots(np.zeros((4, 4)), (1.0, 1.0), periodic=True)
    assert len(spots) == 0 and spots.place.shape == (0, 2)


def test_edges_that_count():
    lone, corner = np.zeros((2, 5, 5), bool)
    lone[2, 2] = corner[0, 0] = True
    assert true_area(lone, periodic=False)[2, 2] == pytest.approx(1.0 - 4.0 * EDGE_EXCESS)
    assert true_area(corner, periodic=False)[0, 0] == pytest.approx(1.0 - 2.0 * EDGE_EXCESS)
    assert true_area(corner, periodic=True)[0, 0] == pytest.approx(1.0 - 4.0 * EDGE_EXCESS)
    assert np.all(true_area(np.ones((3, 4), bool), periodic=True) == 1.0)
