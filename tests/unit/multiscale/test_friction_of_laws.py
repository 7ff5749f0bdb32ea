"""Scenes with friction of laws: columns, paths, restart, files, what is said and refused."""

import h5py
import numpy as np
import pytest
from helpers.resumed_runs import gone_on, ran_past

from patchlaw.multiscale import Run, Scene, make_setup, read_laws, run, write_laws
from patchlaw.multiscale.models import problem
from patchlaw.support import NotConverged

MU, SHIFT = 0.3, 4e-4
LOAD = {
    "force": "2.1 N",
    "steps": 1,
    "shear": [["0.4 um", "0 um"], ["-0.4 um", "0.1 um"], ["0.4 um", "0 um"]],
    "shear_steps": 2,
}
CUBE = {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [3, 3, 2]}
COARSE = {"table_tolerance": 0.01}
SLAB = CUBE | {"lengths": [5.0, 4.0], "height": 2.0}


def scene(kind="consistent", *, load=LOAD, friction=MU, **sections):
    spectrum = {"hurst": 0.8, "waves": [2, 6], "rms_height": "1 um", "seed": 3}
    data = {
        "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": [1.0, 1.0]},
        "friction": {"coefficient": friction},
        "load": load,
        "output": {"check": "none", "figures": False, "report": False},
    }
    if kind == "representative":
        many = load | {"force": "42 N"} if load is LOAD else load
        slab = {"block": SLAB, "law": {"kind": kind}, "load": many, "coupling": COARSE}
        return Scene.from_dict(data | slab | sections)
    patches = {"patches": {"grid": [2, 2]}, "coupling": {"kind": kind} | COARSE}
    return Scene.from_dict(data | {"block": CUBE} | patches | sections)


@pytest.mark.long
def test_full_sliding_is_the_coefficient_times_the_force():
    far = {"force": "2.1 N", "steps": 1, "shear": [["5 um", "2 um"]], "shear_steps": 1}
    history = run(scene(load=far))
    forces = history.shear_force_x_N[-1], history.shear_force_y_N[-1]
    # points whose bodies turn over slide in directions of their own, by parts of a degree
    assert np.hypot(*forces) == pytest.approx(MU * 2.1, rel=1e-3)
    assert history.slip_area_fraction[-1] == pytest.approx(
        history.contact_area_fraction[-1], rel=1e-6
    )
    # these directions go on turning into that of the shift
    assert (
        history.tangential_stiffness_N_per_mm[-1] < 0.02 * history.tangential_stiffness_N_per_mm[0]
    )


@pytest.mark.long
def test_the_stiffness_is_that_of_a_small_shift_back():
    """Where the plane turns back everything sticks, what slid included."""
    load = {"force": "30 N", "steps": 1, "shear": [[0.0, 2e-4], [0.0, 1.999e-4]], "shear_steps": 1}
    history = run(scene("representative", load=load))
    change = (history.shear_force_y_N[1] - history.shear_force_y_N[2]) / 1e-7
    # what little slips sideways on the way back, and springs between their nodes
    assert history.tangential_stiffness_N_per_mm[2] == pytest.approx(change, rel=2e-3)
    assert history.tangential_stiffness_N_per_mm[1] < 0.98 * change


@pytest.mark.long
def test_a_shear_force_is_prescribed_under_a_free_plane():
    load = {
        "force": ["1 N", "2 N"], "steps": 1, "tilt": "free",
        "shear_force": [["0.1 N", "0 N"], ["0.2 N", "-0.3 N"]], "shear_path": "along",
    }  # fmt: skip
    history = run(scene(load=load))
    assert history.shear_force_x_N == pytest.approx([0.1, 0.2], abs=1e-9)
    assert history.shear_force_y_N == pytest.approx([0.0, -0.3], abs=1e-9)
    assert history.moment_x_N_mm == pytest.approx([0.0, 0.0], abs=1e-8)
    assert history.shear_y_mm[1] < history.shear_y_mm[0]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["consistent", "representative"])
def test_a_run_goes_on_with_its_sliders(tmp_path, kind):
    whole = ran_past(scene(kind), 4, tmp_path / "run.state").history()
    _, rest = gone_on(scene(kind), tmp_path / "run.state")
    assert [step.step for step in rest] == [5, 6, 7]
    for name in ("shear_force_x_N", "shear_force_y_N", "dissipated_mJ", "force_N"):
        found = [getattr(step, name) for step in rest]
        # Newton's method leaves 1e-9 of the force, small components as much as large ones
        left = 1e-9 * (whole.force_N[-1] if name.endswith("_N") else 1.0)
        assert found == pytest.approx(list(getattr(whole, name)[4:]), rel=1e-7, abs=left)


