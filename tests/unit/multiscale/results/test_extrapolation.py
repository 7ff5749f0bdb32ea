"""Values at mesh size zero lie inside their error bars, on sequences whose limit is known."""

import numpy as np
import pytest

from multiscale.results.extrapolation import extrapolated
from support.errors import InputError

LIMIT = 4.0
RATIOS = (2.0 ** (1 / 3), 1.5, 2.0)


def sequences(meshes, ratio, *, count=2000, seed=0, least=-0.4, most=3.0, noise=0.0):
    """Return results of c + a hᵖ (1 + b h) with noise, the sizes, and the rates p."""
    random = np.random.default_rng(seed)
    sizes = ratio ** np.arange(meshes - 1.0, -1.0, -1.0)
    rate = random.uniform(0.8, 4.0, count)
    factor = random.choice([-1.0, 1.0], count) * random.uniform(0.01, 1.0, count)
    bend = random.uniform(least, most, count) / sizes[0]
    h = sizes[:, None]
    errors = factor * h**rate * (1.0 + bend * h)
    shaken = errors + noise * errors[-1] * random.uniform(-1.0, 1.0, errors.shape)
    return LIMIT + shaken, sizes, rate


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


@pytest.mark.parametrize("order", [None, 2.0])
@pytest.mark.parametrize("ratio", RATIOS)
def test_three_meshes_contain_the_limit(order, ratio):
    values, sizes, _ = sequences(3, ratio)
    estimate = extrapolated(values, sizes, order)
    # those outside have b h < −0.3 and show a rate that is twice too small
    assert missed(estimate) < 0.002


@pytest.mark.parametrize(("ratio", "noise"), [(2.0 ** (1 / 3), 0.03), (1.5, 0.1), (2.0, 0.2)])
def test_noise_is_survived(ratio, noise):
    """Shares of the finest mesh's error, as contacts by whole nodes give; rates 0.8 to 4."""
    values, sizes, _ = sequences(3, ratio, noise=noise)
    assert missed(extrapolated(values, sizes, 2.0)) < 0.05


@pytest.mark.parametrize("meshes", [2, 3])
def test_pure_powers_are_exact(meshes):
    sizes = np.array([1.7, 1.3, 1.0][-meshes:])
    rates = np.array([0.7, 1.0, 2.0, 3.5])
    values = LIMIT + 0.3 * sizes[:, None] ** rates
    for i, rate in enumerate(rates):
        estimate = extrapolated(values[:, [i]], sizes, None if meshes == 3 else rate)
        assert estimate.value[0] == pytest.approx(LIMIT, abs=1e-12)  # rounding
        assert estimate.rate[0] == pytest.approx(rate, abs=1e-9)
        assert estimate.error[0] > 0.01  # the bar does not claim to be exact


def test_bar_is_of_the_size_of_the_error():
    """A bar that contains everything tells nothing."""
    values, sizes, rate = sequences(3, 1.5, least=0.0, most=0.5)
    usual = (rate > 1.0) & (rate < 2.5)
    finest = np.abs(values[-1] - LIMIT)
    relative = (extrapolated(values, sizes, 2.0).error / finest)[usual]
    assert np.median(relative) < 1.5


def test_nothing_is_observed_where_nothing_converges():
    sizes = np.array([4.0, 2.0, 1.0])
    swinging, slow, growing = [4.2, 3.9, 4.1], [4.3, 4.2, 4.11], [4.01, 4.05, 4.2]
    values = np.transpose([swinging, slow, growing])
    estimate = extrapolated(values, sizes, 2.0)
    assert np.isnan(estimate.rate).all()
    assert estimate.value == pytest.approx(values[-1])
    assert np.all(estimate.error >= np.ptp(values, axis=0))


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
        (np.zeros((2, 1)), [2.0, 1.0], None, "two meshes show no rate"),
        (np.zeros((2, 1)), [3.0, 2.0, 1.0], 2.0, "results and mesh sizes do not fit together"),
        (np.zeros((2, 1)), [2.0, 1.0], 0.0, "the order must be positive"),
    ],
)
def test_what_does_not_fit_is_refused(values, sizes, order, text):
    with pytest.raises(InputError, match=text):
        extrapolated(values, sizes, order)
