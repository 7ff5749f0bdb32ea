"""Physical quantities as users write them ("8 um", "4 GPa"), turned into mm, N and MPa."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from patchlaw.support.errors import InputError


class _Target(NamedTuple):
    """A target unit: an example of a quantity, sizes that make sense, and its common spellings."""

    example: str
    sizes: tuple[float, float]
    common: dict[str, float] = {}  # noqa: RUF012


_UNITS = {
    "mm": _Target('"8 um"', (1e-15, 1e15), {"m": 1e3, "mm": 1.0, "um": 1e-3, "µm": 1e-3}),
    "MPa": _Target(
        '"4 GPa"', (1e-15, 1e15), {"Pa": 1e-6, "kPa": 1e-3, "MPa": 1.0, "GPa": 1e3, "bar": 0.1}
    ),
    "mm**4": _Target('"1e-9 mm^4"', (1e-60, 1e60)),
    "": _Target('"5 um/mm"', (1e-15, 1e6), {"um/mm": 1e-3}),
    "N": _Target('"5 N"', (1e-30, 1e30), {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6}),
    "W/m/K": _Target('"50 W/m/K"', (1e-9, 1e9), {"W/m/K": 1.0}),
    "ohm*m": _Target('"1.7e-8 ohm m"', (1e-15, 1e25), {"ohm m": 1.0}),
    "Pa*s": _Target('"1 mPa s"', (1e-9, 1e9), {"Pa s": 1.0, "mPa s": 1e-3}),
    "1/MPa": _Target('"1e-8 mm^2/N"', (1e-30, 1e6)),
    "m/s": _Target('"5 m/s"', (1e-15, 1e9), {"m/s": 1.0, "mm/s": 1e-3}),
    "K": _Target('"300 K"', (1e-9, 1e9), {"K": 1.0}),
    "1/K": _Target('"12e-6 1/K"', (1e-12, 1.0), {"ppm/K": 1e-6, "um/m/K": 1e-6}),
    "t/mm**3": _Target('"7850 kg/m^3"', (1e-15, 1e-6)),
    "t": _Target('"2 kg"', (1e-15, 1e9), {"kg": 1e-3, "g": 1e-6, "t": 1.0}),
    "deg": _Target('"90 deg"', (1e-9, 1e6), {"deg": 1.0}),
    "s": _Target('"55 min"', (1e-3, 1e12), {"s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}),
}
"""Target units in pint's notation; an empty one is a ratio.

