"""How a block yields where contacts are: limits, derivatives and refusals."""

import numpy as np
import pytest

from geometry import PatchGrid
from geometry.errors import InputError
from multiscale.laws import LawPoint
from multiscale.spread import ContactSpread
from multiscale.yielding import SpreadLoads, UniformLoads

PATCHES = PatchGrid(grid=(2, 1), lengths=(2.0, 1.0))
LOADS = PatchGrid(grid=(4, 2), lengths=(2.0, 1.0))
APPROACH = np.linspace(0.0, 8e-3, 9)
LEAN = np.array([-1e-3, 1e-3])


def spread(loads=LOADS, seed=0):
    """Forces that begin at different rows and grow by different powers."""
    rng = np.random.default_rng(seed)
    touch = rng.uniform(0.0, 4e-3, loads.count)
    power = rng.uniform(1.2, 2.0, loads.count)
    above = np.maximum(APPROACH[:, None] - touch, 0.0)
    return ContactSpread(
        patches=PATCHES, loads=loads, approach=APPROACH, lean=LEAN, forces=1e3 * above**power
    )


def point(local):
    """Laws p = 50 (s/mm)^1.5 MPa with closure s − p/1000."""
    rise = np.maximum(local, 0.0)
    pressure, slope = 50.0 * rise**1.5, 75.0 * np.sqrt(rise)
    return LawPoint(local - pressure / 1e3, pressure, 1.0 - slope / 1e3, slope)


def matrices(loads, seed=1):
    rng = np.random.default_rng(seed)
    part = rng.uniform(-1.0, 1.0, (loads.count, loads.count))
    return 1e-3 * np.eye(2), 1e-3 * (part + part.T)


def test_shares_add_up_and_are_the_rows_there():
    found = spread()
    shares = found.shares(APPROACH[6] + LEAN)
    row = found.forces[6]
    totals = np.bincount(found.owner, row)
    np.testing.assert_allclose(shares.force, row / totals[found.owner], rtol=1e-12)
    for part in (shares.force, shares.stiffness):
        np.testing.assert_allclose(np.bincount(found.owner, part), 1.0, rtol=1e-12)
    for part in (shares.dforce, shares.dstiffness):
        np.testing.assert_allclose(np.bincount(found.owner, part), 0.0, atol=1e-9)


def test_stiffness_shares_are_those_of_growing_forces():
    found = spread()
    local, h = 5.3e-3 + LEAN, 1e-7
    ahead, behind = (found.shares(local + side * h).force for side in (1, -1))
    shares = found.shares(local)
    # the derivative of the share is what a larger share in stiffness makes of it
    np.testing.assert_allclose(shares.dforce, (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-4)


def test_nothing_moves_outside_the_rows():
    found = spread()
    for local in (LEAN - 1e-3, LEAN + 1e-2):
        shares, next_to = found.shares(local), found.shares(local + 1e-4)
        assert not shares.dforce.any() and not shares.dstiffness.any()
        np.testing.assert_array_equal(shares.force, next_to.force)


def test_without_any_load_shares_are_equal():
    found = ContactSpread(
        patches=PATCHES, loads=LOADS, approach=APPROACH, lean=LEAN, forces=np.zeros((9, 8))
    )
    np.testing.assert_allclose(found.shares(np.array([2e-3, 2e-3])).force, 0.25)


def test_one_rectangle_per_patch_is_a_compliance():
    half_space, correction = matrices(PATCHES)
    block = SpreadLoads(half_space, correction, spread(PATCHES))
    plain = UniformLoads(half_space + correction * PATCHES.area)
    local = np.array([3e-3, 6e-3])
    at = point(local)
    np.testing.assert_allclose(
        block.displacement(local, at), plain.displacement(local, at), rtol=1e-13
    )
    np.testing.assert_allclose(block.slope(local, at), plain.slope(local, at), rtol=1e-13)


def test_equal_correction_everywhere_needs_no_places():
    half_space, _ = matrices(LOADS)
    block = SpreadLoads(half_space, np.full((8, 8), 2e-4), spread())
    local = np.array([3e-3, 6e-3])
    at = point(local)
    expected = half_space @ at.pressure + 2e-4 * at.pressure.sum() * PATCHES.area
    np.testing.assert_allclose(block.displacement(local, at), expected, rtol=1e-12)


@pytest.mark.parametrize("local", [(3.3e-3, 6.1e-3), (1.2e-3, 4.4e-3), (-5e-4, 9.9e-3)])
def test_slope_is_the_derivative(local):
    block = SpreadLoads(*matrices(LOADS), spread())
    local, h = np.array(local), 1e-8
    slope = block.slope(local, point(local))
    for j in range(2):
        step = h * np.eye(2)[j]
        ahead, behind = (
            block.displacement(local + side * step, point(local + side * step)) for side in (1, -1)
        )
        # central differences of smooth pieces: rounding of 1e-16 / h
        np.testing.assert_allclose(slope[:, j], (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"loads": PatchGrid(grid=(3, 2), lengths=(2.0, 1.0))}, r"must divide .*multiples of"),
        ({"forces": np.zeros((3, 8))}, "rows of a spread do not fit"),
        ({"lean": np.zeros(3)}, "rows of a spread do not fit"),
    ],
)
def test_what_does_not_fit_is_refused(changes, text):
    content = {
        "patches": PATCHES,
        "loads": LOADS,
        "approach": APPROACH,
        "lean": LEAN,
        "forces": np.zeros((9, 8)),
    }
    with pytest.raises(InputError, match=text):
        ContactSpread(**(content | changes))
