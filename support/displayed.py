"""Tables as text, as HTML and for other packages; results that show themselves as one."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from html import escape
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

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
