"""Physical quantities as users write them ("8 um", "4 GPa"), turned into mm, N and MPa."""

from __future__ import annotations

import math
import re
from functools import cache, partial
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, WithJsonSchema

_EXAMPLES = {
    "mm": '"8 um"',
    "MPa": '"4 GPa"',
    "mm**4": '"1e-9 mm^4"',
    "": '"5 um/mm"',
    "N": '"5 N"',
    "s": '"55 min"',
}

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?"
_UNIT = r"\(?(?:[^\W\d]+|%)(?:\s*(?:\^|\*\*)\s*[+-]?[0-9]{1,2}(?![0-9])|[²³⁴])?\)?"
_QUANTITY = re.compile(rf"\s*{_NUMBER}\s*(?:\*?\s*{_UNIT}(?:\s*[*/·]\s*{_UNIT}|\s+{_UNIT})*)?\s*")
_LONGEST = 100  # characters

_COMMON = {
    "mm": {"m": 1e3, "mm": 1.0, "um": 1e-3, "µm": 1e-3},
    "MPa": {"Pa": 1e-6, "kPa": 1e-3, "MPa": 1.0, "GPa": 1e3},
    "": {"um/mm": 1e-3},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "s": {"s": 1.0, "min": 60.0, "h": 3600.0},
}
"""Units that most scenes do with: a third of a second less than pint's."""

_IN_COMMON = re.compile(rf"\s*({_NUMBER})\s*([^\W\d]+(?:/mm)?)\s*")

_SIZES = {
    "mm": (1e-15, 1e15),
    "MPa": (1e-15, 1e15),
    "mm**4": (1e-60, 1e60),
    "": (1e-15, 1e6),
    "N": (1e-30, 1e30),
    "s": (1e-3, 1e12),
}


@cache
def _registry() -> Any:
    """Return pint's registry, made on first use: it costs a third of a second."""
    import pint

    return pint.UnitRegistry()


def parse_quantity(value: Any, unit: str) -> float:
    """Turn a quantity into a number in ``unit``.

    Args:
        value: A string with a unit, or a bare number that already is in ``unit``.
        unit: Target unit in pint's notation; empty for a ratio.

    Returns:
        The magnitude in ``unit``.

    Raises:
        ValueError: When the value is no quantity, has another dimension, is not finite or of no
            scale that computing in double precision leaves sense to.
    """
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"is not a quantity (allowed: a number in {_named(unit)} or a string)")
    try:
        number = _with_unit(value, unit) if isinstance(value, str) else float(value)
    except OverflowError:  # a whole number beyond floating point
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("is not finite (allowed: a finite quantity)")
    least, most = _SIZES[unit]
    if number != 0.0 and not least <= abs(number) <= most:
        raise ValueError(
            f"is out of any scale (allowed: {least:g} to {most:g} {unit or 'as a ratio'}, or 0)"
        )
    return number


def _with_unit(text: str, unit: str) -> float:
    """Convert a string with a unit, by pint unless it is a common one."""
    common = _IN_COMMON.fullmatch(text)
    if common and common[2] in _COMMON.get(unit, {}) and len(text) <= _LONGEST:
        return float(common[1]) * _COMMON[unit][common[2]]
    allowed = f"(allowed: a quantity in units of {_named(unit)}, such as {_EXAMPLES[unit]})"
    # pint would also do sums, and 9**9**9 for as long as it takes
    if len(text) > _LONGEST or not _QUANTITY.fullmatch(text):
        raise ValueError(f"cannot be read as a quantity {allowed}")
    try:
        quantity = _registry().Quantity(text)
    except Exception as error:  # pint raises whatever its tokenizer meets
        raise ValueError(f"cannot be read as a quantity {allowed}") from error
    if quantity.unitless and unit and text.strip():
        raise ValueError(f"has no unit {allowed}")
    try:
        return float(quantity.to(unit or "dimensionless").magnitude)
    except Exception as error:
        raise ValueError(f"has the wrong unit {allowed}") from error


