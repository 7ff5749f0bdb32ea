"""Rough surfaces in shear: Ciavarella and Jäger's superposition, paths, loops, turns."""

from functools import cache

import numpy as np
import pytest

from patchlaw.geometry import Material, MaterialPair, ShearControl, Spectrum, synthesise
from patchlaw.micro import FrictionModel, HalfSpaceModel

FRICTION = 0.43
SURFACES = {
    "smooth waves": Spectrum(hurst=0.8, waves=(2, 7), rms_slope=0.11, seed=5),
    "many short waves": Spectrum(hurst=0.45, waves=(3, 16), rms_slope=0.07, seed=11),
    "long ridges": Spectrum(hurst=0.9, waves_x=(2, 5), waves_y=(4, 14), rms_slope=0.09, seed=23),
}
LENGTHS = 1.0, 1.2


class Rough:
    """A rough surface on 64 × 80 cells under a force, and its friction."""

    def __init__(self, name, periodic, poisson_ratio=0.0):
        surface = synthesise(SURFACES[name], grid=(64, 80), lengths=LENGTHS)
        pair = MaterialPair(first=Material(young_modulus=1900.0, poisson_ratio=poisson_ratio))
        self.normal = HalfSpaceModel(
            surface=surface,
            contact_modulus=pair.contact_modulus,
            periodic=periodic,
            tolerance=1e-10,
        )
        self.force = 0.0117 * pair.contact_modulus * LENGTHS[0] * LENGTHS[1]
        self.pressed = self.normal.solve_force(self.force)
        self.model = FrictionModel(
            materials=pair,
            coefficient=FRICTION,
            spacing=surface.spacing,
            periodic=periodic,
            tolerance=1e-8,
        )

    @property
    def ratio(self):
        """Mindlin's ratio of normal over tangential stiffness."""
        nu = self.model.materials.first.poisson_ratio
        return (2.0 - nu) / (2.0 * (1.0 - nu))

    def shift_of(self, part):
        """Return the shift, and pressures of the lower force that it stands for, by the formula."""
        lower = self.normal.solve_force(self.force * (1.0 - part))
        return FRICTION * self.ratio * (self.pressed.approach - lower.approach), lower.pressures

    def at(self, before, *shift, pressed=None):
        pressures = (self.pressed if pressed is None else pressed).pressures
        return self.model.advance(before, pressures, ShearControl(shift=shift))


rough = cache(Rough)
CASES = [(name, periodic) for name in SURFACES for periodic in (False, True)]


@pytest.mark.long
@pytest.mark.parametrize(("name", "periodic"), CASES)
def test_the_superposition_of_ciavarella_and_jager(name, periodic):
    case = rough(name, periodic)
    state = None
    for part in (0.13, 0.48, 0.87):
        shift, lower = case.shift_of(part)
        state = case.at(state, 0.6 * shift, -0.8 * shift)
        # at ν = 0 both problems have the same matrix; what is left are the tolerances
        limit = FRICTION * case.force
        assert np.hypot(*state.force) / limit == pytest.approx(part, rel=1e-7)
        tractions = FRICTION * (case.pressed.pressures - lower)
        largest = tractions.max()
        assert state.traction[0] == pytest.approx(0.6 * tractions, abs=1e-6 * largest)
        assert state.traction[1] == pytest.approx(-0.8 * tractions, abs=1e-6 * largest)


@pytest.mark.parametrize(
    ("name", "periodic"),
    [
        *CASES[1:3],
        *(pytest.param(*c, marks=pytest.mark.long) for c in CASES if c not in CASES[1:3]),
    ],
)
def test_poissons_ratio_changes_the_superposition_by_per_cents(name, periodic):
    case = rough(name, periodic, 0.3)
    shift, _ = case.shift_of(0.5)
    state = case.at(None, shift, 0.0)
    # single spots are stiffer across or along their longer side: 1.2 % on isotropic surfaces
    assert state.force[0] / (FRICTION * case.force) == pytest.approx(0.5, rel=0.04)


@pytest.mark.parametrize("periodic", [False, True])
def test_stick_stiffness_is_the_normal_one_at_zero_poissons_ratio(periodic):
    case = rough("many short waves", periodic)
    state = case.at(None, 0.0, 0.0)
    normal = case.normal.stiffness(case.pressed, turns=False).approach
    assert case.model.stiffness(state)[0] == pytest.approx(normal, rel=1e-6)


