"""Fretting: cells that slip under a shear wear, against closed forms and what any wear keeps.

Where the plane is held at an approach d and shifts to and fro by ±s, a paraboloid of radius R
sticks within c, d − c²/R = s/μ for like bodies of ν = 0, and wears around it until nothing presses
there (Popov 2014, doi 10.1002/zamm.201300132, by the method of dimensionality reduction).
The force that is left is 2 E* (c d − c³/3R), the pressure

    p = (2 E*/(π R)) √(c² − r²) + (E*/π) (d − c²/R)/√(c² − r²).
"""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.mindlin_sphere import MindlinSphere

from patchlaw.geometry import (
    Control,
    Material,
    MaterialPair,
    ShearControl,
    Spectrum,
    Surface,
    synthesise,
)
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.micro.friction.coupled import press_coupled

RADIUS, APPROACH, FRICTION = 2.17, 0.0213, 0.43
PAIR = MaterialPair(first=Material(young_modulus=2130.0, poisson_ratio=0.0))
EDGE = np.sqrt(RADIUS * APPROACH)


def paraboloid(cells, wear):
    side = 2.3 * EDGE
    x = ((np.arange(cells) + 0.5) / cells - 0.5) * side
    distance = np.hypot(x[:, None], x)
    surface = Surface(heights=-(distance**2) / (2.0 * RADIUS), lengths=(side, side))
    normal = HalfSpaceModel(surface, contact_modulus=PAIR.contact_modulus, highest=0.0)
    friction = FrictionModel(
        materials=PAIR, coefficient=FRICTION, spacing=surface.spacing, wear=wear
    )
    return SimpleNamespace(normal=normal, friction=friction, distance=distance)


def fretted(case, loads, before=None):
    """Return states and shears under loads (key, size, shift along x and y) one after another."""
    found = [before or (None, None)]
    for key, size, shift in loads:
        control = Control(**{key: size}, shear=ShearControl(shift=shift))
        state, shear = found[-1]
        start = None if state is None else state.start
        found.append(press_coupled(case.normal, case.friction, control, shear, start=start))
    return found[1:]


def test_what_wears_off_in_a_cycle_is_what_mindlin_and_deresiewicz_lose():
    """And k ∫ p |ds| cell by cell, in the annulus that slips alone: little wears, which acts back
    on nothing.
    """
    case = paraboloid(48, wear=1e-9)
    force = 4.0 / 3.0 * PAIR.contact_modulus * np.sqrt(RADIUS) * APPROACH**1.5
    exact = MindlinSphere(
        radius=EDGE, approach=APPROACH, force=force, coefficient=FRICTION, poisson_ratio=0.0
    )
    shift = 0.7 * exact.sliding_shift
    turns = [(shift, 0.0), (-shift, 0.0), (shift, 0.0)]
    states = fretted(case, [("approach", APPROACH, one) for one in ((0.0, 0.0), *turns)])
    cell, wear = case.friction.cell, case.friction.wear
    worn = [0.0 if one.worn_depth is None else one.worn_depth.sum() * cell for one, _ in states]
    lost = exact.energy_per_cycle(shift)
    # the cells along the edges of stick and contact err by 2 % of the energy on 48² of them
    assert worn[3] - worn[1] == pytest.approx(wear / FRICTION * lost, rel=0.03)
    slips = [np.hypot(*(b.slip - a.slip)) for (_, a), (_, b) in pairwise(states)]
    depth = wear * states[0][0].pressure * sum(slips)
    np.testing.assert_allclose(states[-1][0].worn_depth, depth, rtol=1e-5, atol=1e-7 * depth.max())
    inside = case.distance < 0.9 * exact.stick_radius(exact.shear_force(shift))
    assert (
        not depth[inside].any()
        and depth[case.distance > EDGE + case.normal.surface.spacing[0]].max() == 0.0
    )


