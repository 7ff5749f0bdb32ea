"""Load histories of Python are checked as those of scenes are."""

import re

import pytest

from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.stages import Stage
from patchlaw.support.errors import InputError


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ({}, "needs exactly one load (allowed: 'approach', 'force', 'pressure' or 'stage')"),
        ({"approach": (1.0,), "force": (1.0,)}, "needs exactly one load"),
        ({"force": ()}, 'force = []: is an empty list (allowed: a quantity such as "5 N"'),
        ({"force": (1.0, 1.0)}, "force = [1.0, 1.0]: repeats a turning point"),
        ({"force": (0.0, 1.0)}, "force = [0.0, 1.0]: must be greater than 0"),
        ({"approach": (1.0, -1.0)}, "approach = [1.0, -1.0]: must not turn below 0"),
        ({"force": (1.0,), "cycles": 2}, "cycles = 2 needs two turning points"),
        (
            {"force": (1.0,), "cycles": 2, "shear": ((1.0, 0.0), (0.0, 0.0))},
            "cycles = 2 needs two turning points",
        ),
        ({"force": (1.0,), "steps": 0}, "steps = 0: must be greater than or equal to 1"),
        ({"force": (1.0,), "zero": "sea"}, "zero: is no height that approaches count from"),
    ],
)
def test_loads_that_make_no_sense_are_refused(load, words):
    with pytest.raises(InputError, match=re.escape(words)):
        LoadHistory(**load)


def controls(history, *origins):
    """Return approach, force and state of the bodies at all load steps."""
    found = [history.control_at(step, *origins) for step in range(1, history.count + 1)]
    return [(one.approach, one.force, one.body_state) for one in found]


def test_stages_follow_each_other():
    history = LoadHistory(
        stage=(Stage(force=4.0), Stage(force=2.0, cycles=2, steps=1), Stage(hold="approach")),
        steps=2,
    )
    assert (history.count, history.quantity, history.points) == (8, "force", (4, 2, 4, 2, 4))
    found = controls(history, (7.0, 4.0))
    assert found[:2] == [(None, 2.0, 0.5), (None, 4.0, 1.0)]
    assert found[2:6] == [(None, 2.0, 3.0), (None, 4.0, 2.0)] * 2
    assert found[6:] == [(7.0, None, 4.5), (7.0, None, 5.0)]
    assert [history.stage_at(step) for step in range(1, 9)] == [1, 1, 2, 2, 2, 2, 3, 3]
    assert [step for step in range(8) if history.begins_stage(step)] == [0, 2, 6]
    assert history.quantity_in(3) == "approach"
    assert history.unloads


def test_turning_points_are_stages():
    """Of the shear too, which follows the load or goes along with it."""
    loads, pairs = (4.0, 2.0), ((1.0, 0.0), (0.0, -1.0))
    plain = LoadHistory(force=loads, shear=pairs, cycles=2, steps=2, shear_steps=3)
    by_load = 2 * [Stage(force=load) for load in loads]
    by_shear = [Stage(shear=(pair,), steps=3) for pair in pairs]
    after = LoadHistory(stage=(*by_load, *by_shear), steps=2)
    along = LoadHistory(force=loads, shear=pairs, cycles=2, steps=2, shear_path="along")
    both = 2 * [Stage(force=f, shear=(s,)) for f, s in zip(loads, pairs, strict=True)]
    for one, other in ((plain, after), (along, LoadHistory(stage=tuple(both), steps=2))):
        assert (one.count, one.points, one.largest) == (other.count, other.points, 4.0)
        for time in range(2 * one.count + 1):
            found, known = one.control_at(time / 2), other.control_at(time / 2)
            assert (found.force, found.shear) == (known.force, known.shear)
    assert plain.points[-1] == 2.0
    assert (plain.stage_at(1), after.stage_at(1)) == (None, 1)


def test_the_contact_bears_forces_pulls_and_pressures():
    history = LoadHistory(stage=(Stage(steps=2), Stage(pressure=-3.0, steps=1)), tilt="free")
    on_face = history.on_face(0.0, 2.0, (0.0, 8.0, 8.0, 10.0))
    assert controls(on_face) == [(None, 4.0, 0.5), (None, 8.0, 1.0), (None, 4.0, 3.0)]
    assert on_face.points == (8.0, 4.0)
    with pytest.raises(InputError, match=r"load\.stage\.1\.force.* = -6.*: pulls the plane off"):
        history.on_face(0.0, 2.0, (0.0, 5.0, 5.0, 5.0))
    plain = LoadHistory(pressure=(3.0, 1.0), steps=1).on_face(0.0, 2.0, (5.0,))
    assert [one[1] for one in controls(plain)] == [11.0, 7.0]


def test_a_load_goes_on_from_where_another_quantity_has_brought_the_plane():
    history = LoadHistory(stage=(Stage(force=4.0), Stage(approach=1.0, cycles=1)), steps=2)
    found = controls(history, (3.0, 4.0))
    assert [one[0] for one in found[2:]] == [2.0, 1.0, 2.0, 3.0]
    assert [control.force or control.approach for control in history.largest_controls] == [1, 4]


def test_approaches_from_the_mean_plane_may_be_negative():
    history = LoadHistory(zero="mean plane", approach=(-2e-3, -1e-3))
    assert (history.quantity, history.points) == ("approach", (-2e-3, -1e-3))


def test_the_history_to_the_largest_load_is_one_step():
    whole = LoadHistory(force=(2.0, 3.0, 1.0), steps=4, tilt="free")
    (largest,) = whole.largest_controls
    history = whole.straight_to(largest)
    assert (history.points, history.count, history.slopes) == ((3.0,), 1, None)