@pytest.mark.parametrize("periodic", [False, True])
def test_the_way_to_a_shift_along_a_line_does_not_count(periodic):
    case = rough("smooth waves", periodic)
    shift, _ = case.shift_of(0.6)
    pressed = case.at(None, 0.0, 0.0)
    at_once, state = case.at(pressed, shift, 0.0), pressed
    for part in (0.2, 0.37, 0.81, 1.0):
        state = case.at(state, part * shift, 0.0)
    assert state.force[0] == pytest.approx(at_once.force[0], rel=1e-7)
    assert state.dissipated == pytest.approx(at_once.dissipated, rel=1e-5)
    by_force = case.model.advance(None, case.pressed.pressures, ShearControl(force=at_once.force))
    assert by_force.shift == pytest.approx((shift, 0.0), rel=1e-6, abs=1e-6 * shift)


@pytest.mark.long
def test_a_loop_closes_and_loses_its_area():
    case = rough("long ridges", False)
    shift, _ = case.shift_of(0.7)
    states = [case.at(None, shift, 0.0)]
    parts = np.linspace(1.0, -1.0, 25)[1:]
    for part in (*parts, *-parts):
        states.append(case.at(states[-1], part * shift, 0.0))
    first, last = states[0], states[-1]
    assert last.force[0] == pytest.approx(first.force[0], rel=1e-7)
    assert last.traction == pytest.approx(first.traction, abs=1e-6 * first.traction.max())
    x = np.array([state.shift[0] for state in states])
    force = np.array([state.force[0] for state in states])
    area = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x)))
    # the trapezoidal rule cuts the corners of 24 steps a leg
    assert last.dissipated - first.dissipated == pytest.approx(area, rel=5e-3)
    middle = states[24]
    assert middle.force[0] == pytest.approx(-first.force[0], rel=1e-7)  # Masing


@pytest.mark.parametrize("periodic", [False, True])
def test_a_turn_by_ninety_degrees_follows_the_new_direction(periodic):
    case = rough("smooth waves", periodic)
    shift, _ = case.shift_of(0.9)
    state = case.at(None, shift, 0.0)
    energy, forces = case.model.energy(state), []
    for part in (0.5, 1.0, 2.0, 4.0, 16.0):
        before, state = state, case.at(state, shift, part * shift)
        forces.append(state.force)
        assert state.dissipated_in_step > 0.0
        # energy in, less what is stored: between the forces of both ends of the step
        work = np.sort(
            [one.force[1] * (state.shift[1] - before.shift[1]) for one in (before, state)]
        )
        gain = case.model.energy(state) - energy
        energy += gain
        assert work[0] <= state.dissipated_in_step + gain <= work[1]
    x, y = np.array(forces).T / (FRICTION * case.force)
    assert (np.diff(x) < 0.0).all()
    assert (np.diff(y) > 0.0).all()
    assert y[-1] > 0.99
    assert x[-1] < 0.1


@pytest.mark.long
def test_friction_never_gives_energy_along_a_random_path():
    case = rough("many short waves", False, 0.3)
    rng, state = np.random.default_rng(3), None
    reach, _ = case.shift_of(0.8)
    for _ in range(12):
        pressed = case.normal.solve_force(case.force * rng.uniform(0.05, 1.0))
        shift = reach * rng.uniform(-1.5, 1.5, 2)
        state = case.at(state, *shift, pressed=pressed)
        assert state.dissipated_in_step >= 0.0
        assert (np.hypot(*state.traction) <= state.bound * (1.0 + 1e-12)).all()
        slides = state.slipping & (state.bound > 0.0)
        assert np.hypot(*state.traction)[slides] == pytest.approx(state.bound[slides], rel=1e-9)


def test_what_touches_anew_begins_without_shear():
    case = rough("smooth waves", False)
    light = case.normal.solve_force(0.1 * case.force)
    shift, _ = case.shift_of(0.3)
    sheared = case.at(None, shift, 0.0, pressed=light)
    heavier = case.at(sheared, shift, 0.0)
    # a heavier load at the same shift shears nothing further; the old contact relaxes a little
    assert heavier.force[0] == pytest.approx(sheared.force[0], rel=2e-2)
    new = heavier.closed & ~sheared.closed
    assert np.abs(heavier.traction[:, new]).max() < 0.05 * np.abs(sheared.traction).max()
