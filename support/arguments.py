"""Checks arguments of public functions and fields of records against their annotations.

What is annotated is what is checked: kinds, lengths of tuples, and `Limits`. Truth values and whole
numbers of numpy become those of Python, real numbers `float`, real arrays `float64`, lists and
arrays in the place of tuples tuples. No imaginary part, mask or unit is dropped.

Units and limits of the fields of records are stated once, where a field is declared. Whatever reads
records from text, as scenes are read, finds them beside the types.
"""

from __future__ import annotations

import collections.abc as abc
import inspect
import math
import operator
import os
import re
import types
import typing
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, fields
from functools import cache, partial, wraps
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.support.checks import LARGEST, SMALLEST, real_array
from patchlaw.support.errors import InputError, shortened
from patchlaw.support.quantities import Unit

KEY = "key"
"""Metadata of a dataclass's field: its name in scene files; None where it is no key of theirs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a number; those that are None are none.

    Args:
        gt: What it exceeds.
        ge: Its least value.
        lt: What it is less than.
        le: Its largest value.
    """

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    __is_annotated_types_grouped_metadata__: ClassVar = True

    def __iter__(self) -> Iterator[Any]:
        """Yield what this stands for beside a type that pydantic reads."""
        import annotated_types

        for name in ("gt", "ge", "lt", "le"):
            if (bound := getattr(self, name)) is not None:
                yield getattr(annotated_types, name.title())(bound)

    def problem(self, value: float) -> str:
        """Return what is wrong with a number, in pydantic's words; empty for nothing."""
        if isinstance(value, float) and not math.isfinite(value):
            return "must be a finite number"
        tests = (
            (self.gt is None or value > self.gt, f"greater than {self.gt}"),
            (self.ge is None or value >= self.ge, f"greater than or equal to {self.ge}"),
            (self.lt is None or value < self.lt, f"less than {self.lt}"),
            (self.le is None or value <= self.le, f"less than or equal to {self.le}"),
        )
        return next((f"must be {words}" for kept, words in tests if not kept), "")


Positive = Limits(gt=0)
Length = Annotated[float, Unit("mm")]
PositiveLength = Annotated[float, Unit("mm"), Positive]
Distance = Annotated[float, Unit("mm", zero=True), Limits(ge=0)]
Side = Annotated[float, Limits(ge=SMALLEST, le=LARGEST)]
Lengths = tuple[Side, Side]
"""Sides (Lx, Ly) of a rectangle [mm]."""
Pressure = Annotated[float, Unit("MPa")]
PositivePressure = Annotated[float, Unit("MPa"), Positive]
Slope = Annotated[float, Unit("")]
Density = Annotated[float, Unit("t/mm**3"), Positive]
Mass = Annotated[float, Unit("t"), Positive]
Count = Annotated[int, Limits(ge=1, le=1_000_000_000)]
Grid = tuple[Count, Count]
"""Numbers of cells or patches along x and y."""
Tag = str | Annotated[int, Limits(ge=0)]
"""Physical name or number of a face in a mesh."""
Heights = Annotated[int, Limits(ge=4, le=1_000_000_000)]
"""Number of heights along a side; fewer than four have no cubic interpolant."""


def part_of(record: Any, base: type) -> dict[str, Any]:
    """Return the fields that a record has from one of its bases, as arguments of that base.

    Args:
        record: The record.
        base: The base, a dataclass.
    """
    return {field.name: getattr(record, field.name) for field in fields(base)}


def changed_fields(record: Any) -> list[str]:
    """Return the names of a record's fields whose values are not their defaults.

    Args:
        record: The record.
    """
    names = []
    for one in fields(record):
        default = one.default if one.default_factory is MISSING else one.default_factory()
        if getattr(record, one.name) != default:
            names.append(one.name)
    return names


def key_of(field: Field[Any]) -> str | None:
    """Return the name of a record's field in scene files; None where it is no key of theirs.

    Args:
        field: The field of a dataclass.
    """
    key: str | None = field.metadata.get(KEY, field.name)
    return key


F = TypeVar("F", bound=Callable[..., Any])

