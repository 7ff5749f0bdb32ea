"""Wear in scenes: what slides wears, as the micro model alone does, with errors and a worn map."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.resumed_runs import gone_on, ran_past

from patchlaw import Material, Problem, Step, read_surface, run
from patchlaw.geometry import Control, ShearControl
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.wear import slide
from patchlaw.multiscale import CellContact, Run, Scene, read_contact, read_fields
from patchlaw.multiscale.models.measured_errors.errors import (
    MeasuredErrors,
    WearErrors,
    error_columns,
)
from patchlaw.multiscale.runs.output.results import write_fields, write_results
from patchlaw.support import InputError

COEFFICIENT, SLID = 3.1e-10, (37.0, 1.9e3, 2.3e4)
"""Of wear [mm²/N], and what is slid [mm]."""


def scene(kind="concurrent", **changes):
    spectrum = {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.1, "seed": 5}
    data = {
        "surface": {"spectrum": spectrum, "grid": [32, 28], "lengths": [0.93, 0.81]},
        "block": {"young_modulus": "70 GPa", "poisson_ratio": 0.3, "height": "1 mm"},
        "coupling": {"kind": kind},
        "wear": {"coefficient": f"{COEFFICIENT!r} mm^2/N"},
        "load": {"force": "20 N", "steps": 1, "sliding": list(SLID)},
        "output": {"figures": False, "report": False, "check": "none"},
    }
    return Scene.from_dict({**data, **changes})


def test_a_scene_wears_as_the_micro_model_alone():
    sizes = {"micro": {"finite_slopes": False}}
    data = scene("analytic", **sizes)
    history = run(data)
    made = Run(data)
    model = HalfSpaceModel(
        made.coupling.parts.surface,
        contact_modulus=made.coupling.parts.materials.contact_modulus,
        tolerance=1e-8,
    )
    state = model.press(Control(force=20.0))
    for step, further in zip(history.steps[1:], np.diff((0.0, *SLID)), strict=True):
        state = slide(model, Control(force=20.0), state.start, COEFFICIENT * further).state
        assert step.approach_mm == pytest.approx(state.approach, rel=1e-6)
        assert step.worn_depth_mm == pytest.approx(state.worn_depth.max(), rel=1e-5)
        assert step.mean_separation_mm == pytest.approx(state.mean_separation, rel=1e-6)


def test_depths_have_no_error_where_the_error_of_the_force_is_not_known():
    step = next(iter(Run(scene("analytic")).load_steps()))
    step = replace(step, worn_depth_mm=2e-3, mean_worn_depth_mm=1e-3)
    found = MeasuredErrors(by_cause={"grid": np.full(6, np.inf)}, stiffness=1.0)
    found = found.with_wear(step, [], WearErrors([0.0] * 6))  # a warning of numpy fails
    assert error_columns(step, found)["worn_depth_error_mm"] is None


@pytest.mark.long
def test_problems_in_python_wear():
    made = Run(scene("analytic"))
    contact = CellContact.of(
        made.coupling.parts.surface,
        Material(young_modulus=7e4, poisson_ratio=0.3),
        wear=COEFFICIENT,
    )
    steps = list(Problem(contact, [Step(force=20.0, slid=far) for far in (0.0, *SLID)]).steps())
    expected = run(scene("analytic"))
    for one, other in zip(steps, expected.steps, strict=True):
        assert one.approach_mm == pytest.approx(other.approach_mm, rel=1e-8)
        assert one.worn_volume_mm3 == pytest.approx(other.worn_volume_mm3, rel=1e-12)


def test_stages_slide_under_loads_of_their_own():
    stages = [
        {"force": "20 N", "steps": 1},
        {"force": "50 N", "sliding": ["0.4 m", "1 m"], "steps": 2},
        {"sliding": "2 m"},
        {"force": "5 N", "sliding": "3 m", "steps": 1},
    ]
    history = run(scene("analytic", load={"stage": stages}))
    slid = np.array([0.0, 0.0, 0.0, 400.0, 1e3, 3e3, 3e3, 6e3])
    np.testing.assert_allclose(history.slid_mm, slid, rtol=1e-14)
    forces = np.array([20.0, 35.0, 50.0, 50.0, 50.0, 50.0, 5.0, 5.0])
    np.testing.assert_allclose(history.force_N, forces, rtol=1e-9)
    volume = COEFFICIENT * np.cumsum(forces * np.diff(slid, prepend=0.0))
    np.testing.assert_allclose(history.worn_volume_mm3, volume, rtol=1e-10)
    np.testing.assert_array_equal(history.stage, [1, 2, 2, 2, 2, 3, 4, 4])


@pytest.mark.long
def test_errors_of_wear_last_when_what_is_prescribed_changes():
    """What wore under a force errs in its approach, and later in the force at another approach."""
    stages = [
        {"force": "20 N", "sliding": "20 m", "steps": 1},
        {"approach": "8 um", "steps": 1},
        {"force": "0 N", "steps": 1},
    ]
    output = {"figures": False, "report": False, "check": "all"}
    steps = run(scene("analytic", load={"stage": stages}, output=output)).steps
    slid, held, free = (dict(step.errors)["wear"] for step in steps[-3:])
    assert slid > 1e-4 * steps[-3].force_N
    assert held > 0.5 * slid
    assert free == 0.0 and np.isfinite(dict(steps[-1].errors)["grid"])


def test_a_plane_that_is_held_wears_its_load_away():
    """Steps grow as the force falls: it does so without end."""
    stages = [{"force": "20 N", "steps": 1}, {"hold": "approach", "sliding": "100 m", "steps": 1}]
    history = run(scene("analytic", load={"stage": stages}))
    assert 0.0 < history.force_N[-1] < 0.1 * history.force_N[0]


def test_wear_is_refused_where_it_would_be_forgotten():
    surface = Run(scene("analytic")).coupling.parts.surface
    steel = Material(young_modulus=7e4, poisson_ratio=0.3)
    for path, wear, text in (
        ([Step(force=1.0, slid=10.0)], 0.0, "path: slides where nothing wears"),
        ([Step(force=1.0, slid=10.0), Step(force=2.0, slid=5.0)], 1e-9, "slides back"),
    ):
        contact = CellContact.of(surface, steel, wear=wear, finite_slopes=False)
        with pytest.raises(InputError, match=text):
            Problem(contact, path)
    with pytest.raises(InputError, match="slid"):
        Step(force=1.0, slid=-5.0)
    contact = CellContact.of(surface, steel, wear=1e-9, friction=0.3, finite_slopes=False)
    both = Step(force=1.0, slid=5.0, shear=ShearControl(shift=(1e-4, 0.0)))
    with pytest.raises(InputError, match="slides as a whole what is sheared"):
        list(Problem(contact, [both]).steps())


def test_the_worn_map_is_a_surface_again(tmp_path):
    """Pressed once more without wear it bears the load at the approach, less what has worn off."""
    made = Run(scene("analytic", micro={"finite_slopes": False}))
    list(made.load_steps())
    write_results(tmp_path, made, options=[])
    worn = np.load(tmp_path / "worn.npy")
    surface, last = made.coupling.parts.surface, made.history().steps[-1]
    depth = read_contact(tmp_path).worn_depth_mm[-1]
    assert made.coupling.model.lowered is not None
    np.testing.assert_allclose(worn, surface.heights - depth, rtol=1e-12, atol=1e-12)
    assert depth.mean() == pytest.approx(last.mean_worn_depth_mm, rel=1e-12)
    again = scene(
        "analytic", surface={"file": str(tmp_path / "worn.npy"), "lengths": [0.93, 0.81]},
        wear=None, load={"force": "20 N", "steps": 1}, micro={"finite_slopes": False},
    )  # fmt: skip
    step = run(again).steps[-1]
    assert step.peak_pressure_MPa == pytest.approx(last.peak_pressure_MPa, rel=1e-6)
    assert step.contact_area_fraction == last.contact_area_fraction


@pytest.mark.slow
def test_errors_know_wear(monkeypatch):
    """Those by steps, and by cells that wear once more: against twice as many along a side."""
    checked = scene("analytic", output={"figures": False, "report": False, "check": "last"})
    step = run(checked).steps[-1]
    causes = dict(step.errors)
    assert 0.0 < causes["wear"] < 0.1 * step.force_N
    finer = {**checked.to_dict()["surface"], "grid": [128, 112]}
    true = run(scene("analytic", surface=finer)).steps[-1]
    for name, error in (
        ("approach_mm", step.approach_error_mm),
        ("contact_area_fraction", step.contact_area_fraction_error),
        ("mean_separation_mm", step.mean_separation_error_mm),
        ("interface_stiffness_N_per_mm", step.interface_stiffness_error_N_per_mm),
        ("worn_depth_mm", step.worn_depth_error_mm),
    ):
        assert abs(getattr(step, name) - getattr(true, name)) <= 1.5 * error
    monkeypatch.setattr(CellContact, "wear_errors", (0.0,) * 6)
    without = run(checked).steps[-1]
    name = "interface_stiffness_error_N_per_mm"
    of_stiffness, share = getattr(step, name) - getattr(without, name), causes["wear"] / 20.0
    assert of_stiffness > 0.0
    assert of_stiffness == pytest.approx(share * step.interface_stiffness_N_per_mm, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("load", [{"force": "20 N"}, {"approach": "3 um"}])
def test_what_has_worn_off_has_errors(load):
    """By steps and cells, with the leak's by steps: against cells twice as fine, many more steps.

    Under a force the volume is exact.
    """
    coarse, slid = {**scene().to_dict()["surface"], "grid": [20, 18]}, [1e4, 1e5]
    data = {
        "surface": coarse,
        "micro": {"finite_slopes": False},
        "leak": {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"], "direction": "x"},
        "load": load | {"steps": 1, "sliding": slid},
        "output": {"figures": False, "report": False, "check": "last"},
    }
    step = run(scene("analytic", **data)).steps[-1]
    assert dict(step.leaks[0].causes)["wear"] > 0.0 or step.leaks[0].rate == 0.0
    assert (step.worn_volume_error_mm3 == 0.0) == ("force" in load)
    del data["leak"]
    data["surface"] = coarse | {"grid": [40, 36]}
    data["load"] = load | {
        "steps": 1,
        "sliding": [0.1 * k * way for way in slid for k in range(2, 11)],
    }
    true = run(scene("analytic", **data)).steps[-1]
    for name, error in (
        ("worn_volume_mm3", step.worn_volume_error_mm3 or 1e-9 * step.worn_volume_mm3),
        ("mean_worn_depth_mm", step.mean_worn_depth_error_mm or 1e-9 * step.mean_worn_depth_mm),
        ("worn_depth_mm", step.worn_depth_error_mm),
    ):
        off = abs(getattr(step, name) - getattr(true, name))
        assert off <= 1.5 * error, name


def fretting(**changes):
    """Return a scene whose cells slip, and wear, under a shear there and back."""
    load = {"force": "20 N", "steps": 1, "shear": [["0.4 um", 0], ["-0.4 um", 0]], "shear_steps": 1}
    friction, micro = {"coefficient": 0.3, "coupled": False}, {"finite_slopes": False}
    return scene("analytic", friction=friction, load=load, micro=micro, **changes)


def test_fretting_wears_off_what_friction_takes(tmp_path):
    """Volume and depths are k/μ of the energy; slid distances times μ and force are, too."""
    made = Run(fretting(wear={"coefficient": "1e-2 mm^2/N"}))
    steps = list(made.load_steps())
    history = made.history()
    np.testing.assert_allclose(
        history.worn_volume_mm3, 1e-2 / 0.3 * history.dissipated_mJ, rtol=1e-12
    )
    np.testing.assert_allclose(history.dissipated_mJ, 0.3 * 20.0 * history.slid_mm, rtol=1e-7)
    assert (np.diff(history.worn_volume_mm3) > 0.0).all()
    assert steps[1].slip_area_fraction < 0.9 * steps[1].contact_area_fraction
    assert (np.diff(history.approach_mm) > 0.0).all()
    write_results(tmp_path, made, options=[])
    contact = read_contact(tmp_path)
    heat, depth = contact.dissipated_mJ_per_mm2[-1], contact.worn_depth_mm[-1]
    np.testing.assert_allclose(depth, 1e-2 / 0.3 * heat, rtol=1e-9, atol=1e-15)
    assert heat.mean() * 0.93 * 0.81 == pytest.approx(steps[-1].dissipated_mJ, rel=1e-12)


@pytest.mark.parametrize("frets", [True, pytest.param(False, marks=pytest.mark.long)])
def test_a_run_that_goes_on_wears_on(tmp_path, frets):
    data = fretting(wear={"coefficient": "1e-2 mm^2/N"}) if frets else scene("analytic")
    whole = ran_past(data, 2, tmp_path / "checkpoint.state")
    _, again = gone_on(data, tmp_path / "checkpoint.state")
    names = "approach_mm", "worn_depth_mm", "worn_volume_mm3", "slid_mm", "shear_force_x_N"
    for one, other in zip(again, whole.history().steps[2:], strict=True):
        assert [getattr(one, name) for name in names] == [getattr(other, name) for name in names]


def test_sliding_heats_by_friction(tmp_path):
    """μ F s is lost, μ F v is the power, and μ ∫ p ds at every cell."""
    made = Run(scene("analytic", friction={"coefficient": 0.3, "speed": "5 m/s"}))
    list(made.load_steps())
    history = made.history()
    np.testing.assert_allclose(history.dissipated_mJ, 0.3 * 20.0 * history.slid_mm, rtol=1e-10)
    np.testing.assert_allclose(history.friction_power_W, 0.3 * 20.0 * 5.0, rtol=1e-10)
    np.testing.assert_allclose(history.approach_mm, run(scene("analytic")).approach_mm, rtol=1e-12)
    write_results(tmp_path, made, options=[])
    contact = read_contact(tmp_path)
    np.testing.assert_allclose(
        contact.dissipated_mJ_per_mm2[-1], 0.3 / COEFFICIENT * contact.worn_depth_mm[-1], rtol=1e-9
    )


@pytest.mark.long  # the body of a block at every cell
def test_fields_of_a_body_have_its_worn_depth(tmp_path):
    """On the cells below the contact face, whose facets are equal."""
    output = {"figures": False, "report": False, "check": "none", "fields": "all"}
    load = {"force": "20 N", "steps": 1, "sliding": "100 m"}
    coarse = {**scene().to_dict()["surface"], "grid": [16, 14]}
    micro = {"finite_slopes": False}
    made = Run(scene(load=load, output=output, micro=micro, surface=coarse))
    *_, step = made.load_steps()
    write_fields(tmp_path, made)
    fields = read_fields(tmp_path)
    assert not fields.worn_depth_mm[0].any()
    sums = fields.worn_depth_mm[-1].sum() / fields.pressure_MPa[-1].sum()
    assert sums == pytest.approx(step.mean_worn_depth_mm / step.mean_pressure_MPa, rel=1e-9)


def test_a_worn_list_of_points_has_its_lengths(tmp_path):
    surface = Run(scene("analytic")).coupling.parts.surface
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    points = np.stack([x, y, surface.heights], axis=-1).reshape(-1, 3)
    np.savetxt(tmp_path / "new.xyz", points)
    load = {"force": "20 N", "steps": 1, "sliding": "10 m"}
    data = {"surface": {"file": str(tmp_path / "new.xyz")}, "micro": {"finite_slopes": False}}
    made = Run(scene("analytic", load=load, **data))
    list(made.load_steps())
    write_results(tmp_path, made, options=[])
    again = read_surface(tmp_path / "worn.xyz")
    np.testing.assert_array_equal(again.heights, np.load(tmp_path / "worn.npy"))
    np.testing.assert_allclose(again.lengths, surface.lengths, rtol=1e-12)


@pytest.mark.long
def test_fretting_goes_with_unloading_hardness_leaks_and_coupling():
    """Cells that yield, a plane that turns, loads that fall to nothing, fluid in the gaps."""
    stages = [
        {"force": "20 N", "steps": 1},
        {"shear": [["0.4 um", 0]], "steps": 1},
        {"force": "30 N", "shear": [["-0.4 um", 0]], "steps": 2},
        {"force": "4 N", "steps": 1},
        {"force": "0 N", "steps": 1},
    ]
    surface = {**scene().to_dict()["surface"], "grid": [20, 20]}
    data = fretting(surface=surface, wear={"coefficient": "1e-3 mm^2/N"}).to_dict()
    data |= {
        "friction": {"coefficient": 0.3, "coupled": True},
        "micro": {"finite_slopes": True, "hardness": "3 GPa"},
        "leak": {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"], "direction": "x"},
        "load": {"tilt": "free", "stage": stages},
    }
    history = run(Scene.from_dict(data))
    volume = 1e-3 / 0.3 * history.dissipated_mJ
    np.testing.assert_allclose(history.worn_volume_mm3, volume, rtol=1e-12)
    assert (np.diff(volume[1:-1]) > 0.0).all() and volume[-1] == volume[-2]
    slid = 1e-3 * history.force_N[1:] * np.diff(history.slid_mm)
    np.testing.assert_allclose(np.diff(volume), slid, rtol=1e-6, atol=1e-15)
    assert history.leak_x_mm3_per_s[-1] > history.leak_x_mm3_per_s[-2]
    assert history.plastic_depth_mm[-1] > 0.0


@pytest.mark.long
def test_errors_know_fretting():
    """Those by steps and by cells, which wear once more: against twice as many of both."""
    wear = {"coefficient": "1e-2 mm^2/N"}
    data = fretting(wear=wear).to_dict()
    data["output"]["check"] = "last"
    step = run(Scene.from_dict(data)).steps[-1]
    assert 0.0 < dict(step.errors)["steps"] < 0.2 * step.force_N
    data["output"]["check"], data["load"]["shear_steps"] = "none", 4
    data["surface"]["grid"] = [64, 56]
    true = run(Scene.from_dict(data)).steps[-1]
    for name, error in (
        ("approach_mm", step.approach_error_mm),
        ("contact_area_fraction", step.contact_area_fraction_error),
        ("mean_separation_mm", step.mean_separation_error_mm),
        ("shear_force_x_N", step.shear_force_error_N),
        ("dissipated_mJ", step.dissipated_error_mJ),
        ("worn_volume_mm3", step.worn_volume_error_mm3),
        ("worn_depth_mm", step.worn_depth_error_mm),
    ):
        assert abs(getattr(step, name) - getattr(true, name)) <= error
    of_volume = 1e-2 / 0.3 * step.dissipated_error_mJ  # which friction takes
    assert step.worn_volume_error_mm3 == pytest.approx(of_volume, rel=1e-9)
