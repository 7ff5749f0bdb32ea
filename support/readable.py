"""Texts for people: numbers in suitable units, notes, tables; who is told a run's progress."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from html import escape
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

ProgressObserver = Callable[[str, int, int], None]
"""Called with the progress of a run: the phase or what is counted in it, how many are done, and of
how many at most; 0 and 0 where nothing is counted, percent and `WHOLE` where parts take unequal
times."""


class _Percent(int):
    """An integer that is no count: a hundred parts are another one."""


WHOLE = _Percent(100)
"""All of what is told in percent."""


def unobserved(*told: Any) -> None:
    """Do nothing: the `ProgressObserver`, or another observer, where nobody wants to know."""


class Caution(str):
    """A note that puts results into question: reports show it beside them."""


class Detail(str):
    """A note for who looks into the solver: reports fold it away."""


_PREFIXES: dict[str, tuple[tuple[str, float], ...]] = {
    "mm": (("m", 1e3), ("mm", 1.0), ("µm", 1e-3), ("nm", 1e-6)),
    "N": (("MN", 1e6), ("kN", 1e3), ("N", 1.0), ("mN", 1e-3), ("µN", 1e-6), ("nN", 1e-9)),
    "MPa": (("TPa", 1e6), ("GPa", 1e3), ("MPa", 1.0), ("kPa", 1e-3), ("Pa", 1e-6)),
    "mm³/s": (
        ("l/s", 1e6),
        ("ml/s", 1e3),
        ("mm³/s", 1.0),
        ("nl/s", 1e-3),
        ("pl/s", 1e-6),
        ("fl/s", 1e-9),
    ),
    "MPa/mm": (("TPa/mm", 1e6), ("GPa/mm", 1e3), ("MPa/mm", 1.0)),
    "mm³": (("cm³", 1e3), ("mm³", 1.0), ("µm³", 1e-9)),
    "mm²": (("mm²", 1.0), ("µm²", 1e-6), ("nm²", 1e-12)),
    "N/mm": (("MN/mm", 1e6), ("kN/mm", 1e3), ("N/mm", 1.0), ("N/m", 1e-3)),
    "mJ": (("J", 1e3), ("mJ", 1.0), ("µJ", 1e-3), ("nJ", 1e-6), ("pJ", 1e-9)),
    "W": (("MW", 1e6), ("kW", 1e3), ("W", 1.0), ("mW", 1e-3), ("µW", 1e-6)),
    "W/K": (("kW/K", 1e3), ("W/K", 1.0), ("mW/K", 1e-3), ("µW/K", 1e-6)),
    "Hz": (("MHz", 1e6), ("kHz", 1e3), ("Hz", 1.0), ("mHz", 1e-3)),
    "W/m²K": (("MW/m²K", 1e6), ("kW/m²K", 1e3), ("W/m²K", 1.0)),
    "S/m²": (("GS/m²", 1e9), ("MS/m²", 1e6), ("kS/m²", 1e3), ("S/m²", 1.0)),
    "S": (("MS", 1e6), ("kS", 1e3), ("S", 1.0), ("mS", 1e-3), ("µS", 1e-6)),
}
"""Units with their sizes in the unit of the key, the largest first."""

SCALED_UNITS = frozenset(_PREFIXES)
"""Units that take prefixes."""

_USUAL = {"mm": "µm"}
"""Units that columns and headlines keep as long as their numbers are of a handy size."""
_HANDY = {"MPa": (0.1, 1e3), "mm²": (0.01, 1e6), "mm³/s": (1e-9, 1e6)}
"""Sizes of numbers that keep them, from the first on and below the second; else 0.1 and 1e4."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def duration(seconds: float) -> str:
    """Return a time as people say it, such as ``0.35 s``, ``1 min 20 s``, ``2 h 5 min``.

    Args:
        seconds: The time [s].
    """
    if seconds < 59.95:
        return f"{seconds:.{3 if seconds >= 9.95 else 2}g} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours} h {minutes} min" if minutes else f"{hours} h"


