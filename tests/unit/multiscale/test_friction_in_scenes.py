"""Scenes with friction: what is solved, kept, written, said and refused."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from helpers.pressed_cells import pressed_cells
from helpers.resumed_runs import gone_on, ran_past
from helpers.small_scene import SMALL_SCENE

from patchlaw.geometry import ShearControl
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.multiscale import LoadHistory, Run, make_setup, read_history, run
from patchlaw.multiscale.cli import main
from patchlaw.multiscale.models import cell_coupling
from patchlaw.multiscale.observers.step_observers import BALANCE, missing_energy
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.support import NotConverged

PATH = {
    "force": "0.9 N",
    "steps": 2,
    "shear": [["0.4 um", "0 um"], ["-0.4 um", "0.1 um"], ["0.4 um", "0 um"]],
    "shear_steps": 2,
}


def scene(kind="analytic", *, load=PATH, friction=0.3, coupled=False, **sections):
    rubs = {} if friction is None else {"friction": {"coefficient": friction, "coupled": coupled}}
    return pressed_cells(kind, load, **rubs, **sections)


def test_the_scene_is_the_model():
    made = make_setup(scene())
    surface, materials = made.parts.surface, made.parts.materials
    normal = HalfSpaceModel(surface, contact_modulus=materials.contact_modulus)
    model = FrictionModel(materials=materials, coefficient=0.3, spacing=surface.spacing)
    bare = run(scene(micro={"finite_slopes": False}))
    state = None
    for step in bare:
        pressed = normal.solve_force(step.force_N)
        shift = step.shear_x_mm, step.shear_y_mm
        state = model.advance(state, pressed.pressures, ShearControl(shift=shift))
        assert state.force == pytest.approx(
            (step.shear_force_x_N, step.shear_force_y_N), rel=1e-5, abs=1e-7
        )
    assert state.dissipated == pytest.approx(step.dissipated_mJ, rel=1e-4)


def test_a_shear_force_is_prescribed_and_goes_along_with_the_load():
    along = {
        "force": ["0.5 N", "0.9 N"],
        "steps": 2,
        "shear_force": [["0.1 N", "0 N"], ["0.1 N", "-0.2 N"]],
        "shear_path": "along",
    }
    history = run(scene(load=along))
    assert len(history) == 4
    assert history.force_N == pytest.approx([0.25, 0.5, 0.7, 0.9])
    assert history.shear_force_x_N == pytest.approx([0.05, 0.1, 0.1, 0.1], abs=1e-9)
    assert history.shear_force_y_N == pytest.approx([0.0, 0.0, -0.1, -0.2], abs=1e-9)
    assert (np.diff(history.shear_y_mm[1:]) < 0.0).all()


def test_cycles_return_to_where_they_were():
    twice = PATH | {"shear": PATH["shear"][1:], "shear_cycles": 2}
    history = run(scene(load=twice))
    assert len(history) == 2 + 2 * 2 * 2
    assert history.shear_force_x_N[-1] == pytest.approx(history.shear_force_x_N[5], rel=0.05)
    assert "the loop from load step" in " ".join(history.notes)


@pytest.mark.parametrize(
    "sections",
    [{}, {"micro": {"hardness": 300.0}}, pytest.param({"coupled": True}, marks=pytest.mark.long)],
)
def test_a_run_goes_on_with_its_tractions_and_slip(tmp_path, sections):
    made, path = scene(**sections), tmp_path / "run.state"
    whole = ran_past(made, 5, path).history()
    _, rest = gone_on(made, path)
    assert [step.step for step in rest] == [6, 7, 8]
    names = "shear_force_x_N", "shear_force_y_N", "dissipated_mJ", "force_N"
    for name in (*names, "approach_mm", "approach_stiffness_N_per_mm"):
        found, known = [getattr(step, name) for step in rest], getattr(whole, name)[5:]
        # coupled, pressures and tractions agree to 1e-6 of the displacements
        np.testing.assert_allclose(found, known, rtol=2e-5 if "coupled" in sections else 0.0)
    # coupled, the plane rises or sinks while it shifts under one force
    moved = np.ptp(whole.approach_mm[1:]) / whole.approach_mm[1]
    assert moved > 1e-5 if "coupled" in sections else moved < 1e-8
    assert ("solved in turn" in " ".join(whole.notes)) == ("coupled" in sections)


@pytest.mark.long
def test_fields_columns_figure_and_report_are_written(tmp_path):
    output = {"check": "none", "figures": True, "report": True, "contact": "all"}
    load = PATH | {"steps": 1, "shear": PATH["shear"][:1]}
    whole = Run(scene(output=output, load=load))
    list(whole.load_steps())
    files = {path.name for path in write_results(tmp_path, whole, options=[])}
    whole.close()
    assert {"shear.png", "contact.h5", "report.html"} <= files
    last = whole.history().steps[-1]
    with h5py.File(tmp_path / "contact.h5") as file:
        group = file[f"step_{last.step}"]
        traction, pressure = group["traction_MPa"][:], group["pressure_MPa"][:]
        slip, slipping = group["slip_mm"][:], group["slipping"][:]
    assert traction.shape == slip.shape == (2, 24, 24)
    size = np.hypot(*traction)
    assert (size <= 0.3 * pressure * (1.0 + 1e-9)).all()
    assert size[slipping] == pytest.approx(0.3 * pressure[slipping], rel=1e-9)
    assert not slip[:, pressure == 0.0].any()
    assert traction[0].sum() / 24**2 == pytest.approx(last.shear_force_x_N, rel=1e-9)
    again = read_history(tmp_path)
    assert again.shear_force_x_N == pytest.approx(whole.history().shear_force_x_N, rel=1e-9)
    report = (tmp_path / "report.html").read_text()
    for text in ("shear force along x", "coefficient of friction", "Which cells stick", "Goodman"):
        assert text in report


def test_what_is_neglected_is_said():
    load = PATH | {"steps": 1, "shear": PATH["shear"][:1], "shear_steps": 1}

    few = {**scene().to_dict()["surface"], "grid": [14, 14]}

    def said(*kind, **sections):
        return " ".join(run(scene(*kind, load=load, surface=few, **sections)).notes)

    notes = said("concurrent")
    assert "tractions lift it (Dundurs' β = 0.412, and a finite body) is left out" in notes
    assert "(Dundurs' β = 0.412) is left out" in said("analytic")
    assert "on a half-space" not in notes
    like = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
    told = "two like bodies, whose pressures and tractions do not see each other"
    assert told in said(counter_body=like)


def test_the_plan_says_the_shear():
    said = dict(make_setup(scene()).about.statements())["load"]
    assert "then in 2 steps each to a shift of (400 nm, 0 nm), (-400 nm, 100 nm)" in said


STAGES = [
    {"force": 0.9, "steps": 1},
    {"shear": [4e-4, 0.0], "steps": 2},
    {"force": 0.5, "steps": 1, "name": "eased"},
    {"shear": [4e-4, 1e-4], "cycles": 1, "steps": 2},
]


def test_stages_press_then_shear():
    history = run(scene(load={"stage": STAGES}))
    assert history.force_N == pytest.approx([0.9, 0.9, 0.9, 0.5, 0.5, 0.5, 0.5, 0.5])
    assert history.shear_x_mm == pytest.approx([0.0, 2e-4, *6 * [4e-4]])
    assert history.shear_y_mm == pytest.approx([0.0, 0.0, 0.0, 0.0, 5e-5, 1e-4, 5e-5, 0.0])
    assert [step.stage for step in history] == [1, 2, 2, 3, 4, 4, 4, 4]
    # as far as the second stage it is the history that has turning points
    same = run(scene(load=PATH | {"steps": 1, "shear": PATH["shear"][0]}))
    for name in ("shear_force_x_N", "dissipated_mJ", "tangential_stiffness_N_per_mm"):
        assert getattr(history, name)[:3] == pytest.approx(getattr(same, name), rel=1e-9)
    assert np.hypot(history.shear_force_x_N, history.shear_force_y_N)[3:].max() < 0.3 * 0.5
    assert (np.diff(history.dissipated_mJ) >= 0.0).all()


def test_stages_prescribe_shear_forces_and_say_so():
    stages = [{"force": 0.9}, {"shear_force": ["0.1 N", "0.05 N"], "steps": 2}]
    made = scene(load={"stage": stages, "steps": 1})
    history = run(made)
    assert history.shear_force_x_N == pytest.approx([0.0, 0.05, 0.1], abs=1e-9)
    said = dict(make_setup(made).about.statements())["load"]
    assert "stage 2 in 2: shear force to (100 mN, 50 mN)" in said


def test_a_force_that_slides_ends_the_run_with_what_was_found(tmp_path, capsys):
    path = tmp_path / "slides.toml"
    slides = 'approach = "8 um"\nsteps = 1\nshear_force = ["1 kN", "0 N"]\nshear_steps = 1\n'
    text = SMALL_SCENE.replace('approach = "8 um"\nsteps = 2\n', slides)
    assert slides in text
    path.write_text(f"{text}[friction]\ncoefficient = 0.3\n", encoding="utf-8")
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 3
    said = capsys.readouterr().err
    assert "load step 2" in said
    assert "exceeds what friction transmits: the contact slides" in said
    assert len(read_history(tmp_path / "out")) == 1


def test_halved_loads_take_their_part_of_the_shear():
    loads = LoadHistory(
        force=(2.0, 4.0), steps=1, shear=((1.0, 0.0), (1.0, 2.0)), shear_path="along"
    )
    first, second = loads.path()
    assert first.part(0.5, None).shear == ShearControl(shift=(0.5, 0.0))
    assert second.part(0.5, first).shear == ShearControl(shift=(1.0, 1.0))
    assert second.part(0.5, first).force == 3.0
    after = replace(loads, shear_path="after", shear_steps=2)
    assert [step.force for step in after.path()] == [2.0] + 5 * [4.0]
    assert after.count == 6
    shears = [step.shear.shift for step in after.path()[1:]]
    assert shears == [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 2.0)]
    assert after.path().control(4.0).shear is None


@pytest.mark.long
@pytest.mark.parametrize(("poisson_ratio", "expected"), [(0.0, True), (0.47, False)])
def test_friction_is_coupled_where_leaving_it_out_would_matter(poisson_ratio, expected):
    """The shift under a shear force differs by half where pressures pull as much as the force."""
    block = {"young_modulus": 4000.0, "poisson_ratio": poisson_ratio}
    load = {"force": "0.9 N", "steps": 2, "shear_force": [["0.14 N", "0 N"]], "shear_steps": 2}

    def shift(coupled):
        rubs = {"coefficient": 0.3} | ({} if coupled is None else {"coupled": coupled})
        done = pressed_cells("analytic", load, block=block, friction=rubs)
        return (history := run(done)).shear_x_mm[-1], " ".join(history.notes)

    (own, notes), (apart, _), (together, _) = map(shift, (None, False, True))
    assert own == (together if expected else apart)
    assert (abs(together / apart - 1.0) > 0.1) == expected
    assert ("the shear would differ by more than 10 %, or" in notes) == expected


def test_friction_is_coupled_where_it_is_not_known_if_that_matters(monkeypatch):
    """The problem on few cells that tells it has no solution."""

    def fails(*_):
        raise NotConverged("it", reason="r", iterations=1, remedy="none")

    monkeypatch.setattr(cell_coupling, "Problem", fails)
    load = PATH | {"shear": PATH["shear"][:1], "steps": 1}
    history = run(pressed_cells("analytic", load, friction={"coefficient": 0.3}))
    assert "or it is not known by how much" in " ".join(history.notes)


def test_energies_of_coupled_friction_are_not_said_to_lack_balance():
    """Tractions that displace the surface across store energy, which slopes do not explain."""
    load = {"force": "0.9 N", "steps": 2, "shear": ["0.4 um", "0 um"], "shear_steps": 1}
    history = run(scene(load=load, friction=1.0, coupled=True))
    assert missing_energy(history.steps) > BALANCE
    assert not [note for note in history.notes if "not balanced" in note]
    assert [note for note in history.notes if note.startswith("energies at load step 3")]
