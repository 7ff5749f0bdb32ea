"""Concurrent coupling: exact on the half-space, and against a direct solution with a sag."""

import numpy as np
import pytest

from geometry import PatchGrid, Spectrum, patch_means, synthesise
from geometry.control import Control
from geometry.errors import NotConverged
from micro import micro_model
from multiscale.concurrent import ConcurrentCoupling
from multiscale.coupling import AnalyticCoupling

MODULUS = 4000.0
LOADS = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
PATCHES = PatchGrid(grid=(2, 3), lengths=(1.0, 1.0))


class Yield:
    """A block that yields beyond the half-space as a rigid stamp on springs, or not at all."""

    loads = LOADS

    def __init__(self, sink, turn=0.0):
        self.sink, self.turn = sink, turn

    def sag(self, forces):
        moment = forces @ (LOADS.centres[:, 0] - 0.5)
        return lambda x, y: self.sink * forces.sum() + self.turn * moment * (x - 0.5) + 0.0 * y


@pytest.fixture(scope="module")
def parts():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    return surface, patch_means(surface, PATCHES)


def coupled(parts, correction, name="half-space"):
    surface, means = parts
    model = micro_model(name, surface, contact_modulus=MODULUS)
    return ConcurrentCoupling(model, PATCHES, means, correction)


def alone(parts, name="half-space"):
    surface, means = parts
    model = micro_model(name, surface, contact_modulus=MODULUS)
    return AnalyticCoupling(model, PATCHES, means)


@pytest.mark.parametrize("name", ["circular", "half-space"])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (4e-3, -3e-3)])
def test_half_space_is_the_micro_model(parts, name, tilt):
    control = Control(approach=8e-3, tilt=tilt)
    one, other = coupled(parts, Yield(0.0), name).press(control), alone(parts, name).press(control)
    # the micro model's own tolerance
    assert one.force_N == pytest.approx(other.force_N, rel=1e-7)
    np.testing.assert_allclose(one.patches.closure_mm, other.patches.closure_mm, rtol=1e-7)
    assert one.mean_separation_mm == pytest.approx(other.mean_separation_mm, rel=1e-7)


@pytest.mark.parametrize("sink", [-0.4e-3, 1e-3, 1e-2], ids=["stiffer", "softer", "slender"])
def test_block_on_a_spring_is_the_micro_model_further_away(parts, sink):
    """A stiffness of the half-space of some 1e3 N/mm in series with 1/sink."""
    coupling = coupled(parts, Yield(sink))
    step = coupling.press(Control(approach=8e-3))
    same = alone(parts).press(Control(approach=8e-3 - sink * step.force_N))
    assert step.force_N == pytest.approx(same.force_N, rel=1e-7)  # the iteration's 1e-8
    assert step.newton_iterations <= 12  # at once from nothing


def test_turning_block_is_a_turned_plane(parts):
    step = coupled(parts, Yield(1e-3, 2e-3)).press(Control(approach=8e-3, tilt=(2e-3, 1e-3)))
    forces = step.patches.pressure_MPa * PATCHES.area
    assert forces.sum() == pytest.approx(step.force_N, rel=1e-12)
    # the block turns by the moment of the forces as its rectangles gather them
    lean = 2e-3 * _gathered_moment(parts, step)
    same = alone(parts).press(
        Control(approach=8e-3 - 1e-3 * step.force_N, tilt=(2e-3 - lean, 1e-3))
    )
    assert step.force_N == pytest.approx(same.force_N, rel=1e-6)


def _gathered_moment(parts, step):
    """Return the moment of the forces gathered on the rectangles, by its own fixed point."""
    surface, _ = parts
    model = micro_model("half-space", surface, contact_modulus=MODULUS)
    moment = 0.0
    for _ in range(40):
        response = model.respond(
            [8e-3 - 1e-3 * step.force_N],
            patches=LOADS,
            mean_heights=np.zeros(16),
            tilt=(2e-3 - 2e-3 * moment, 1e-3),
        )
        moment = 0.5 * moment + 0.5 * float(response.patch_force[0] @ (LOADS.centres[:, 0] - 0.5))
    return moment


@pytest.mark.parametrize("tilt", [(0.0, 0.0), None])
def test_force_and_moment_are_balanced(parts, tilt):
    coupling = coupled(parts, Yield(5e-4))
    for force in (0.5, 2.0, 1.0):
        step = coupling.press(Control(force=force, tilt=tilt))
        assert step.force_N == pytest.approx(force, rel=3e-8)  # balance and iteration
        if tilt is None:
            assert np.abs(step.moment_N_mm).max() < 3e-8 * force


def test_block_that_flies_away_is_said(parts):
    """Less than nothing to stand on: no equilibrium."""
    with pytest.raises(NotConverged, match="block and contacts"):
        coupled(parts, Yield(-2.0)).press(Control(approach=8e-3))
