"""Runs on bodies from meshes that go on: with the same results, and not with another mesh."""

import pytest
from helpers.box_msh import write_box

from patchlaw import InputError
from patchlaw.geometry import BlockShape
from patchlaw.multiscale import Scene
from patchlaw.multiscale.runs.output.results_folder import FILE_NAME, checkpoint_of, find_checkpoint
from patchlaw.multiscale.runs.scene_run import Run
from patchlaw.support.files import write_record

TICKS = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(3, 3, 2)).ticks


def scene_on(mesh):
    spectrum = {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.2, "seed": 3}
    return Scene.from_dict(
        {
            "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": [0.1, 0.1]},
            "law": {"kind": "representative"},
            "body": {
                "mesh": str(mesh),
                "contact": "top",
                "supports": [{"surface": "bottom"}],
                "young_modulus": "4 GPa",
                "poisson_ratio": 0.15,
            },
            "load": {"force": "2 N", "steps": 3},
        }
    )


@pytest.mark.slow
def test_a_run_goes_on_with_the_same_mesh_alone(tmp_path):
    mesh, folder = write_box(tmp_path / "cube.msh", TICKS), tmp_path / "results"
    folder.mkdir()
    scene = scene_on(mesh)
    first = Run(scene)
    steps = first.load_steps()
    next(steps)
    write_record(folder / FILE_NAME, checkpoint_of(first, first.coupling.state()))
    whole = [first.steps[0].approach_mm, *(step.approach_mm for step in steps)]

    write_box(mesh, (*TICKS[:2], 1.1 * TICKS[2]))
    with pytest.raises(InputError, match=r"content of body.mesh = .*is not what the run in"):
        find_checkpoint(folder, scene)
    write_box(mesh, TICKS)
    again = Run(scene)
    kept = find_checkpoint(folder, scene)
    again.resume(kept.steps, kept.position, kept.state, kept.table)
    list(again.load_steps())
    found = [step.approach_mm for step in again.steps]
    assert found == pytest.approx(whole, rel=1e-9)  # Newton's residual, 1e-9 of the load
