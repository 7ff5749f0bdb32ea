"""Reads nested dictionaries into the records that the code uses, by pydantic.

A record says all that there is to say of its keys: types, units, limits and defaults by its fields,
meanings in the section ``Args`` of its docstring.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import pydantic
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, WithJsonSchema

from patchlaw.multiscale.scene.surface import HeightMap
from patchlaw.support.arguments import Limits, Unit, key_of
from patchlaw.support.errors import InputError
from patchlaw.support.quantities import example, named, parse_quantity

T = TypeVar("T")
Complain = Callable[[list[str]], InputError]
"""Returns the error on the place of a key that a section does not have."""

_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)
_OF_NUMBERS = re.compile(r" \[(?:mm⁴?|MPa|N)\]")
"""A unit in a docstring, which the type of the field states too."""
_ARGUMENT = re.compile(r"^    (\w+): ", re.MULTILINE)
_OF_TYPES = ("str", "int", "constrained-int", "float", "constrained-float")
"""Names of types that stand at the end of a key's place where it may have several."""


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
    model = model_of(cast(Any, record))
    try:
        return _made(record, model.model_validate(data))
    except pydantic.ValidationError as error:
        raise _first_problem(error, unknown) from None
    except InputError as refusal:
        raise _placed(refusal, None, data) from None


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


@cache
def model_of(record: Any) -> type[BaseModel]:
    """Return the pydantic model that checks what is written of a record, and describes it.

    Args:
        record: A dataclass.
    """
    hints, (summary, meanings) = get_type_hints(record, include_extras=True), described(record)
    keys = {field.name: field for field in fields(record) if key_of(field)}
    stated: dict[str, Any] = {
        name: (_readable(hints[name]), _stated(keys[name], meanings.get(name, "")))
        for name in meanings or keys  # Python may be told to drop docstrings
        if name in keys
    }
    return pydantic.create_model(record.__name__, __config__=_CONFIG, __doc__=summary, **stated)


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


def _stated(field: Field[Any], meaning: str) -> Any:
    """Return default, name and meaning of a key as pydantic takes them."""
    default: dict[str, Any] = {}
    if field.default is not MISSING:
        default = {"default": field.default}
    elif field.default_factory is not MISSING:
        default = {"default": field.default_factory()}
    return pydantic.Field(alias=key_of(field), description=meaning, **default)


def _readable(kind: Any) -> Any:
    """Return a type as pydantic is to read it: records from sections, numbers from quantities."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        checks = [check for mark in kind.__metadata__ for check in _checks(mark)]
        return Annotated[_readable(parts[0]), *checks]
    if origin in (Union, UnionType):
        return Union[tuple(_readable(one) for one in parts)]  # noqa: UP007
    if origin in (tuple, list, dict):
        return origin[tuple(one if one is ... else _readable(one) for one in parts)]
    if is_dataclass(kind) and isinstance(kind, type):
        return Annotated[model_of(kind), AfterValidator(lambda model: _made(kind, model))]
    if kind in (float, int, bool):
        return Annotated[kind, pydantic.Field(strict=True)]
    return kind


def _made(record: type[T], model: BaseModel) -> T:
    return record(**{name: getattr(model, name) for name in type(model).model_fields})


def _checks(mark: Any) -> Iterator[Any]:
    """Yield what pydantic is to do for a mark on a type."""
    if isinstance(mark, Limits):
        yield pydantic.Field(gt=mark.gt, ge=mark.ge, lt=mark.lt, le=mark.le)
    elif isinstance(mark, Unit):
        yield BeforeValidator(lambda value: _parsed(value, mark))
        yield _schema(mark)
    else:
        yield mark


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


def _schema(unit: Unit) -> WithJsonSchema:
    """Describe a quantity, or one or several, for editors and for the JSON Schema of a scene."""
    one = {
        "anyOf": [{"type": "number"}, {"type": "string"}],
        "description": f"string with a unit, or a bare number in {named(unit.name)}",
        "unit": unit.name,
        "examples": [example(unit.name).strip('"')],
    }
    listed = {"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}
    pair = {"type": "array", "items": one, "minItems": 2, "maxItems": 2}
    pairs = {"anyOf": [pair, {"type": "array", "items": pair, "minItems": 1}]}
    return WithJsonSchema(pairs if unit.pairs else listed if unit.several else one)


def _first_problem(error: pydantic.ValidationError, unknown: Complain) -> InputError:
    """Return the first problem that pydantic has with what was written, with key and value."""
    problems = error.errors(include_url=False)
    # A misspelt key also leaves its true name missing: the misspelling is what to say.
    problems.sort(key=lambda problem: problem["type"] != "extra_forbidden")
    problem = problems[0]
    path = [str(part) for part in problem["loc"]]
    if problem["type"] == "extra_forbidden":
        return unknown(path)
    # of a key with several types pydantic names the type, and has a problem for each
    if path and path[-1] in _OF_TYPES:
        path.pop()
    path = [part for part in path if "[" not in part and part != "bool"]
    key = ".".join(path) or None
    if problem["type"] == "missing":
        return InputError("is required and missing", key=key)
    if problem["type"] == "model_type":
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
