"""Finite slopes in the contact problem: its fixed point, every control, any path."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw import NotConverged
from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import FiniteSlopes, HalfSpaceModel
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.complementarity import slope_iteration

NU, MODULUS = 0.3, 4000.0
E_STAR = MODULUS / (1.0 - NU**2)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 6), rms_slope=0.2, seed=3), grid=(64, 48), lengths=(1.0, 0.75)
)
SLOPES = FiniteSlopes(SURFACE, Material(young_modulus=MODULUS, poisson_ratio=NU))
MODEL = HalfSpaceModel(
    surface=SURFACE,
    contact_modulus=E_STAR,
    slopes=(SLOPES,),
    highest=SURFACE.highest,
    tolerance=1e-10,
)
CONTROLS = {
    "approach": Control(approach=8e-3),
    "tilted": Control(approach=8e-3, tilt=(3e-3, -2e-3)),
    "force": Control(force=2.0),
    "free tilt": Control(force=2.0, tilt=None),
    "approach, free tilt": Control(approach=8e-3, tilt=None),
}


@pytest.fixture(params=CONTROLS)
def control(request):
    return CONTROLS[request.param]


@pytest.mark.long
def test_solves_the_fixed_point(control):
    """Evaluated from its parts: half-space and slopes under the pressures found."""
    state = MODEL.press(control)
    grid = Compliance(periodic=False).on_grid(SURFACE.grid, SURFACE.spacing)
    moved = grid.displacement(state.pressure / E_STAR) + SLOPES.displacement(state.pressure)
    gap = moved - MODEL.interference(state.plane)
    slack = (
        4e-9 * MODEL.interference(state.plane).max()
    )  # slopes are lagged until they change by 3e-9
    assert np.abs(gap[state.in_contact]).max() <= slack
    assert gap.min() >= -slack
    assert state.gap == pytest.approx(gap, abs=slack)
    assert state.residual <= 3e-9
    # and they matter: a plane that may turn leans on what yields least
    small = replace(MODEL, slopes=()).press(control)
    if control.force is None:
        assert state.force < 0.995 * small.force
    else:
        assert state.force == pytest.approx(2.0, rel=1e-12)
        assert state.approach > 1.002 * small.approach


def test_costs_less_than_two_more_solutions(control):
    """Each starts from the last: measured 1.4 … 1.8 times the iterations without slopes.

    By a matrix every solution takes a product or two, 2.8 times together.
    """
    without = replace(MODEL, slopes=()).press(control)
    assert MODEL.press(control).iterations < 3.0 * without.iterations


@pytest.mark.parametrize("approach", [1e-3, 0.3])
def test_slopes_of_a_flat_surface_add_nothing(approach):
    """Slopes then change nothing at all, which asks for no better solution than the tolerance."""
    flat = replace(SURFACE, heights=np.zeros(SURFACE.grid))
    slopes = FiniteSlopes(flat, SLOPES.material)
    state = replace(MODEL, surface=flat, highest=0.0, slopes=(slopes,)).press(
        Control(approach=approach)
    )
    without = replace(MODEL, surface=flat, highest=0.0, slopes=()).press(Control(approach=approach))
    assert state.in_contact.all()
    assert state.force == pytest.approx(without.force, rel=1e-10)


def test_full_contact_pressed_on():
    """Slopes add more the deeper the plane: what they change falls slowly, from any start."""
    there = Control(approach=1.0)
    before = MODEL.press(Control(approach=0.9))
    states = [MODEL.press(there, start=start) for start in (None, before.guess)]
    assert all(state.in_contact.all() for state in states)
    assert states[0].force == pytest.approx(states[1].force, rel=1e-8)


def test_slopes_that_do_not_agree_are_told():
    class Unsteady(FiniteSlopes):
        """Displacements that are other ones at every call: there is no fixed point."""

        def __init__(self):
            self.dice = np.random.default_rng(0)

        def displacement(self, pressure):
            return 1e-4 * self.dice.random(pressure.shape)

    message = r"the displacements by finite slopes did not converge: they still change by .*e-0[23]"
    with pytest.raises(NotConverged, match=message):
        replace(MODEL, slopes=(Unsteady(),)).press(Control(approach=8e-3))


def test_nothing_touches():
    state = MODEL.press(Control(approach=-1e-3))
    assert state.force == 0.0 and state.gap.min() > 0.0


@pytest.mark.parametrize("approach", [-2e-3, 2e-6, 8e-3])
@pytest.mark.parametrize("tilt", [None, (0.0, 0.0)])
def test_iterations_of_all_solutions_are_counted(approach, tilt, monkeypatch):
    """Those too that end clear of the surface, where slopes of a far larger load are given up."""
    counts, solve = [], slope_iteration.solve_on_surface

    def counted(problem, start):
        found = solve(problem, start)
        counts.append(found.iterations)
        return found

    monkeypatch.setattr(slope_iteration, "solve_on_surface", counted)
    start = MODEL.press(Control(approach=30e-3))
    counts.clear()
    state = MODEL.press(Control(approach=approach, tilt=tilt), start=start.guess)
    assert state.iterations == sum(counts)


def test_solutions_nearby_tell_how_slopes_change():
    """Half-way between two solutions their changes leave the second evaluation next to nothing."""
    calls, displacement = [], SLOPES.displacement

    class Counted(FiniteSlopes):
        """Finite slopes whose evaluations are counted."""

        def __init__(self):
            pass

        def displacement(self, pressure):
            calls.append(pressure)
            return displacement(pressure)

    model = replace(MODEL, slopes=(Counted(),))
    low, high = (model.solve(approach).guess for approach in (7.5e-3, 8e-3))
    calls.clear()
    between = model.solve(7.75e-3, start=low.towards(high, 0.5))
    assert len(calls) == 2  # 3 without the two solutions
    # each is right to the change by slopes that ends it, 3e-9 at most
    assert between.force == pytest.approx(MODEL.solve(7.75e-3).force, rel=4e-9)
