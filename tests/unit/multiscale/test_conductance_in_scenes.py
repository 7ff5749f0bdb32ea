"""Scenes that ask for the conductance of their interface: columns, laws, notes, refusals."""

import csv
from functools import cache

import numpy as np
import pytest
from helpers.resumed_runs import ran_past

from patchlaw.geometry import Control
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import STEFAN_BOLTZMANN
from patchlaw.multiscale import Run, Scene, make_setup, read_history, run
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.multiscale.runs.output.results_folder import read_checkpoint

LAWS = ("isolated", "consistent")
HEAT = {"conductivity": ["50 W/m/K", "0.2 W/m/K"]}
PAIR = 1.0 / (1.0 / 50.0 + 1.0 / 0.2)
GAPS = {"gas": "0.026 W/m/K", "temperature": "350 K", "emissivity": 0.4}


def scene(kind="analytic", conductance=HEAT, **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1}
    data = {
        "surface": {"spectrum": spectrum, "grid": [24, 24], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": kind} | ({"table_tolerance": 0.01} if kind in LAWS else {}),
        "load": {"approach": 0.008, "steps": 2},
        "output": {"check": "none", "figures": False, "report": False, "contact": "none"},
    }
    return Scene.from_dict(
        data | ({} if conductance is None else {"conductance": conductance}) | sections
    )


@cache
def ran(kind):
    return run(scene(kind))


@pytest.mark.parametrize("load", [{"approach": 0.008}, {"force": 20.0}])
def test_gas_next_to_contacts_errs_by_the_size_of_the_cells(load):
    """Insulators: most of the heat goes through the gas, and most of that next to contacts."""
    heat = {"conductivity": "0.2 W/m/K", "gas": "0.026 W/m/K", "temperature_jump": "70 nm"}
    asked = scene(conductance=heat, load=load | {"steps": 1}).with_({"output.check": "last"})
    finer = asked.with_({"surface.grid": [96, 96], "output.check": "none"})
    step, exact = (run(one)[-1] for one in (asked, finer))
    for name in ("gap_conductance", "thermal_conductance"):
        own, true = (getattr(one, f"{name}_W_per_K") for one in (step, exact))
        assert own < 0.95 * true
        assert true - own < 1.5 * getattr(step, f"{name}_error_W_per_K") < 1.5 * true


def test_contacts_conduct_by_the_stiffness_of_the_interface():
    asked = scene(micro={"finite_slopes": False}).with_({"output.check": "last"})
    setup = make_setup(asked)
    model = HalfSpaceModel(
        setup.parts.surface, contact_modulus=setup.parts.materials.contact_modulus
    )
    history, step = run(asked), 1e-7
    for approach, conductance in zip(
        history.approach_mm, history.thermal_conductance_W_per_K, strict=True
    ):
        ahead, behind = (model.press(Control(approach=approach + way)) for way in (step, -step))
        rate = (ahead.force - behind.force) / (behind.mean_separation - ahead.mean_separation)
        expected = 2.0 * PAIR / model.contact_modulus * rate * 1e-3  # N/mm / MPa = mm
        assert conductance == pytest.approx(expected, rel=1e-4)
    assert (history.gap_conductance_W_per_K == 0.0).all()
    assert history[-1].gap_conductance_error_W_per_K == 0.0  # nothing is not off
    assert np.isnan(history.electrical_conductance_S).all()


def test_heat_and_current_pass_alike():
    both = scene(conductance={"conductivity": "80 W/m/K", "resistivity": "1.7e-8 ohm m"})
    history = run(both)
    ratio = history.electrical_conductance_S / history.thermal_conductance_W_per_K
    np.testing.assert_allclose(ratio, 1.0 / 1.7e-8 / 80.0, rtol=1e-12)


@pytest.mark.parametrize("kind", ["consistent", pytest.param("isolated", marks=pytest.mark.long)])
def test_patch_laws_conduct_by_the_stiffness_of_their_interface(kind):
    near = {"approach": ["0.00796 mm", "0.008 mm", "0.00804 mm"], "steps": 1}
    done = Run(scene(kind, load=near))
    before, step, after = done.load_steps()
    gaps = before.mean_separation_mm - after.mean_separation_mm
    rate = (after.force_N - before.force_N) / gaps
    modulus = done.coupling.parts.materials.contact_modulus
    # N/mm over MPa is a length in mm; half a per cent of the way, and the table's own tolerance
    expected = 2.0 * PAIR * rate / modulus * 1e-3
    assert step.thermal_conductance_W_per_K == pytest.approx(expected, rel=0.03)
    for law, c, found in zip(
        done.coupling.table.laws,
        step.patches.closure_mm,
        step.patches.interface_stiffness_MPa_per_mm,
        strict=True,
    ):
        ahead, behind = (law.at(c + way, extend=True) for way in (1e-6, -1e-6))
        quotient = (ahead.pressure - behind.pressure) / (behind.separation - ahead.separation)
        assert found == pytest.approx(float(quotient), rel=0.05, abs=1e-3)
    done.close()


def shown(**changes):
    """Return the load steps of a scene whose gaps conduct, with maps of the gaps."""
    output = {"check": "none", "figures": False, "report": False, "contact": "all"}
    return run(scene(conductance=HEAT | GAPS | changes, output=output))


@pytest.mark.parametrize("jump", ["0 um", "0.37 um", "2 um"])
def test_gas_and_radiation_pass_through_the_gaps(jump):
    """By hand, from maps of gaps: k/(g + M) beside the contacts, which conduct by themselves."""
    history = shown(temperature_jump=jump)
    length = 1e-3 * float(jump.split()[0])
    for step, record in zip(history, history.contact_records, strict=True):
        open_gaps = record.gap_mm[record.pressure_MPa == 0.0]
        gas = 0.026e3 * np.sum(1.0 / (open_gaps + length)) / record.gap_mm.size
        radiation = 4.0 * 0.4 * STEFAN_BOLTZMANN * 350.0**3 * (1.0 - step.contact_area_fraction)
        assert step.gap_conductance_W_per_K == pytest.approx((gas + radiation) * 1e-6, rel=1e-9)
        # no less than a layer as thick as the mean gap (Jensen), without radiation
        mean = 0.026e3 * len(open_gaps) / record.gap_mm.size / (open_gaps.mean() + length)
        assert gas > 1.05 * mean
    contacts = history.thermal_conductance_W_per_K - history.gap_conductance_W_per_K
    np.testing.assert_allclose(contacts, ran("analytic").thermal_conductance_W_per_K, rtol=1e-9)
    assert any("of it through the gaps" in note for note in history.notes)
    assert any("temperature_jump" in note for note in history.notes) == (jump == "0 um")


@pytest.mark.long
@pytest.mark.parametrize("kind", ["analytic", "consistent"])
@pytest.mark.parametrize(("check", "known"), [("none", []), ("last", [2]), ("all", [1, 2])])
def test_conductances_have_errors_where_others_have(kind, check, known):
    """That of contacts is relative to them that of the stiffness which they follow from."""
    output = {"check": check, "figures": False, "report": False}
    both = {"conductivity": "80 W/m/K", "resistivity": "1.7e-8 ohm m", "gas": "0.026 W/m/K"}
    both["temperature_jump"] = "0.4 um"
    history = run(scene(kind, both, output=output))
    errors = history.interface_stiffness_error_N_per_mm / history.interface_stiffness_N_per_mm
    assert [step.step for step in history if step.interface_stiffness_error_N_per_mm] == known
    of_current = history.electrical_conductance_error_S / history.electrical_conductance_S
    np.testing.assert_allclose(of_current, errors, rtol=1e-12)
    through_contacts = history.thermal_conductance_W_per_K - history.gap_conductance_W_per_K
    least = errors * through_contacts
    more = history.thermal_conductance_error_W_per_K > least  # gaps add theirs
    assert more.tolist() == [number in known for number in (1, 2)]
    assert not known or any(" ± " in note for note in history.notes if "conductance at" in note)


def test_conductances_have_alike_errors_where_no_stiffness_is_stated():
    shown, hidden = (
        run(scene(output={"check": "last", "contact": contact})) for contact in ("auto", "none")
    )
    assert np.isnan(hidden.interface_stiffness_N_per_mm).all()
    assert hidden[-1].thermal_conductance_error_W_per_K == pytest.approx(
        shown[-1].thermal_conductance_error_W_per_K,
        rel=0.3,  # of 24² cells solved to 1e-4, on which another may touch: 0.15
    )


def test_where_cells_yield_the_error_of_the_stiffness_adds_to_that_of_increments():
    hard = {"hardness": "300 MPa"}
    with_, without = (
        run(scene(micro=hard, output={"check": check, "contact": "auto"}))[-1]
        for check in ("last", "none")
    )
    assert without.interface_stiffness_error_N_per_mm is None  # the scatter is not all of it
    stiffness = with_.interface_stiffness_N_per_mm
    assert without.stiffness_scatter == pytest.approx(with_.stiffness_scatter, rel=1e-12) != 0.0
    share = with_.thermal_conductance_error_W_per_K / with_.thermal_conductance_W_per_K
    added = with_.interface_stiffness_error_N_per_mm / stiffness - without.stiffness_scatter
    assert added == pytest.approx(share, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["analytic", "concurrent", "consistent"])
def test_what_touches_everywhere_conducts_without_bound(kind):
    """And has no stiffness: what its mean gap closes by is rounding, and the error of laws."""
    load = {"force": ["200 N", "900 N", "3 kN", "3.5 kN"], "steps": 1}
    output = {"check": "none", "figures": False, "report": False, "contact": "auto"}
    history = run(scene(kind, load=load, output=output, patches={"grid": [4, 4]}))
    assert history.contact_area_fraction[2:].tolist() == [1.0, 1.0]
    assert np.isnan(history.thermal_conductance_W_per_K[2:]).all()
    assert history.thermal_conductance_W_per_K[0] > 0.0
    if kind == "consistent":
        assert np.isnan(history.interface_stiffness_N_per_mm[2:]).all()
    assert any(
        "the last of them load step 4: without bound, as the surfaces touch everywhere" in note
        for note in history.notes
    )
    barely = any("not found: the mean gap hardly closes, or" in note for note in history.notes)
    assert barely == (kind == "consistent")  # whose second load step is near full contact


@pytest.mark.parametrize(("jump", "least"), [("0.37 um", 0.3), ("0.5 nm", 0.05), (None, 0.0)])
def test_gas_of_laws_is_the_least_that_gaps_conduct(jump, least):
    heat = HEAT | GAPS | ({} if jump is None else {"temperature_jump": jump})
    exact = run(scene(conductance=heat)).gap_conductance_W_per_K
    laws = run(scene("consistent", heat).with_({"output.check": "last"}))
    assert (laws.gap_conductance_W_per_K < exact).all()
    assert (laws.gap_conductance_W_per_K > least * exact).all()
    off, error = (
        exact[-1] - laws[-1].gap_conductance_W_per_K,
        laws[-1].gap_conductance_error_W_per_K,
    )
    assert (error is None) if jump is None else off < error
    if jump == "0.5 nm":  # by the power ⅓ of the open gap over the jump
        assert error > 8.0 * laws[-1].gap_conductance_W_per_K
    (told,) = (note for note in laws.notes if "the least that the gas conducts" in note)
    assert ("has no bound, and the gas no error" in told) == (jump is None)


def test_columns_are_written_read_and_kept_over_a_resume(tmp_path):
    done = ran_past(scene("consistent"), 1, tmp_path / "checkpoint.state")
    kept = read_checkpoint(tmp_path / "checkpoint.state")
    np.testing.assert_array_equal(
        kept.steps[0].patches.interface_stiffness_MPa_per_mm,
        done.steps[0].patches.interface_stiffness_MPa_per_mm,
    )
    write_results(tmp_path, done, options=[])
    again, before = read_history(tmp_path), done.history()
    for name in ("thermal_conductance_W_per_K", "gap_conductance_W_per_K"):
        np.testing.assert_array_equal(getattr(again, name), getattr(before, name))
    for one, other in zip(again, before, strict=True):
        np.testing.assert_array_equal(
            one.patches.interface_stiffness_MPa_per_mm, other.patches.interface_stiffness_MPa_per_mm
        )
    with (tmp_path / "patches.csv").open() as file:
        assert next(csv.reader(file))[-1] == "interface_stiffness_MPa_per_mm"
    assert any("that of the interface alone" in note for note in before.notes)


def test_scenes_that_do_not_ask_have_no_conductance():
    history = run(scene(conductance=None))
    assert np.isnan(history.thermal_conductance_W_per_K).all()
    assert not any("conductance" in note for note in history.notes)
    assert history.patch_columns[-1] == "contact_area_fraction"  # no law, no stiffness of one