_ARRAY_LIKE = set(get_args(ArrayLike)) or {ArrayLike}
_ARRAYS = {"f": "iuf", "i": "iu", "u": "iu", "b": "b"}
"""Kinds of arrays that are taken for a kind of array."""


@dataclass(frozen=True)
class Has:
    """Attributes that a thing of another library has, instead of its class.

    Args:
        words: What it is called in errors.
        names: The attributes.
    """

    words: str
    names: tuple[str, ...]

    def holds(self, value: Any) -> bool:
        """Tell whether a thing has them."""
        return all(hasattr(value, name) for name in self.names)


Comm = Annotated[
    Any, Has("a communicator of mpi4py such as MPI.COMM_WORLD, or None", ("rank", "size", "bcast"))
]
"""Communicator of mpi4py; without one a process is alone."""


class _Refused(Exception):
    """A value is not what its annotation says.

    Args:
        what: The text that goes on behind ``key = value:``; or the annotation, which says it.
    """

    def __str__(self) -> str:
        (what,) = self.args
        return what if isinstance(what, str) else f"must be {_words(what)}"


class _Beyond(_Refused):
    """A number is beyond its limits, and of the right kind."""


def checked(function: F) -> F:
    """Let a function refuse arguments that are not what their annotations say.

    Args:
        function: The function; the error of its arguments is an `InputError` that names the
            argument, its value and what is allowed. Parameters that are annotated by names for type
            checkers alone are passed on as they are.
    """
    parameters: dict[str, inspect.Parameter] = {}
    several = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)

    @wraps(function)
    def with_checked(*args: Any, **kwargs: Any) -> Any:
        if not parameters:
            parameters.update(inspect.signature(function).parameters)
        hints, given = _hints(function), list(args)
        for place, (name, one) in enumerate(zip(parameters, given, strict=False)):
            if parameters[name].kind in several:
                break
            if name in hints and one is not parameters[name].default:
                given[place] = _passed(name, one, hints[name])
        for name in kwargs.keys() & hints.keys():
            if kwargs[name] is not parameters[name].default:
                kwargs[name] = _passed(name, kwargs[name], hints[name])
        return function(*given, **kwargs)

    return typing.cast(F, with_checked)


def check_fields(record: Any, *, finite: bool = True) -> None:
    """Refuse a record with a field that is not what its annotation says.

    Args:
        record: The record, a dataclass, while it is made.
        finite: Whether its numbers are finite; in results what is not known is not a number.

    Raises:
        InputError: Names field and value.
    """
    hints = _hints(record.__class__)
    for one in fields(record):
        value = getattr(record, one.name)
        if value is not one.default:
            passed = _passed(one.name, value, hints[one.name], finite)
            if passed is not value:
                object.__setattr__(record, one.name, passed)


def _passed(name: str, value: Any, hint: Any, finite: bool = True) -> Any:
    """Return what to pass on for an argument."""
    try:
        return _taken(value, hint, finite)
    except _Refused as refused:
        raise InputError(str(refused), key=name, value=value) from None
    except InputError as error:  # of `real_array`
        raise error.located(key=name) from None


@cache
def _hints(described: Any) -> dict[str, Any]:
    """Return the annotations of a function, or of a record, by name."""
    if isinstance(described, type):
        return typing.get_type_hints(described, include_extras=True)
    found: dict[str, Any] = {}
    for name, hint in described.__annotations__.items():
        alone = types.SimpleNamespace(__annotations__={name: hint})
        with suppress(NameError):  # imported for type checkers alone
            found |= typing.get_type_hints(alone, described.__globals__, include_extras=True)
    return found


def _taken(value: Any, hint: Any, finite: bool) -> Any:
    """Return what to pass on for a value, as its annotation has it.

    Raises:
        _Refused: When it is not what the annotation says.
    """
    if value.__class__ is hint and (hint is not float or math.isfinite(value)):
        return value
    if hint is ArrayLike:
        return real_array(value)
    hint = _meant(hint)
    return _TAKES.get(get_origin(hint) or hint, _instance)(value, hint, finite)


@cache
def _meant(hint: Any) -> Any:
    """Return what an alias stands for that a statement ``type`` made, as numpy's from 2.5 on."""
    meant = getattr(get_origin(hint) or hint, "__value__", None)
    if meant is None:
        return hint
    return _meant(meant[get_args(hint)] if get_args(hint) else meant)


