"""The concurrent coupling: blocks that yield nothing, lost contact, refusals, failures."""

import numpy as np
import pytest

from geometry import PatchGrid, Spectrum, patch_means, synthesise
from geometry.control import Control
from geometry.errors import InputError, NotConverged
from micro import RigidPlane, micro_model
from multiscale import concurrent
from multiscale.concurrent import ConcurrentCoupling

MODULUS = 4000.0
SURFACE = synthesise(
    Spectrum(hurst=0.95, waves=(2, 6), rms_slope=0.215, seed=3),
    grid=(32, 32),
    lengths=(1.0, 1.0),
)
SCENE = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
MEANS = patch_means(SURFACE, SCENE)
LOADS = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))


class Level:
    """Sinks as a whole."""

    loads = LOADS

    def __init__(self, compliance):
        self.compliance = compliance

    def sag(self, forces):
        depth = self.compliance * float(np.sum(forces))
        return lambda x, y: depth + 0.0 * np.add(x, y)


def coupling(compliance, name="half-space", **options):
    model = micro_model(name, SURFACE, contact_modulus=MODULUS)
    return ConcurrentCoupling(model, SCENE, MEANS, Level(compliance), **options)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.01, -0.005)])
@pytest.mark.parametrize("name", ["half-space", "islands", "elliptic"])
def test_without_yielding_one_press_gives_the_micro_model(name, tilt):
    step = coupling(0.0, name).press(Control(approach=0.02, tilt=tilt))
    model = micro_model(name, SURFACE, contact_modulus=MODULUS)
    plane = RigidPlane.above(SURFACE, 0.02, tilt)
    alone = model.press(plane, patches=SCENE, mean_heights=MEANS).response
    assert step.newton_iterations == 1
    # the same problem solved from its own solution: the models' tolerance
    np.testing.assert_allclose(step.force_N, alone.force[0], rtol=1e-8)
    np.testing.assert_allclose(
        step.patches.closure_mm, plane.means(SCENE) - alone.patch_displacement[0], rtol=1e-8
    )


@pytest.mark.parametrize("name", ["half-space", "elliptic", "elliptic-independent"])
def test_a_block_that_sinks_is_a_plane_that_came_less_near(name):
    step = coupling(2e-3, name).press(Control(approach=0.02))
    model = micro_model(name, SURFACE, contact_modulus=MODULUS)
    plane = RigidPlane.above(SURFACE, 0.02 - 2e-3 * step.force_N)
    alone = model.press(plane, patches=SCENE, mean_heights=MEANS).response
    # the iteration's tolerance, 1e-8, times the half-space's answer to a change of the sag
    np.testing.assert_allclose(step.force_N, alone.force[0], rtol=1e-7)


def test_contact_is_lost_and_found_again():
    pressed = coupling(1e-3)
    first = pressed.press(Control(approach=0.02))
    assert pressed.press(Control(approach=-0.01)).force_N == 0.0
    again = pressed.press(Control(approach=0.02))
    np.testing.assert_allclose(again.force_N, first.force_N, rtol=5e-8)  # tolerance 1e-8, twice


def test_a_failure_leaves_the_coupling_as_it_was(monkeypatch):
    pressed, other = coupling(1e-3), coupling(1e-3)
    for one in (pressed, other):
        one.press(Control(approach=0.01))
    monkeypatch.setattr(concurrent, "_MOST", 1)
    with pytest.raises(NotConverged, match=r"yielding at .*DIVERGED_MAX_IT after 1 iterations"):
        pressed.press(Control(approach=0.02))
    monkeypatch.undo()
    after, expected = (one.press(Control(approach=0.015)) for one in (pressed, other))
    assert after.force_N == expected.force_N
    assert after.newton_iterations == expected.newton_iterations


def test_a_tolerance_must_be_positive():
    with pytest.raises(InputError, match="the tolerance must be positive"):
        coupling(0.0, tolerance=0.0)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.01, 0.0), None])
def test_without_force_nothing_touches(tilt):
    pressed = coupling(1e-3)
    pressed.press(Control(force=1.0))
    step = pressed.press(Control(force=0.0, tilt=tilt))
    assert (step.force_N, step.contacts) == (0.0, 0)