Scenes with common spellings do without pint, whose import takes 0.25 to 0.34 s.
"""

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?"
_UNIT = r"\(?(?:[^\W\d]+|%)(?:\s*(?:\^|\*\*)\s*[+-]?[0-9]{1,2}(?![0-9])|[²³⁴])?\)?"
_FURTHER = rf"(?:\s*[*/·]\s*{_UNIT}|\s+{_UNIT})*"
_QUANTITY = re.compile(rf"\s*{_NUMBER}\s*(?:(?:\*?|1?\s*/)\s*{_UNIT}{_FURTHER})?\s*")
_LONGEST = 100  # characters

_COMMON = re.compile(rf"\s*({_NUMBER})\s*([^\W\d]+(?:[/ ][^\W\d]+)*)\s*")


@cache
def _registry() -> Any:
    """Return pint's registry, made anew: its cache on disk would be pickles, which are never read.

    It takes 0.25 s instead of 0.03 s.
    """
    import pint

    return pint.UnitRegistry()


def parse_quantity(value: Any, unit: str, *, zero: bool = False) -> float:
    """Turn a quantity into a number in ``unit``.

    Args:
        value: A string with a unit, or a bare number that already is in ``unit``.
        unit: Target unit in pint's notation; empty for a ratio.
        zero: Whether a refusal offers 0 too, as the limits of the key allow it.

    Returns:
        The magnitude in ``unit``.

    Raises:
        InputError: When the value is no quantity, has another dimension, is not finite, or so
            large or small that double precision would not do.
    """
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise InputError("is not a quantity", allowed=f"a number in {named(unit)} or a string")
    try:
        number = _with_unit(value, unit) if isinstance(value, str) else float(value)
    except OverflowError:  # a whole number beyond floating point
        number = math.inf
    if not math.isfinite(number):
        raise InputError("is not finite", allowed="a finite quantity")
    least, most = _UNITS[unit].sizes
    if number != 0.0 and not least <= abs(number) <= most:
        allowed = f"{least:g} to {most:g} {unit or 'as a ratio'}{', or 0' if zero else ''}"
        raise InputError("is out of any scale", allowed=allowed)
    return number


def _with_unit(text: str, unit: str) -> float:
    """Convert a string with a unit, by pint unless its unit is a common one."""
    if text.strip() == "0":  # is the same in all units
        return 0.0
    target, common = _UNITS[unit], _COMMON.fullmatch(text)
    if common and common[2] in target.common and len(text) <= _LONGEST:
        return float(common[1]) * target.common[common[2]]
    hint = _correction(text[:_LONGEST], target)
    allowed = f"a quantity in units of {named(unit)}, such as {target.example}"
    if hint and common and len(text) <= _LONGEST:  # Mm and mPa are units too, but hardly meant
        raise InputError(f"is in no usual unit{hint}", allowed=allowed)
    # pint would also do sums, and 9**9**9 for as long as it takes
    if len(text) > _LONGEST or not _QUANTITY.fullmatch(text):
        raise InputError(f"cannot be read as a quantity{hint}", allowed=allowed)
    registry = _registry()  # what fails there is no fault of the quantity
    try:
        quantity = registry.Quantity(text)
    except Exception as error:  # pint raises whatever its tokenizer meets
        raise InputError(f"cannot be read as a quantity{hint}", allowed=allowed) from error
    if quantity.unitless and unit and text.strip():
        raise InputError(f"has no unit{hint}", allowed=allowed)
    try:
        number, zero = (
            float(one.to(unit or "dimensionless").magnitude)
            for one in (quantity, registry.Quantity(0.0, quantity.units))
        )
    except Exception as error:
        raise InputError(f"has the wrong unit{hint}", allowed=allowed) from error
    if zero != 0.0:  # degrees of a scale; whether pint reads them depends on its release
        raise InputError(f"cannot be read as a quantity{hint}", allowed=allowed)
    return number


def _correction(text: str, target: _Target) -> str:
    """Return a question where a unit has letters of the wrong case, or a number a decimal comma."""
    number = re.match(r"[\s\d.,+-]*(?:[eE][+-]?\d+)?", text)[0].strip()  # type: ignore[index]
    unit = text.strip()[len(number) :].strip()
    cased = {one.casefold(): one for one in reversed(target.common)}
    pointed = re.sub(r"^([+-]?\d+),(\d+)$", r"\1.\2", number)
    right = f"{pointed} {cased.get(unit.casefold(), unit)}"
    if right == f"{number} {unit}" or re.search(r",\d{3}$", number):  # which may mark thousands
        return ""
    return f"; did you mean '{right.strip()}'?"


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a number, or of several, beside its type; pydantic reads quantities for it.

    Args:
        name: The unit in pint's notation; empty for a ratio.
        several: Whether the field holds a tuple, for which users may write one number or a list.
        pairs: Whether it holds a tuple of pairs along x and y, for which users may write one pair.
        zero: Whether 0 is allowed, which refusals then offer.
    """

    name: str
    several: bool = False
    pairs: bool = False
    zero: bool = False

    def __get_pydantic_core_schema__(self, kind: Any, of: Callable[[Any], Any]) -> dict[str, Any]:
        parsed = {"type": "no-info", "function": self.parsed}
        return {"type": "function-before", "function": parsed, "schema": of(kind)}

    def __get_pydantic_json_schema__(self, _: Any, of: Callable[[Any], Any]) -> dict[str, Any]:
        return self.schema

    def parsed(self, value: Any) -> Any:
        """Return a number, or tuples of them, from what a user writes; see `parse_quantity`."""
        if not (self.several or self.pairs):
            return parse_quantity(value, self.name, zero=self.zero)
        listed = value if isinstance(value, list | tuple) else [value]
        if self.several:
            return tuple(parse_quantity(one, self.name) for one in listed)
        pairs = listed if listed and isinstance(listed[0], list | tuple) else [listed]
        if any(not isinstance(pair, list | tuple) or len(pair) != 2 for pair in pairs):
            shown = example(self.name)
            allowed = f"[{shown}, {shown}], or a list of such pairs"
            raise InputError("is no pair of quantities along x and y", allowed=allowed)
        return tuple(tuple(parse_quantity(one, self.name) for one in pair) for pair in pairs)

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON Schema of what a user writes, which editors know."""
        one = {
            "anyOf": [{"type": "number"}, {"type": "string"}],
            "description": f"string with a unit, or a bare number in {named(self.name)}",
            "unit": self.name,
            "examples": [example(self.name).strip('"')],
        }
        pair = {"type": "array", "items": one, "minItems": 2, "maxItems": 2}
        each = pair if self.pairs else one
        listed = {"anyOf": [each, {"type": "array", "items": each, "minItems": 1}]}
        return listed if self.several or self.pairs else one


def parse_duration(text: str) -> float:
    """Turn a duration into seconds.

    Args:
        text: A quantity such as ``"55 min"``, ``"2 h"`` or, as batch systems have it, ``"55m"``.

    Returns:
        The seconds.

    Raises:
        InputError: When it is no duration, or not positive.
    """
    seconds = parse_quantity(text, "s")
    if not seconds > 0.0:
        raise InputError("must be greater than 0")
    return seconds


def named(unit: str) -> str:
    """Return the name of a unit, or that it is a ratio."""
    return unit or "a ratio"


def example(unit: str) -> str:
    """Return a quantity as users write it, in one of the usual units.

    Args:
        unit: Target unit in pint's notation.
    """
    return _UNITS[unit].example