def _words(hint: Any) -> str:
    """Return what errors call the values that an annotation allows; nothing where it is any."""
    if hint is ArrayLike:
        return "numbers"
    hint = _meant(hint)
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind is Annotated:
        return next((one.words for one in inner[1:] if isinstance(one, Has)), _words(inner[0]))
    if kind in (Union, types.UnionType):
        words = [_words(one) for one in _options(inner)]
        return " or ".join(words) if all(words) else ""
    if kind is Literal:
        return "one of " * (len(inner) > 1) + ", ".join(map(repr, inner))
    if kind is tuple:
        inner = inner or (Any, ...)
        endless = len(inner) == 2 and inner[1] is Ellipsis
        return f"{'a list of' if endless else len(inner)} {_plural(inner)}"
    if kind in _SEQUENCES:
        return f"a list of {_plural(inner)}"
    if kind in _WORDS or not isinstance(kind, type) or getattr(kind, "_is_protocol", False):
        return _WORDS.get(kind, "")
    how = f", by {kind.HOW}" if hasattr(kind, "HOW") else ""
    return f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}{how}"


def _plural(inner: tuple[Any, ...]) -> str:
    """Return the words for several values of the first of some annotations."""
    words = _words(inner[0]) if inner else ""
    simple = re.fullmatch("an? ([a-z ]+)", words)
    return f"{simple[1]}s" if simple else f"values, each {words}" if words else "values"


@cache
def _options(inner: tuple[Any, ...]) -> list[Any]:
    """Return the annotations of a union, of which those of what numpy makes arrays of are one."""
    if not set(inner) >= _ARRAY_LIKE:
        return list(inner)
    return [*(one for one in inner if one not in _ARRAY_LIKE), ArrayLike]


def _instance(value: Any, hint: Any, finite: bool) -> Any:
    """Take what is an instance of a class; anything where protocols have none."""
    kind = get_origin(hint) or hint
    if kind in (Any, object) or getattr(kind, "_is_protocol", False):
        return value
    holds = _HOLDS.get(kind)
    if holds is None and not isinstance(kind, type):
        return value
    if not (isinstance(value, kind) if holds is None else holds(value)):
        raise _Refused(hint)
    return value


def _annotated(value: Any, hint: Any, finite: bool) -> Any:
    base, *marks = get_args(hint)
    things = [one for one in marks if isinstance(one, Has)]
    if things and not things[0].holds(value):
        raise _Refused(f"must be {things[0].words}")
    value = value if things else _taken(value, base, finite)
    for one in marks:
        if isinstance(one, Limits) and (problem := one.problem(value)):
            raise _Beyond(problem)
    return value


def _any_of(value: Any, hint: Any, finite: bool) -> Any:
    """Take a value of which one of several annotations holds."""
    options, problems = _options(get_args(hint)), []
    if value is None and type(None) in options:
        return None
    for one in options:
        try:
            return _taken(value, one, finite)
        except _Beyond:
            raise
        except (_Refused, InputError) as refused:
            if one is not type(None):  # its frames, this one too, would hold all they see
                problems.append(refused.with_traceback(None))
    if len(problems) == 1:
        raise problems[0]
    raise _Refused(hint)


def _choice(value: Any, hint: Any, finite: bool) -> Any:
    if not (isinstance(value, str | int) and value in get_args(hint)):
        raise _Refused(hint)
    return value


_SINGLE: dict[Any, Any] = {float: Real, int: Integral, bool: (bool, np.bool_)}
"""What single values of a kind are taken from."""


def _single(value: Any, hint: Any, finite: bool) -> Any:
    """Take a number or a truth value, which an array without dimensions may hold."""
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.is_masked(value):
        value = value.item()
    if not isinstance(value, _SINGLE[hint]) or (isinstance(value, bool) and hint is not bool):
        raise _Refused(hint)
    try:
        value = hint(value)
    except OverflowError:
        value = math.inf
    if finite and hint is float and not math.isfinite(value):
        raise _Refused("must be a finite number")
    return value


