"""Units and limits of fields: what they refuse, and what readers of records find."""

import math
import re
from dataclasses import dataclass, field
from typing import Annotated, TypeVar

import numpy as np
import pytest
from typing_extensions import TypeAliasType

from patchlaw.support import (
    KEY,
    Count,
    InputError,
    Length,
    Limits,
    PositiveLength,
    arguments,
    check_fields,
    checked,
    key_of,
    part_of,
)


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A bar."""

    length: PositiveLength
    share: Annotated[float, Limits(ge=0, lt=1)] | None = None
    parts: Count = 1
    place: Length = 0.0
    inner: float = field(default=0.0, metadata={KEY: None})

    def __post_init__(self):
        check_fields(self)


@dataclass(frozen=True, kw_only=True)
class NamedBar(Bar):
    """A bar with a name."""

    name: str = field(metadata={KEY: "load"})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"length": 0.0}, "length = 0.0: must be greater than 0"),
        ({"length": math.nan}, "length = nan: must be a finite number"),
        ({"length": math.inf}, "length = inf: must be a finite number"),
        ({"share": -0.1}, "share = -0.1: must be greater than or equal to 0"),
        ({"share": 1.0}, "share = 1.0: must be less than 1"),
        ({"parts": 0}, "parts = 0: must be greater than or equal to 1"),
        ({"parts": 10**400}, "must be less than or equal to 1000000000"),
    ],
)
def test_numbers_beyond_their_limits_are_refused(change, words):
    with pytest.raises(InputError, match=re.escape(words)):
        NamedBar(**{"length": 1.0, "name": "b"} | change)


def test_numbers_without_limits_and_none_are_taken():
    bar = NamedBar(length=1.0, place=-1e300, name="b")
    assert (bar.share, bar.place) == (None, -1e300)


def test_what_a_record_has_from_a_base_are_arguments_of_it():
    bar = NamedBar(length=2.0, parts=3, name="b")
    assert Bar(**part_of(bar, Bar)) == Bar(length=2.0, parts=3)


def test_keys_of_fields():
    keys = {name: key_of(one) for name, one in NamedBar.__dataclass_fields__.items()}
    assert keys == {
        "length": "length", "share": "share", "parts": "parts", "place": "place",
        "inner": None, "name": "load",
    }  # fmt: skip


def test_aliases_of_the_statement_type_are_what_they_stand_for(monkeypatch):
    """As numpy 2.5 makes those of arrays; what an alias does not name was taken for an array."""
    scalar = TypeVar("scalar", bound=np.generic)
    of_arrays = np.ndarray[tuple[int, ...], np.dtype[scalar]]
    arrays = TypeAliasType("arrays", of_arrays, type_params=(scalar,))
    alike = TypeAliasType("alike", float | arrays[np.float64])
    monkeypatch.setattr(arguments, "ArrayLike", alike)
    monkeypatch.setattr(arguments, "_ARRAY_LIKE", {alike})

    def take(heights, bar=None, numbers=0.0, places=()):
        return heights, numbers

    take.__annotations__ = {"heights": arrays[np.float64], "places": arrays[np.int32]}
    take.__annotations__["bar"] = Bar | None
    take.__annotations__["numbers"] = alike | None
    take = checked(take)
    taken, numbers = take(np.ones(2, np.float32), numbers=[1, 2])
    assert taken.dtype == numbers.dtype == np.float64
    for wrong, words in (
        ({"places": taken}, "an array of whole"),
        ({"bar": 3.0}, "bar = .* a Bar"),
    ):
        with pytest.raises(InputError, match=words):
            take(np.ones(2), **wrong)


def test_tuples_and_arrays_of_anything_have_any_length():
    def take(several, array=None):
        return several

    take.__annotations__ = {"several": tuple, "array": np.ndarray | None}
    take = checked(take)
    assert take(()) == () and take([0.3, "a"], np.ones(3)) == (0.3, "a")
    with pytest.raises(InputError, match=r"several = .* a list of values"):
        take(0.3)
    with pytest.raises(InputError, match=r"array = .* an array"):
        take((), 0.3)
