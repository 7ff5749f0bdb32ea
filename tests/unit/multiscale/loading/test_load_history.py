"""Load histories of Python are checked as those of scenes are."""

import re

import pytest

from patchlaw.geometry import Control
from patchlaw.multiscale import LoadHistory, Problem, Step
from patchlaw.multiscale.loading.path import Path, Stage
from patchlaw.support import InputError


@pytest.mark.parametrize(("load", "words"), [
    ({}, "needs exactly one load (allowed: 'approach', 'force', 'pressure' or 'stage')"),
    ({"force": (1.0,), "cycles": 2, "shear": ((1.0, 0.0), (0.0, 0.0))},
     "cycles = 2 needs two turning points"),
    ({"force": (1.0,), "steps": 0}, "steps = 0: must be greater than or equal to 1"),
    ({"force": (1.0,), "zero": "sea"}, "zero: is no height that approaches count from"),
])  # fmt: skip
def test_loads_that_make_no_sense_are_refused(load, words):
    with pytest.raises(InputError, match=re.escape(words)):
        LoadHistory(**load)


def controls(path, *origins):
    """Return approach, force and state of the bodies at all load steps."""
    found = [step.control(*origins) for step in path]
    return [(one.approach, one.force, one.body_state) for one in found]


def test_stages_follow_each_other():
    history = LoadHistory(
        stage=(Stage(force=4.0), Stage(force=2.0, cycles=2, steps=1), Stage(hold="approach")),
        steps=2,
    )
    path = history.path()
    assert (history.count, len(path), path.quantity) == (8, 8, "force")
    assert [step.value for step in path.turning_points] == [4.0, 2.0, 4.0, 0.0]
    found = controls(path, (7.0, 4.0))
    assert found[:2] == [(None, 2.0, 0.5), (None, 4.0, 1.0)]
    assert found[2:6] == [(None, 2.0, 3.0), (None, 4.0, 2.0)] * 2
    assert found[6:] == [(7.0, None, 4.5), (7.0, None, 5.0)]
    assert [step.stage for step in path] == [1, 1, 2, 2, 2, 2, 3, 3]
    assert path[-1].part(0.5, path[-2]).control((7.0, 4.0)).body_state == 4.75
    assert path[-2].part(0.5, path[-3]).control((7.0, 4.0)) == Control(
        approach=7.0, body_state=4.25
    )
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
        found, known = one.path(), other.path()
        assert (one.count, len(found), found.largest()) == (other.count, len(known), 4.0)
        before = None, None
        for both in zip(found, known, strict=True):
            halves = [step.part(0.5, last) for step, last in zip(both, before, strict=True)]
            for here, there in (both, halves):
                assert (here.force, here.shear) == (there.force, there.shear)
            before = both
    assert plain.path()[-1].value == 2.0
    assert (plain.path()[0].stage, after.path()[0].stage) == (None, 1)


def test_the_contact_bears_forces_pulls_and_pressures():
    history = LoadHistory(stage=(Stage(steps=2), Stage(pressure=-3.0, steps=1)), tilt="free")
    path = history.path(0.0, 2.0, (0.0, 8.0, 8.0, 10.0))
    assert controls(path) == [(None, 4.0, 0.5), (None, 8.0, 1.0), (None, 4.0, 3.0)]
    plain = LoadHistory(pressure=(3.0, 1.0), steps=1)
    assert [one[1] for one in controls(plain.path(0.0, 2.0, (5.0,)))] == [11.0, 7.0]
    many = LoadHistory(force=(3.0, 1.0), steps=1_000_000, cycles=1_000)
    with pytest.raises(InputError, match="makes 2000000000 load steps"):
        many.path()
    with pytest.raises(InputError, match=r"pressure = 3.0: needs a face .*force"):
        plain.path()


def test_a_load_goes_on_from_where_another_quantity_has_brought_the_plane():
    history = LoadHistory(stage=(Stage(force=4.0), Stage(approach=1.0, cycles=1)), steps=2)
    path = history.path()
    found = controls(path, (3.0, 4.0))
    assert [one[0] for one in found[2:]] == [2.0, 1.0, 2.0, 3.0]
    assert [control.force or control.approach for control in path.largest_controls] == [1, 4]


def test_approaches_from_the_mean_plane_may_be_negative():
    history = LoadHistory(zero="mean plane", approach=(-2e-3, -1e-3))
    path = history.path(3e-3)
    assert (path.quantity, path.largest()) == ("approach", pytest.approx(2e-3, rel=1e-14))
    with pytest.raises(InputError, match=r"zero = 'mean plane'.* is a height of a surface"):
        Problem(type("Pressed", (), {"press": None}), history)


def test_paths_may_be_lists_of_steps():
    """Refused where no model could be pressed with them."""
    with pytest.raises(InputError, match="either the approach or the force"):
        Step(approach=1.0, force=1.0)
    path = Path([Step(force=1.0, tilt=None), Step(approach=2.0)])
    assert (path.quantity, path.largest(), path.tilt) == ("force", 1.0, None)
