"""Every key of a scene says what it is, in help and schema alike."""

import re
from dataclasses import fields, is_dataclass
from functools import cache
from typing import get_args, get_type_hints

import pydantic
import pytest

from patchlaw.multiscale import Scene
from patchlaw.multiscale.scene.schema import bare_quantities, described, flat, read, scene_keys
from patchlaw.support import key_of

GIVEN = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 8], "rms_slope": 0.1},
        "grid": [32, 32],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {"young_modulus": "210 GPa", "poisson_ratio": 0.3},
    "load": {"approach": "8 um", "tilt": [1e-3, 0]},
}


def records(kind):
    """Yield the records in a type."""
    if isinstance(kind, type) and is_dataclass(kind):
        yield kind
    for part in get_args(kind):
        yield from records(part)


def described_keys(record):
    """Yield all keys of a section and of those in it with what their docstring says."""
    hints, (_, meanings) = get_type_hints(record, include_extras=True), described(record)
    for field in fields(record):
        if key_of(field):
            yield f"{record.__name__}.{field.name}", meanings.get(field.name, "")
            for inner in records(hints[field.name]):
                yield from described_keys(inner)


def test_every_key_has_a_description():
    texts = dict(described_keys(Scene))
    assert len(texts) > 100
    for name, text in texts.items():
        assert len(text) > 10, name
        assert text[0].isupper() and text.endswith("."), name


def test_every_key_of_the_schema_is_explained():
    for name, key in scene_keys().items():
        assert key.meaning.endswith("."), name
        assert key.is_section or key.values, name
        assert "``" not in key.meaning, name


def test_sections_come_before_their_keys():
    names = list(scene_keys())
    assert names.index("load") < names.index("load.force")
    assert names.index("surface.spectrum") < names.index("surface.spectrum.hurst")


@pytest.mark.parametrize(
    ("name", "values", "unit", "default"),
    [
        ("block.young_modulus", 'quantity, such as "4 GPa", or number in MPa', "MPa", "required"),
        ("block.poisson_ratio", "number > -1 and < 0.5", "", "required"),
        ("surface.lengths", 'list of 2: quantity, such as "8 um", or number in mm', "mm", "not"),
        ("load.steps", "whole number ≥ 1 and ≤ 1e+06", "", "8"),
        ("output.report", "true | false", "", "true"),
        ("block.sides", '"free" | "roller"', "", '"free"'),
        ("patches.grid", "list of 2: whole number ≥ 1", "", "[4, 4]"),
        ("surface.file", "text", "", "not given"),
    ],
)
def test_values_unit_and_default(name, values, unit, default):
    key = scene_keys()[name]
    assert (key.values, key.unit) == (values, unit)
    assert default in key.default


def test_units_that_bare_numbers_were_taken_in():
    assert (
        list(bare_quantities(Scene.from_dict(GIVEN).written)) == []
    )  # ratios and counts have no unit
    scene = Scene.from_dict(GIVEN).with_(
        {"block.young_modulus": 210, "surface.lengths": [1, "1 mm"], "block.margin": 0}
    )
    assert list(bare_quantities(scene.written)) == [
        "surface.lengths = [1, '1 mm'] taken in mm",
        "block.young_modulus = 210 taken in MPa",
    ]


def test_dotted_keys_of_nested_sections():
    assert dict(flat({"a": {"b": 1, "c": {"d": [2]}}, "e": None})) == {
        "a.b": 1, "a.c.d": [2], "e": None,
    }  # fmt: skip


def test_bare_numbers_have_the_unit_that_the_schema_states():
    """Two ways to it: the schema of all keys takes longer than the rest of a small run's setup."""
    for name, key in scene_keys().items():
        *sections, last = name.split(".")
        data = {last: 2}
        for section in reversed(sections):
            data = {section: data}
        expected = [f"{name} = 2 taken in {key.unit}"] * bool(key.unit)
        assert key.is_section or list(bare_quantities(data)) == expected, name


SHAPES = (lambda one: one), (lambda one: [one, one]), (lambda one: [one, one, one])
"""Ways to write a value: alone, for two axes, for three."""
BESIDE = {
    "margin": GIVEN["block"],
    "temperature_jump": {"conductivity": ["50 W/m/K"], "gas": "0.026 W/m/K"},
    "pull": {"surface": "washers"},
    "wear": {"surface": "pad", **GIVEN["surface"]},
}
"""What a section with a key that may be 0 needs beside it."""


adapter_of = cache(pydantic.TypeAdapter)


def problem_of(record, key, value):
    """Return what is said of a value by the limits of its key; empty for nothing."""
    try:
        adapter_of(record).validate_python({key: value})
    except pydantic.ValidationError as error:
        found = [one for one in error.errors() if one["loc"][:1] == (key,)]
        return next((str(one["ctx"].get("error", one)) for one in found if "ctx" in one), "")
    return ""


def test_what_a_refusal_of_a_size_offers_is_taken():
    """Whole records take the zeros; their other values depend on each other."""
    offers_zero, count = set(), 0
    for record in {one for kind in _kinds(Scene) for one in records(kind)}:
        for key in filter(None, map(key_of, fields(record))):
            for shape in SHAPES:
                said = problem_of(record, key, shape(1e-300))
                found = re.search(
                    r"out of any scale \(allowed: (\S+) to (\S+) [^,)]*(, or 0)?", said
                )
                if found is None:
                    continue
                count += 1
                for offered in map(float, found.groups()[:2]):
                    assert not problem_of(record, key, shape(offered)), (record, key, offered)
                if found[3]:
                    offers_zero.add(key)
                    assert not problem_of(record, key, shape(0)), (record, key)
                    read(record, BESIDE[key] | {key: 0})
    assert count > 60
    assert offers_zero == set(BESIDE)


def _kinds(record):
    """Yield the types of all keys, of sections within sections too."""
    for kind in get_type_hints(record, include_extras=True).values():
        yield kind
        for inner in records(kind):
            yield from _kinds(inner)
