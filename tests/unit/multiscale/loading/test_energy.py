"""Work and energies of a period with finite slopes through full contact."""

from dataclasses import replace

import pytest

from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.observers.step_observers import BALANCE, energy_notes, missing_energy
from patchlaw.support.readable import Caution

YOUNG = 4000.0


def through_full_contact(steps, largest):
    """Return a run whose mean pressure rises to a share of Young's modulus."""
    spectrum = {"hurst": 0.87, "waves": [2, 5], "rms_slope": 0.2, "seed": 3}
    return run(Scene.from_dict({
        "surface": {
            "spectrum": spectrum, "grid": [40, 40], "lengths": [0.02, 0.02], "periodic": True,
        },
        "block": {"young_modulus": YOUNG, "poisson_ratio": 0.3}, "coupling": {"kind": "analytic"},
        "load": {"pressure": largest * YOUNG, "steps": steps},
        "output": {"figures": False, "report": False, "check": "none"},
    }))  # fmt: skip


@pytest.mark.parametrize(("steps", "largest"), [
    (6, 0.24), pytest.param(8, 0.75, marks=pytest.mark.long),
    pytest.param(10, 0.24, marks=pytest.mark.long),
])  # fmt: skip
def test_work_is_what_is_stored_where_the_approach_turns_back(steps, largest):
    """The stiffness grows without bound there; the trapezoidal rule errs by up to 0.6 %."""
    history = through_full_contact(steps, largest)
    energies = [step.elastic_energy_mJ for step in history.steps]
    for step in history.steps:
        assert step.work_mJ == pytest.approx(step.elastic_energy_mJ, abs=0.01 * max(energies))
    assert energies[-1] < max(energies)  # the plane goes back under its force
    assert missing_energy(history.steps) < BALANCE
    assert not [note for note in history.notes if isinstance(note, Caution) and "energ" in note]


def test_full_contact_has_no_mean_gap():
    history = through_full_contact(4, 0.75)
    full = history.contact_area_fraction > 1.0 - 1e-9
    assert full.any() and not full.all()
    assert (history.mean_separation_mm[full] == 0.0).all()
    assert (history.mean_separation_mm[~full] > 1e-9).all()


def test_energies_say_that_some_went_with_what_has_worn_off():
    steps = through_full_contact(2, 0.24).steps
    (plain,) = energy_notes(steps)
    (worn,) = energy_notes([steps[0], replace(steps[1], slid_mm=3.0)])
    assert "worn off" not in plain and "(trapezoidal rule between load steps)" in plain
    assert worn.endswith("; the rest went with what has worn off)")


def test_no_stiffness_is_stated_from_where_the_approach_turns_back():
    steps = through_full_contact(8, 0.75).steps
    approaches = [step.approach_mm for step in steps]
    turn = approaches.index(max(approaches))
    stated = [step.approach_stiffness_N_per_mm for step in steps]
    assert 0 < turn < len(steps) - 1
    assert all(value is not None and value > 0.0 for value in stated[:turn])
    assert not any(stated[turn + 1 :])
