"""Wear of cells against closed forms, dense matrices and what any wear keeps."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.closed_forms import love_centre
from tests.helpers.dense_contact import dense_contact, matrix_of

RADIUS, MODULUS, FORCE, COEFFICIENT, SLID = 50.0, 1000.0, 0.02, 1e-6, 2e4
"""Of a sphere [mm, MPa, N, mm²/N, mm]."""


def _worn_sphere(increments):
    side, cells = 1.2, 96
    middle = (np.arange(cells) + 0.5) * side / cells - 0.5 * side
    heights = -(middle[:, None] ** 2 + middle**2) / (2.0 * RADIUS)
    model = HalfSpaceModel(Surface(heights=heights, lengths=(side, side)), contact_modulus=MODULUS)
    state = model.press(Control(force=FORCE))
    for slid in np.diff([0.0, *np.geomspace(1.0, SLID, increments)]):
        worn = replace(model, wear=COEFFICIENT * slid)
        state = worn.press(Control(force=FORCE), start=state.start)
    return state


@pytest.mark.long
def test_a_worn_sphere_is_a_cap_under_even_pressure():
    """A cap of radius a and height a²/2R has the volume π a⁴/4R; first order in the increments."""
    cap = (4.0 * RADIUS * COEFFICIENT * FORCE * SLID / np.pi) ** 0.25
    peaks = []
    for increments in (8, 32, 128):
        state = _worn_sphere(increments)
        assert np.sqrt(state.contact_area / np.pi) == pytest.approx(cap, rel=2e-3)
        peaks.append(state.peak_pressure * state.contact_area / FORCE)
    assert peaks[-1] == pytest.approx(1.0, abs=0.02)
    above = np.array(peaks) - 1.0
    assert (above[1:] < 0.3 * above[:-1]).all()  # a quarter at first order


def test_a_cell_at_constant_approach_wears_off_exponentially():
    """One cell bears c p, c its own compliance: c dp/ds = −k p, so p = p₀ (1 + k Δs/c)^−n."""
    heights = np.full((6, 6), -0.01)
    heights[2, 3] = 0.0
    surface = Surface(heights=heights, lengths=(0.6, 0.6))
    model = HalfSpaceModel(surface, contact_modulus=4000.0, highest=0.0)
    compliance = float(love_centre(0.05, 0.05)) / (np.pi * 4000.0)
    coefficient, slid, steps = 1e-7, 3e3, 40
    state = first = model.press(Control(approach=1e-3))
    assert first.peak_pressure == pytest.approx(1e-3 / compliance, rel=1e-10)
    for _ in range(steps):
        worn = replace(model, wear=coefficient * slid / steps)
        state = worn.press(Control(approach=1e-3), start=state.start)
    ratio = coefficient * slid / compliance
    implicit = (1.0 + ratio / steps) ** -steps
    assert state.peak_pressure / first.peak_pressure == pytest.approx(implicit, rel=1e-9)
    assert implicit == pytest.approx(np.exp(-ratio), rel=ratio**2 / steps)


def test_a_cell_that_yields_wears_from_its_hardness_and_keeps_both_depths():
    """It bears H from the start, then H (1 + k Δs/c)^−n, and first touches lower by both depths."""
    heights, hardness = np.full((6, 6), -0.01), 90.0
    heights[2, 3] = 0.0
    surface = Surface(heights=heights, lengths=(0.6, 0.6))
    model = HalfSpaceModel(surface, contact_modulus=4000.0, highest=0.0, hardness=hardness)
    compliance, approach = float(love_centre(0.05, 0.05)) / (np.pi * 4000.0), 5.3e-3
    state = model.press(Control(approach=approach))
    plastic = approach - compliance * hardness
    assert state.plastic_depth[2, 3] == pytest.approx(plastic, rel=1e-9)
    ratio, worn = 0.4, 0.0
    for step in range(1, 6):
        wears = replace(model, wear=ratio * compliance)
        state = wears.press(Control(approach=approach), start=state.start)
        pressure = hardness * (1.0 + ratio) ** -step
        worn += ratio * compliance * pressure
        assert state.peak_pressure == pytest.approx(pressure, rel=1e-9)
        assert state.worn_depth[2, 3] == pytest.approx(worn, rel=1e-9)
        assert state.plastic_depth[2, 3] == pytest.approx(plastic, rel=1e-9)
    free = model.press(Control(force=0.0), start=state.start)
    assert free.approach == pytest.approx(plastic + worn, rel=1e-9)
    assert plastic + worn == pytest.approx(approach - compliance * pressure, rel=1e-9)
    again = model.press(Control(force=0.7 * hardness * 0.01), start=free.start)
    assert again.approach == pytest.approx(plastic + worn + 0.7 * hardness * compliance, rel=1e-9)


def _rough(seed, cells=20, slope=0.1):
    spectrum = Spectrum(hurst=0.8, waves=(2, 5), rms_slope=slope, seed=seed)
    return synthesise(spectrum, grid=(cells, cells + 4), lengths=(0.81, 1.07))


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 1500.0])
@pytest.mark.parametrize("tilt", [(1.3e-3, -0.7e-3), None])
@pytest.mark.parametrize("share", [0.3, 30.0])
def test_a_worn_load_is_that_of_a_dense_matrix(hardness, tilt, share):
    """With k Δs on the diagonal of the compliance of all cells, whatever its size."""
    surface, modulus, force = _rough(11), 7.7e4, 61.3
    model = HalfSpaceModel(surface, contact_modulus=modulus, hardness=hardness, tolerance=1e-12)
    before = model.press(Control(force=0.4 * force, tilt=tilt))
    wear = share * surface.spacing[0] / modulus
    state = replace(model, wear=wear).press(Control(force=force, tilt=tilt), start=before.start)
    shape, cell = surface.grid, float(np.prod(surface.spacing))
    x = (surface.x - surface.x.mean())[:, None] + np.zeros(shape)
    y = surface.y - surface.y.mean() + np.zeros(shape)
    modes, loads = [np.ones(shape)], [force / cell]
    plane = (tilt or (0.0, 0.0))[0] * x + (tilt or (0.0, 0.0))[1] * y
    if tilt is None:
        modes, loads = [*modes, x, y], [*loads, 0.0, 0.0]
    left = 0.0 if before.plastic_depth is None else before.plastic_depth
    matrix = matrix_of(model.compliance.on_grid(shape, surface.spacing), shape)
    unit = modulus / surface.spacing[0]  # of pressures, so that all equations are of one size
    dense = dense_contact(
        unit * (matrix + wear * np.eye(len(matrix))),
        plane + surface.heights - surface.highest - left,
        modes=np.array([mode.ravel() for mode in modes]),
        loads=np.array(loads) / unit,
        upper=(hardness or np.inf) / unit,
    )
    pressure, peak = unit * dense.pressure, state.peak_pressure
    np.testing.assert_allclose(state.pressure.ravel(), pressure, atol=1e-8 * peak)
    assert state.approach == pytest.approx(dense.motion[0], rel=1e-8)
    np.testing.assert_allclose(state.worn_depth, wear * state.pressure, rtol=1e-12)
    np.testing.assert_allclose(state.displacement.ravel(), matrix @ pressure, rtol=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("hardness", [None, 9000.0])
def test_what_wear_keeps(periodic, hardness):
    """The volume k F s, and a contact in equilibrium on the worn heights without further wear."""
    surface, coefficient = _rough(5, cells=48), 3.1e-9
    model = HalfSpaceModel(
        surface, contact_modulus=2.1e5, periodic=periodic, hardness=hardness, tolerance=1e-10
    )
    state, volume = model.press(Control(force=40.0)), 0.0
    cell = float(np.prod(surface.spacing))
    for force, slid in ((40.0, 1e3), (65.0, 3.7e3), (20.0, 5.1e3), (90.0, 2.3e3)):
        worn = replace(model, wear=coefficient * slid)
        state, area = worn.press(Control(force=force), start=state.start), state.contact_area
        volume += coefficient * force * slid
        assert state.worn_depth.sum() * cell == pytest.approx(volume, rel=1e-10)
        lowered = state.start.lowered
        again = HalfSpaceModel(
            Surface(
                heights=surface.heights - lowered,
                lengths=surface.lengths,
                periodic=surface.periodic,
            ),
            contact_modulus=2.1e5,
            periodic=periodic,
            hardness=hardness,
            tolerance=1e-10,
            highest=surface.highest,
        ).press(Control(force=force))
        # residuals of 1e-10 of the interference, over the compliance of a cell
        atol = 1e-9 * np.ptp(surface.heights) * 2.1e5 / surface.spacing[0]
        np.testing.assert_allclose(again.pressure, state.pressure, rtol=0.0, atol=atol)
        assert again.approach == pytest.approx(state.approach, rel=1e-8)
        assert again.elastic_energy == pytest.approx(state.elastic_energy, rel=1e-7)
        gap = model.stiffness(state)
        assert gap.interface == pytest.approx(model.stiffness(again).interface, rel=1e-5)
    assert state.contact_area > 1.2 * area
    assert state.mean_separation == pytest.approx(state.gap.mean(), rel=1e-9)
