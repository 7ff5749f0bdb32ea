"""Errors say where and what, and arrive whole on other ranks."""

import pickle
import re

import numpy as np
import pytest

from patchlaw.support import InputError, NotBalanced, NotConverged, check_scale, frozen_array


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (InputError("is wrong"), "is wrong"),
        (InputError("is wrong", value=-4, key="block.height"), "block.height = -4: is wrong"),
        (
            InputError("is wrong", value="8 kg", key="a.b", allowed="a length", file="s.toml"),
            "s.toml: a.b = '8 kg': is wrong (allowed: a length)",
        ),
        (
            NotConverged("the solve", reason="DIVERGED_ITS", iterations=7, remedy="load.steps"),
            "the solve did not converge: DIVERGED_ITS after 7 iterations; load.steps",
        ),
    ],
)
def test_text_survives_pickling(error, text):
    copy = pickle.loads(pickle.dumps(error))
    assert str(error) == str(copy) == text
    assert vars(copy) == vars(error)


def test_what_smaller_steps_do_not_help_is_that_on_every_rank():
    error = NotBalanced("the solve", reason="NOT_BALANCED", iterations=7, remedy="hold it")
    for other in (pickle.loads(pickle.dumps(error)), error.advised("press less")):
        assert type(other) is NotBalanced


def test_location_is_added_once():
    error = InputError("is wrong").located(key="inner").located(key="outer", file="s.toml")
    assert str(error) == "s.toml: inner: is wrong"


class Mute:
    def __repr__(self):
        raise RuntimeError("has no text")


class Odd:
    def __repr__(self):
        return 5


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Mute(), r"<Mute "),
        (Odd(), "<Odd "),
        ([Mute()], r"\[<Mute "),
        (10**5000, "<int>: is wrong"),
        (np.eye(2), r"array\(\[\[1., 0.\], \[0., 1.\]\]\): is wrong"),
    ],
    ids=["mute", "odd", "inside", "long", "array"],
)
def test_values_without_a_text_are_named_by_their_type(value, text):
    assert re.match(text, str(InputError("is wrong", value=value)))


class Counted:
    """Says how often it was asked for its text."""

    asked = 0

    def __repr__(self):
        Counted.asked += 1
        return "1"


def test_no_more_is_made_of_a_text_than_is_shown():
    value = Counted()
    for _ in range(60):  # 2^60 parts
        value = [value, value]
    text = str(InputError("is wrong", value=value))
    assert text.startswith("[[[[") and text.endswith("…: is wrong") and Counted.asked < 300


@pytest.mark.parametrize(
    "value",
    [[], (), {}, [1, "a"], (1,), (1, 2), {"a": [1, {"b": 2.5}], 3: ()}, "it's", b"\xff", None],
)
def test_short_values_are_shown_as_python_does(value):
    assert str(InputError("is wrong", value=value)) == f"{value!r}: is wrong"


def test_values_within_themselves_are_shown():
    value = []
    value.append(value)
    assert str(InputError("is wrong", value=value)).startswith("[[[[")


def test_frozen_arrays_are_copies():
    original = np.arange(4)
    copy = frozen_array(original)
    original[0] = 7
    assert copy[0] == 0.0 and not copy.flags.writeable


@pytest.mark.parametrize(
    "heights",
    [
        np.zeros((4, 4)),
        np.full((4, 4), 1e-200),
        1.0 + 1e-16 * np.arange(16.0).reshape(4, 4),  # but for rounding
        1e-14 * np.arange(16.0).reshape(4, 4),
        np.full((4, 4), np.nan),
    ],
)
def test_level_planes_and_fine_roughness_pass(heights):
    check_scale(heights)
