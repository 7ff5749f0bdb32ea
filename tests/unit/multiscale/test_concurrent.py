"""The concurrent coupling: blocks that yield nothing, lost contact, refusals, failures."""

from dataclasses import replace

import numpy as np
import pytest
from multiscale.couplings.concurrent import ConcurrentCoupling
from multiscale.couplings.concurrent_newton import damped_turn

from geometry import PatchGrid, Spectrum, Surface, patch_means, synthesise
from geometry.control import Control
from geometry.errors import InputError, NotConverged
from micro import HalfSpaceModel, RigidPlane, micro_model
from multiscale.couplings import concurrent

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
@pytest.mark.parametrize("compliance", [-2e-4, 1e-3, 1e-2], ids=["stiffer", "softer", "slender"])
def test_a_block_that_sinks_is_a_plane_that_came_less_near(name, compliance):
    """The half-space's own compliance under a uniform pressure is 2.4e-4 mm/N."""
    step = coupling(compliance, name).press(Control(approach=0.02))
    model = micro_model(name, SURFACE, contact_modulus=MODULUS)
    plane = RigidPlane.above(SURFACE, 0.02 - compliance * step.force_N)
    alone = model.press(plane, patches=SCENE, mean_heights=MEANS).response
    # the iteration's tolerance, 1e-8, times the half-space's answer to a change of the sag
    np.testing.assert_allclose(step.force_N, alone.force[0], rtol=1e-7)


def test_a_block_that_pushes_ever_harder_is_refused():
    """A block that rises under load by more than contacts can give way has no equilibrium."""
    with pytest.raises(NotConverged, match=r"yielding at .*load\.steps"):
        coupling(-2.0).press(Control(approach=0.02))


@pytest.mark.parametrize(
    "control",
    [Control(approach=0.02), Control(force=2.0), Control(force=2.0, tilt=None)],
    ids=["approach", "force", "balanced"],
)
def test_a_coarse_model_changes_the_way_but_not_the_solution(control):
    x = (np.arange(16) + 0.5) / 16
    fewer = Surface(heights=SURFACE.height_at(x[:, None], x), lengths=SURFACE.lengths)
    coarse = micro_model("half-space", fewer, contact_modulus=MODULUS)
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=MODULUS, tolerance=1e-10)
    ahead, alone = (
        ConcurrentCoupling(model, SCENE, MEANS, Level(3e-3), coarse=one) for one in (coarse, None)
    )
    for load in (1.0, 1.2, 0.8):
        now = replace(control, **{name: load * value for name, value in _load(control)})
        one, other = ahead.press(now), alone.press(now)
        # twice the iteration's tolerance, 1e-8, and some
        np.testing.assert_allclose(one.force_N, other.force_N, rtol=5e-8)
        np.testing.assert_allclose(one.approach_mm, other.approach_mm, rtol=5e-8)
        np.testing.assert_allclose(one.tilt, other.tilt, atol=5e-8)
        if load == 1.0:
            assert one.newton_iterations < other.newton_iterations


def _load(control):
    names = ("approach", "force")
    return [(name, getattr(control, name)) for name in names if getattr(control, name) is not None]


@pytest.mark.parametrize("force", [0.1, 0.3])
def test_a_plane_free_to_turn_comes_down_from_its_first_contact(force):
    """First touch is at the border; the sag is a lower plane, so the micro model is the witness."""
    block = Level(1e-3)
    block.loads = PatchGrid(grid=(8, 8), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=MODULUS, tolerance=1e-10)
    pressed = ConcurrentCoupling(model, SCENE, MEANS, block)
    step = pressed.press(Control(force=force, tilt=None))
    plane = RigidPlane.above(SURFACE, step.approach_mm - 1e-3 * step.force_N, step.tilt)
    alone = model.press(plane, patches=SCENE, mean_heights=MEANS).response
    # the iteration's tolerance, 1e-8, and some
    np.testing.assert_allclose(alone.force[0], force, rtol=5e-8)
    np.testing.assert_allclose(alone.moment[0], 0.0, atol=5e-8 * force)
    assert max(np.abs(step.tilt)) > 1e-3


def test_too_few_contacts_damp_the_turn_alone():
    """One contact of stiffness 3 at (0.3, 0.1) under a force that it lacks and cannot balance."""
    place, arms = np.array([1.0, 0.3, 0.1]), np.array([0.0, 0.7, 0.7])
    stiffness, missing = 3.0 * np.outer(place, place), np.array([0.5, 0.0, 0.0])
    turn = damped_turn(stiffness, missing, arms, 1e-2)
    assert 0.5e-2 < np.abs(turn * arms).sum() <= 1e-2
    # the contact carries what the force and the damped slopes leave it: its own moment is met
    assert (stiffness @ turn)[0] == pytest.approx(0.5, rel=1e-6)
    held = np.diag([3.0, 0.2, 0.1])
    exact = np.array([1.0, 1e-3, 2e-3])
    assert damped_turn(held, held @ exact, arms, 1e-2) == pytest.approx(exact, rel=1e-9)


def test_a_coarse_model_that_fails_is_left_out():
    class Failing:
        contact_modulus, first_touch = MODULUS, 0.0

        def press(self, *_, **__):
            raise NotConverged("the coarse model", reason="NONE", iterations=1, remedy="none")

    model = micro_model("half-space", SURFACE, contact_modulus=MODULUS)
    one = ConcurrentCoupling(model, SCENE, MEANS, Level(1e-3), coarse=Failing())
    other = coupling(1e-3)
    for approach in (0.02, 0.015):
        control = Control(approach=approach)
        assert one.press(control).force_N == other.press(control).force_N


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
    with pytest.raises(
        NotConverged, match=r"the block's yielding at .*DIVERGED_MAX_IT after 1 iterations"
    ):
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
