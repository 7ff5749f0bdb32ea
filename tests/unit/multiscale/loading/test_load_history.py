"""Load histories of Python are checked as those of scenes are."""

import re

import pytest

from multiscale.loading.load_history import LoadHistory
from support.errors import InputError


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
        ({"force": (1.0,), "steps": 0}, "steps = 0: must be greater than or equal to 1"),
        ({"force": (1.0,), "zero": "sea"}, "zero: is no height that approaches count from"),
    ],
)
def test_loads_that_make_no_sense_are_refused(load, words):
    with pytest.raises(InputError, match=re.escape(words)):
        LoadHistory(**load)


def test_approaches_from_the_mean_plane_may_be_negative():
    history = LoadHistory(zero="mean plane", approach=(-2e-3, -1e-3))
    assert (history.quantity, history.points) == ("approach", (-2e-3, -1e-3))


def test_the_history_to_the_largest_load_is_one_step():
    whole = LoadHistory(force=(2.0, 3.0, 1.0), steps=4, tilt="free")
    (largest,) = whole.largest_controls
    history = whole.straight_to(largest)
    assert (history.points, history.count, history.slopes) == ((3.0,), 1, None)
