"""The periodic half-space model against Green's function molecular dynamics.

Contact areas and elastic energies of self-affine surfaces from a few to 94 per cent of contact,
mean values of Y. Zhou's simulations in the data of xylcsi/PerssonModelFudgeFactor (commit d3341a6,
Area_GFMD_Zhou.mat and Uel_GFMD_Zhou.mat). Hurst exponent 0.8, no roll-off, angular wavenumbers from
1e4 to 1e6 1/m, rms height 6 µm, E* = 1 Pa.
"""

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel

HURST, LOWEST, HEIGHT = 0.8, 10.0, 6e-3  # 1/mm, mm
PRESSURES = np.array([0.005, 0.025, 0.113, 0.24])
"""Mean pressure / E*."""
AREAS = np.array([0.0399348, 0.1852442, 0.6571422, 0.9405832])
ENERGIES = np.array([1.311382e-8, 6.812624e-8, 1.880270e-7, 2.199568e-7])
"""Contact area fraction, and elastic energy over nominal area and E* [m]."""


def surface(waves, cells, seed):
    """Draw a period of so many times the longest wave.

    The number is no whole one: waves on a lattice have the continuous spectrum's rms height,
    rms gradient and energy together only with some, 1.25 and 3.45 among them (to 0.5 %; with 1 the
    rms height squared is 72 % too large).
    """
    length = waves * 2.0 * np.pi / LOWEST
    scale = HEIGHT**2 * HURST / (np.pi * LOWEST ** (-2 * HURST) * (1.0 - 100.0 ** (-2 * HURST)))
    spectrum = Spectrum(
        hurst=HURST,
        waves=(waves, 100.0 * waves),
        s0=scale * (2.0 * np.pi / length) ** (-2 * (1 + HURST)),
        seed=seed,
    )
    return synthesise(spectrum, grid=(cells, cells), lengths=(length, length))


def found(rough, pressures):
    """Return counted and corrected areas and energies of the surface in their units."""
    model = HalfSpaceModel(rough, contact_modulus=1.0, periodic=True, tolerance=1e-6)
    states = [model.press(Control(force=pressure * rough.area)) for pressure in pressures]
    counted, corrected, energy = np.transpose(
        [
            (state.in_contact.mean() * rough.area, state.contact_area, state.elastic_energy)
            for state in states
        ]
    )
    return counted / rough.area, corrected / rough.area, energy / rough.area * 1e-3  # mm to m


@pytest.mark.parametrize(
    ("waves", "cells", "first"),
    [(1.25, 320, 2), pytest.param(3.45, 1176, 0, marks=pytest.mark.long)],
)
def test_areas_and_energies(waves, cells, first):
    """Their cells are not stated; 3.4 to the shortest wave give their counted areas at all loads.

    Counting adds to the area what the perimeter correction takes off again.
    """
    counted, corrected, energy = found(surface(waves, cells, seed=1), PRESSURES[first:])
    # 1.6 % at most with seeds 1 and 2 of the larger surface, 3.5 cells to the shortest wave and
    # more; 1.5 % with the smaller one's 2.6
    assert counted == pytest.approx(AREAS[first:], rel=0.025)
    # what counting adds is more than 0.5 % of the area, up to 94 % of contact
    assert np.all(corrected < 0.995 * AREAS[first:])
    # two seeds differ by 4.6 % at the smallest load, their own runs by 4.4 % (standard deviation)
    assert energy == pytest.approx(ENERGIES[first:], rel=0.05)
