"""Scenes with a hardness: what is solved, kept, written, said and refused."""

from functools import cache

import numpy as np
import pytest
from helpers.pressed_cells import pressed_cells
from helpers.resumed_runs import gone_on, ran_past

from patchlaw.geometry import Control
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import make_setup, run, sweep
from patchlaw.multiscale.observers.step_observers import BALANCE, missing_energy

HARDNESS = 300.0
UP_AND_DOWN = {"approach": [0.008, 0.004], "steps": 2}


def scene(kind="analytic", *, hardness=HARDNESS, load=UP_AND_DOWN, **sections):
    micro = {} if hardness is None else {"hardness": hardness}
    return pressed_cells(kind, load, **{"micro": micro, **sections})


@cache
def ran(kind, periodic=False):
    return run(scene(kind, periodic=periodic))


@pytest.mark.parametrize(
    ("kind", "periodic"), [("analytic", False), ("analytic", True), ("concurrent", False)]
)
def test_load_steps_bear_the_hardness_and_leave_a_plastic_depth(kind, periodic):
    history = ran(kind, periodic)
    assert history.peak_pressure_MPa.max() <= HARDNESS * (1.0 + 1e-10)
    assert history.yielding_area_fraction[1] > 0.0
    assert history.yielding_area_fraction[-1] == 0.0
    depth = history.contact.plastic_depth_mm
    assert depth.max() == history.plastic_depth_mm[-1] == history.plastic_depth_mm[1] > 0.0
    assert history.plastic_work_mJ[-1] == pytest.approx(
        HARDNESS * depth.sum() / depth.size, rel=1e-10
    )
    elastic = run(scene(kind, hardness=None, periodic=periodic))
    # flattened summits bear less on the way back, and yielding ones on the way there
    assert (history.force_N[1:] < elastic.force_N[1:]).all()


def test_the_scene_is_the_model_under_a_bound():
    setup = make_setup(scene(load={"approach": 0.008, "steps": 1}, micro={
        "hardness": "300 MPa", "finite_slopes": False,
    }))  # fmt: skip
    model = HalfSpaceModel(
        setup.parts.surface,
        contact_modulus=setup.parts.materials.contact_modulus,
        hardness=HARDNESS,
    )
    (step,) = run(setup.scene)
    assert step.force_N == pytest.approx(model.press(Control(approach=0.008)).force, rel=1e-7)


def test_laws_of_rising_loads_meet_the_contact_problem():
    load = {"approach": 0.008, "steps": 2}
    laws, solved = (run(scene(kind, load=load)) for kind in ("consistent", "concurrent"))
    np.testing.assert_allclose(laws.force_N, solved.force_N, rtol=2e-3)  # the table's tolerance
    assert any("laws are those of rising loads" in note for note in laws.notes)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["consistent", "concurrent"])
def test_areas_of_patches_bear_their_forces(kind):
    """No pressure exceeds the hardness: force / hardness is the least area, between rows too."""
    load, least = {"approach": 0.012, "steps": 9}, np.inf
    spectrum = {"hurst": 0.8, "waves": [2, 10], "rms_slope": 0.2, "seed": 3}
    rough = {"surface": {"spectrum": spectrum, "grid": [32, 32], "lengths": [1, 1]}}
    for step in run(scene(kind, hardness=210.0, load=load, patches={"grid": [4, 4]}, **rough)):
        pressure, area = step.patches.pressure_MPa, step.patches.contact_area_fraction
        least = min(least, float((area * 210.0 - pressure).min()))
    assert least > -1e-9 * 210.0


def test_representative_laws_end_below_the_hardness():
    from patchlaw.multiscale import representative_law

    surface = make_setup(scene(periodic=True)).parts.surface
    given = {"contact_modulus": 4000.0, "periodic": True, "hardness": HARDNESS}
    law = representative_law(
        [surface], 4000.0, largest_pressure=0.9 * HARDNESS, tolerance=1e-2,
        make_model=lambda sample: HalfSpaceModel(sample, **given),
    )  # fmt: skip
    # the last row has the plane at the height of the mean plane
    end = HalfSpaceModel(surface, **given).press(Control(approach=law.initial_separation))
    assert law.rows.pressure[-1] == pytest.approx(end.force / surface.area, rel=1e-6)
    state = HalfSpaceModel(surface, **given).press(Control(force=0.2 * HARDNESS * surface.area))
    # closure and approach both count from the highest point
    assert law.pressure(state.approach) == pytest.approx(0.2 * HARDNESS, rel=2e-2)
    # gaps are those of the surface as it has yielded
    assert state.plastic_depth.mean() > 0.05 * state.mean_separation
    at = law.at(np.array([state.approach]))
    assert at.separation[0] == pytest.approx(state.mean_separation, rel=1e-3)


def test_resumed_run_keeps_the_plastic_depth_bit_for_bit(tmp_path):
    path = tmp_path / "checkpoint.state"
    whole = ran_past(scene(), 2, path)
    again, after = gone_on(scene(), path)
    expected = whole.steps[2:]
    for name in ("force_N", "plastic_depth_mm", "plastic_work_mJ", "work_mJ"):
        assert [getattr(one, name) for one in after] == [getattr(one, name) for one in expected]
    np.testing.assert_array_equal(
        again.contacts[-1].plastic_depth_mm, whole.contacts[-1].plastic_depth_mm
    )


