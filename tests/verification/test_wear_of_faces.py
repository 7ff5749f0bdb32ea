"""Wear of faces under laws, in a user's own problem: closed forms, and what any wear keeps."""

import numpy as np
import pytest
from helpers.contact_laws import PowerLaw, RangedLaw, Spring
from helpers.faces import at, tagged
from helpers.user_problems import BOTTOM, HEXAHEDRA, box, elastic, pressed_box, pressed_face

from benchmarks.wear_of_laws import differences
from patchlaw.geometry import Control, Friction, RigidPlane, ShearControl
from patchlaw.macro import compat
from patchlaw.macro.contact import newton
from patchlaw.support import InputError, NotConverged

COEFFICIENT, BED = 3.7e-7, 41.3
"""Of wear [mm²/N], and of a Winkler bed [MPa/mm]."""


def made(laws=None, *, young=1e9, wear=COEFFICIENT, cells=(3, 2, 1), **options):
    """A box, by default next to rigid, whose top has a law and wears."""
    exact = {"petsc_options": {"snes_rtol": 1e-13, "ksp_rtol": 1e-13}}
    own = {"cells": cells, "cell": HEXAHEDRA, "work": lambda u: elastic(u, young=young)}
    return pressed_box(laws=laws or Spring(BED), wear=wear, solver=exact, **own, **options)


def test_a_punch_on_a_winkler_bed_wears_to_even_pressure():
    """K (δ − g) = p: with dp/ds = K (dδ/ds − k p) deviations from the mean fall as exp(−K k s)."""
    slope, force, slid, steps = 2.3e-3, 5.9, 3e4, 7
    rough, problem = made(crown=lambda x, y: slope * x, indenter=Control(force=force))
    problem.solve()
    first = rough.pressure - force
    np.testing.assert_allclose(first, -BED * slope * (rough.points[:, 0] - 0.5), atol=1e-6)
    for _ in range(steps):
        rough.slide(slid / steps)
        problem.solve()
    ratio = BED * COEFFICIENT * slid
    implicit = (1.0 + ratio / steps) ** -steps
    # the box is soft in 1e-7 of the bed
    np.testing.assert_allclose(rough.pressure - force, implicit * first, rtol=1e-5)
    assert implicit == pytest.approx(np.exp(-ratio), rel=ratio**2 / steps)
    assert rough.plane.approach == pytest.approx(
        0.5 * slope + force / BED + COEFFICIENT * force * slid, rel=1e-6
    )
    assert rough.worn_volume == pytest.approx(COEFFICIENT * force * slid, rel=1e-11)
    worn = COEFFICIENT * slid * force + first * (1.0 - implicit) / BED
    np.testing.assert_allclose(rough.worn_depth, worn, rtol=1e-6)


@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
def test_the_volume_of_every_step_is_that_of_archard(mode):
    """Under loads that rise, fall and turn the plane, whose steps are of first order."""
    law, forces = PowerLaw(3e3, 1e-4, 2.2), (4.1, 7.3, 0.9, 5.2)
    rough, problem = made(law, young=900.0, wear=1e-5, mode=mode, indenter=Control(force=1.0))
    volume = 0.0
    for number, force in enumerate(forces):
        rough.indenter = Control(force=force, tilt=None if number > 1 else (1e-3, 2e-4))
        slid = 130.0 * (1 + number)
        rough.slide(slid)
        problem.solve()
        volume += 1e-5 * force * slid
        assert rough.worn_volume == pytest.approx(volume, rel=1e-11)
        before = rough.pressure, rough.plane.approach
        problem.solve()  # nothing slides: the contact stays
        np.testing.assert_allclose(rough.pressure, before[0], rtol=1e-8)
        assert rough.plane.approach == pytest.approx(before[1], rel=1e-10)
    np.testing.assert_allclose(law.pressure(rough.closure), rough.pressure, rtol=1e-10)