def number(value: float, digits: int = 4, smallest: int = -6) -> str:
    """Return a number such as ``0.00012``, ``41000`` or, far from one, ``1.2·10⁻⁹``.

    Args:
        value: The number.
        digits: Significant digits; zeros at the end are left out.
        smallest: Power of ten below which a number is written with one.
    """
    if not math.isfinite(value):
        return "–" if math.isnan(value) else f"{value}".replace("inf", "∞")
    mantissa, _, power = f"{value + 0.0:.{digits - 1}e}".partition("e")  # never -0
    if value and not smallest <= int(power) < 10:
        return f"{float(mantissa):g}·{power_of_ten(int(power))}"
    text = f"{float(mantissa + 'e' + power):.{max(digits - 1 - int(power), 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def power_of_ten(power: int) -> str:
    """Return a power of ten such as ``10⁻⁹``."""
    return f"10{str(power).translate(_SUPERSCRIPTS)}"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in the prefix that suits its size, such as ``8 µm`` or ``4 GPa``.

    Args:
        value: The magnitude in ``unit``.
        unit: A key of the prefixes, such as mm, N or MPa.
        digits: Significant digits.
    """
    return quantities([value], unit, digits)[0]


def quantities(values: Iterable[float], unit: str, digits: int = 4) -> list[str]:
    """Return quantities of one sentence, all in the prefix that suits the largest.

    Such as ``160 mN`` and ``0.86 mN``.

    Args:
        values: The magnitudes in ``unit``; those that are not finite do not count.
        unit: A key of the prefixes, such as mm, N or MPa.
        digits: Significant digits of each.
    """
    known = list(values)
    largest = max((abs(value) for value in known if math.isfinite(value)), default=0.0)
    name, size = _fitting(float(f"{largest:.{digits}g}"), unit)
    return [f"{number(value / size, digits)} {name}" for value in known]


def usual_unit(values: Iterable[float], unit: str) -> tuple[str, float]:
    """Return the unit, and its size, in which numbers that belong together are shown.

    It is the usual one, such as µm, N and MPa, as long as the largest number is of a handy size,
    and that with the prefix that suits the largest number else.

    Args:
        values: The magnitudes in ``unit``; those that are not finite do not count.
        unit: A key of the prefixes, such as mm, N or MPa.
    """
    name, size = next(one for one in _PREFIXES[unit] if one[0] == _USUAL.get(unit, unit))
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    least, most = _HANDY.get(unit, (0.1, 1e4))
    if not largest or least <= largest / size < most:
        return name, size
    return _fitting(largest, unit)


def counted(count: int, what: str) -> str:
    """Return how many there are of something, such as ``1 spot`` or ``2 spots``.

    Args:
        count: Their number.
        what: One of them.
    """
    return f"{count} {what}{'s' * (count != 1)}"


def shown_unit(values: Iterable[float], unit: str) -> tuple[str, float]:
    """Return the unit, and its size, in which numbers that belong together stand in a table.

    Args:
        values: The magnitudes in ``unit``; those that are not finite do not count.
        unit: Any unit; only keys of the prefixes take some, and "%" stands for shares.
    """
    if unit in SCALED_UNITS:
        return usual_unit(values, unit)
    return unit, 0.01 if unit == "%" else 1.0


def with_error(value: float, error: float | None = None, digits: int = 5) -> str:
    """Return a number with its error, both rounded to the second digit of the error.

    Args:
        value: The number.
        error: Its error; 0, None, or what rounding makes, for none.
        digits: Significant digits of a number without an error.
    """
    if not error or not math.isfinite(error) or error < 1e-9 * abs(value):
        return number(value, digits, smallest=-4)
    power = math.floor(math.log10(max(abs(value), error)))
    if power < -4:
        shift = 10.0**-power
        ten = f"·10{str(power).translate(_SUPERSCRIPTS)}"
        return f"({with_error(value * shift, error * shift)}){ten}"
    places = max(1 - math.floor(math.log10(error)), 0)
    return f"{value:.{places}f} ± {error:.{places}f}"


def with_most(value: float, error: float | None = None, digits: int = 5) -> str:
    """Return a number whose sign is known with its error, or where that is larger with the most.

    Rounded to an error far above it the number would read as zero.

    Args:
        value: The number.
        error: Its error, as of `with_error`.
        digits: Significant digits of a number without an error.
    """
    if not error or not abs(value) < error < math.inf:
        return with_error(value, error, digits)
    most = math.copysign(abs(value) + error, value)
    return f"{number(value, 2)} (or up to {number(most, 2)})"


def span(values: Iterable[float], unit: str) -> str:
    """Return the range of a quantity in one unit, such as ``5 to 20 N``.

    Args:
        values: The magnitudes in ``unit``; those that are not finite do not count.
        unit: A key of the prefixes, such as mm, N or MPa.
    """
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    name, size = usual_unit(known, unit)
    ends = dict.fromkeys(number(end / size) for end in (min(known), max(known)))
    return f"{' to '.join(ends)} {name}"


def column(heading: str, values: Iterable[float], unit: str, digits: int = 4) -> list[str]:
    """Return a column of a table, its heading first: numbers in the unit that suits them.

    Args:
        heading: Its heading, which the unit is added to.
        values: The magnitudes in ``unit``; what is not finite is shown as unknown.
        unit: A key of the prefixes, such as mm, N or MPa; "%" shows shares in per cent.
        digits: Significant digits.
    """
    numbers = list(values)
    name, size = shown_unit(numbers, unit)
    shown = (number(one / size, digits) if math.isfinite(one) else "–" for one in numbers)
    return [f"{heading} [{name}]", *shown]


def measured(value: float, error: float | None, unit: str, digits: int = 4) -> str:
    """Return a quantity with its error in one unit, such as ``0.5899 ± 0.0007 µm``.

    Args:
        value: The magnitude in ``unit``.
        error: Its error in ``unit``; 0 or None for none.
        unit: A key of the prefixes, such as mm, N or MPa.
        digits: Significant digits of a number without an error.
    """
    name, size = usual_unit([value], unit)
    return f"{with_error(value / size, error and error / size, digits)} {name}"


def usual(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in its usual unit, as columns of tables have it, such as ``0.5899 µm``.

    Args:
        value: The magnitude in ``unit``.
        unit: A key of the prefixes, such as mm, N or MPa.
        digits: Significant digits.
    """
    return measured(value, None, unit, digits)


