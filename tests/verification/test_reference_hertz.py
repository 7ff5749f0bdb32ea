"""The meshed block against Hertz: force, semi-axes, pressure, rates, and the bias of the areas."""

from functools import cache

import numpy as np
import pytest
from helpers.reference_cases import (
    MODULUS,
    body,
    ellipsoid,
    hertz,
    meshed,
    peak_pressure,
    power_law,
    pressed,
    semi_axes,
)

from patchlaw.geometry import Control

RADIUS, SIZE = 25.0, 0.05  # a contact of a twentieth of the block, slopes of 0.002
APPROACH = SIZE**2 / RADIUS
SPHERE = ellipsoid(RADIUS, RADIUS)
METHODS = ("active-set", "augmented-lagrangian")
# the augmented Lagrangian takes some five times as long
SLOW = pytest.mark.parametrize(
    "method", [METHODS[0], pytest.param(METHODS[1], marks=pytest.mark.slow)]
)


@cache
def contact_of_the_sphere():
    """Return Hertz's contact, under the displacement of the block."""
    return hertz(RADIUS, RADIUS, APPROACH)


@cache
def sphere(element, method, edges):
    """Press the sphere on a mesh with so many edges along the contact's radius."""
    return pressed(SPHERE, APPROACH, fine=SIZE / edges, element=element, method=method)


def errors(element, method, edges):
    """Return the relative errors of the force."""
    found = []
    for count in edges:
        _, state = sphere(element, method, count)
        assert state.reaction == pytest.approx(state.force, rel=1e-9)  # of linear solves to 1e-10
        found.append(state.force / float(contact_of_the_sphere().force) - 1.0)
    return found


@pytest.mark.long
@SLOW
def test_quadratic_tetrahedra_converge(method):
    coarse, fine = errors("P2", method, (1.5, 3.0))
    # measured 0.49 and 0.11 %; 0.62 and 0.19 % at quadrature points. Where nodes happen to lie
    # scatters the coarse one by 0.4 %, so that no order is seen on one sphere
    assert 0.0 < fine < 0.003
    assert 1.5 * fine < coarse < 0.01


@pytest.mark.slow
@SLOW
def test_linear_tetrahedra_converge_with_less_than_second_order(method):
    coarse, fine = errors("P1", method, (3.0, 6.0))
    # measured 6.5 and 2.2 %, then 0.6 % with 12
    assert 0.015 < fine < 0.03
    assert 1.2 < np.log2(coarse / fine) < 2.1


@pytest.mark.long
def test_two_quadratic_meshes_extrapolate_to_hertz():
    coarse, fine = errors("P2", "active-set", (1.5, 3.0))
    # measured −0.03 %; what the block gives is known to 0.1 % of the force
    assert abs(fine - (coarse - fine) / 7.0) < 2e-3


def check_shape(block, state, contact, *, axes):
    """Compare semi-axes and peak pressure with Hertz'."""
    a, b = semi_axes(block, state)
    # forces of nodes at the border stand for what lies beside them
    assert a == pytest.approx(float(contact.semi_major), rel=axes[0])
    assert b == pytest.approx(float(contact.semi_minor), rel=axes[1])
    # of the node next to the middle; measured −3.1 % at most
    assert peak_pressure(block, state) == pytest.approx(float(contact.peak_pressure), rel=0.045)


@pytest.mark.long
@SLOW
def test_radius_and_peak_pressure_of_a_sphere(method):
    block, state = sphere("P2", method, 3.0)
    check_shape(block, state, contact_of_the_sphere(), axes=(0.015, 0.015))  # measured −0.8 %


@pytest.mark.long
@SLOW
def test_semi_axes_and_force_of_an_ellipsoid(method):
    major, minor, size = 75.0, 15.0, 0.1
    approach = size**2 / np.sqrt(major * minor)
    contact = hertz(major, minor, approach)
    options = {"fine": size / 3.0, "method": method}
    block, state = pressed(ellipsoid(major, minor), approach, **options)
    # measured 0.05 %, and 0.5 % at quadrature points
    assert state.force == pytest.approx(float(contact.force), rel=8e-3)
    check_shape(block, state, contact, axes=(0.01, 0.04))  # measured 0.2, and −2.4 % of b


@pytest.mark.long
def test_bias_of_the_areas():
    """Nodes count their whole surroundings; within facets the border lies too far inside."""
    nodal, fine = np.transpose(
        [
            (state.nodal_area, state.contact_area)
            for _, state in (sphere("P2", "active-set", count) for count in (1.5, 3.0))
        ]
    ) / (np.pi * float(contact_of_the_sphere().semi_major) ** 2)
    # measured +15 and +2.7 % by nodes, which scatter by a row of them; −5.5 and −3.4 % fine
    assert np.all(np.abs(nodal - 1.0) < 0.2)
    assert np.all((0.92 < fine) & (fine < 1.0))
    assert fine[1] > fine[0]


@pytest.mark.slow
def test_bias_of_the_areas_at_quadrature_points():
    """Nodes that share a facet with a point in contact bear force: far more than touch."""
    exact = np.pi * float(contact_of_the_sphere().semi_major) ** 2
    _, state = sphere("P2", "augmented-lagrangian", 3.0)
    # measured +19 % by nodes, +4 % within facets
    assert 0.08 < state.nodal_area / exact - 1.0 < 0.3
    assert abs(state.contact_area / exact - 1.0) < 0.08


def towards_a_punch(exponent, approach):
    """Return a block that is C rⁿ on a mesh, C, and Sneddon's force and contact radius."""
    coefficient = approach / (0.1**exponent * 3.0)

    def profile(x, y):  # levels off at 30 approaches, which changes 1e-6 of it in the contact
        rise = coefficient * (x**2 + y**2) ** (exponent / 2)
        return rise / (1.0 + (rise / (30.0 * approach)) ** 4) ** 0.25

    force, contact = power_law(exponent, coefficient, approach)
    (block,) = meshed(body(profile, points=257), approach, fine=contact / 3.0)
    return block, coefficient, force, contact


@pytest.mark.long
@pytest.mark.parametrize("exponent", [6, pytest.param(12, marks=pytest.mark.slow)])
def test_towards_the_flat_punch(exponent):
    """C rⁿ tends to a flat punch of its contact's radius: F = 2 E* a δ n / (n + 1)."""
    approach = 1e-4
    block, coefficient, force, contact = towards_a_punch(exponent, approach)
    near = [block.solve(Control(approach=factor * approach)) for factor in (0.9, 1.0, 1.1)]
    # measured +0.2 and +0.7 %, with twice the edges −0.02 and −0.1 %
    assert near[1].force == pytest.approx(force, rel=1e-2)
    # whatever the body, a small step meets a punch of the contact's radius
    stiffness = (near[2].force - near[0].force) / (0.2 * approach)
    expected = [power_law(exponent, coefficient, factor * approach)[0] for factor in (0.9, 1.1)]
    assert stiffness == pytest.approx((expected[1] - expected[0]) / (0.2 * approach), rel=0.02)
    assert force / (2.0 * MODULUS * contact * approach) == pytest.approx(
        exponent / (exponent + 1.0),
        rel=0.04,  # and what the block gives, 3 %
    )
