"""Records are read from sections: by their types, with the words of their docstrings."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import pytest
from pydantic import ConfigDict

from patchlaw.multiscale.scene.schema import described, json_schema, read, to_dict
from patchlaw.support import KEY, InputError, Length, Limits, PositiveLength, Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Bore:
    """A bore.

    Args:
        radius: Radius of the bore [mm].
    """

    radius: PositiveLength

    def __post_init__(self):
        if self.radius > 5.0:
            raise InputError("is larger than the plate", key="radius", value=self.radius)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plate(Bore):
    """A plate
    of two lines.

    Args:
        bores: Its bores.
        named: Bores by name.
        sides: Its sides [mm].
        loads: One load or several [N].
        end: Where it ends; ``"inf"`` is nowhere.
        count: How many
            there are.
        inner: What is no key.

    Note:
        Not this.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    bores: tuple[Bore, ...] = ()
    named: dict[str, Bore] = field(default_factory=dict)
    sides: tuple[Length, Length] | None = None
    loads: Annotated[tuple[float, ...], Unit("N", several=True)] = ()
    end: Length | Literal["inf"] = "inf"
    count: Annotated[int, Limits(ge=1)] = 1
    inner: int = field(default=7, metadata={KEY: None})


def test_quantities_and_records_within_records_are_read():
    data = {"radius": "1 mm", "bores": [{"radius": 2}], "loads": "3 kN"}
    plate = read(Plate, data | {"named": {"a": {"radius": "4 um"}}, "sides": ["1 m", 0.5]})
    assert plate == Plate(
        radius=1.0, bores=(Bore(radius=2.0),), named={"a": Bore(radius=4e-3)}, sides=(1000.0, 0.5),
        loads=(3000.0,),
    )  # fmt: skip
    assert read(Plate, to_dict(plate)) == plate == read(Plate, to_dict(plate, whole=False))
    assert "inner" not in to_dict(plate) and "sides" not in to_dict(Plate(radius=1.0), whole=False)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({}, "radius: is required and missing"),
        ({"radius": "1 kg"}, "radius = '1 kg': has the wrong unit"),
        ({"radius": 9}, "radius = 9: is larger than the plate"),
        ({"radius": 1, "bores": [{"radius": "8 mm"}]}, "bores.0.radius = '8 mm': is larger"),
        ({"radius": 1, "named": {"a": {"radius": 0}}}, "named.a.radius = 0: must be greater"),
        ({"radius": 1, "count": True}, "count = True: must be a valid integer"),
        ({"radius": 1, "outer": 1}, "outer: unknown key"),
        ({"radius": 1, "bores": 3}, "bores = 3: must be a list"),
        (3, "3: must be a section"),
    ],
)
def test_the_first_problem_is_named_with_key_and_value(data, words):
    with pytest.raises(InputError) as caught:
        read(Plate, data)
    assert str(caught.value).startswith(words)


def test_meanings_are_those_of_docstrings_own_before_inherited():
    summary, meanings = described(Plate)
    assert summary == "A plate\nof two lines."
    assert list(meanings) == ["bores", "named", "sides", "loads", "end", "count", "inner", "radius"]
    assert meanings["count"] == "How many\nthere are."
    assert (meanings["inner"], meanings["radius"]) == ("What is no key.", "Radius of the bore.")


def test_the_schema_has_units_limits_and_meanings():
    schema = json_schema(Plate)
    assert list(schema["properties"])[-1] == "radius" and schema["required"] == ["radius"]
    assert schema["properties"]["radius"]["unit"] == "mm"
    assert schema["properties"]["count"] == {
        "default": 1, "description": "How many\nthere are.", "minimum": 1, "title": "Count",
        "type": "integer",
    }  # fmt: skip
    one, several, *_ = schema["properties"]["loads"]["anyOf"]
    assert (one["unit"], several["minItems"]) == ("N", 1)