def percent(share: float, digits: int = 2) -> str:
    """Return a share in per cent, such as ``0.012 %``.

    Args:
        share: The share, 1 for the whole.
        digits: Significant digits.
    """
    return f"{number(100.0 * share, digits)} %"


def _fitting(value: float, unit: str) -> tuple[str, float]:
    """Return the largest unit that is not above a value, and its size; of none the smallest."""
    prefixes = _PREFIXES[unit]
    plain = next((one for one in prefixes if one[1] == 1.0), prefixes[-1])
    if not value:
        return plain
    return next((one for one in prefixes if abs(value) >= one[1] * (1.0 - 1e-12)), prefixes[-1])


def times(counts: Any, sign: str = " × ") -> str:
    """Return counts along axes as a text, such as ``16 × 16``.

    Args:
        counts: The counts.
        sign: What stands between them.
    """
    return sign.join(map(str, counts))


def listed(parts: Iterable[str]) -> str:
    """Return parts as a list in words.

    Args:
        parts: The parts, at least one.
    """
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


Table: TypeAlias = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings of the columns, and the rows with a text for each column."""

_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, those that turn the direction of writing, and halves of characters, which
stand for bytes of names that are no UTF-8."""


class Displayed(ABC):
    """A result that shows itself: a line in a shell, a table where it is printed or in a notebook.

    A record takes it as a base, with ``repr=False``, because the fields of results are arrays.
    """

    __slots__ = ()

    @abstractmethod
    def displayed(self) -> tuple[str, Table]:
        """Return a line that says what this is, and a table of at most some sixty rows."""

    def __repr__(self) -> str:
        return f"<{self.displayed()[0]}>"

    def __str__(self) -> str:
        line, table = self.displayed()
        return f"{line}\n{table_text(table)}"

    def _repr_html_(self) -> str:
        """Return line and table as HTML, which notebooks show."""
        line, table = self.displayed()
        return f"<p>{escape(line)}</p>{table_html(table)}"


