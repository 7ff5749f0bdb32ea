"""The keys of a scene: values, unit, default and meaning of each, from the models that check them.

They are those of the JSON Schema of scene files, so that help and schema say the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from patchlaw.multiscale.scene.contents import SceneSections
from patchlaw.multiscale.scene.reader import model_of
from patchlaw.multiscale.scene.scene_file import flat


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a scene, or a section.

    Args:
        name: The dotted name, such as ``load.force``.
        schema: Its JSON Schema.
        required: Whether it has to be given.
    """

    name: str
    schema: Mapping[str, Any]
    required: bool

    @property
    def is_section(self) -> bool:
        """Whether it holds further keys."""
        return "properties" in self.schema

    @property
    def meaning(self) -> str:
        """What it means, in a sentence or more."""
        return " ".join(self.schema["description"].replace("``", "").split())

    @property
    def values(self) -> str:
        """The values that it may have."""
        return _values(self.schema)

    @property
    def unit(self) -> str:
        """Unit of bare numbers; empty where numbers have none."""
        return next(_units(self.schema), "")

    @property
    def default(self) -> str:
        """Its default as it would stand in a scene file, or that it has none."""
        if self.required:
            return "none: it is required"
        default = self.schema.get("default")
        return "not given" if default is None else json.dumps(default)


def scene_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files."""
    return model_of(SceneSections).model_json_schema(by_alias=True) | {"title": "Scene"}


@cache
def scene_keys() -> dict[str, Key]:
    """Return all keys and sections of a scene by dotted name, each section before its keys."""
    schema = scene_schema()
    return {key.name: key for key in _keys(schema, schema["$defs"], "")}


def _keys(section: Mapping[str, Any], parts: Mapping[str, Any], prefix: str) -> Iterator[Key]:
    """Yield the keys of a section and of the sections in it."""
    for name, stated in section["properties"].items():
        options = [stated, *stated.get("anyOf", ())]
        # sections in a list, or by names of the user's
        options += [stated.get(several, {}) for several in ("items", "additionalProperties")]
        references = [option["$ref"] for option in options if option and "$ref" in option]
        part = parts[references[0].rpartition("/")[2]] if references else {}
        required = name in section.get("required", ())
        yield Key(prefix + name, {**part, **stated}, required)
        if part:
            yield from _keys(part, parts, f"{prefix}{name}.")


def _values(schema: Mapping[str, Any]) -> str:
    """Return the values that a JSON Schema allows, in words."""
    if "unit" in schema:
        unit, (example,) = schema["unit"], schema["examples"]
        return f'quantity, such as "{example}"' + (
            f", or number in {unit}" if unit else ", or number"
        )
    if "enum" in schema or "const" in schema:
        return " | ".join(json.dumps(one) for one in schema.get("enum", [schema.get("const")]))
    if options := schema.get("anyOf"):
        return "; or ".join(_values(one) for one in options if one.get("type") != "null")
    kind = schema.get("type")
    if "properties" in schema or "$ref" in schema:
        return "section"
    if kind == "array":
        items = schema.get("prefixItems", ())
        if not items:
            return f"list of: {_values(schema['items'])}"
        return f"list of {len(items)}: {_values(items[0])}"
    words = {"boolean": "true | false", "integer": "whole number", "string": "text"}
    return words.get(str(kind), "number") + _bounds(schema)


def _bounds(schema: Mapping[str, Any]) -> str:
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    # a bound of 10⁹ is none that a user meets
    stated = {sign: schema[name] for name, sign in signs.items() if name in schema}
    bounds = [f"{sign} {bound:g}" for sign, bound in stated.items() if bound < 1e9]
    return f" {' and '.join(bounds)}" if bounds else ""


def _units(schema: Mapping[str, Any]) -> Iterator[str]:
    """Yield the units of the quantities in a JSON Schema."""
    if "unit" in schema:
        yield schema["unit"]
    parts = (*schema.get("anyOf", ()), *schema.get("prefixItems", ()), schema.get("items", {}))
    for part in parts:
        if part:
            yield from _units(part)


def bare_quantities(data: Mapping[str, Any]) -> Iterator[str]:
    """Yield what bare numbers of a scene were taken for, such as ``height = 1 taken in mm``.

    Args:
        data: What was written of the scene.
    """
    for name, value in flat(data):
        numbers = value if isinstance(value, list | tuple) else [value]
        bare = any(isinstance(one, int | float) and one for one in numbers)
        if bare and (unit := _key_of(name).unit):
            yield f"{name} = {value} taken in {unit}"


def _key_of(name: str) -> Key:
    """Return the key of a dotted name, of which one part may be a number or a user's name."""
    keys = scene_keys()
    return next(keys[one] for one in _names(name) if one in keys)


def keys_beside(path: Sequence[str]) -> list[str]:
    """Return the keys of the section that a key would be in.

    Args:
        path: The parts of its dotted name; one may be a number or a name of the user's.
    """
    keys, section = scene_keys(), ".".join(path[:-1])
    place = next((one for one in _names(section) if one in keys), "")
    inner = (name.rpartition(".") for name in keys)
    return [name for before, _, name in inner if before == place]


def _names(name: str) -> Iterator[str]:
    """Yield a dotted name, and it without one of its parts."""
    parts = name.split(".")
    yield name
    yield from (".".join(parts[:i] + parts[i + 1 :]) for i in range(len(parts)))
