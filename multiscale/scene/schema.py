"""Reads nested dictionaries into the records that the code uses; describes their keys.

A record says all that there is to say of its keys: types, units, limits and defaults by its fields,
meanings in the section ``Args`` of its docstring. Values are checked as arguments of Python are.
Help says what the JSON Schema of scene files says.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from itertools import chain
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from patchlaw.multiscale.scene.body_sections import HeightMap
from patchlaw.multiscale.scene.sections import SceneSections
from patchlaw.support.arguments import Limits, ReadBy, Unit, key_of, passed, words_of
from patchlaw.support.errors import InputError
from patchlaw.support.quantities import example, named, parse_quantity

T = TypeVar("T")
Complain = Callable[[list[str]], InputError]
"""Returns the error on the place of a key that a section does not have."""

_OF_NUMBERS = re.compile(r" \[(?:mm⁴?|MPa|N)\]")
"""A unit in a docstring, which the type of the field states too."""
_ARGUMENT = re.compile(r"^    (\w+): ", re.MULTILINE)


class _Misspelt(Exception):
    """A key that there is none of, whose true name may be missing: it is what to say first."""


def _unknown(path: list[str]) -> InputError:
    return InputError("unknown key", key=".".join(path))


def read(record: type[T], data: Any, unknown: Complain = _unknown) -> T:
    """Read a section.

    Args:
        record: The class of the record.
        data: The section as a scene file has it.
        unknown: Returns the error on a key that there is none of.

    Raises:
        InputError: When anything is wrong: the first problem, with key, value and what is allowed.
    """
    try:
        return _section(data, record, ())
    except _Misspelt as misspelt:
        raise unknown(list(misspelt.args)) from None


Path = tuple[str, ...]
"""Names of sections within each other, and of a key."""


def _section(data: Any, record: type[T], path: Path) -> T:
    """Read a section at a path of keys."""
    key = ".".join(path) or None
    if not isinstance(data, Mapping):
        raise InputError("must be a section", key=key, value=data)
    hints, values, problems = _hints_of(cast(Any, record)), {}, []
    known = {name: one for one in fields(record) if (name := key_of(one))}  # type: ignore[arg-type]
    for name, one in known.items():
        try:
            if name in data:
                values[one.name] = _value(data[name], hints[name], (*path, name))
            elif one.default is one.default_factory is MISSING:
                problem = "is required and missing"
                raise InputError(problem, key=".".join((*path, name)))
        except InputError as error:
            problems.append(error.with_traceback(None))
    for name in data:
        if name not in known:
            raise _Misspelt(*path, str(name))
    if problems:
        raise problems[0]
    try:
        return record(**values)
    except InputError as refusal:
        value = data.get(refusal.key, refusal.value)
        inner = ".".join(part for part in (key, refusal.key) if part) or None
        raise InputError(refusal.problem, value=value, allowed=refusal.allowed, key=inner) from None


def _value(value: Any, hint: Any, path: Path) -> Any:
    """Read what is written of a key: sections, and numbers of quantities."""
    base, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    origin, inner, key, given = get_origin(base), get_args(base), ".".join(path), value
    try:
        for mark in marks:
            if isinstance(mark, Unit):
                value = _parsed(value, mark)
            elif isinstance(mark, ReadBy):
                value = mark.read(value)
        if base in _TYPES or origin is Literal:
            found = passed(key, value, hint)
            return float(found) if base is float else found
    except InputError as refusal:
        raise InputError(refusal.problem, value=given, allowed=refusal.allowed, key=key) from None
    if origin in (Union, UnionType):
        return _any_of(value, inner, path)
    if origin is dict and isinstance(value, Mapping):
        return {name: _value(one, inner[1], (*path, str(name))) for name, one in value.items()}
    if origin in (tuple, list):
        return origin(_items(value, inner, path))
    if origin is dict or is_dataclass(base):
        return _section(value, base, path)
    return value


def _items(value: Any, inner: tuple[Any, ...], path: Path) -> Iterator[Any]:
    """Yield what stands in a list, of one annotation or of as many as there are values."""
    key = ".".join(path)
    if not isinstance(value, list | tuple):
        raise InputError("must be a list", key=key, value=value)
    if len(inner) == 1 or inner[1] is ...:
        inner = inner[:1] * len(value)
    if len(value) != len(inner):
        size = "few" if len(value) < len(inner) else "many"
        raise InputError(f"has too {size} values", key=key, value=list(value))
    for number, (one, hint) in enumerate(zip(value, inner, strict=True)):
        yield _value(one, hint, (*path, str(number)))


def _any_of(value: Any, options: tuple[Any, ...], path: Path) -> Any:
    """Read what one of several annotations allows; the first says what is wrong."""
    problems = []
    for one in options:
        try:
            return _value(value, one, path)
        except InputError as error:
            problems.append(error.with_traceback(None))
    first, key = problems[0], ".".join(path)
    others = [one for one in options[1:] if get_origin(one) is Literal and first.key == key]
    problem = first.problem + "".join(f", or {words_of(one)}" for one in others)
    raise InputError(problem, value=first.value, allowed=first.allowed, key=first.key)


def to_dict(record: Any, *, whole: bool = True) -> Any:
    """Return a section as JSON can hold it, with every key by its name.

    Args:
        record: The section, or a value in it; a map of heights is named by its digest.
        whole: Whether keys without a value are among them, as None.
    """
    if is_dataclass(record):
        named = ((key_of(field), getattr(record, field.name)) for field in fields(record))
        pairs = [(key, value) for key, value in named if key and (whole or value is not None)]
        return {key: to_dict(value, whole=whole) for key, value in pairs}
    if isinstance(record, dict):
        return {name: to_dict(value, whole=whole) for name, value in record.items()}
    if isinstance(record, list | tuple):
        return [to_dict(value, whole=whole) for value in record]
    return record.digest if isinstance(record, HeightMap) else record


def described(record: Any) -> tuple[str, dict[str, str]]:
    """Return what docstrings say of a record, and of its fields, then of those of its bases.

    Args:
        record: A dataclass.
    """
    meanings: dict[str, str] = {}
    for base in filter(is_dataclass, record.__mro__):
        _, _, rest = (inspect.getdoc(base) or "").partition("\n\nArgs:\n")
        _, *parts = _ARGUMENT.split(rest.partition("\n\n")[0])
        for name, text in zip(parts[::2], parts[1::2], strict=True):
            meanings.setdefault(name, _OF_NUMBERS.sub("", inspect.cleandoc(text)))
    return (inspect.getdoc(record) or "").partition("\n\nArgs:\n")[0], meanings


def _parsed(value: Any, unit: Unit) -> Any:
    if unit.pairs:
        return _pairs(value, unit)
    if not unit.several:
        return parse_quantity(value, unit.name)
    listed = value if isinstance(value, list | tuple) else [value]
    return tuple(parse_quantity(one, unit.name) for one in listed)


def _pairs(value: Any, unit: Unit) -> tuple[tuple[float, ...], ...]:
    """Read one pair of quantities along x and y, or a list of pairs."""
    listed = value if isinstance(value, list | tuple) else [value]
    pairs = listed if listed and isinstance(listed[0], list | tuple) else [listed]
    if any(not isinstance(pair, list | tuple) or len(pair) != 2 for pair in pairs):
        shown = example(unit.name)
        allowed = f"[{shown}, {shown}], or a list of such pairs"
        raise InputError("is no pair of quantities along x and y", allowed=allowed)
    return tuple(tuple(parse_quantity(one, unit.name) for one in pair) for pair in pairs)


def schema_of(record: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of a section, whose keys are in the order of its docstring.

    Args:
        record: A dataclass.
        parts: Receives the schemas of the sections in it, by the names of their classes.
    """
    hints, (summary, meanings) = get_type_hints(record, include_extras=True), described(record)
    known = {one.name: one for one in fields(record) if key_of(one)}
    keys: dict[str, Any] = {}
    for name in meanings or known:  # Python may be told to drop docstrings
        if name in known and (stated := _schema(hints[name], parts)):
            field, key = known[name], str(key_of(known[name]))
            if field.default is not MISSING:
                stated["default"] = to_dict(field.default)
            elif field.default_factory is not MISSING:
                stated["default"] = to_dict(field.default_factory())
            keys[key] = stated | {"description": meanings.get(name, "")}
    return {
        "title": record.__name__,
        "description": summary,
        "type": "object",
        "properties": keys,
        "required": [key for key, stated in keys.items() if "default" not in stated],
        "additionalProperties": False,
    }


