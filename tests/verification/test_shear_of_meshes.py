"""Shear of the measured surface on bodies from meshes, against blocks and against each other."""

import numpy as np
import pytest
from helpers.box_msh import cube_section

from patchlaw.multiscale import Scene, run

CONSTANTS = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
SPECTRUM = {"hurst": 0.95, "waves": [2, 5], "rms_slope": 0.215, "seed": 1}
SCENE = {
    "surface": {"spectrum": {**SPECTRUM, "waves": [2, 10]}, "grid": [64, 64], "lengths": [1, 1]},
    "coupling": {"kind": "concurrent"},
    "micro": {"finite_slopes": False},
    "output": {"figures": False, "report": False, "check": "none"},
}
TURN = {"force": 2.0, "steps": 1, "shear": [[1e-3, 0.0], [1e-3, 8e-4]], "shear_steps": 1}


def sheared(*, coupled=False, **sections):
    """Return shear forces and approach of the last load steps, shape (2, 3) [N, µm]."""
    friction = {"coefficient": 0.4, "coupled": coupled}
    history = run(Scene.from_dict(SCENE | {"friction": friction, "load": TURN} | sections))
    rows = [(s.shear_force_x_N, s.shear_force_y_N, 1e3 * s.approach_mm) for s in history.steps]
    return np.array(rows[1:])


def cube(folder, cells, **where):
    return CONSTANTS | cube_section(folder, cells, **where)


@pytest.mark.slow
@pytest.mark.parametrize("coupled", [False, True])
def test_a_cube_on_a_mesh_is_the_block(tmp_path, coupled):
    """Its own shear is more than a third of the shift."""
    found = sheared(body=cube(tmp_path, 6), coupled=coupled)
    expected = sheared(block=CONSTANTS, coupled=coupled)
    alone = sheared(block=CONSTANTS, coupling={"kind": "analytic"})
    largest = np.abs(expected[:, :2]).max()
    # 6³ quadratic hexahedra are 0.3 % too stiff in shear, as their edges at the support are
    # singular; coupled, more than half of the force is what pressures of the whole face do
    atol = (0.016 if coupled else 0.008) * largest
    np.testing.assert_allclose(found[:, :2], expected[:, :2], atol=atol)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], rtol=1e-3)
    assert np.abs(alone[0, 0] / expected[0, 0]) > 1.4


@pytest.mark.slow
def test_a_meshed_counter_body_goes_with_a_margin(tmp_path):
    wide = CONSTANTS | {"margin": 0.2}
    counter = cube(tmp_path, 7, margin=0.2, above=True)
    found = sheared(block=wide, counter_body=counter)
    softer = sheared(block=wide | {"young_modulus": 2000.0})
    # that of the mesh, one half of the compliance
    np.testing.assert_allclose(found, softer, atol=0.004 * np.abs(softer[:, :2]).max())


@pytest.mark.slow
@pytest.mark.parametrize("cells", [2, 4])
def test_stated_errors_know_the_elements(tmp_path, cells):
    """Edges at the support are singular: force and shear of few cells against the block's."""
    coarse = {**SCENE["surface"], "grid": [32, 32], "spectrum": SPECTRUM}
    load = {"approach": 8e-3, "steps": 1, "shear": [[1e-3, 4e-4]], "shear_steps": 1}
    scene = SCENE | {"surface": coarse, "friction": {"coefficient": 0.4}, "load": load}
    quiet = {**SCENE["output"], "contact": "none"}
    body = {"body": cube(tmp_path, cells), "output": {**quiet, "check": "last"}}
    found = run(Scene.from_dict(scene | body)).steps[-1]
    true = run(Scene.from_dict(scene | {"block": CONSTANTS, "output": quiet})).steps[-1]
    shear, other = (
        np.array([step.shear_force_x_N, step.shear_force_y_N]) for step in (found, true)
    )
    by_body = dict(found.errors)["body"]
    of_shear = dict(found.shear_errors)["body"] + by_body / found.force_N * np.hypot(*shear)
    assert abs(found.force_N - true.force_N) < 1.5 * by_body
    assert 1e-3 < np.hypot(*(shear - other)) / np.hypot(*other) < 1.5 * of_shear / np.hypot(*other)
