"""Physical quantities as users write them ("8 um", "4 GPa"), turned into mm, N and MPa."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, WithJsonSchema


class _Unit(NamedTuple):
    """A target unit: an example of a quantity, sizes that make sense, and its common spellings."""

    example: str
    sizes: tuple[float, float]
    common: dict[str, float] = {}  # noqa: RUF012


_UNITS = {
    "mm": _Unit('"8 um"', (1e-15, 1e15), {"m": 1e3, "mm": 1.0, "um": 1e-3, "µm": 1e-3}),
    "MPa": _Unit('"4 GPa"', (1e-15, 1e15), {"Pa": 1e-6, "kPa": 1e-3, "MPa": 1.0, "GPa": 1e3}),
    "mm**4": _Unit('"1e-9 mm^4"', (1e-60, 1e60)),
    "": _Unit('"5 um/mm"', (1e-15, 1e6), {"um/mm": 1e-3}),
    "N": _Unit('"5 N"', (1e-30, 1e30), {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6}),
    "W/m/K": _Unit('"50 W/m/K"', (1e-9, 1e9), {"W/m/K": 1.0}),
    "ohm*m": _Unit('"1.7e-8 ohm m"', (1e-15, 1e25), {"ohm m": 1.0}),
    "K": _Unit('"300 K"', (1e-9, 1e9), {"K": 1.0}),
    "deg": _Unit('"90 deg"', (1e-9, 1e6), {"deg": 1.0}),
    "s": _Unit('"55 min"', (1e-3, 1e12), {"s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}),
}
"""Target units in pint's notation; an empty one is a ratio.

Scenes with common spellings do without pint, whose import takes 0.25 to 0.34 s.
"""

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?"
_UNIT = r"\(?(?:[^\W\d]+|%)(?:\s*(?:\^|\*\*)\s*[+-]?[0-9]{1,2}(?![0-9])|[²³⁴])?\)?"
_QUANTITY = re.compile(rf"\s*{_NUMBER}\s*(?:\*?\s*{_UNIT}(?:\s*[*/·]\s*{_UNIT}|\s+{_UNIT})*)?\s*")
_LONGEST = 100  # characters

_COMMON = re.compile(rf"\s*({_NUMBER})\s*([^\W\d]+(?:[/ ][^\W\d]+)*)\s*")


@cache
def _registry() -> Any:
    """Return pint's registry; with its cache on disk it takes 0.03 s instead of 0.25 s."""
    import pint

    try:
        return pint.UnitRegistry(cache_folder=":auto:")
    except Exception:  # the cache is damaged, or its folder cannot be written to
        return pint.UnitRegistry()


def parse_quantity(value: Any, unit: str) -> float:
    """Turn a quantity into a number in ``unit``.

    Args:
        value: A string with a unit, or a bare number that already is in ``unit``.
        unit: Target unit in pint's notation; empty for a ratio.

    Returns:
        The magnitude in ``unit``.

    Raises:
        ValueError: When the value is no quantity, has another dimension, is not finite, or so
            large or small that double precision would not do.
    """
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"is not a quantity (allowed: a number in {_named(unit)} or a string)")
    try:
        number = _with_unit(value, unit) if isinstance(value, str) else float(value)
    except OverflowError:  # a whole number beyond floating point
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("is not finite (allowed: a finite quantity)")
    least, most = _UNITS[unit].sizes
    if number != 0.0 and not least <= abs(number) <= most:
        raise ValueError(
            f"is out of any scale (allowed: {least:g} to {most:g} {unit or 'as a ratio'}, or 0)"
        )
    return number


def _with_unit(text: str, unit: str) -> float:
    """Convert a string with a unit, by pint unless its unit is a common one."""
    if text.strip() == "0":  # is the same in all units
        return 0.0
    target, common = _UNITS[unit], _COMMON.fullmatch(text)
    if common and common[2] in target.common and len(text) <= _LONGEST:
        return float(common[1]) * target.common[common[2]]
    hint = _correction(text[:_LONGEST], target)
    allowed = f"{hint} (allowed: a quantity in units of {_named(unit)}, such as {target.example})"
    if hint and common and len(text) <= _LONGEST:  # Mm and mPa are units too, but hardly meant
        raise ValueError(f"is in no usual unit{allowed}")
    # pint would also do sums, and 9**9**9 for as long as it takes
    if len(text) > _LONGEST or not _QUANTITY.fullmatch(text):
        raise ValueError(f"cannot be read as a quantity{allowed}")
    try:
        quantity = _registry().Quantity(text)
    except Exception as error:  # pint raises whatever its tokenizer meets
        raise ValueError(f"cannot be read as a quantity{allowed}") from error
    if quantity.unitless and unit and text.strip():
        raise ValueError(f"has no unit{allowed}")
    try:
        return float(quantity.to(unit or "dimensionless").magnitude)
    except Exception as error:
        raise ValueError(f"has the wrong unit{allowed}") from error


