"""Errors say where and what, and arrive whole on other ranks."""

import pickle

import pytest

from geometry.errors import InputError, NotConverged


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
    "value", [Mute(), Odd(), [Mute()], 10**5000], ids=["mute", "odd", "inside", "long"]
)
def test_values_without_a_text_are_named_by_their_type(value):
    assert str(InputError("is wrong", value=value)) == f"<{type(value).__name__}>: is wrong"
