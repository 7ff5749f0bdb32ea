"""Checks arguments of public functions and fields of records against their annotations.

What is annotated is what is checked: kinds, lengths of tuples, and `Limits`. Numbers and truth
values of numpy become those of Python, real arrays `float64`, lists and arrays in the place of
tuples tuples. Nothing is rounded, and no imaginary part, mask or unit is dropped.

Units and limits of the fields of records are stated once, where a field is declared. Whatever reads
records from text, as scenes are read, finds them beside the types.
"""

from __future__ import annotations

import collections.abc as abc
import inspect
import math
import os
import re
import types
import typing
from collections.abc import Callable
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, fields
from functools import cache, wraps
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.support.checks import real_array
from patchlaw.support.errors import InputError, shortened

KEY = "key"
"""Metadata of a dataclass's field: its name in scene files; None where it is no key of theirs."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a number, or of several.

    Args:
        name: The unit in pint's notation; empty for a ratio.
        several: Whether the field holds a tuple, for which users may write one number or a list.
        pairs: Whether it holds a tuple of pairs along x and y, for which users may write one pair.
    """

    name: str
    several: bool = False
    pairs: bool = False


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
Pressure = Annotated[float, Unit("MPa")]
PositivePressure = Annotated[float, Unit("MPa"), Positive]
Slope = Annotated[float, Unit("")]
Density = Annotated[float, Unit("t/mm**3"), Positive]
Mass = Annotated[float, Unit("t"), Positive]
Count = Annotated[int, Limits(ge=1, le=1_000_000_000)]
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
Check = Callable[[Any], Any]
"""Returns what to pass on for a value, or raises `_Refused`."""

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
    """A value is not what its annotation says; the text goes on behind ``key = value:``."""


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
        checks = _checks(function)
        given = list(args)
        for place, (name, one) in enumerate(zip(parameters, given, strict=False)):
            if parameters[name].kind in several:
                break
            if name in checks and one is not parameters[name].default:
                given[place] = _passed(name, one, checks[name])
        for name in kwargs.keys() & checks.keys():
            if kwargs[name] is not parameters[name].default:
                kwargs[name] = _passed(name, kwargs[name], checks[name])
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
    for name, check, default in _field_checks(record.__class__, finite):
        value = getattr(record, name)
        if value is not default and (passed := _passed(name, value, check)) is not value:
            object.__setattr__(record, name, passed)


@cache
def _field_checks(record: type, finite: bool) -> list[tuple[str, Check, Any]]:
    """Return name, check and default, which needs none, of the fields of a class of records."""
    checks = _checks(record, finite)
    return [
        (one.name, checks[one.name], one.default) for one in fields(record) if one.name in checks
    ]


def _passed(name: str, value: Any, check: Check) -> Any:
    """Return what to pass on for an argument."""
    try:
        return check(value)
    except _Refused as refused:
        raise InputError(str(refused), key=name, value=value) from None
    except InputError as error:  # of `real_array`
        raise error.located(key=name) from None


@cache
def _checks(described: Any, finite: bool = True) -> dict[str, Check]:
    """Return the checks of a function's arguments, or of a record's fields, by name."""
    found: dict[str, Any] = {}
    for name, hint in _hints(described).items():
        if (check := _check_of(hint, finite)) is not None:
            found[name] = check[0]
    return found


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