def test_errors_are_not_measured_after_unloading():
    history = run(scene(output={"check": "all", "figures": False}))
    assert [bool(step.errors) for step in history] == [True, True, False, False]
    assert sum("after unloading are not measured" in note for note in history.notes) == 1


@pytest.mark.parametrize(
    ("load", "measured"),
    [
        # the edge touches first: approaches at the middle are negative
        ({"force": ["0.02 N", "0.05 N"], "tilt": [0.05, 0.0], "steps": 1}, [True, True]),
        ({"force": ["0.05 N", "0.02 N", "0.05 N"], "tilt": [0.05, 0.0], "steps": 1}, [1, 0, 1]),
        ({"approach": [0.004, 0.008, 0.004, 0.008, 0.009], "steps": 1}, [1, 1, 0, 1, 1]),
    ],
)
def test_only_steps_below_earlier_loads_count_as_unloaded(load, measured):
    history = run(scene(load=load, output={"check": "all", "figures": False}))
    assert [bool(step.errors) for step in history] == measured
    assert (history.approach_mm < 0.0).all() == ("force" in load)


def test_stiffness_has_an_error_where_cells_yield_anew():
    history = ran("analytic")
    assert history.stiffness_scatter[0] == 0.0  # nothing yields at the first load step
    assert (history.stiffness_scatter[2:] == 0.0).all()
    back = run(scene(load={"approach": [0.008, 0.00799], "steps": 1}))
    found = (back.force_N[0] - back.force_N[1]) / 1e-5
    assert np.isnan(back.approach_stiffness_error_N_per_mm[0])  # not all of it is known
    error = back.stiffness_scatter[0] * back.approach_stiffness_N_per_mm[0]
    assert 0.0 < abs(back.approach_stiffness_N_per_mm[0] - found) < error < 0.5 * found


def test_the_work_of_the_way_back_is_the_elastic_energy_that_it_gives_back():
    load = {"approach": [0.0083, 0.0021], "steps": 4}
    history = run(scene(load=load, micro={"hardness": HARDNESS, "finite_slopes": False}))
    stored = history.elastic_energy_mJ + history.plastic_work_mJ
    assert history.plastic_work_mJ[3] > 0.0
    # by force and stiffness at both ends of a step; 2 % where contacts part
    np.testing.assert_allclose(np.diff(history.work_mJ)[3:], np.diff(stored)[3:], rtol=0.03)


def test_notes_say_what_yielded_and_what_would_bear_elastic_contacts():
    (hard,) = (note for note in ran("analytic").notes if note.startswith("hardness 300 MPa"))
    assert "after load step 4 a plastic volume of" in hard
    history = run(scene(hardness=None))
    (soft,) = (note for note in history.notes if note.startswith("elastic contacts: pressures"))
    peak = history.peak_pressure_MPa.max()
    assert f"up to {peak / 1e3:.3g} GPa" in soft or f"up to {peak:.3g} MPa" in soft
    assert "state micro.hardness" in soft


def test_peaks_of_contacts_smaller_than_cells_are_not_stated():
    """The mean over their real area is higher than the pressure of any cell."""
    history = run(scene(hardness=None, load={"force": 1e-7, "steps": 1}))
    (said,) = (note for note in history.notes if note.startswith("elastic contacts"))
    area = history.contact_area_fraction[0]
    assert history.peak_pressure_MPa[0] < history.force_N[0] / area
    assert "contacts are smaller than cells" in said and "without yielding" not in said


def test_energies_are_in_balance_in_every_run():
    for kind in ("analytic", "concurrent"):
        history = ran(kind)
        assert missing_energy(history.steps) < BALANCE
        assert any(note.startswith("energies at load step 4: elastic") for note in history.notes)
        assert not any("not balanced" in note for note in history.notes)
    fine = run(scene(load={"approach": 0.008, "steps": 12}))
    stored = fine.elastic_energy_mJ + fine.plastic_work_mJ
    np.testing.assert_allclose(fine.work_mJ[3:], stored[3:], rtol=0.02)  # between load steps


def test_hardness_above_the_mean_pressure_has_an_equilibrium():
    load = {"force": "20 N", "steps": 1}
    (step,) = run(scene("analytic", hardness="21 MPa", load=load))
    assert step.force_N == pytest.approx(20.0, rel=1e-12)
    assert step.yielding_area_fraction > 0.9


def test_forces_under_a_hardness_are_not_scaled_with_the_modulus():
    one = scene(load={"approach": 0.008, "steps": 1})
    found = sweep(one, {"block.young_modulus": ["4 GPa", "8 GPa"]}).force_N.ravel()
    (alone,) = run(one.with_({"block.young_modulus": "8 GPa"}))
    assert found[1] == pytest.approx(alone.force_N, rel=1e-12)
    assert found[1] < 1.95 * found[0]
