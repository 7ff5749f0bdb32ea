"""The meshed roughness of a body from a mesh: the block's results, its plan, what it refuses."""

import numpy as np
import pytest
from helpers.box_msh import write_box

from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.support import InputError

ELASTIC = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
QUIET = {"figures": False, "report": False, "check": "none", "contact": "none"}
TICKS = [np.linspace(0.0, 1.0, 4), np.linspace(0.0, 1.0, 4), np.linspace(-1.0, 0.0, 4)]


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    """Return the file of a cube in hexahedra."""
    path = tmp_path_factory.mktemp("cube") / "cube.msh"
    write_box(path, TICKS)
    return path


def scene(path=None, **sections):
    """Return a scene on the cube's mesh, or on the block of its size."""
    body = {
        "mesh": str(path),
        "contact": "top",
        "element": "quadratic",
        "supports": [{"surface": "bottom"}],
    }
    below = {"block": {"height": 1.0, **ELASTIC}} if path is None else {"body": body | ELASTIC}
    content = {
        "surface": {
            "spectrum": {"hurst": 0.9, "waves": [1, 4], "rms_slope": 0.15, "seed": 4},
            "grid": [64, 64],
            "lengths": [1.0, 1.0],
        },
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": "reference"},
        "load": {"approach": 6e-3, "steps": 1},
        "output": QUIET,
        **below,
    }
    return Scene.from_dict(content | sections)


@pytest.fixture(scope="module")
def history(cube):
    return run(scene(cube))


@pytest.mark.long
def test_cube_from_a_mesh_is_the_block_within_both_error_bars(history):
    on_mesh, on_block = (one.reference.force for one in (history, run(scene())))
    both = float(on_mesh.error[0] + on_block.error[0])
    assert abs(float(on_mesh.value[0] - on_block.value[0])) < both
    assert both < 0.02 * float(on_block.value[0])


@pytest.mark.long
def test_plan_says_what_is_meshed_and_what_it_takes(cube):
    setup = make_setup(scene(cube))
    said = dict(setup.about.statements())
    assert "two meshes of tetrahedra (P2)" in said["body"]
    assert "bisected from the 27 hexahedra of cube.msh" in said["body"]
    planned = np.array(setup.rough_meshes.unknowns)
    made = np.array([one.problem.body.dofs for one in setup.model.meshes])
    assert np.all(np.abs(np.log2(made / planned)) < 1.0)
    setup.release()


@pytest.mark.long
def test_meshes_follow_the_face_that_gives_way(cube, tmp_path):
    """A column 8 times as high takes most of the approach, and contacts are smaller on it."""
    path = tmp_path / "column.msh"
    write_box(path, [*TICKS[:2], np.linspace(-8.0, 0.0, 17)])
    coarse = {"fine": 0.06, "meshes": 1}
    places = [
        len(make_setup(scene(one, reference={"fine": 0.01})).rough_meshes.shapes[1].places)
        for one in (path, cube)
    ]
    assert 0 < places[0] < 0.8 * places[1]
    by_force = run(scene(path, reference=coarse, load={"force": 0.5}))
    assert by_force.force_N[-1] == pytest.approx(0.5, rel=1e-9)


def test_a_thin_plate_under_deep_valleys_is_refused(tmp_path):
    path = tmp_path / "plate.msh"
    write_box(path, [*TICKS[:2], np.linspace(-0.02, 0.0, 2)])
    setup = make_setup(scene(path))
    with pytest.raises(InputError, match=r"surface = .*: a valley of the roughness is too deep"):
        _ = setup.model