def test_wear_to_come_is_no_part_of_the_stiffness_of_the_laws():
    law = PowerLaw(3e3, 1e-4, 2.2)
    rough, problem = made(law, wear=1e-4, indenter=Control(force=5.7))
    problem.solve()
    before = rough.stiffness_matrix(problem.displacement).norm()
    rough.slide(370.0)
    rough.evaluate(problem.displacement)  # under even pressure: this stays as the face wears
    assert rough.worn_volume == pytest.approx(1e-4 * 370.0 * 5.7)
    shown = rough.fields()["stiffness"].x.array.max()
    assert shown == pytest.approx(law.stiffness(rough.closure).max(), rel=1e-6)  # the box is soft
    assert rough.stiffness_matrix(problem.displacement).norm() == pytest.approx(before, rel=1e-6)


def test_wear_at_a_constant_approach_is_exponential_and_of_first_order():
    """Body, law and plane in series bear p = K (δ − w): dp/ds = −k K p."""
    young, approach, slid = 500.0, 7e-3, 9e4
    rough, problem = made(young=young, cells=(1, 1, 1), indenter=RigidPlane(approach=approach))
    problem.solve()
    first, record = rough.force, rough.wear_record
    ratio, errors = COEFFICIENT * slid * first / approach, []
    for steps in (4, 8, 16):
        rough.wear_record = record
        for _ in range(steps):
            rough.slide(slid / steps)
            problem.solve()
        assert rough.force == pytest.approx(first * (1.0 + ratio / steps) ** -steps, rel=1e-3)
        errors.append(rough.force / first - np.exp(-ratio))
    assert np.all(np.abs(np.divide(errors[:-1], errors[1:]) - 2.0) < 0.15)

    rough.wear_record = record
    report = problem.slide(slid)
    assert report.steps > 2 and rough.wear_record[:, 2].min() > 0.0
    error = abs(rough.force - first * np.exp(-ratio))
    assert 0.2 * report.force_errors[0] < error < report.force_errors[0]
    assert report.approach_errors == (0.0,)


def test_a_held_approach_wears_off_the_right_volume_under_a_law_that_is_no_line():
    """p = A c³ with c = δ − w: c = δ (1 + 2 k s A δ²)^−½."""
    approach, pressure, ratio = 7e-3, 2.9, 1.3
    law, plane = PowerLaw(pressure / approach**3, power=3.0), RigidPlane(approach=approach)
    rough, problem = made(law, young=1e12, cells=(1, 1, 1), indenter=plane)
    problem.solve()
    area = rough.force / pressure
    problem.slide(ratio * approach / (COEFFICIENT * pressure))
    depth = approach * (1.0 - (1.0 + 2.0 * ratio) ** -0.5)
    # what the steps may err by, see `geometry.sliding`
    assert rough.worn_volume == pytest.approx(depth * area, rel=0.027)


class Hardening(Spring):
    """A bed that stiffens by K/d for each depth d that wears off: p = K c (1 + w/d)."""

    depth = 2e-4

    def __init__(self, k):
        super().__init__(k)
        self.laws, self.running_in = (self,), self

    def __len__(self):
        return 1

    def pressures(self, patch, closure, depth):
        return self.rates(patch, closure, depth)[0]

    def stiffnesses(self, patch, closure, depth):
        return self.rates(patch, closure, depth)[1]

    def rates(self, patch, closure, depth):
        slope = self.k * (1.0 + depth / self.depth) * (closure > 0.0)
        falls = np.maximum(slope - self.k * np.maximum(closure, 0.0) / self.depth, 0.0)
        return slope * closure, slope, falls

    def know(self, name):
        return False

    def check_range(self, patch, closure, depth):
        pass