@pytest.mark.long
def test_the_worn_paraboloid_is_that_of_the_method_of_dimensionality_reduction():
    """Whatever the coefficient: half a mm wears off per MPa and mm that a cell slips."""
    case, stick = paraboloid(48, wear=0.5), 0.6 * EDGE
    shift = FRICTION * (APPROACH - stick**2 / RADIUS)
    turns = [("approach", APPROACH, (one, 0.0)) for one in (shift, -shift) * 3]
    states = fretted(case, [("approach", APPROACH, (0.0, 0.0)), *turns])
    (new, _), (state, shear) = states[0], states[-1]
    modulus, far = PAIR.contact_modulus, case.distance
    force = 2.0 * modulus * (stick * APPROACH - stick**3 / (3.0 * RADIUS))
    # the stick area is made of cells: 0.5 % of the force, and 4 % of a singular pressure
    assert state.force == pytest.approx(force, rel=0.01)
    root = np.sqrt(np.maximum(stick**2 - far**2, 1e-12))
    pressure = modulus / np.pi * (2.0 / RADIUS * root + (APPROACH - stick**2 / RADIUS) / root)
    inner = far < 0.7 * stick
    np.testing.assert_allclose(state.pressure[inner], pressure[inner], rtol=0.01)
    assert state.pressure[inner].min() > 1.1 * new.pressure[inner].min()
    assert state.pressure[far > 1.15 * stick].max() < 1e-3 * new.peak_pressure
    area = shear.sticking.sum() * case.friction.cell
    assert area == pytest.approx(np.pi * stick**2, rel=0.05)


@pytest.mark.parametrize(
    ("coupled", "hardness", "wear"),
    [(True, 260.0, 2e-4), pytest.param(False, None, 0.1, marks=pytest.mark.long)],
)
def test_what_fretting_keeps(coupled, hardness, wear):
    """Energy and volume at every load step, and equilibrium on the worn heights without wear."""
    spectrum = Spectrum(hurst=0.8, waves=(2, 5), rms_slope=0.1, seed=12)
    surface = synthesise(spectrum, grid=(24, 28), lengths=(0.83, 0.97))
    pair = MaterialPair(first=Material(young_modulus=7.1e3, poisson_ratio=0.29 * coupled))
    known = {"contact_modulus": pair.contact_modulus, "hardness": hardness, "tolerance": 1e-10}
    normal = HalfSpaceModel(surface, **known)
    friction = FrictionModel(
        materials=pair, coefficient=0.37, spacing=surface.spacing, coupled=coupled, wear=wear
    )
    case, cell = SimpleNamespace(normal=normal, friction=friction), friction.cell
    loads = [(3.1, (0.0, 0.0)), (3.1, (2.1e-4, 1.1e-4)), (4.2, (-2.3e-4, 0.0)), (1.4, (2e-4, 0.0))]
    states = fretted(case, [("force", size, shift) for size, shift in loads])
    volume = 0.0
    for state, shear in states:
        before, volume = volume, 0.0 if state.worn_depth is None else state.worn_depth.sum() * cell
        assert volume >= before
        assert volume == pytest.approx(wear / 0.37 * shear.dissipated, rel=1e-12)
    worn = state.start.lowered
    heights = surface.heights - worn - (0.0 if state.displaced is None else state.displaced)
    again = HalfSpaceModel(
        Surface(heights=heights, lengths=surface.lengths), highest=surface.highest, **known
    ).press(Control(force=loads[-1][0]))
    # passes end where what displaces changes by 1e-6 of the largest displacement
    np.testing.assert_allclose(again.pressure, state.pressure, atol=3e-5 * state.peak_pressure)
    assert worn.max() > 0.01 * state.displacement.max()


@pytest.mark.long
def test_increments_of_fretting_converge():
    """Steps to the same shifts halved: what differs halves, nearly, by first order."""
    case, depths, shift = paraboloid(24, wear=3e-3), [], 0.6 * FRICTION * APPROACH
    for steps in (4, 8, 16):
        parts = np.linspace(0.0, 1.0, steps + 1)
        way = [*(shift * parts), *(shift * (1.0 - 2.0 * parts[1:]))]
        states = fretted(case, [("approach", APPROACH, (one, 0.0)) for one in way])
        depths.append(states[-1][0].worn_depth.sum())
    first, second = np.abs(np.diff(depths))
    assert second < 0.7 * first < 0.01 * depths[-1]
