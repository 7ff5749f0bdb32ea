"""Finite slopes of a period in full contact, against the harmonics of a body with a wavy surface.

The body fills z < a cos kx. Airy's function Σ (A_n + B_n z) e^(nkz) cos nkx adds to uniaxial
compression by the mean pressure. Its coefficients leave no traction along x on the true surface and
make this plane there. A layer of it that is free to widen has no resultant along x and y, so that
the resultants of the waves, uniform over its height and of the opposite sign, lift its surface.
"""

import numpy as np
import pytest

from patchlaw.geometry import Control, Material, Surface
from patchlaw.micro import FiniteSlopes, HalfSpaceModel

YOUNG, CELLS, WAVES = 4000.0, 64, 24
X = (np.arange(CELLS) + 0.5) / CELLS


def exact(amplitude, nu, mean):
    """Return pressures at X over Young's modulus and the approach from the flat body's plane."""
    k = 2.0 * np.pi * np.arange(1, WAVES + 1)[:, None]
    h, slope = amplitude * np.cos(2.0 * np.pi * X), -2.0 * np.pi * amplitude * np.sin(2 * np.pi * X)
    growth = np.exp(k * (h - amplitude))
    even, odd = np.cos(k * X) * growth, np.sin(k * X) * growth
    along = np.concatenate([k**2 * even, (2.0 * k + k**2 * h) * even])  # σ_xx by A, then by B
    upright = np.concatenate([-(k**2) * even, -(k**2) * h * even])  # σ_zz
    across = np.concatenate([k**2 * odd, (k + k**2 * h) * odd])  # σ_xz
    raised = (1.0 + nu) * np.concatenate([-k * even, (1.0 - 2.0 * nu - k * h) * even])
    no_traction = np.column_stack([(across - slope * along).T, np.zeros(CELLS)])
    plane = np.column_stack([raised.T, -np.ones(CELLS)])
    conditions = np.concatenate([no_traction, plane])
    wanted = np.concatenate([np.zeros(CELLS), (mean - 1.0) * h])
    size = np.abs(conditions).max(axis=0)
    found = np.linalg.lstsq(conditions / size, wanted, rcond=None)[0] / size
    assert np.abs(conditions @ found - wanted).max() < 1e-10 * amplitude
    waves, height = found[:-1], found[-1]
    along_x = (np.concatenate([k * even, (1.0 + k * h) * even]).T @ waves).mean()
    both = (np.concatenate([0.0 * even, 2.0 * even]).T @ waves).mean()  # of σ_xx and σ_zz
    pressure = mean - (upright - slope * across).T @ waves
    return pressure, -height - nu * (along_x + nu * both)


@pytest.mark.long
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
@pytest.mark.parametrize(("slope", "error"), [(0.05, 4e-5), (0.15, 1e-3), (0.3, 1e-2)])
def test_pressures_fall_and_the_plane_goes_back_as_the_mean_pressure_rises(nu, slope, error):
    """Errors are of third order: 2e-5, 7e-4 and 6.6e-3 of the amplitude of the pressures."""
    amplitude = slope / (2.0 * np.pi)
    heights = np.repeat(amplitude * np.cos(2.0 * np.pi * X)[:, None], 8, axis=1)
    surface = Surface(heights=heights, lengths=(1.0, 0.125), periodic=True)
    slopes = FiniteSlopes(surface, Material(young_modulus=YOUNG, poisson_ratio=nu), periodic=True)
    modulus = YOUNG / (1.0 - nu**2)
    model = HalfSpaceModel(
        surface, contact_modulus=modulus, periodic=True, slopes=(slopes,), tolerance=1e-11
    )
    approaches = []
    for mean in (0.25, 0.5, 0.75):
        state = model.press(Control(force=mean * YOUNG * surface.area))
        assert state.in_contact.all()
        pressure, approach = exact(amplitude, nu, mean)
        off = state.pressures / YOUNG - pressure[:, None]
        assert np.abs(off).max() < error * 0.5 * np.ptp(pressure)
        approaches.append(state.approach - model.reference_height + surface.mean_height)
        assert approaches[-1] == pytest.approx(approach, rel=error)
        # what is flattened falls with the heights, which the mean pressure compresses
        small = np.pi * amplitude * modulus / YOUNG * (1.0 - mean)
        assert 0.5 * np.ptp(pressure) == pytest.approx(small, rel=2.0 * slope**2)
    assert approaches[0] > approaches[1] > approaches[2] > 0.0
