"""How a block yields where contacts are: limits, derivatives and refusals."""

import numpy as np
import pytest
from multiscale.couplings.yielding import SpreadLoads, UniformLoads
from multiscale.law_tables.spread import ContactSpread, divides

from geometry import PatchGrid
from geometry.errors import InputError
from multiscale.laws import LawPoint

PATCHES = PatchGrid(grid=(2, 1), lengths=(2.0, 1.0))
LOADS = PatchGrid(grid=(4, 2), lengths=(2.0, 1.0))
BOTH = np.arange(2)
LEAN = np.array([-1e-3, 1e-3])
APPROACH = np.linspace(0.0, 8e-3, 9)[:, None] + LEAN


def spread(loads=LOADS, correction=None, seed=0):
    """Forces that begin at different rows and grow by different powers."""
    rng = np.random.default_rng(seed)
    touch = rng.uniform(0.0, 4e-3, loads.count)
    power = rng.uniform(1.2, 2.0, loads.count)
    above = np.maximum(np.linspace(0.0, 8e-3, 9)[:, None] - touch, 0.0)
    if correction is None:
        correction = np.zeros((loads.count, loads.count))
    return ContactSpread(
        patches=PATCHES,
        loads=loads,
        approach=APPROACH,
        forces=1e3 * above**power,
        correction=correction,
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
    share, change = found.shares(APPROACH[6])
    row = found.forces[6]
    np.testing.assert_allclose(share, row / np.bincount(found.owner, row)[found.owner], rtol=1e-12)
    np.testing.assert_allclose(np.bincount(found.owner, share), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.bincount(found.owner, change), 0.0, atol=1e-9)


def test_change_is_the_derivative_of_the_shares():
    found = spread()
    local, h = 5.3e-3 + LEAN, 1e-7
    ahead, behind = (found.shares(local + side * h)[0] for side in (1, -1))
    np.testing.assert_allclose(found.shares(local)[1], (ahead - behind) / (2 * h), rtol=1e-5)


def test_nothing_moves_outside_the_rows():
    found = spread()
    for local in (LEAN - 1e-3, LEAN + 1e-2):
        share, change = found.shares(local)
        assert not change.any()
        np.testing.assert_array_equal(share, found.shares(local + 1e-4)[0])


def test_without_any_load_shares_are_equal():
    found = ContactSpread(
        patches=PATCHES,
        loads=LOADS,
        approach=APPROACH,
        forces=np.zeros((9, 8)),
        correction=np.zeros((8, 8)),
    )
    np.testing.assert_allclose(found.shares(np.array([2e-3, 2e-3]))[0], 0.25)


def test_one_rectangle_per_patch_is_a_compliance():
    half_space, correction = matrices(PATCHES)
    block = SpreadLoads(half_space, spread(PATCHES, correction))
    plain = UniformLoads(half_space + correction * PATCHES.area)
    local = np.array([3e-3, 6e-3])
    at = point(local)
    np.testing.assert_allclose(
        block.displacement(local, at), plain.displacement(local, at), rtol=1e-13
    )
    np.testing.assert_allclose(
        block.slope(local, at, BOTH), plain.slope(local, at, BOTH), rtol=1e-13
    )


def test_equal_correction_everywhere_needs_no_places():
    half_space, _ = matrices(LOADS)
    block = SpreadLoads(half_space, spread(correction=np.full((8, 8), 2e-4)))
    local = np.array([3e-3, 6e-3])
    at = point(local)
    expected = half_space @ at.pressure + 2e-4 * at.pressure.sum() * PATCHES.area
    np.testing.assert_allclose(block.displacement(local, at), expected, rtol=1e-12)


@pytest.mark.parametrize("local", [(3.3e-3, 6.1e-3), (1.2e-3, 4.4e-3), (-5e-4, 9.9e-3)])
def test_slope_is_the_derivative(local):
    half_space, correction = matrices(LOADS)
    block = SpreadLoads(half_space, spread(correction=correction))
    local, h = np.array(local), 1e-8
    slope = block.slope(local, point(local), BOTH)
    np.testing.assert_array_equal(block.slope(local, point(local), BOTH[1:]), slope[:, 1:])
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
        (
            {"loads": PatchGrid(grid=(3, 2), lengths=(2.0, 1.0))},
            r"the rectangles of the loads must divide the patches",
        ),
        ({"forces": np.zeros((3, 8))}, "rows of a spread do not fit"),
        ({"approach": np.zeros((9, 3))}, "rows of a spread do not fit"),
        ({"correction": np.zeros((8, 7))}, "rows of a spread do not fit"),
    ],
)
def test_what_does_not_fit_is_refused(changes, text):
    content = {
        "patches": PATCHES,
        "loads": LOADS,
        "approach": APPROACH,
        "forces": np.zeros((9, 8)),
        "correction": np.zeros((8, 8)),
    }
    with pytest.raises(InputError, match=text):
        ContactSpread(**(content | changes))


def test_loads_must_divide_the_patches():
    odd = PatchGrid(grid=(3, 3), lengths=PATCHES.lengths)
    assert not divides(odd, PATCHES) and divides(LOADS, PATCHES) and divides(PATCHES, PATCHES)
    beyond = PatchGrid(grid=(4, 1), lengths=(4.0, 1.0))  # lines on all borders, and more outside
    assert not divides(beyond, PATCHES)
