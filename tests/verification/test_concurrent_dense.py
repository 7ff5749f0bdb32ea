"""The concurrent coupling against one dense complementarity problem, and path independence."""

import numpy as np
import pytest
from helpers.concurrent_cases import CELLS, coupling, dense_forces

from patchlaw.geometry.rigid_plane import Control

CONTROLS = {
    "level": Control(approach=0.02),
    "tilted": Control(approach=0.02, tilt=(0.01, -0.004)),
    "force": Control(force=4.0),
    "balanced": Control(approach=0.02, tilt=None),
    "force, balanced": Control(force=4.0, tilt=None),
}
HALF = 0.5 * np.sqrt(2.0)


@pytest.mark.parametrize("scale", [-0.3, 1.0, 10.0])
@pytest.mark.parametrize("name", CONTROLS)
def test_the_coupling_finds_the_solution_of_the_whole_problem(name, scale):
    control = CONTROLS[name]
    step = coupling(scale).press(control)
    dense = dense_forces(scale, step.approach_mm, step.tilt)
    half = CELLS // 2
    patches = dense.reshape(2, half, 2, half).sum(axis=(1, 3)).ravel()
    force = dense.sum()
    # the residual of the complementarity problem is 1e-11
    np.testing.assert_allclose(step.force_N, force, rtol=1e-9)
    np.testing.assert_allclose(step.patches.pressure_MPa * 0.25, patches, atol=1e-9 * force)
    if control.force:
        np.testing.assert_allclose(force, control.force, rtol=1e-9)
    if control.tilt is None:
        centres = (np.arange(CELLS) + 0.5) / CELLS - 0.5
        moments = np.array([dense.sum(axis=1) @ centres, dense.sum(axis=0) @ centres])
        np.testing.assert_allclose(moments, 0.0, atol=1e-9 * force * HALF)
    else:
        assert step.tilt == control.tilt


def test_loading_and_unloading_end_in_the_same_state():
    up = coupling(3.0)
    loaded = [up.press(Control(approach=a)) for a in (0.01, 0.015, 0.02, 0.015)]
    first, again = loaded[1], loaded[3]
    # no iteration over the body is left, which ended at 1e-8
    np.testing.assert_allclose(again.force_N, first.force_N, rtol=1e-9)
    np.testing.assert_allclose(
        again.patches.pressure_MPa,
        first.patches.pressure_MPa,
        atol=1e-9 * first.patches.pressure_MPa.max(),
    )