def _check_of(hint: Any, finite: bool) -> tuple[Check, str] | None:
    """Return the check of an annotation, and its words; None where anything may be."""
    if hint is None or hint is type(None):
        return _same(lambda value: value is None, "None"), "None"
    if hint is ArrayLike:
        return real_array, "numbers"
    hint = _meant(hint)
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        if things := [one for one in inner[1:] if isinstance(one, Has)]:
            return _same(things[0].holds, things[0].words), things[0].words
        base = _check_of(inner[0], finite)
        limits = [one for one in inner[1:] if isinstance(one, Limits)]
        return base if base is None or not limits else (_within(base[0], limits), base[1])
    if origin in (Union, types.UnionType):
        arrays = set(inner) >= _ARRAY_LIKE
        others = [one for one in inner if not (arrays and one in _ARRAY_LIKE)]
        options = [_check_of(one, finite) for one in others]
        return _any_of([*options, (real_array, "numbers")] if arrays else options)
    if origin is Literal:
        words = "one of " + ", ".join(map(repr, inner)) if len(inner) > 1 else repr(inner[0])
        return _same(lambda value: isinstance(value, str | int) and value in inner, words), words
    if origin is np.ndarray:
        return _array(inner[1], "an array")
    if origin is tuple:
        return _tuple(inner, finite)
    if isinstance(origin, type) and issubclass(origin, abc.Mapping):
        return _mapping(inner, finite)
    if origin in (abc.Sequence, abc.Iterable, list):
        return _items(origin, inner, finite)
    if origin is abc.Callable or hint is Callable:
        return _same(callable, "a function"), "a function"
    kind = origin or hint
    return _of_class(kind, finite) if isinstance(kind, type) else None


def _meant(hint: Any) -> Any:
    """Return what an alias stands for that a statement ``type`` made, as numpy's from 2.5 on."""
    meant = getattr(get_origin(hint) or hint, "__value__", None)
    if meant is None:
        return hint
    return _meant(meant[get_args(hint)] if get_args(hint) else meant)


def _of_class(kind: type, finite: bool) -> tuple[Check, str] | None:
    """Return the check of a class; None of protocols, which have no instances."""
    simple: dict[type, tuple[Check, str]] = {
        float: (_number(finite), "a number"),
        int: (_whole, "a whole number"),
        bool: (_truth, "True or False"),
        str: (_same(lambda value: isinstance(value, str), "a text"), "a text"),
    }
    if kind in simple:
        return simple[kind]
    if kind is typing.BinaryIO:
        return _same(lambda value: hasattr(value, "read"), "a file"), "an open file"
    if kind in (Any, object) or getattr(kind, "_is_protocol", False):
        return None
    words = f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"
    words += f", by {how}" if (how := getattr(kind, "HOW", "")) else ""
    if kind in (Path, os.PathLike):
        kind, words = os.PathLike, "a pathlib.Path"
    return _same(lambda value: isinstance(value, kind), words), words


def _same(holds: Callable[[Any], bool], words: str) -> Check:
    """Return the check that passes a value on as it is."""

    def check(value: Any) -> Any:
        if not holds(value):
            raise _Refused(f"must be {words}")
        return value

    return check


def _plain(value: Any) -> Any:
    """Return the number in an array without dimensions, and any other value as it is."""
    single = isinstance(value, np.ndarray) and value.ndim == 0
    return value.item() if single and not np.ma.is_masked(value) else value


def _number(finite: bool) -> Check:
    """Return the check of a real number."""

    def check(value: Any) -> Any:
        if type(value) is not float:
            value = _plain(value)
            if isinstance(value, bool) or not isinstance(value, Real):
                raise _Refused("must be a number")
            try:
                number = float(value)
            except OverflowError:
                number = math.inf
            value = value if isinstance(value, int | float) else number
        else:
            number = value
        if finite and not math.isfinite(number):
            raise _Refused("must be a finite number")
        return value

    return check


def _whole(value: Any) -> Any:
    value = _plain(value)
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise _Refused("must be a whole number")
    return int(value)


def _truth(value: Any) -> Any:
    value = _plain(value)
    if not isinstance(value, bool | np.bool_):
        raise _Refused("must be True or False")
    return bool(value)


def _within(base: Check, limits: list[Limits]) -> Check:
    """Return the check of a number within limits."""

    def check(value: Any) -> Any:
        value = base(value)
        for one in limits:
            if problem := one.problem(value):
                raise _Beyond(problem)
        return value

    return check


def _any_of(options: list[tuple[Check, str] | None]) -> tuple[Check, str] | None:
    """Return the check of values of which one of several annotations holds."""
    known = [one for one in options if one is not None]
    if len(known) < len(options):
        return None
    words = " or ".join(one for _, one in known)
    real = [check for check, one in known if one != "None"]

    def check(value: Any) -> Any:
        problem: _Refused | InputError | None = None
        for one, _ in known:
            try:
                return one(value)
            except _Beyond:
                raise
            except (_Refused, InputError) as refused:
                if one in real:  # its frames, this one too, would hold all they see
                    problem = refused.with_traceback(None)
        if len(real) > 1 or problem is None:
            raise _Refused(f"must be {words}")
        raise problem

    return check, words