_TYPES = {float: "number", int: "integer", bool: "boolean", str: "string", type(None): "null"}
_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def _schema(hint: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of an annotation; empty of what no file has."""
    base, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if units := [mark for mark in marks if isinstance(mark, Unit)]:
        return _schema_of_quantity(units[0])
    bounds = {
        name: limit
        for mark in marks
        if isinstance(mark, Limits)
        for side, name in _BOUNDS.items()
        if (limit := getattr(mark, side)) is not None
    }
    origin, inner = get_origin(base), get_args(base)
    if origin in (Union, UnionType):
        each = [_schema(one, parts) for one in inner]
        parts_of = (one["anyOf"] if "anyOf" in one and "unit" not in one else [one] for one in each)
        return {"anyOf": list(chain.from_iterable(parts_of))} if all(each) else {}
    if origin is Literal:
        return {"enum": list(inner), "type": "string"}
    if is_dataclass(base):
        name = base.__name__  # type: ignore[union-attr]
        if name not in parts:
            parts[name] = schema_of(base, parts)
        return {"$ref": f"#/$defs/{name}"}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema(inner[1], parts)}
    if origin in (tuple, list):
        if len(inner) == 1 or inner[1] is ...:
            return {"type": "array", "items": _schema(inner[0], parts)}
        items = [_schema(one, parts) for one in inner]
        size = len(items)
        return {"type": "array", "prefixItems": items, "minItems": size, "maxItems": size}
    return {"type": _TYPES[base], **bounds} if base in _TYPES else {}


def _schema_of_quantity(unit: Unit) -> dict[str, Any]:
    """Return the JSON Schema of a quantity, of one or several, or of pairs."""
    one = {
        "anyOf": [{"type": "number"}, {"type": "string"}],
        "description": f"string with a unit, or a bare number in {named(unit.name)}",
        "unit": unit.name,
        "examples": [example(unit.name).strip('"')],
    }
    listed = {"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}
    pair = {"type": "array", "items": one, "minItems": 2, "maxItems": 2}
    pairs = {"anyOf": [pair, {"type": "array", "items": pair, "minItems": 1}]}
    return pairs if unit.pairs else listed if unit.several else one


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
    parts: dict[str, Any] = {}
    return schema_of(SceneSections, parts) | {"title": "Scene", "$defs": parts}


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


def flat(section: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys of a scene with dots, and their values.

    Args:
        section: The scene as nested dictionaries.
        above: What stands before its keys.
    """
    for name, value in section.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def bare_quantities(data: Mapping[str, Any]) -> Iterator[str]:
    """Yield what bare numbers of a scene were taken for, such as ``height = 1 taken in mm``.

    Args:
        data: What was written of the scene.
    """
    for name, value in flat(data):
        numbers = value if isinstance(value, list | tuple) else [value]
        bare = any(isinstance(one, int | float) and one for one in numbers)
        if bare and (unit := _unit_of(name)):
            yield f"{name} = {value} taken in {unit}"


def _unit_of(name: str) -> str:
    """Return the unit of bare numbers at a dotted name; empty where they have none.

    Parts of the name may be numbers or names of the user's. A JSON Schema of all keys, which knows
    the units too, takes 60 ms.
    """
    hint: Any = SceneSections
    for part in name.split("."):
        records: list[Any] = [one for one in _within(hint) if is_dataclass(one)]
        hint = next((keys[part] for one in records if part in (keys := _hints_of(one))), hint)
    return next((one.name for one in _within(hint) if isinstance(one, Unit)), "")


def _within(hint: Any) -> Iterator[Any]:
    """Yield an annotation and all that it is made of."""
    yield hint
    for one in get_args(hint):
        yield from _within(one)


@cache
def _hints_of(record: Any) -> dict[str | None, Any]:
    """Return the annotations of a record by key of scenes."""
    hints = get_type_hints(record, include_extras=True)
    return {key_of(field): hints[field.name] for field in fields(record)}


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
