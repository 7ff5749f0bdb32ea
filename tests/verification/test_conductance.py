"""Conductance of contacts: spots in closed form, and the potential problem solved by itself."""

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import (
    conductance_per_area,
    gas_conductance,
    pair_conductivity,
    radiation_conductance,
    total_conductance,
)
from patchlaw.support import InputError

MODULUS = 3000.0


def potential(touching, spacing):
    """Return the flow [mm] into isothermal cells of a half-space at unit temperature and k = 1/2.

    And the mean temperature of all cells.

    Uniform flow q on a rectangle warms a half-space by q/(2π k) ∫ dA/r, whose integral over
    rectangles is Love's of a uniform pressure. The dense system is solved for a temperature of one
    at all centres.
    """
    x, y = (np.array(np.nonzero(np.ones_like(touching))).T * spacing).T
    a, b = 0.5 * np.asarray(spacing)
    touching = touching.ravel()

    def corner(u, v):
        return u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v))

    u, v = x[:, None] - x[touching], y[:, None] - y[touching]
    kernel = (
        corner(u + a, v + b) - corner(u - a, v + b) - corner(u + a, v - b) + corner(u - a, v - b)
    )
    flow = np.linalg.solve(kernel[touching] / np.pi, np.ones(int(touching.sum())))
    return float(flow.sum()) * 4 * a * b, float((kernel @ flow).mean()) / np.pi


@pytest.mark.parametrize("cells", [64, pytest.param(256, marks=pytest.mark.long)])
def test_one_circular_spot_conducts_4_k_a(cells):
    x = (np.arange(cells) + 0.5) / cells - 0.5
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2) / 10.0, lengths=(1.0, 1.0))
    model = HalfSpaceModel(sphere, contact_modulus=MODULUS)
    state = model.press(Control(approach=2e-2))
    radius = np.sqrt(5.0 * 2e-2)  # Hertz
    stiffness = model.stiffness(state).approach
    found = total_conductance(stiffness, MODULUS, pair_conductivity([40.0]))
    assert found == pytest.approx(4 * 40.0 * radius * 1e-3, rel=5e-3 * (256 / cells) ** 0.5)


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_rough_contact_is_the_isothermal_one(seed):
    spectrum = Spectrum(hurst=0.8, waves=(2, 8), rms_slope=0.2, seed=seed)
    surface = synthesise(spectrum, grid=(48, 40), lengths=(1.0, 0.8))
    model = HalfSpaceModel(surface, contact_modulus=MODULUS, tolerance=1e-10)
    state = model.press(Control(approach=2e-2))
    assert 40 < np.count_nonzero(state.in_contact) < 800
    stiffness = model.stiffness(state)
    flow, mean = potential(state.in_contact, model.surface.spacing)
    assert stiffness.approach / MODULUS == pytest.approx(flow, rel=1e-8)
    # the interface has the temperature between the spots and the mean of what lies behind them
    assert 0.1 < mean < 0.9
    # the mean is found in single precision, and leaves 0.1 to 0.9 of it in the denominator
    assert stiffness.interface / MODULUS == pytest.approx(flow / (1.0 - mean), rel=1e-5)


def test_conductances_of_two_bodies_are_in_series():
    assert pair_conductivity([50.0, 0.2]) == pytest.approx(1 / (1 / 50.0 + 1 / 0.2))
    assert total_conductance(6.0, 3000.0, 25.0) == pytest.approx(1e-4)  # 2 · 25 W/m/K · 2 µm
    # a spot per mm²: the same number per 1e-6 m²
    assert conductance_per_area(6.0, 3000.0, 25.0) == pytest.approx(100.0)
    for wrong in ([], [1.0, -2.0], [0.0], [1.0, 2.0, 3.0], [np.inf]):
        with pytest.raises(InputError, match="conductivities"):
            pair_conductivity(wrong)


def test_air_gap_and_radiation():
    assert gas_conductance([1e-2], 0.026) == pytest.approx(2600.0)  # 26 mW/m/K over 10 µm
    # half of the area in contact; the gas in a wedge: k ln(1 + G/M)/G
    assert gas_conductance([0.0, 1e-2], 0.026) == pytest.approx(1300.0)
    assert gas_conductance([1e-18, 1e-2], 0.026) == pytest.approx(1300.0)  # no gap but rounding
    assert gas_conductance([0.0, 1e-2], 0.026, 3e-3) == pytest.approx(1000.0)
    wedge = (np.arange(1000) + 0.5) * 1e-5
    expected = 26.0 * np.log(1.0 + 10.0 / 0.4) / 1e-2
    assert gas_conductance(wedge, 0.026, 4e-4) == pytest.approx(expected, rel=1e-4)  # midpoints
    # black faces at 300 K: 4 σ T³ = 6.12 W/m²/K (Incropera, table of radiation coefficients)
    assert radiation_conductance(300.0, 1.0) == pytest.approx(6.124, rel=1e-3)


def test_contacts_that_yield_conduct_as_others():
    """Unloading begins on the same cells, which then bear less than the hardness."""
    spectrum = Spectrum(hurst=0.8, waves=(2, 10), rms_slope=0.2, seed=5)
    rough = synthesise(spectrum, grid=(48, 48), lengths=(1.0, 1.0))
    model = HalfSpaceModel(rough, contact_modulus=MODULUS, hardness=150.0, tolerance=1e-10)
    state = model.press(Control(approach=8e-3))
    assert np.count_nonzero(state.yielding) > 0.3 * np.count_nonzero(state.in_contact)
    step = 1e-8
    back = model.press(Control(approach=8e-3 - step), start=state.start)
    rate = (state.force - back.force) / step
    unloading = model.unloading_stiffness(state)
    assert unloading.approach == pytest.approx(rate, rel=1e-3)
    closed = back.gap.mean() - state.gap.mean()
    assert unloading.interface == pytest.approx((state.force - back.force) / closed, rel=1e-3)
    assert model.stiffness(state).approach < 0.9 * rate
