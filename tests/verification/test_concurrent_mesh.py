"""The contact problem on bodies from meshes, against blocks and against each other."""

import numpy as np
import pytest
from helpers.box_msh import cube_section

from patchlaw.multiscale import Run, Scene

E, NU = 4000.0, 0.15
CONSTANTS = {"young_modulus": E, "poisson_ratio": NU}
SCENE = {
    "surface": {
        "spectrum": {"hurst": 0.95, "waves": [2, 10], "rms_slope": 0.215, "seed": 1},
        "grid": [64, 64],
        "lengths": [1, 1],
    },
    "coupling": {"kind": "concurrent"},
    "load": {"approach": "8 um", "steps": 2},
    "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
}


def forces(**sections):
    whole = Run(Scene.from_dict(SCENE | sections))
    return np.array([step.force_N for step in whole.load_steps()])


def cube(folder, cells, **where):
    return CONSTANTS | cube_section(folder, cells, **where)


@pytest.mark.long
@pytest.mark.parametrize("known", [True, False])
def test_errors_of_elements_are_stated_or_not_known(tmp_path, monkeypatch, known):
    """Two cells a side against the block; and linear elements too many for a second solution."""
    if not known:
        monkeypatch.setattr("patchlaw.macro.compliance.mesh_face.MOST_DOFS", 10)
    small = {"surface": {**SCENE["surface"], "grid": [24, 24]}, **SMALL}
    small["surface"]["spectrum"] = {**SCENE["surface"]["spectrum"], "waves": [2, 4]}
    checked = {"output": {**SCENE["output"], "check": "last"}}
    body = cube(tmp_path, 2) | {"young_modulus": E if known else 2.0 * E}  # another for the cache
    whole = Run(Scene.from_dict(SCENE | small | checked | {"body": body}))
    *_, step = whole.load_steps()
    notes = [str(note) for note in whole.history().notes]
    if not known:
        assert step.force_error_N is None
        assert any("the error by body is not known" in note for note in notes)
        return
    true = forces(**small, block=CONSTANTS)[-1]
    assert 0.0 < abs(step.force_N - true) < 1.5 * dict(step.errors)["body"]


SMALL = {"micro": {"finite_slopes": False}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cells", "slopes", "off"),
    [(4, False, 2e-3), pytest.param(6, True, 2e-3, marks=pytest.mark.slow)],
)
def test_a_cube_on_a_mesh_is_the_block(tmp_path, cells, slopes, off):
    """On 6³ quadratic hexahedra the eight modes have 1.7 elements a half wave."""
    micro = {"micro": {"finite_slopes": slopes}}
    found = forces(body=cube(tmp_path, cells), **micro)
    expected = forces(block=CONSTANTS, **micro)
    np.testing.assert_allclose(found, expected, rtol=off)


@pytest.mark.slow
def test_a_face_larger_than_the_surface(tmp_path):
    """No side bounds the surface; 12 modes on 7 elements along it."""
    found = forces(body=cube(tmp_path, 10, margin=0.2), **SMALL)
    expected = forces(block=CONSTANTS | {"margin": 0.2}, **SMALL)
    np.testing.assert_allclose(found, expected, rtol=2e-3)  # 2e-4 with 12³


@pytest.mark.slow
def test_laws_on_a_mesh_find_the_contact_problem_again(tmp_path):
    body = cube(tmp_path, 4)
    laws = {"coupling": {"kind": "consistent"}, "patches": {"grid": [2, 2]}}
    found, expected = forces(body=body, **SMALL, **laws), forces(body=body, **SMALL)
    np.testing.assert_allclose(found, expected, rtol=1e-3)  # the default tolerance of tables


@pytest.mark.slow
@pytest.mark.parametrize("first", ["block", "mesh"])
def test_a_margin_goes_with_a_meshed_counter_body(tmp_path, first):
    """Two alike bodies, both wider than the surface, are one of half the modulus."""
    wide = CONSTANTS | {"margin": 0.2}
    first = {"block": wide} if first == "block" else {"body": cube(tmp_path, 10, margin=0.2)}
    counter = cube(tmp_path, 10, margin=0.2, above=True)
    found = forces(counter_body=counter, **first, **SMALL)
    softer = wide | {"young_modulus": 0.5 * E}
    np.testing.assert_allclose(found, forces(block=softer, **SMALL), rtol=2e-3)  # that of 10³


@pytest.mark.slow
def test_a_stiff_counter_body_is_a_rigid_plane_beside_a_margin(tmp_path):
    """The pair takes more modes, 16 for 13, which change the force by 3e-4; with finite slopes."""
    block = {"block": CONSTANTS | {"margin": 0.1}}
    stiff = cube(tmp_path, 3, above=True) | {"young_modulus": 1e9 * E}
    np.testing.assert_allclose(forces(counter_body=stiff, **block), forces(**block), rtol=6e-4)