def printable(text: str) -> str:
    """Return a text with escapes for characters that steer a terminal, or are none of Unicode.

    Line breaks and tabs stay.

    Args:
        text: The text, such as a name of a user.
    """
    return _STEERING.sub(lambda found: ascii(found[0])[1:-1], text)


def table_text(table: Table) -> str:
    """Return a table as lines of text, without spaces at their ends.

    Args:
        table: Its headings and rows. Columns of words are aligned at the left, others at the
            right.
    """
    heading, rows = table
    columns = list(zip(heading, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    pads = [str.rjust if _are_numbers(column[1:]) else str.ljust for column in columns]
    lines = (
        "  ".join(pad(cell, width) for pad, cell, width in zip(pads, row, widths, strict=True))
        for row in (heading, *rows)
    )
    return "\n".join(line.rstrip() for line in lines)


def table_html(table: Table, text_columns: Collection[int] = ()) -> str:
    """Return a table as an HTML element; characters that HTML reserves are escaped.

    Args:
        table: Its headings and rows.
        text_columns: Numbers of the columns, beside the first, that are text.
    """
    heading, rows = table
    head = "".join(f"<th>{escape(name)}</th>" for name in heading)
    kinds = [' class="text"' if place in text_columns else "" for place in range(len(heading))]
    body = "".join(
        "\n<tr>"
        + "".join(f"<td{kind}>{escape(cell)}</td>" for kind, cell in zip(kinds, row, strict=True))
        + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}\n</table>"


def of_columns(*columns: Sequence[str]) -> Table:
    """Return the table of columns, each with its heading first.

    Args:
        *columns: The columns, of one length.
    """
    heading, *rows = zip(*columns, strict=True)
    return heading, rows


def spread(count: int, most: int) -> list[int]:
    """Return the numbers of at most so many rows out of more, at equal distances, with both ends.

    Args:
        count: Number of rows.
        most: Number of rows that are shown at most.
    """
    return np.linspace(0, count - 1, min(count, most)).round().astype(int).tolist()


def _are_numbers(cells: Sequence[str]) -> bool:
    """Tell whether the cells of a column are numbers, with errors or without, or marks for none."""
    return all(not cell or cell[0] in "–-+.…0123456789" or cell in ("nan", "inf") for cell in cells)


def data_frame(records: list[dict[str, Any]]) -> Any:
    """Return records as a pandas data frame, with a column for each of their keys.

    Args:
        records: The rows.

    Raises:
        ImportError: When pandas, which patchlaw does not require, is not installed.
    """
    return _optional("a data frame", "pandas", "`records` gives the same rows").DataFrame(records)


def dataset(
    values: Mapping[str, Any], coordinates: Mapping[str, Any], facts: Mapping[str, Any]
) -> Any:
    """Return arrays as an xarray dataset.

    Args:
        values: Dimensions and array of each variable, by name.
        coordinates: The same of each coordinate.
        facts: Attributes of the dataset.

    Raises:
        ImportError: When xarray, which patchlaw does not require, is not installed.
    """
    instead = "the attributes of the same names are plain arrays"
    module = _optional("a dataset", "xarray", instead)
    return module.Dataset(dict(values), coords=dict(coordinates), attrs=dict(facts))


def _optional(what: str, package: str, instead: str) -> Any:
    """Import a package that patchlaw does not require, or say what it is needed for."""
    try:
        return import_module(package)
    except ImportError as error:
        raise ImportError(
            f"{what} needs {package} (Debian: apt install python3-{package}); {instead} without it"
        ) from error
