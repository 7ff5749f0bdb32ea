"""Load histories: legs, halving where a step fails or changes the force by too much."""

from itertools import pairwise

import numpy as np
import pytest
from helpers.histories import load_step

from patchlaw.multiscale import LoadHistory, Problem, Step
from patchlaw.multiscale.loading.path import Stage
from patchlaw.multiscale.models.problem import BeyondLaws
from patchlaw.support import InputError, NotConverged


class Spring:
    """F = k δ^(3/2), for steps that are not too large."""

    def __init__(self, largest_step=np.inf, end=np.inf):
        self.largest_step, self.end, self.last, self.tried = largest_step, end, 0.0, []

    def press(self, control):
        approach = control.approach
        if approach is None:
            approach = control.force ** (2 / 3)
        self.tried.append(approach)
        if approach > self.end:
            raise BeyondLaws("it", reason="LAW_RANGE: short", iterations=0, remedy="less")
        if abs(approach - self.last) > self.largest_step:
            raise NotConverged("it", reason="DIVERGED", iterations=2, remedy="take smaller steps")
        self.last = approach
        spent = {"newton_iterations": 3, "linear_iterations": 10}
        return load_step(0, approach_mm=approach, force_N=approach**1.5, **spent)


def test_a_load_that_a_solver_refuses_is_wrong_input_before_the_first_step_alone():
    """Later it ends the run like a load step that does not converge, and names file and key."""

    class Closed(Spring):
        def press(self, control):
            if control.approach is not None and control.approach > 1.0:
                raise InputError("no gap is left", value=control.approach, allowed="< 1 mm")
            return super().press(control)

    begins = LoadHistory(approach=(2.0,), steps=1)
    with pytest.raises(InputError, match=r"f.toml: load.approach = 2.0: no gap .*< 1 mm"):
        list(Problem(Closed(), begins, file="f.toml").steps())
    later = LoadHistory(stage=(Stage(force=0.5), Stage(approach=2.0)), steps=1)
    steps = Problem(Closed(), later, file="f.toml").steps()
    assert next(steps).force_N == pytest.approx(0.5, rel=1e-12)  # rounding of the power
    with pytest.raises(NotConverged, match=r"step 2 .*REFUSED.* f.toml: load.stage.1.approach = 2"):
        next(steps)


def load_history(*points, quantity="approach", **more):
    return LoadHistory(**{quantity: points}, **more)


def approaches(loads):
    return [step.approach for step in loads.path()]


def test_legs_are_divided_evenly():
    loads = load_history(8.0, 2.0, 5.0, steps=3)
    np.testing.assert_allclose(approaches(loads), [8 / 3, 16 / 3, 8, 6, 4, 2, 3, 4, 5], rtol=1e-15)


def test_cycles_repeat_the_turning_points():
    loads = load_history(8.0, 2.0, steps=2, cycles=3)
    again = load_history(8.0, 2.0, 8.0, 2.0, 8.0, 2.0, steps=2)
    assert approaches(loads) == approaches(again) == [4.0, 8.0, 5.0, 2.0] + 2 * [5.0, 8.0, 5.0, 2.0]
    assert (loads.count, len(loads.path()), loads.path().largest()) == (12, 12, 8.0)
    assert [step.approach for step in loads.path().turning_points] == [8.0, 2.0]
    assert loads.unloads
    assert load_history(2.0, 8.0, cycles=2).unloads
    assert not load_history(2.0, 8.0).unloads
    assert not load_history(-2.0, zero="mean plane").unloads  # first touch lies above it
    assert load_history(-2.0, -4.0, zero="mean plane").unloads
    assert len(list(Problem(Spring(), loads).steps())) == 12


def test_paths_are_lists_of_steps():
    """Halved from where another quantity has brought the plane, where that changes."""
    spring = Spring(0.5)
    steps = list(Problem(spring, [Step(force=0.125), Step(approach=1.0, stage=1)]).steps())
    assert spring.tried == pytest.approx([0.25, 1.0, 0.625, 1.0])
    assert [(step.by_force, step.stage) for step in steps] == [(True, None), (False, 1)]


@pytest.mark.parametrize(
    "path", [[Step(force=3.0), Step(approach=4.0)], [Step(approach=3.0), Step(force=9.0)]]
)
def test_paths_that_change_the_quantity_go_on_from_the_plane(path):
    """Halved steps lead from where the plane is, not from first touch."""
    steps = list(Problem(Spring(), path, force_change=0.4).steps())
    forces = [step.force_N for step in steps]
    assert len(steps) > len(path)
    assert forces == sorted(forces)
    last = path[-1].force or path[-1].approach ** 1.5
    assert forces[-1] == pytest.approx(last, rel=1e-12)  # rounding of the power
    # beside the first step, from nothing, none changes the force by more
    assert all(b - a <= 0.4 * b * (1.0 + 1e-9) for a, b in pairwise(forces))


def test_controls_carry_quantity_and_tilt():
    control = load_history(2.0, quantity="force", tilt="free").path().control(1.5)
    assert (control.approach, control.force, control.tilt) == (None, 1.5, None)


def test_failing_step_is_halved_and_its_work_is_counted():
    spring = Spring(0.3)
    (step,) = Problem(spring, load_history(1.0, steps=1)).steps()
    assert spring.tried == [1.0, 0.5, 0.25, 0.5, 1.0, 0.75, 1.0]
    assert step.newton_iterations == 3 * 2 + 4 * 3
    assert step.linear_iterations == 40


def test_hopeless_step_keeps_those_before_it():
    spring, steps = Spring(0.5), []
    with pytest.raises(NotConverged, match=r"load step 3 .approach .* DIVERGED after 2") as error:
        for step in Problem(spring, load_history(1.2, steps=3)).steps():
            steps.append(step.step)
            spring.largest_step = 0.5 if step.step < 2 else 0.0
    assert steps == [1, 2]
    assert error.value.exit_code == 3
    assert "halved 8 times; take smaller steps" in str(error.value)


def test_end_of_a_law_is_not_approached_by_halves():
    spring = Spring(end=0.6)
    with pytest.raises(NotConverged, match=r"load step 2 .*LAW_RANGE: short"):
        list(Problem(spring, load_history(1.0, steps=2)).steps())
    assert spring.tried == [0.5, 1.0]


@pytest.mark.parametrize("quantity", ["approach", "force"])
def test_force_changes_by_no_more_than_asked(quantity):
    loads = load_history(1.0, 0.1, quantity=quantity, steps=2, force_change=0.2)
    steps = list(Problem(Spring(), loads).steps())
    force = np.array([step.force_N for step in steps])
    largest = np.maximum.accumulate(force)
    changes = np.abs(np.diff(force)) / largest[1:]
    assert changes.max() <= 0.2 * (1 + 1e-9)  # the driver's allowance for rounding
    assert [step.step for step in steps] == list(range(1, len(steps) + 1))
    # no finer than halving makes it: two steps of a half would have been too much
    assert len(steps) < 2 * (1.0 + 1.0) / 0.1
    reached = np.array([getattr(step, "force_N" if quantity == "force" else "approach_mm")
                     for step in steps])  # fmt: skip
    for step in loads.path():
        assert np.abs(reached - step.value).min() < 1e-12


def test_first_step_from_nothing_may_be_any():
    assert len(list(Problem(Spring(), load_history(1.0, steps=1, force_change=0.1)).steps())) == 1
