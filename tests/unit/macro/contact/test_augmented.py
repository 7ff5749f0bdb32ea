"""Contact at quadrature points: it agrees with nodes, and holds exactly."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.block_cases import rough_contact

from patchlaw.geometry import BlockShape, Control, Spectrum, Surface, synthesise
from patchlaw.macro import Material
from patchlaw.macro.contact.augmented_lagrangian import INTERFERENCE

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
X = (np.arange(65) + 0.5) / 65 - 0.5
SPHERE = Surface(heights=-((X[:, None] - 0.02) ** 2 + X**2) / 4.0, lengths=(1.0, 1.0))
ROUGH = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.15, seed=2), grid=(64, 64), lengths=(1.0, 1.0)
)
FLAT = Surface(heights=np.zeros((8, 8)), lengths=(1.0, 1.0))
SHAPE = BlockShape(interface=(1.0, 1.0), height=0.5, cells=(8, 8, 3), grading=2.0)


def problem(shape, method, surface=SPHERE, sides="free", **options):
    return rough_contact(shape, surface, MATERIAL, sides, method=method, **options)


def at_points(found, state):
    """Return depths and pressures of the quadrature points."""
    method, displacement = found.method, found.body.stiffness.createVecRight()
    displacement.array[:] = state.displacement
    closure = method.equilibrium.forces.closure(displacement)
    return closure - method.law.distance, method.law.pressure(closure)


def forces(shape, control):
    methods = ("active-set", "augmented-lagrangian")
    return [problem(shape, method).solve(control).force for method in methods]


@pytest.mark.slow
@pytest.mark.parametrize("element", ["Q1", "P1", "Q2", "P2"])
def test_points_and_nodes_agree_to_the_discretisation(element):
    cells = (5, 5, 2) if element.endswith("2") else (12, 12, 3)
    nodes, points = forces(replace(SHAPE, cells=cells, element=element), Control(approach=0.04))
    assert points == pytest.approx(nodes, rel=LIMIT[element])


# measured 4e-8, 7e-12, 7e-4 and 6e-3: between linear nodes on one sphere points ask for no more
LIMIT = {"Q1": 1e-5, "P1": 1e-7, "Q2": 2e-3, "P2": 1e-2}


@pytest.mark.long
@pytest.mark.parametrize("element", ["Q1", "P2"])
def test_no_point_interferes_and_none_is_pulled(element):
    found = problem(replace(SHAPE, cells=(5, 5, 2), element=element), "augmented-lagrangian")
    state = found.solve(Control(force=30.0, tilt=None))
    depth, pressure = at_points(found, state)
    assert depth.max() <= INTERFERENCE[int(element[1])] * np.abs(state.displacement).max()
    assert pressure.min() == 0.0 < pressure.max()
    assert state.force == pytest.approx(30.0, rel=1e-9)
    assert state.reaction == pytest.approx(30.0, rel=1e-9)
    np.testing.assert_allclose(state.moment, 0.0, atol=1e-8)


@pytest.mark.parametrize("method", ["active-set", "augmented-lagrangian"])
def test_a_plane_that_turns_bears_the_prescribed_moment(method):
    found = problem(replace(SHAPE, cells=(8, 8, 2), element="Q1"), method)
    moment = (2.0, -1.2)
    state = found.solve(Control(force=30.0, tilt=None, moment=moment))
    assert state.force == pytest.approx(30.0, rel=1e-9)
    np.testing.assert_allclose(state.moment, moment, atol=1e-7)


@pytest.mark.parametrize("element", ["Q1", "P1"])
def test_no_point_presses_across_a_gap(element):
    shape = replace(SHAPE, height=1.0, cells=(8, 8, 4), grading=1.0, element=element)
    found = problem(shape, "augmented-lagrangian", ROUGH)
    state = found.solve(Control(approach=0.012))
    depth, pressure = at_points(found, state)
    widest = -depth[pressure > 0.0].min()
    assert widest <= INTERFERENCE[1] * np.abs(state.displacement).max()


@pytest.mark.parametrize("element", ["Q1", "P1"])
def test_without_force_nothing_touches(element):
    shape = replace(SHAPE, height=1.0, cells=(8, 8, 4), grading=1.0, element=element)
    # beyond the highest node, short of the points of the facets around it
    state = problem(shape, "augmented-lagrangian", ROUGH).solve(Control(approach=6e-3))
    assert (state.force, state.reason) == (0.0, "CONVERGED_NO_CONTACT")
    assert (state.nodes, state.contacts, state.contact_area) == (0, 0, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_flat_top_on_rollers_is_a_column(element):
    shape = replace(SHAPE, cells=(4, 4, 2), element=element)
    state = problem(shape, "augmented-lagrangian", FLAT, "roller").solve(Control(approach=1e-3))
    # uniform strain on every mesh; the last interference is 1e-8 of the approach
    assert state.force == pytest.approx(MATERIAL.confined_modulus * 1e-3 / 0.5, rel=1e-7)
    assert state.contact_area == pytest.approx(1.0, rel=1e-12)
    assert state.contacts == 1
