"""Periods with finite slopes near full contact: one force per approach, from any start."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import FiniteSlopes, HalfSpaceModel

YOUNG, NU, CELLS = 4000.0, 0.3, 32
E_STAR = YOUNG / (1.0 - NU**2)


def model_of(rms_slope, seed=3, noise=0.0):
    """Return the model of a rough period, its heights changed by a share of them."""
    spectrum = Spectrum(hurst=0.87, waves=(1, 5), rms_slope=rms_slope, seed=seed)
    surface = replace(
        synthesise(spectrum, grid=(CELLS, CELLS), lengths=(0.02, 0.02)), periodic=True
    )
    dice = np.random.default_rng(seed)
    heights = surface.heights * (1.0 + noise * dice.standard_normal(surface.grid))
    surface = replace(surface, heights=heights, periodic=True)
    slopes = FiniteSlopes(surface, Material(young_modulus=YOUNG, poisson_ratio=NU), periodic=True)
    return HalfSpaceModel(surface, contact_modulus=E_STAR, periodic=True, slopes=(slopes,))


def under(model, mean, start=None):
    """Return the contact under a mean pressure over Young's modulus."""
    return model.press(Control(force=mean * YOUNG * model.surface.area), start=start)


@pytest.mark.long
@pytest.mark.parametrize("rms_slope", [pytest.param(0.05, marks=pytest.mark.long), 0.2, 0.4])
def test_an_approach_has_one_force_from_any_start_and_with_other_rounding(rms_slope):
    model, other = model_of(rms_slope), model_of(rms_slope, noise=1e-15)
    closed = under(model, 0.5 + rms_slope)
    assert closed.in_contact.all()
    for part in (0.3, 0.6, 0.9, 0.97):  # 0.97: the force answers 30 to 100 times to the approach
        approach = part * closed.approach
        light = model.solve(0.5 * approach)
        states = [model.solve(approach, start=one and one.guess) for one in (None, light, closed)]
        states.append(other.solve(approach))
        forces = np.array([state.force for state in states])
        assert forces == pytest.approx(forces[0], rel=3e-6)
        assert not states[0].in_contact.all()
        assert under(model, states[0].mean_pressure / YOUNG).approach == pytest.approx(
            approach, rel=1e-7
        )


@pytest.mark.slow
@pytest.mark.parametrize("rms_slope", [0.1, 0.3])
def test_the_largest_approach_lies_before_full_contact(rms_slope):
    model = model_of(rms_slope)
    means = np.linspace(0.4, 2.0, 33) * 1.7 * rms_slope * E_STAR / YOUNG / 2.0
    approaches, start = [], None
    for mean in means:
        state = under(model, mean, start)
        approaches.append(state.approach)
        start = state.guess
    assert state.in_contact.all()
    rise = np.diff(approaches)
    turn = int(np.argmax(approaches))
    assert 0 < turn < len(means) - 2 and (rise[:turn] > 0.0).all() and (rise[turn:] < 0.0).all()
    # of both forces of an approach, that of a plane that comes nearer
    beyond = under(model, means[-1])
    lower = model.solve(beyond.approach, start=beyond.guess)
    assert lower.mean_pressure < means[turn] * YOUNG < beyond.mean_pressure
    largest = float(max(approaches))
    assert model.solve(largest * (1.0 - 1e-5)).mean_pressure < means[turn + 1] * YOUNG
    for further in (1.0 + 1e-4, 1.5, 10.0):
        with pytest.raises(InputError, match=r"no gap left at this approach \(allowed: < ") as told:
            model.solve(largest * further)
        allowed = float(told.value.allowed.split()[1])
        assert allowed == pytest.approx(largest, rel=1e-4)


def test_mean_pressures_of_youngs_modulus_are_refused():
    with pytest.raises(InputError, match=r"finite slopes end .*allowed: a pressure < 4000 MPa"):
        under(model_of(0.1), 1.0)
    assert under(model_of(0.1), 0.95).in_contact.all()