def _correction(text: str, target: _Unit) -> str:
    """Return a question where a unit has letters of the wrong case, or a number a decimal comma."""
    number = re.match(r"[\s\d.,+-]*(?:[eE][+-]?\d+)?", text)[0].strip()  # type: ignore[index]
    unit = text.strip()[len(number) :].strip()
    cased = {one.casefold(): one for one in reversed(target.common)}
    pointed = re.sub(r"^([+-]?\d+),(\d+)$", r"\1.\2", number)
    right = f"{pointed} {cased.get(unit.casefold(), unit)}"
    if right == f"{number} {unit}" or re.search(r",\d{3}$", number):  # which may mark thousands
        return ""
    return f"; did you mean '{right.strip()}'?"


def parse_duration(text: str) -> float:
    """Turn a duration into seconds.

    Args:
        text: A quantity such as ``"55 min"``, ``"2 h"`` or, as batch systems have it, ``"55m"``.

    Returns:
        The seconds.

    Raises:
        ValueError: When it is no duration, or not positive.
    """
    seconds = parse_quantity(text, "s")
    if not seconds > 0.0:
        raise ValueError("must be greater than 0")
    return seconds


def parse_turning_points(value: Any, unit: str) -> tuple[float, ...]:
    """Turn one quantity, or a list of them, into the turning points of a load from zero.

    Args:
        value: A quantity, or a list of quantities.
        unit: Target unit in pint's notation.

    Returns:
        The magnitudes in ``unit``.

    Raises:
        ValueError: As for `parse_points`, or when a value is negative or the first is zero.
    """
    points = parse_points(value, unit)
    check_from_zero(points)
    return points


def check_from_zero(points: tuple[float, ...]) -> None:
    """Raise a ValueError when turning points are negative, or the first is zero."""
    if not points[0] > 0.0:
        raise ValueError("must be greater than 0")
    if min(points) < 0.0:
        raise ValueError("must not turn below 0")


def parse_points(value: Any, unit: str) -> tuple[float, ...]:
    """Turn one quantity, or a list of them, into turning points of any sign.

    Args:
        value: A quantity, or a list of quantities.
        unit: Target unit in pint's notation.

    Returns:
        The magnitudes in ``unit``.

    Raises:
        ValueError: When a value is no quantity of that dimension, the list is empty, or one repeats
            the one before.
    """
    listed = isinstance(value, list | tuple)
    points = tuple(parse_quantity(one, unit) for one in (value if listed else [value]))
    allowed = f"(allowed: a quantity such as {_UNITS[unit].example}, or a list of turning points)"
    if not points:
        raise ValueError(f"is an empty list {allowed}")
    if any(one == other for one, other in pairwise(points)):
        raise ValueError(f"repeats a turning point {allowed}")
    return points


def parse_pair(value: Any, unit: str) -> tuple[float, ...]:
    """Turn one positive quantity, or a list of one or two, into numbers: one for each body.

    Args:
        value: A quantity, or a list of quantities.
        unit: Target unit in pint's notation.

    Returns:
        The magnitudes in ``unit``.

    Raises:
        ValueError: When a value is no quantity of that dimension or not positive, or there are more
            than two.
    """
    listed = isinstance(value, list | tuple)
    pair = tuple(parse_quantity(one, unit) for one in (value if listed else [value]))
    allowed = f"(allowed: one or two quantities > 0 such as {_UNITS[unit].example})"
    if len(pair) not in (1, 2):
        raise ValueError(f"needs a value for one body or for both {allowed}")
    if not min(pair) > 0.0:
        raise ValueError(f"must be greater than 0 {allowed}")
    return pair


def _named(unit: str) -> str:
    return unit or "a ratio"


def _schema(unit: str, *, several: bool = False) -> WithJsonSchema:
    """Describe a quantity, or one or several, for editors and for the JSON Schema of a scene."""
    one = {
        "anyOf": [{"type": "number"}, {"type": "string"}],
        "description": f"string with a unit, or a bare number in {_named(unit)}",
        "unit": unit,
        "examples": [_UNITS[unit].example.strip('"')],
    }
    listed = {"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}
    return WithJsonSchema(listed if several else one)


def _parser(unit: str, parse: Callable[[Any, str], Any] = parse_quantity) -> BeforeValidator:
    return BeforeValidator(lambda value: parse(value, unit))


Length = Annotated[float, _parser("mm"), _schema("mm")]
Pressure = Annotated[float, _parser("MPa"), _schema("MPa")]
SpectralAmplitude = Annotated[float, _parser("mm**4"), _schema("mm**4")]
Slope = Annotated[float, _parser(""), _schema("")]
Approaches = Annotated[tuple[float, ...], _parser("mm", parse_points), _schema("mm", several=True)]
Forces = Annotated[
    tuple[float, ...], _parser("N", parse_turning_points), _schema("N", several=True)
]
Angle = Annotated[float, _parser("deg"), _schema("deg")]
ThermalConductivity = Annotated[float, _parser("W/m/K"), _schema("W/m/K")]
Temperature = Annotated[float, _parser("K"), _schema("K")]
OneOrTwoConductivities = Annotated[
    tuple[float, ...], _parser("W/m/K", parse_pair), _schema("W/m/K", several=True)
]
OneOrTwoResistivities = Annotated[
    tuple[float, ...], _parser("ohm*m", parse_pair), _schema("ohm*m", several=True)
]
Tilt = tuple[Slope, Slope] | Literal["free"]
