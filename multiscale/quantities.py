"""Physical quantities as users write them ("8 um", "4 GPa"), turned into mm, N and MPa."""

from __future__ import annotations

import math
from functools import cache, partial
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema

_EXAMPLES = {
    "mm": '"8 um"',
    "MPa": '"4 GPa"',
    "mm**4": '"1e-9 mm^4"',
    "": '"5 um/mm"',
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
        ValueError: When the value is no quantity, has another dimension or is not finite.
    """
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"is not a quantity (allowed: a number in {_named(unit)} or a string)")
    number = _with_unit(value, unit) if isinstance(value, str) else float(value)
    if not math.isfinite(number):
        raise ValueError("is not finite (allowed: a finite quantity)")
    return number


def _with_unit(text: str, unit: str) -> float:
    """Convert a string with a unit by pint."""
    allowed = f"(allowed: a quantity in units of {_named(unit)}, such as {_EXAMPLES[unit]})"
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


def _named(unit: str) -> str:
    return unit or "a ratio"


def _schema(unit: str) -> WithJsonSchema:
    """Describe a quantity for editors and for the JSON Schema of a scene."""
    return WithJsonSchema(
        {
            "anyOf": [{"type": "number"}, {"type": "string"}],
            "description": f"string with a unit, or a bare number in {_named(unit)}",
            "examples": [_EXAMPLES[unit].strip('"')],
        }
    )


def _reader(unit: str) -> BeforeValidator:
    return BeforeValidator(partial(parse_quantity, unit=unit))


Length = Annotated[float, _reader("mm"), _schema("mm")]
Pressure = Annotated[float, _reader("MPa"), _schema("MPa")]
SpectralAmplitude = Annotated[float, _reader("mm**4"), _schema("mm**4")]
Slope = Annotated[float, _reader(""), _schema("")]