def test_pressures_are_found_that_lie_far_below_those_of_what_has_not_worn():
    """With x = k s p: x/(k s) = K (c − x) (1 + x/d); Newton's steps go from end to end and back."""
    stiff, slid, approach = 40.0, 1e6, 0.3
    rough, problem = made(Hardening(stiff), indenter=RigidPlane(approach=approach))
    rough.slide(slid)
    rough.evaluate(problem.displacement)
    ratio, d = stiff * COEFFICIENT * slid, Hardening.depth
    linear = d + ratio * (d - approach)
    worn = (-linear + np.sqrt(linear**2 + 4.0 * ratio**2 * approach * d)) / (2.0 * ratio)
    np.testing.assert_allclose(rough.worn_depth, worn, rtol=1e-12)


def test_zones_wear_by_coefficients_of_their_own_however_far_a_step_slides():
    """A face that nothing bends keeps its approach: K (δ − w) = p in both zones, steep as it is."""
    mesh = box(cells=(2, 1, 1), cell=HEXAHEDRA)
    zones = {5: at(mesh, 2, 0.0, among=lambda x: x[0] < 0.51),
             6: at(mesh, 2, 0.0, among=lambda x: x[0] > 0.49)}  # fmt: skip
    tags = tagged(mesh, zones | {BOTTOM: at(mesh, 2, -1.0)})
    laws, wear = {"soft": Spring(30.0), "hard": Spring(4e4)}, {"soft": 2e-6, "hard": 5e-7}
    rough, problem = pressed_face(
        compat.vector_space(mesh, 1), tags, None, names={"soft": 5, "hard": 6}, laws=laws,
        wear=wear, indenter=RigidPlane(approach=1e-3), work=lambda u: elastic(u, young=1e10),
    )  # fmt: skip
    expected = np.array([30.0, 4e4]) * 1e-3
    for distance in (1e2, 1e6):
        rough.slide(distance)
        problem.solve()
        expected /= 1.0 + np.array([30.0, 4e4]) * np.array([2e-6, 5e-7]) * distance
        np.testing.assert_allclose(rough.patch_pressure, expected, rtol=1e-5)
    assert rough.fields()["worn_depth"].x.array.max() == pytest.approx(1e-3, rel=1e-4)


RUBBING = Friction(coefficient=0.43, poisson_ratio=0.2)


def test_fretting_takes_the_energy_of_friction():
    """The volume is k/μ × the energy at every load step, whatever k and however the plane turns."""
    for wear in (1e-5, 0.7):  # depths of which count
        options = {"young": 900.0, "wear": wear, "friction": RUBBING}
        rough, problem = made(RangedLaw(3e3, end=5e-2), indenter=Control(force=5.7), **options)
        for shift, tilt in ((1.7e-3, (0.0, 0.0)), (4.1e-3, None), (-3.3e-3, None)):
            shear = ShearControl(shift=(shift, 0.3 * shift))
            rough.indenter = Control(force=5.7, tilt=tilt, shear=shear)
            problem.solve()
            volume = wear / RUBBING.coefficient * rough.dissipated
            assert rough.worn_volume == pytest.approx(volume, rel=1e-7)
        assert rough.force == pytest.approx(5.7) and rough.worn_depth.min() > 0.0
        before = rough.worn_volume
        problem.solve()
        assert rough.worn_volume == pytest.approx(before, rel=1e-6)
    assert rough.worn_depth.max() > 0.1 * np.ptp(rough.closure)


@pytest.mark.parametrize(
    ("wear", "controls"),
    [
        (1e-5, [{"approach": 1e-3, "tilt": (3e-3, 0.0)}, {"approach": -1e-3, "tilt": (3e-3, 0.0)}]),
        (1e-5, [{"force": 3.0}, {"force": 0.0}]),
        # depths beyond the closures
        pytest.param(0.7, [{"force": 0.57}, {"force": 5.7e-4}], marks=pytest.mark.long),
    ],
)
def test_what_opens_while_it_slips_has_worn_by_the_energy_too(wear, controls):
    """Friction takes energy under pressures of before, though nothing presses in the end."""
    options = {"young": 900.0, "wear": wear, "friction": RUBBING}
    rough, problem = made(RangedLaw(3e3, end=5e-2), indenter=Control(force=5.7), **options)
    problem.solve()
    for number, control in enumerate(controls):
        shear = ShearControl(shift=(4e-3 * (-1) ** number, 8e-4))
        rough.indenter = Control(**{"tilt": (0.0, 0.0), **control}, shear=shear)
        problem.solve()
        volume = wear / RUBBING.coefficient * rough.dissipated
        assert rough.worn_volume == pytest.approx(volume, rel=1e-7)
    assert (rough.pressure <= 0.0).sum() > 0.5 * len(rough.pressure)


