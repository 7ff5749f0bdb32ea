"""Asperities on a finite body, against a slow solution of the dense complementarity problem."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.asperity_states import displacement, interference, pressed
from helpers.truncated_newton import SOLVERS, solve_by
from scipy.optimize import brentq

from patchlaw.geometry import (
    Asperities,
    Control,
    PatchGrid,
    Spectrum,
    find_asperities,
    patch_means,
    synthesise,
)
from patchlaw.micro import MODELS, AsperityModel, BodyModes, HertzContact
from patchlaw.micro.boundary_elements.body_modes import BodyPoints

MODULUS = 4000.0
PATCHES = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 6), rms_slope=0.2, seed=5), grid=(48, 48), lengths=(1.0, 1.0)
)
APPROACH = 8e-3
MEANS = patch_means(SURFACE, PATCHES)


def body(sign=1.0, size=5e-5):
    """A smooth compliance; as large as that of a cube, pressing down or lifting."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(16, 16)) * np.exp(
        -0.5 * np.add.outer(np.arange(4), np.arange(4)).ravel()
    )
    return BodyModes((1.0, 1.0), sign * size * half @ half.T / np.abs(half @ half.T).max())


def apart():
    """Nine summits so far apart that none comes near to another's contact."""
    x, y = (axis.ravel() for axis in np.meshgrid([0.2, 0.5, 0.8], [0.2, 0.5, 0.8]))
    rng = np.random.default_rng(4)
    minor = 0.1 * np.exp(rng.normal(0.0, 0.3, 9))
    return Asperities(
        x=x,
        y=y,
        z=-rng.exponential(2e-3, 9),
        radius_major=minor * 1.5,
        radius_minor=minor,
        angle=np.pi * rng.random(9),
        lengths=(1.0, 1.0),
        highest=0.0,
        mean_height=-0.02,
    )


def dense(model, required):
    """Solve for the indentations one after another until none changes (Gauss and Seidel)."""
    a, elliptic = model.asperities, model.name.startswith("elliptic")
    points = BodyPoints.at(model.body, a.x, a.y)
    between = points.by(points)
    major = a.radius_major if elliptic else a.radius
    minor = a.radius_minor if elliptic else a.radius

    def contact(k, t):
        return HertzContact(
            contact_modulus=MODULUS, radius_major=major[k], radius_minor=minor[k], indentation=t
        )

    law = np.array([float(contact(k, 1.0).force) for k in range(len(a))])
    t = np.zeros(len(a))
    for _ in range(300):
        before = t.copy()
        for k in range(len(a)):
            force = law * t**1.5
            force[k] = 0.0
            pushed = between[k] @ force
            for i in np.flatnonzero(t > 0.0) if "independent" not in model.name else ():
                if i != k:
                    dx, dy = a.x[k] - a.x[i], a.y[k] - a.y[i]
                    cos, sin = np.cos(a.angle[i]), np.sin(a.angle[i])
                    pushed += contact(i, t[i]).displacement(
                        cos * dx + sin * dy, cos * dy - sin * dx
                    )
            lacking = required[k] - pushed

            def gap(own, k=k, lacking=lacking):
                return own + between[k, k] * law[k] * own**1.5 - lacking

            t[k] = brentq(gap, 0.0, 1.0, xtol=1e-18) if lacking > 0.0 else 0.0
        if np.abs(t - before).max() < 1e-15:
            return t, law * t**1.5
    raise AssertionError("the oracle has not converged")


@pytest.mark.parametrize("sign", [1.0, -0.5])
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_is_the_dense_solution(name, solver, sign, monkeypatch):
    solve_by(solver, monkeypatch)
    model = AsperityModel(name, apart(), contact_modulus=MODULUS, body=body(sign))
    state = pressed(model, 8e-3, tilt=(3e-3, -2e-3))
    t, force = dense(model, model.asperities.interference(state.plane))
    assert 4 < np.count_nonzero(t) < 9  # some are in contact, some are not
    # contact conditions are met to 1e-10 of the approach
    assert state.ellipses.force == pytest.approx(force, rel=1e-8, abs=1e-10)
    on, required = state.ellipses.force > 0.0, interference(model.asperities, state)
    assert displacement(model, state)[on] == pytest.approx(required[on], abs=1e-11)


def test_summit_that_the_body_raises_touches():
    """It stands below the plane, and force on the other one raises it more than that."""
    two = apart().subset(np.array([4, 7]))
    two = replace(two, z=np.array([0.0, -2.05e-3]))
    # the second mode along y: what presses one half down raises the other
    matrix = np.zeros((4, 4))
    matrix[1, 1] = 2e-3
    model = AsperityModel(
        "elliptic-independent",
        replace(two, x=np.array([0.5, 0.5]), y=np.array([0.2, 0.9])),
        contact_modulus=MODULUS,
        body=BodyModes((1.0, 1.0), matrix),
    )
    state = pressed(model, 2e-3)
    assert interference(model.asperities, state)[1] == 0.0
    t, force = dense(model, np.array([2e-3, -5e-5]))
    assert np.all(t > 0.0)
    assert state.ellipses.force == pytest.approx(force, rel=1e-8)


def surface_models():
    asperities = find_asperities(SURFACE)
    for name in MODELS:
        yield AsperityModel(name, asperities, contact_modulus=MODULUS)


@pytest.fixture(params=list(surface_models()), ids=lambda model: model.name)
def model(request):
    return request.param


def press(model, **given):
    return model.press(Control(**given), patches=PATCHES, mean_heights=MEANS)


def test_uniform_yielding_is_a_plane_that_has_come_less_near(model):
    """A body that moves as a whole by its force: the model on its half-space is the witness."""
    spring = 5e-4
    yielding = replace(model, body=BodyModes((1.0, 1.0), np.array([[spring]])))
    found = press(yielding, approach=APPROACH)
    force = found.force
    less = press(model, approach=APPROACH - spring * force)
    # contacts converge to 1e-10 of the largest interference
    assert force == pytest.approx(less.force, rel=1e-8)
    assert found.contact_area == pytest.approx(less.contact_area, rel=1e-8)
    sunk = less.patch_displacement[0] + spring * force
    assert found.patch_displacement[0] == pytest.approx(sunk, rel=1e-6)
    assert found.patch_separation[0] == pytest.approx(less.patch_separation[0], abs=1e-8)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (4e-3, -3e-3), None])
def test_force_and_moments_are_met(model, tilt):
    yielding = replace(model, body=body())
    force = press(yielding, approach=APPROACH).force
    assert force != pytest.approx(press(model, approach=APPROACH).force, rel=1e-3)
    found = press(yielding, force=force, tilt=tilt)
    assert found.force == pytest.approx(force, rel=1e-8)
    if tilt is None:
        assert np.abs(found.moment).max() < 1e-8 * force
    elif tilt == (0.0, 0.0):
        assert found.plane.approach == pytest.approx(APPROACH, rel=1e-8)


def test_patch_alone_stands_on_its_own_half_space(model):
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    alone, _ = replace(model, body=body()).of_patch(patches, 0)
    assert alone.body is None