@pytest.mark.long
def test_steps_that_change_the_force_by_too_much_leave_no_slip_behind():
    load = {"approach": ["4 um", "1 um"], "steps": 1, "force_change": 0.3}
    load |= {"shear": [[SHIFT, 0.0], [0.0, SHIFT]], "shear_path": "along"}
    divided = Run(scene(load=load))
    steps = list(divided.load_steps())
    assert len(steps) > 4
    plain = {"approach": [f"{1e3 * step.approach_mm!r} um" for step in steps], "steps": 1}
    plain |= {"shear": [[step.shear_x_mm, step.shear_y_mm] for step in steps]}
    # the same steps, none of which was tried at more than its size
    other = Run(scene(load=plain | {"shear_path": "along"}))
    other.coupling.table = divided.coupling.table
    for one, same in zip(steps, other.load_steps(), strict=True):
        assert same.shear_force_x_N == pytest.approx(one.shear_force_x_N, rel=1e-6, abs=1e-9)
        assert same.dissipated_mJ == pytest.approx(one.dissipated_mJ, rel=1e-6, abs=1e-12)
    divided.close()
    other.close()


@pytest.mark.slow
def test_laws_are_extended_under_shear_with_what_has_slipped():
    load = {"force": ["6 N", "12 N"], "steps": 1, "shear": [[SHIFT, 0.0], [2 * SHIFT, 0.0]]}
    load |= {"shear_path": "along"}
    long = run(scene("representative", load=load))
    little = {"kind": "representative", "largest_pressure": "0.5 MPa"}
    short = run(scene("representative", load=load, law=little))
    assert "the laws were extended" in " ".join(short.notes)
    # other springs stand for the same law
    assert short.shear_force_x_N == pytest.approx(long.shear_force_x_N, rel=0.01)
    assert short.dissipated_mJ == pytest.approx(long.dissipated_mJ, rel=0.1)


def test_law_files_have_springs_and_their_tangential_stiffness(tmp_path):
    table = make_setup(scene()).make_laws()
    path = write_laws(tmp_path / "laws.h5", table)
    ratio = 1.85 / 1.7
    again = read_laws(path)
    with h5py.File(path) as file:
        springs = file["patch_0_0/springs"]
        assert springs["normal_stiffness"].attrs["unit"] == "MPa/mm"
        assert ((springs["coupling"][:] > 0.4) & (springs["coupling"][:] <= 0.9)).all()
        normal, along = springs["normal_stiffness"][:], springs["tangential_stiffness"][:]
        assert normal == pytest.approx(ratio * along)
        assert normal.sum() >= float(table.laws[0].stiffness(table.laws[0].range[1])) * 0.999
    for law, same in zip(table.laws, again.laws, strict=True):
        assert same.stiffness_ratio == pytest.approx(ratio)
        assert same.springs.stiffness == pytest.approx(law.springs.stiffness, rel=1e-12)


def test_the_plan_says_friction_and_whether_errors_are_measured():
    said = dict(make_setup(scene(output={"check": "last"})).about.statements())
    assert "coefficient 0.3; the laws are beds of springs" in said["friction"]
    assert said["error"].endswith("body and laws; those of the shear as well")
    said = dict(make_setup(scene("representative", output={"check": "last"})).about.statements())
    assert said["error"].endswith("slopes, edges, zero; those of the shear as well")
    said = dict(make_setup(scene("representative")).about.statements())
    assert said["error"].endswith("output.check = 'none'")


PRESSED = {"force": "1 N", "steps": 1}


@pytest.mark.long
def test_friction_without_shear_holds_the_body():
    history = run(scene("representative", load=PRESSED, friction=0.01))
    assert history.shear_x_mm[-1] == 0.0
    assert history.dissipated_mJ[-1] > 0.0


@pytest.mark.slow
def test_a_force_that_slides_under_an_approach_ends_the_run(monkeypatch):
    monkeypatch.setattr(problem, "_SMALLEST", 1.0)  # never halved
    whole = Run(scene(load={"approach": 2e-3, "steps": 1, "shear_force": [90.0, 0.0]}))
    with pytest.raises(NotConverged, match="SLIDES"):
        list(whole.load_steps())
    whole.close()