@pytest.mark.long
def test_depths_beyond_all_closures_settle_in_few_solutions(monkeypatch):
    """Of 19 times the closures; each from the one before takes 15 to 28, combined 9 or 10."""
    monkeypatch.setattr(newton, "_MOST_WORN", 12)
    options = {"young": 900.0, "wear": 1.2, "friction": RUBBING, "crown": lambda x, y: 2e-3 * x * x}
    rough, problem = made(RangedLaw(3e3, end=0.5), indenter=Control(force=0.21), **options)
    problem.solve()
    approach = rough.plane.approach
    for shift in (6e-3, -5e-3):
        shear = ShearControl(shift=(shift, 0.3 * shift))
        rough.indenter = Control(approach=approach, tilt=(0.0, 0.0), shear=shear)
        problem.solve()
        volume = 1.2 / RUBBING.coefficient * rough.dissipated
        assert rough.worn_volume == pytest.approx(volume, rel=1e-7)
    assert rough.worn_depth.max() > 3.0 * np.ptp(rough.closure)


def test_what_a_solver_of_ones_own_accepts_has_worn_by_its_slip():
    """Slips of a solution without wear, which a small coefficient hardly changes."""
    volumes = []
    for wear in (1e-5, None):
        options = {"young": 900.0, "wear": wear, "friction": RUBBING}
        rough, problem = made(RangedLaw(3e3, end=5e-2), indenter=Control(force=5.7), **options)
        problem.solve()
        pressed = rough.worn_volume  # the body has slipped as it bulged
        shear = ShearControl(shift=(4e-3, 0.0))
        rough.indenter = Control(force=5.7, shear=shear)
        if wear is None:
            record = rough.slip_record
            problem.solve()
            moved = problem.displacement
            rough, _ = made(
                RangedLaw(3e3, end=5e-2), indenter=Control(force=5.7), **options | {"wear": 1e-5}
            )
            rough.slip_record = record
            rough.indenter = Control(force=5.7, shear=shear)
            rough.accept(moved)
            rough.evaluate(moved)
        else:
            problem.solve()
        volumes.append(rough.worn_volume - pressed)
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-4) and volumes[0] > 0.0


def test_strokes_at_a_held_approach_wear_as_the_slipped_way():
    """On a rigid body with the law p = K c: p falls by 1 + K k s in each stroke, which slips s.

    Springs give μ r p/K to either side, with Mindlin's ratio r, which does not slip.
    """
    stiff, wear, approach = 37.0, 1e-3, 2e-3
    law = RangedLaw(stiff, 0.0, 1.0, 3e-3)
    options = {"wear": wear, "friction": RUBBING, "indenter": RigidPlane(approach=approach)}
    rough, problem = made(law, **options)
    problem.solve()
    bears, given = stiff * approach, 0.0
    for shift in (2.1, -1.9, 2.3):
        shear = ShearControl(shift=(shift, 0.0))
        rough.indenter = Control(approach=approach, shear=shear)
        problem.solve()
        start, given = given, shift
        bears /= 1.0 + stiff * wear * abs(given - start)
        # springs give some 1e-3 of a stroke; the energy's mean between two bounds is of first order
        assert rough.force == pytest.approx(bears, rel=0.01)
        np.testing.assert_allclose(
            rough.shear_force[0], np.sign(given - start) * 0.43 * rough.force
        )


