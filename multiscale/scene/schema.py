"""Reads nested dictionaries into the records that the code uses, by pydantic; describes their keys.

A record says all that there is to say of its keys: types, units, limits and defaults by its fields,
meanings in the section ``Args`` of its docstring. Help says what the JSON Schema of scene files
says.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Any, TypeVar, cast, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import SchemaValidator

from patchlaw.multiscale.scene.body_sections import HeightMap
from patchlaw.multiscale.scene.sections import SceneSections
from patchlaw.support import InputError, Unit, key_of

T = TypeVar("T")
Complain = Callable[[list[str]], InputError]
"""Returns the error on the place of a key that a section does not have."""

_OF_NUMBERS = re.compile(r" \[(?:mm⁴?|MPa|N)\]")
"""A unit in a docstring, which the type of the field states too."""
_ARGUMENT = re.compile(r"^    (\w+): ", re.MULTILINE)
_OF_TYPES = ("str", "int", "constrained-int", "float", "constrained-float")
"""Names of types that stand at the end of a key's place where it may have several."""
_EXTRA = "unexpected_keyword_argument"
"""What pydantic calls the problem with a key that there is none of."""


def _unknown(path: list[str]) -> InputError:
    return InputError("unknown key", key=".".join(path))


def read(record: type[T], data: Any, unknown: Complain = _unknown) -> T:
    """Read a section.

    Args:
        record: The class of the record, whose ``__pydantic_config__`` forbids further keys.
        data: The section as a scene file has it.
        unknown: Returns the error on a key that there is none of.

    Raises:
        InputError: When anything is wrong: the first problem, with key, value and what is allowed.
    """
    try:
        return cast(T, _validator(cast(Any, record)).validate_python(data))
    except ValidationError as error:
        raise _first_problem(error, unknown) from None


@cache
def _validator(record: Any) -> SchemaValidator:
    """Return what reads a record, whose numbers and truth values are none of texts or each other.

    All of pydantic would be strict otherwise, and no list be taken for a tuple.
    """
    schema = TypeAdapter(record).core_schema

    def be_strict(part: Any) -> None:
        if isinstance(part, dict):
            if part.get("type") in ("float", "int", "bool"):
                part["strict"] = True
            part = part.values()
        if not isinstance(part, str):
            for inner in part:
                if isinstance(inner, dict | list | tuple):
                    be_strict(inner)

    be_strict(schema)
    return SchemaValidator(schema)


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


def _first_problem(error: ValidationError, unknown: Complain) -> InputError:
    """Return the first problem that pydantic has with what was written, with key and value."""
    problems = error.errors(include_url=False)
    # A misspelt key also leaves its true name missing: the misspelling is what to say.
    problems.sort(key=lambda problem: problem["type"] != _EXTRA)
    problem = problems[0]
    path = [str(part) for part in problem["loc"]]
    if problem["type"] == _EXTRA:
        return unknown(path)
    # of a key with several types pydantic names the type, and has a problem for each
    if path and path[-1] in _OF_TYPES:
        path.pop()
    path = [part for part in path if "[" not in part and part != "bool"]
    key = ".".join(path) or None
    if problem["type"] == "missing" and path and path[-1].isdecimal():
        few = "has too few values"
        return InputError(few, key=".".join(path[:-1]), value=list(problem["input"]))
    if problem["type"] == "missing":
        return InputError("is required and missing", key=key)
    if problem["type"] == "dataclass_type":
        return InputError("must be a section", key=key, value=problem["input"])
    instead = "".join(
        f", or {other['ctx']['expected']}"
        for other in problems[1:]
        if other["type"] == "literal_error" and other["input"] is problem["input"]
    )
    refusal = problem.get("ctx", {}).get("error")
    if isinstance(refusal, InputError):
        return _placed(refusal, key, problem["input"], instead)
    text = problem["msg"].replace("Input should be", "must be").replace("valid tuple", "list")
    value = {} if isinstance(problem["input"], dict) else {"value": problem["input"]}
    return InputError(text + instead, key=key, **value)


def _placed(refusal: InputError, key: str | None, given: Any, instead: str = "") -> InputError:
    """Return the error of a record, or of a value, at its place in what was given for it."""
    value = given
    if isinstance(given, Mapping):
        value = given.get(refusal.key, refusal.value)
    key = ".".join(part for part in (key, refusal.key) if part) or None
    return InputError(refusal.problem + instead, value=value, allowed=refusal.allowed, key=key)


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


class _Describing(GenerateJsonSchema):
    """Takes the meanings of keys from docstrings, and their order."""

    def dataclass_schema(self, schema: Any) -> dict[str, Any]:
        found, record = super().dataclass_schema(schema), schema["cls"]
        found["description"], meanings = described(record)
        keys, known = {one.name: key_of(one) for one in fields(record)}, found["properties"]
        ordered = {keys.get(name): {"description": text} for name, text in meanings.items()}
        ordered = {key: known[key] | text for key, text in ordered.items() if key in known}
        return found | {"properties": ordered or known}


def json_schema(record: Any) -> dict[str, Any]:
    """Return the JSON Schema of a record, whose ``__pydantic_config__`` forbids further keys.

    Args:
        record: A dataclass.
    """
    return TypeAdapter(record).json_schema(schema_generator=_Describing)


def scene_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files."""
    return json_schema(SceneSections) | {"title": "Scene"}


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