def _array(dtype: Any, words: str) -> tuple[Check, str]:
    """Return the check of an array, real numbers of which become float64."""
    kind = np.dtype(get_args(dtype)[0]).kind if get_args(dtype)[0] is not Any else ""

    def check(value: Any) -> Any:
        if kind == "f":
            return real_array(value)
        if not isinstance(value, np.ndarray) or np.ma.is_masked(value):
            raise _Refused(f"must be {words}")
        if kind and value.dtype.kind not in _ARRAYS[kind]:
            raise _Refused(f"must be {words} of {'flags' if kind == 'b' else 'whole numbers'}")
        return value

    return check, words


def _listed(value: Any, words: str) -> list[Any]:
    """Return what stands in a list, a tuple or an array."""
    single = isinstance(value, np.ndarray) and value.ndim == 0
    if single or not isinstance(value, list | tuple | np.ndarray | range):
        raise _Refused(f"must be {words}")
    if np.ma.is_masked(value):
        raise _Refused(f"must be {words}, and none of them masked")
    return list(value)


def _tuple(inner: tuple[Any, ...], finite: bool) -> tuple[Check, str] | None:
    """Return the check of a tuple of one length, or of any."""
    endless = len(inner) == 2 and inner[1] is Ellipsis
    items = [_check_of(one, finite) for one in (inner[:1] if endless else inner)]
    words = f"{'a list of' if endless else len(items)} {_plural(items[0] if items else None)}"

    def check(value: Any) -> Any:
        parts = _listed(value, words) if not isinstance(value, tuple) else list(value)
        checks = items * len(parts) if endless else items
        if len(parts) != len(checks):
            raise _Refused(f"must be {words}")
        passed = tuple(_item(one, part, words) for one, part in zip(checks, parts, strict=True))
        same = isinstance(value, tuple) and all(map(lambda a, b: a is b, passed, value))
        return value if same else passed

    return check, words


def _item(check: tuple[Check, str] | None, value: Any, words: str) -> Any:
    """Return what to pass on for a value in a list."""
    try:
        return value if check is None else check[0](value)
    except _Refused as refused:
        told = f"; {shortened(value)} {refused}" if check and check[1] not in str(refused) else ""
        raise _Refused(f"must be {words}{told}") from None


def _plural(check: tuple[Check, str] | None) -> str:
    """Return the words for several values of one kind."""
    words = check[1] if check else "values"
    simple = re.fullmatch("an? ([a-z ]+)", words)
    return f"{simple[1]}s" if simple else f"values, each {words}" if check else words


def _items(kind: Any, inner: tuple[Any, ...], finite: bool) -> tuple[Check, str]:
    """Return the check of a sequence, or of what can be gone through; a text is neither."""
    item = _check_of(inner[0], finite) if inner else None
    words = f"a list of {_plural(item)}"

    def check(value: Any) -> Any:
        array = isinstance(value, np.ndarray) and value.ndim > 0
        kinds = abc.Iterable if kind is abc.Iterable else abc.Sequence
        if isinstance(value, str | bytes) or not (array or isinstance(value, kinds)):
            raise _Refused(f"must be {words}")
        if item is None or kind is abc.Iterable:
            return value
        passed = [_item(item, one, words) for one in value]
        return value if all(map(lambda a, b: a is b, passed, value)) else passed

    return check, words


def _mapping(inner: tuple[Any, ...], finite: bool) -> tuple[Check, str]:
    """Return the check of a dictionary."""
    key, item = (_check_of(one, finite) for one in inner) if inner else (None, None)
    words = "a dictionary"

    def check(value: Any) -> Any:
        if not isinstance(value, abc.Mapping):
            raise _Refused(f"must be {words}")
        for name, one in value.items():
            _item(key, name, f"{words} by {key[1] if key else 'anything'}")
            _item(item, one, f"{words} of {item[1] if item else 'anything'}")
        return value

    return check, words