def test_a_slide_that_fails_leaves_no_sliding_behind():
    """The next load step, which may slip by other loads, wears by the energy of friction alone."""
    options = {"young": 900.0, "wear": 1e-3, "friction": RUBBING, "cells": (2, 2, 1)}
    rough, problem = made(RangedLaw(3e3, end=5e-2), indenter=Control(force=5.7), **options)
    problem.solve()
    problem._newton.snes.setTolerances(max_it=1)
    with pytest.raises(NotConverged, match="DIVERGED_MAX_IT"):
        problem.slide(1.0)
    assert not rough.forces.slides


@pytest.mark.long
def test_what_slides_with_friction_wears_to_even_pressure():
    """Shear stresses press the leading edge, which wears until pressures are even."""
    slid, wear = 1e5, 1e-7
    options = {"young": 900.0, "wear": wear, "friction": RUBBING, "cells": (4, 3, 2)}
    rough, problem = made(RangedLaw(3e3, end=5e-2), indenter=Control(force=5.7), **options)
    problem.solve()
    rough.slide(1e-3 * slid)
    problem.solve()
    new, shift = np.ptp(rough.pressure), rough.shift
    reports = [problem.slide(slid) for _ in range(3)]
    assert np.ptp(rough.pressure) < 0.02 * new
    assert rough.worn_volume == pytest.approx(wear * 5.7 * 3.001 * slid, rel=1e-6)
    np.testing.assert_allclose(rough.shear_force, [0.43 * 5.7, 0.0], atol=1e-8)
    np.testing.assert_array_equal(rough.shift, shift)  # counts from where the plane has come
    assert reports[-1].approach_errors[0] < 1e-3 * np.ptp(rough.worn_depth)
    rough.slide(1.0)
    rough.slide(0.0)  # takes it back
    volume = rough.worn_volume
    problem.solve()
    assert rough.worn_volume == pytest.approx(volume, rel=1e-9)
    np.testing.assert_allclose(rough.shear_force, [0.43 * 5.7, 0.0], rtol=1e-6, atol=1e-6)


def test_what_does_not_wear():
    for options, text in (
        ({"wear": -1e-8}, "wear"),
        ({"wear": {"pad": 1e-8}}, "wear.*laws by zone"),
    ):
        with pytest.raises(InputError, match=text):
            made(indenter=RigidPlane(approach=1e-3), **options)
    rough, problem = made(wear=None, indenter=RigidPlane(approach=1e-3))
    with pytest.raises(InputError, match="wear: the interface does not wear"):
        rough.slide(1.0)
    with pytest.raises(InputError, match="no interface wears"):
        problem.slide(1.0)
    rough, problem = made(indenter=RigidPlane(approach=1e-3))
    for distance in (-1.0, np.nan, "1 m"):
        with pytest.raises(InputError, match="distance"):
            rough.slide(distance)
    with pytest.raises(InputError, match="of another face"):
        rough.wear_record = np.ones((4, 3))


@pytest.mark.long  # laws of worn samples: 4 s each
@pytest.mark.parametrize("seed", [2, 5])
def test_laws_run_in_as_the_cells_that_they_are_made_of(seed):
    """Evenly pressed faces differ by what laws lose between two depths, and by first contacts."""
    off = differences(seed, even=True, cells=32)
    bounds = {"contact_area_fraction": 0.015, "mean_separation_mm": 0.015, "worn_volume_mm3": 1e-9}
    for name, most in bounds.items():
        assert np.abs(off[name]).max() < most, name


@pytest.mark.slow  # on quadratic elements: 10 s each
@pytest.mark.parametrize("seed", [1, 4])
def test_a_face_under_laws_runs_in_as_its_cells(seed):
    """A tilted map of few waves is no sample of itself: laws err as when they are new."""
    off = differences(seed, cells=32)
    bounds = {"approach_mm": 0.02, "contact_area_fraction": 0.04, "mean_separation_mm": 0.03}
    for name, most in (bounds | {"worn_volume_mm3": 1e-9}).items():
        assert np.abs(off[name]).max() < most, name