def _array(value: Any, hint: Any, finite: bool) -> Any:
    """Take an array; real numbers become float64."""
    of = get_args(get_args(hint)[1])[0] if get_args(hint) else Any
    kind = np.dtype(of).kind if of is not Any else ""
    if kind == "f":
        return real_array(value)
    if not isinstance(value, np.ndarray) or np.ma.is_masked(value):
        raise _Refused("must be an array")
    if kind and value.dtype.kind not in _ARRAYS[kind]:
        raise _Refused(f"must be an array of {'flags' if kind == 'b' else 'whole numbers'}")
    return value


def _tuple(value: Any, hint: Any, finite: bool) -> Any:
    """Take a tuple of one length, or of any, or a list or an array in its place."""
    inner = get_args(hint) or (Any, ...)
    endless = len(inner) == 2 and inner[1] is Ellipsis
    single = isinstance(value, np.ndarray) and value.ndim == 0
    if single or not isinstance(value, tuple | list | np.ndarray | range):
        raise _Refused(hint)
    if np.ma.is_masked(value):
        raise _Refused(f"must be {_words(hint)}, and none of them masked")
    if not endless and len(value) != len(inner):
        raise _Refused(hint)
    hints = inner[:1] * len(value) if endless else inner
    pairs = zip(value, hints, strict=True)
    passed = tuple(_item(one, each, finite, partial(_words, hint)) for one, each in pairs)
    same = isinstance(value, tuple) and all(map(operator.is_, passed, value))
    return value if same else passed


def _items(value: Any, hint: Any, finite: bool) -> Any:
    """Take a sequence, or what can be gone through; a text is neither."""
    kind, inner = get_origin(hint) or hint, get_args(hint)
    array = isinstance(value, np.ndarray) and value.ndim > 0
    kinds = abc.Iterable if kind is abc.Iterable else abc.Sequence
    if isinstance(value, str | bytes) or not (array or isinstance(value, kinds)):
        raise _Refused(hint)
    if not inner or kind is abc.Iterable:
        return value
    passed = [_item(one, inner[0], finite, partial(_words, hint)) for one in value]
    return value if all(map(operator.is_, passed, value)) else passed


def _item(value: Any, hint: Any, finite: bool, whole: Callable[[], str]) -> Any:
    """Return what to pass on for a value among others, of which errors give the words."""
    try:
        return _taken(value, hint, finite)
    except _Refused as refused:
        told = "" if _words(hint) in str(refused) else f"; {shortened(value)} {refused}"
        raise _Refused(f"must be {whole()}{told}") from None


def _mapping(value: Any, hint: Any, finite: bool) -> Any:
    if not isinstance(value, abc.Mapping):
        raise _Refused("must be a dictionary")
    key, item = get_args(hint) or (Any, Any)
    for name, one in value.items():
        _item(name, key, finite, lambda: f"a dictionary by {_words(key)}")
        _item(one, item, finite, lambda: f"a dictionary of {_words(item)}")
    return value


_SEQUENCES = abc.Sequence, abc.Iterable, list
_TAKES: dict[Any, Callable[[Any, Any, bool], Any]] = {
    Annotated: _annotated,
    Union: _any_of,
    types.UnionType: _any_of,
    Literal: _choice,
    np.ndarray: _array,
    tuple: _tuple,
    **dict.fromkeys(_SEQUENCES, _items),
    **dict.fromkeys((abc.Mapping, abc.MutableMapping, dict), _mapping),
    **dict.fromkeys(_SINGLE, _single),
}
"""Takes values of a kind of annotation, or refuses them; `_instance` does of all others."""
_HOLDS: dict[Any, Callable[[Any], bool]] = {
    None: lambda value: value is None,
    abc.Callable: callable,
    typing.BinaryIO: lambda value: hasattr(value, "read"),
    Path: lambda value: isinstance(value, os.PathLike),
}
_WORDS: dict[Any, str] = {
    **dict.fromkeys((Any, object), ""),
    None: "None",
    type(None): "None",
    np.ndarray: "an array",
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "a text",
    abc.Callable: "a function",
    typing.BinaryIO: "an open file",
    **dict.fromkeys((abc.Mapping, abc.MutableMapping, dict), "a dictionary"),
    **dict.fromkeys((Path, os.PathLike), "a pathlib.Path"),
}