def parse_duration(text: str) -> float:
    """Turn a duration into seconds.

    Args:
        text: A quantity such as ``"55 min"``, ``"2 h"`` or, as batch systems have it, ``"55m"``.

    Returns:
        The seconds.

    Raises:
        ValueError: When it is no duration, or not positive.
    """
    minutes = re.fullmatch(r"\s*([0-9.]+)\s*m\s*", text)  # to pint, metres
    seconds = parse_quantity(f"{minutes[1]} min" if minutes else text, "s")
    if not seconds > 0.0:
        raise ValueError("must be greater than 0")
    return seconds


def parse_turning_points(value: Any, unit: str) -> tuple[float, ...]:
    """Turn one quantity, or a list of them, into the turning points of a load.

    Args:
        value: A quantity, or a list of quantities.
        unit: Target unit in pint's notation.

    Returns:
        The magnitudes in ``unit``.

    Raises:
        ValueError: When a value is no quantity of that dimension, the list is empty, a value is
            negative, the first is zero or one repeats the one before.
    """
    listed = isinstance(value, list | tuple)
    points = tuple(parse_quantity(one, unit) for one in (value if listed else [value]))
    allowed = f"(allowed: a quantity such as {_EXAMPLES[unit]}, or a list of turning points)"
    if not points:
        raise ValueError(f"is an empty list {allowed}")
    if not points[0] > 0.0:
        raise ValueError("must be greater than 0")
    if min(points) < 0.0:
        raise ValueError("must not turn below 0")
    if any(one == other for one, other in pairwise(points)):
        raise ValueError(f"repeats a turning point {allowed}")
    return points


def parse_tilt(value: Any) -> tuple[float, float] | Literal["free"]:
    """Turn a pair of slopes into numbers, and let ``"free"`` pass.

    Args:
        value: Two slopes, or ``"free"``.

    Raises:
        ValueError: When it is neither.
    """
    if value == "free":
        return "free"
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(
            'is not a tilt (allowed: two slopes such as ["5 um/mm", "0 um/mm"], or "free")'
        )
    return parse_quantity(value[0], ""), parse_quantity(value[1], "")


def _named(unit: str) -> str:
    return unit or "a ratio"


def _quantity_schema(unit: str) -> dict[str, Any]:
    """Describe a quantity for editors and for the JSON Schema of a scene."""
    return {
        "anyOf": [{"type": "number"}, {"type": "string"}],
        "description": f"string with a unit, or a bare number in {_named(unit)}",
        "examples": [_EXAMPLES[unit].strip('"')],
    }


def _schema(unit: str) -> WithJsonSchema:
    return WithJsonSchema(_quantity_schema(unit))


def _points_schema(unit: str) -> WithJsonSchema:
    one = _quantity_schema(unit)
    return WithJsonSchema({"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]})


def _reader(unit: str) -> BeforeValidator:
    return BeforeValidator(partial(parse_quantity, unit=unit))


Length = Annotated[float, _reader("mm"), _schema("mm")]
Pressure = Annotated[float, _reader("MPa"), _schema("MPa")]
SpectralAmplitude = Annotated[float, _reader("mm**4"), _schema("mm**4")]
Slope = Annotated[float, _reader(""), _schema("")]
TurningPoints = tuple[float, ...]
Approaches = Annotated[
    TurningPoints, BeforeValidator(partial(parse_turning_points, unit="mm")), _points_schema("mm")
]
Forces = Annotated[
    TurningPoints, BeforeValidator(partial(parse_turning_points, unit="N")), _points_schema("N")
]
Tilt = Annotated[
    tuple[float, float] | Literal["free"],
    BeforeValidator(parse_tilt),
    WithJsonSchema(
        {
            "anyOf": [
                {"const": "free"},
                {"type": "array", "items": _quantity_schema(""), "minItems": 2, "maxItems": 2},
            ]
        }
    ),
]
