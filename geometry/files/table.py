"""Numbers in rows of text, whichever of the usual separators and decimal signs they have."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator

import numpy as np

from geometry.files.content import BYTES_PER_HEIGHT, check_memory
from support.arrays import Array
from support.errors import InputError

Line = tuple[int, str]
"""A line of a file without its comment: its number, from 1, and its text."""

_DIGITS = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_NUMBER = re.compile(rf"{_DIGITS}|[-+]?(?:nan|inf|infinity)", re.IGNORECASE | re.ASCII)
_WITH_COMMA = re.compile(r"[-+]?\d*,\d+(?:e[-+]?\d+)?", re.IGNORECASE | re.ASCII)
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}", re.ASCII)


def is_number(cell: str) -> bool:
    """Tell whether a cell is a number with a decimal point, or nan.

    Args:
        cell: The text of the cell.
    """
    return _NUMBER.fullmatch(cell) is not None


def words_of(row: str) -> list[str]:
    """Return what stands between white space, commas and semicolons.

    Args:
        row: The text of a line.
    """
    return [word for word in re.split(r"[\s;,]+", row) if word]


def number_table(lines: list[Line]) -> tuple[Array, list[str]]:
    """Return a matrix of numbers.

    One separator holds for all rows: a semicolon, a comma, or else white space. Decimal commas are
    read where nothing else can be meant: where the separator is another one, no number has a point,
    and not all commas could mark thousands.

    Args:
        lines: The rows.

    Returns:
        The matrix, and remarks on how it was understood.

    Raises:
        InputError: When a cell is no number or rows differ in length; names line and column.
    """
    if not lines:
        raise InputError("the file is empty")
    rows, remarks = [row for _, row in lines], []
    separator = _separator(rows)
    if separator and all(row.endswith(separator) for row in rows):
        rows = [row[:-1] for row in rows]
    if separator != "," and any("," in row for row in rows):
        rows, remarks = _with_points(lines, rows, separator), ["decimal commas"]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)  # of rows without any number
            matrix = np.loadtxt(io.StringIO("\n".join(rows)), delimiter=separator, ndmin=2)
    except (ValueError, UserWarning) as error:
        raise _complaint(lines, rows, separator, str(error)) from None
    check_memory(matrix.size * BYTES_PER_HEIGHT)
    return matrix, remarks


def _separator(rows: list[str]) -> str | None:
    """Return the sign between numbers, None for white space."""
    first = rows[0]
    cells = first.split()
    commas = len(cells) > 1 and all(is_number(one) or _WITH_COMMA.fullmatch(one) for one in cells)
    if ";" in first:
        return ";"
    if "," in first and not commas:
        return ","
    return "\t" if any(re.search(r"\t *\t", row) for row in rows) else None  # with empty cells


def _with_points(lines: list[Line], rows: list[str], separator: str | None) -> list[str]:
    """Return rows with points for decimal commas; refuse commas that may be something else."""
    numbers = {one for one in re.split(r"[\s;]+", "\n".join(rows)) if "," in one}
    marks = all(_THOUSANDS.fullmatch(one) for one in numbers) or any("." in row for row in rows)
    if marks or not all(_WITH_COMMA.fullmatch(one) for one in numbers):
        line, column, cell = next(one for one in _cells(lines, rows, separator) if "," in one[2])
        raise InputError(
            f"not a matrix of numbers: line {line}, column {column}: it is not clear what the "
            f"comma in '{cell[:40]}' means",
            allowed="decimal points; decimal commas in all numbers, with semicolons or white space "
            "between them",
        )
    return [row.replace(",", ".") for row in rows]


def _complaint(
    lines: list[Line], rows: list[str], separator: str | None, reason: str
) -> InputError:
    """Return the error on the first cell that is no number, or row of another length."""
    width, first = len(rows[0].split(separator)), lines[0][0]
    allowed = "numbers with decimal points; nan where a height is missing; # before comments"
    for line, column, cell in _cells(lines, rows, separator):
        if not is_number(cell):
            what = f"'{cell[:40]}' is no number" if cell else "the cell is empty"
            reason = f"line {line}, column {column}: {what}"
            break
    else:
        for (line, _), row in zip(lines, rows, strict=True):
            if (count := len(row.split(separator))) != width:
                reason = f"line {line} has {count} of them, line {first} has {width}"
                break
    return InputError(f"not a matrix of numbers: {reason}", allowed=allowed)


def _cells(
    lines: list[Line], rows: list[str], separator: str | None
) -> Iterator[tuple[int, int, str]]:
    """Yield line, column and text of every cell."""
    for (line, _), row in zip(lines, rows, strict=True):
        for column, cell in enumerate(row.split(separator), 1):
            yield line, column, cell.strip()
