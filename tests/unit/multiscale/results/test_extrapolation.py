"""Values at mesh size zero lie inside their error bars, on sequences whose limit is known."""

import numpy as np
import pytest

from patchlaw.multiscale import extrapolated
from patchlaw.support import InputError

LIMIT = 4.0
RATIOS = (2.0 ** (1 / 3), 1.5, 2.0)


def sequences(meshes, ratio, order, *, count=2000, seed=0, least=-0.4, most=3.0, noise=0.0):
    """Return results of c + a hᵖ (1 + b h) with noise, a share of the finest error; the sizes."""
    random = np.random.default_rng(seed)
    sizes = ratio ** np.arange(meshes - 1.0, -1.0, -1.0)
    factor = random.choice([-1.0, 1.0], count) * random.uniform(0.01, 1.0, count)
    bend = random.uniform(least, most, count) / sizes[0]
    h = sizes[:, None]
    errors = factor * h**order * (1.0 + bend * h)
    shaken = errors + noise * errors[-1] * random.uniform(-1.0, 1.0, errors.shape)
    return LIMIT + shaken, sizes


def missed(estimate):
    """Return the share of error bars without the limit."""
    return np.mean(np.abs(estimate.value - LIMIT) > estimate.error * (1.0 + 1e-9))


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("ratio", [1.5, 2.0, 4.0])
def test_two_meshes_of_known_order_contain_the_limit(order, ratio):
    sizes = np.array([ratio, 1.0])
    bend = np.linspace(-0.4, 30.0, 400) / ratio  # and far beyond where h² matters less than h
    values = LIMIT - 0.1 * sizes[:, None] ** order * (1.0 + bend * sizes[:, None])
    estimate = extrapolated(values, sizes, order)
    assert missed(estimate) == 0.0
    assert np.all(estimate.rate == order)


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("ratio", RATIOS)
def test_three_meshes_contain_the_limit(order, ratio):
    values, sizes = sequences(3, ratio, order)
    assert missed(extrapolated(values, sizes, order)) == 0.0


def test_known_scatter_covers_noise():
    """Errors of the finest mesh of 1 %, and noise of single meshes of up to that."""
    random = np.random.default_rng(4)
    h = np.array([2.0, 1.0])
    values = LIMIT * (1.0 + 0.01 * h[:, None] ** 2 + 0.01 * random.uniform(-1, 1, (2, 2000)))
    assert missed(extrapolated(values, h, 2.0, 0.0)) > 0.0
    assert missed(extrapolated(values, h, 2.0, 0.017)) == 0.0  # 4/3 and 1/3 of it


@pytest.mark.parametrize("meshes", [2, 3])
def test_pure_powers_are_exact(meshes):
    sizes = np.array([1.7, 1.3, 1.0][-meshes:])
    for order in (0.7, 1.0, 2.0, 3.5):
        estimate = extrapolated(LIMIT + 0.3 * sizes[:, None] ** order, sizes, order)
        assert estimate.value[0] == pytest.approx(LIMIT, abs=1e-12)  # rounding
        assert estimate.rate[0] == order
        assert estimate.error[0] > 0.01  # the bar does not claim to be exact


def test_bar_is_of_the_size_of_the_error():
    """A bar that contains everything tells nothing."""
    values, sizes = sequences(3, 2.0**0.25, 4.0, least=0.0, most=0.1)
    finest = np.abs(values[-1] - LIMIT)
    assert np.median(extrapolated(values, sizes, 4.0).error / finest) < 1.5


def test_a_mesh_between_that_disagrees_widens_the_bar():
    h = np.array([2.0, np.sqrt(2.0), 1.0])
    values = LIMIT + 0.1 * h[:, None]
    two, three = (extrapolated(values[at], h[at], 2.0) for at in ([0, 2], [0, 1, 2]))
    assert three.value == pytest.approx(two.value)
    off = abs(values[1, 0] - (values[2, 0] + (two.value[0] - values[2, 0]) * (1.0 - 2.0)))
    assert three.error[0] == pytest.approx(two.error[0] + off)
    assert off > 0.005


def test_swinging_results_contain_the_limit():
    random = np.random.default_rng(3)
    error = random.uniform(0.2, 1.0, (3, 500)) * np.array([[4.0], [-2.0], [1.0]])
    assert missed(extrapolated(LIMIT + error, [4.0, 2.0, 1.0], 1.0)) == 0.0


def test_accidental_agreement_is_not_believed():
    estimate = extrapolated([[1.1, 2.2, 3.0, 4.4], [1.0, 2.0, 3.0, 4.0]], [2.0, 1.0], 2.0)
    relative = estimate.error / [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(relative, np.array([1.0, 1.0, 0.5, 1.0]) * relative[0], rtol=1e-12)


def test_no_contact_has_no_error():
    estimate = extrapolated(np.zeros((3, 2)), [4.0, 2.0, 1.0], 2.0)
    assert np.all(estimate.value == 0.0)
    assert np.all(estimate.error == 0.0)
    assert np.isnan(estimate.rate).all()


def test_one_mesh_has_no_bar():
    estimate = extrapolated([[1.0, 2.0]], [1.0])
    assert np.all(estimate.value == [1.0, 2.0])
    assert np.isnan(estimate.error).all()
    assert np.isnan(estimate.rate).all()


@pytest.mark.parametrize(
    ("values", "sizes", "order", "text"),
    [
        (np.zeros((2, 1)), [1.0, 2.0], 2.0, "mesh sizes must fall"),
        (np.zeros((2, 1)), [2.0, 1.0], None, "meshes alone show no rate"),
        (np.zeros((2, 1)), [3.0, 2.0, 1.0], 2.0, "results and mesh sizes do not fit together"),
        (np.zeros((2, 1)), [2.0, 1.0], 0.0, "the order must be positive"),
    ],
)
def test_what_does_not_fit_is_refused(values, sizes, order, text):
    with pytest.raises(InputError, match=text):
        extrapolated(values, sizes, order)
