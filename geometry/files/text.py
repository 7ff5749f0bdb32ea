"""Heights from text: matrices, exported images that state their size and unit, point lists."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from patchlaw.geometry.files.content import (
    BYTES_PER_HEIGHT,
    LENGTH_UNITS,
    FileContent,
    check_memory,
    length_unit,
)
from patchlaw.support import LARGEST, Array, Indices, InputError

_SIZE = re.compile(r"#[^:：]*[:：]\s*([0-9.,eE+-]+)\s*(\S+)\s*")
_FAULT = r"#(?:n/a|(?:num|value|div/0)!)"
"""What spreadsheets write for what is no number; not the beginning of a comment."""
_COMMENT = re.compile(rf"(?:^|(?<=\s))(?!{_FAULT})#.*", re.IGNORECASE)
_CELL = r'(?<![^\s;,])"?(?:{})"?(?![^\s;,])'
_NO_NUMBER = re.compile(
    rf"[-+]?1[.,]#[A-Z]+\d*|[-+]?nan\(\w*\)|{_CELL.format('no data')}", re.IGNORECASE | re.ASCII
)
"""What libraries of C write for results that are no number, 1.#QNAN, -1.#IND00 or -nan(ind), and
the one word for a missing height that has two."""
_MISSING = re.compile(
    _CELL.format(rf"no_?data|bad|n/?a|-{{2,3}}|\*{{2,3}}|{_FAULT}"), re.IGNORECASE | re.ASCII
)
"""Other words for it, which headings may contain."""
_PLAIN = re.compile(r"(?!.*--)[-+.,;eE\d\s]*")
"""Lines with none of these, as most are."""
_LATERAL_UNIT = re.compile(r"#\s*Lateral units\s*[:：]\s*(\S+)\s*", re.IGNORECASE)
_VALUE_UNIT = re.compile(r"#\s*Value units\s*[:：]\s*(\S+)\s*", re.IGNORECASE)
_WORD = re.compile(r"#[^:：]*[:：]\s*(\S+)\s*")
_FOREIGN = re.compile(r"#\s*File Format\s*=")

Line = tuple[int, str]
"""A line of a file without its comment: its number, from 1, and its text."""
_DIGITS = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_NUMBER = re.compile(rf"{_DIGITS}|[-+]?(?:nan|inf|infinity)", re.IGNORECASE | re.ASCII)
_WITH_COMMA = re.compile(r"[-+]?\d*,\d+(?:e[-+]?\d+)?", re.IGNORECASE | re.ASCII)
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}", re.ASCII)
_PAIRS = re.compile(r"(?: *[-+]?(?:0|[1-9]\d*),\d+(?:,|$))+", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """The lines of a text file by what they are.

    Args:
        comments: What begins with ``#``.
        heading: Lines of words before the rows.
        rows: Rows of numbers, as far as they are right; without comments and empty lines.
    """

    comments: list[str]
    heading: list[str]
    rows: list[Line]

    @property
    def stated(self) -> list[str]:
        """Comments and words before the rows, all as comments."""
        return [*self.comments, *(f"# {line}" for line in self.heading)]

    @property
    def may_be_foreign(self) -> bool:
        """Whether its words may state what another program knows, such as sides and units."""
        spip = any(_FOREIGN.match(line) for line in self.comments)  # its comments scale heights
        if not spip and self.rows and _image(self.stated, decimal_commas=True)[0]:
            return False
        stated = not self.rows or any(re.search(r"\d", line) for line in self.heading)
        return spip or bool(self.heading and stated)

    def check_rows(self, shape: tuple[int, ...]) -> None:
        """Refuse what another reader made of the rows where it left some out.

        SurfaceTopography leaves out rows with a word, such as ``---``, and stretches the others.

        Args:
            shape: Numbers of heights along a row and of rows, as they were read.

        Raises:
            InputError: Names a line.
        """
        rows = [(number, words_of(row)) for number, row in self.rows]
        rows = [(number, words) for number, words in rows if len(words) == shape[0]]
        if shape[0] < 2 or len(rows) <= shape[1]:
            return
        for number, words in rows:
            for word in words:
                if not is_number(word) and word != "BAD":
                    raise InputError(f"line {number}: '{word[:40]}' is no number")
        if len(rows) % shape[1]:  # several channels have several times as many
            raise InputError(
                f"the text has {len(rows)} rows of {shape[0]} numbers, of which SurfaceTopography "
                f"read {shape[1]}",
                allowed="nan where a height is missing",
            )


def load_text(file: Path) -> Text | None:
    """Return the lines of a text in UTF-8, UTF-16 or Latin-1; None of a file that is no text.

    Args:
        file: The file.

    Raises:
        InputError: When it is larger than memory.
    """
    with file.open("rb") as stream:
        start = stream.read(4096)
    wide = start.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in start and not wide:
        return None
    check_memory(file.stat().st_size * 8)  # roughly what reading takes per character
    content = file.read_bytes()
    try:
        whole = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        whole = content.decode("latin-1")
    lines = whole.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    comments = [line.strip() for line in lines if line.lstrip().startswith("#")]
    cleaned = (
        line if _PLAIN.fullmatch(line) else _NO_NUMBER.sub("nan", _COMMENT.sub("", line))
        for line in lines
    )
    numbered = ((number, line.strip(" \v\f")) for number, line in enumerate(cleaned, 1))
    rows = [(number, row) for number, row in numbered if row.strip()]
    count = _heading(rows)
    return Text(
        comments=comments,
        heading=[row.strip() for _, row in rows[:count]],
        rows=[
            (number, row if _PLAIN.fullmatch(row) else _MISSING.sub("nan", row))
            for number, row in rows[count:]
        ],
    )


def _heading(rows: list[Line]) -> int:
    """Count the lines of words before the numbers; a row with damaged numbers is none."""
    lines: list[list[str]] = []
    for _, row in rows:
        lines.append(words_of(row))
        if 2 * sum(map(is_number, lines[-1])) >= len(lines[-1]):
            break
    else:
        return len(rows)
    *words, numbers = lines
    for count, cells in enumerate(words):
        labels = len(set(cells)) > 1 and not any(map(is_number, cells))
        # numbers among them, or BAD, BAD, BAD; one number a line is no matrix
        if 1 < len(cells) == len(numbers) and not labels:
            return count
    return len(words)


def read_text(text: Text, *, as_points: bool = False) -> FileContent:
    """Read a matrix of heights, or a list of points in three columns.

    The row index of a matrix is ix. White space, commas or semicolons separate its columns, and
    comments follow ``#`` at the beginning of a line or after a space; lines of words before the
    numbers are left out. Where comments or these words state width, height and unit, as Gwyddion's
    export does, it is an image: a row runs along x. Heights are missing in empty cells and where
    ``nan``, ``BAD``, ``No Data``, ``n/a``, ``#N/A``, ``---`` or ``***`` stands.

    Args:
        text: The lines of a file.
        as_points: Whether it is no matrix; a list of points has three columns.

    Raises:
        InputError: When it is no matrix of numbers, a profile, or points of no regular grid.
    """
    matrix, remarks = number_table(text.rows)
    image, unit = _image(text.stated, decimal_commas="decimal commas" in remarks)
    if text.heading and not image:
        remarks.insert(0, f"its heading '{text.heading[0][:40]}' left out")
    if as_points or (matrix.shape[1] == 3 and not image):
        points = replace(heights_of_points(matrix), unit=unit, remarks=tuple(remarks))
        for line in text.comments:  # as Gwyddion states the unit of x and y
            if points.lengths and (stated := _LATERAL_UNIT.fullmatch(line)):
                x, y = (LENGTH_UNITS[length_unit(stated[1])] * side for side in points.lengths)
                return replace(points, lengths=(x, y), of_points=False)
        return points
    if min(matrix.shape) < 3:
        rows, columns = matrix.shape
        raise InputError(
            f"{rows} rows of {columns} numbers are a profile, not a surface",
            allowed="a matrix of heights, or three columns x, y, z",
        )
    if lists_points(matrix):
        raise InputError(
            f"a list of points with {matrix.shape[1]} columns: the first two are the places of a "
            "regular grid",
            allowed="three columns x, y, z",
        )
    notes: tuple[str, ...] = ()
    if (inner := _without_coordinates(matrix)) is not matrix:
        matrix, notes = inner, ("its first row and column are coordinates, and are left out",)
    heights = matrix.T if image else matrix
    return FileContent(
        heights=heights, lengths=image, unit=unit, remarks=tuple(remarks), notes=notes
    )


def _without_coordinates(matrix: Array) -> Array:
    """Return the heights without a first row and column of coordinates, or all if there are none.

    They rise in even steps where the heights beside them do not.

    Raises:
        InputError: When the first row alone does, or the first column.
    """
    found = [
        (name, len(rows[0]) - 1)
        for name, rows in (("row", matrix), ("column", matrix.T))
        if _is_even(rows[0, 1:]) and not _is_even(rows[1, 1:])
    ]
    # by chance heights hardly rise evenly along both, or along one of many
    if len(found) == 2:
        return matrix[1:, 1:]
    if found and found[0][1] >= 12:
        raise InputError(
            f"the first {found[0][0]} of the matrix rises in even steps, as coordinates do, and "
            "heights do not",
            allowed="heights alone, with lengths in the scene; an .npy is taken as it is",
        )
    return matrix


def _is_even(values: Array) -> bool:
    """Tell whether four values or more rise, or fall, in equal steps but for rounding."""
    steps = np.diff(values)
    if len(steps) < 3 or not np.isfinite(steps).all():
        return False
    mean = float(steps.mean())
    return bool(mean and np.all(np.abs(steps - mean) <= 0.01 * abs(mean)))


def _sides(texts: list[str], decimal_commas: bool) -> list[float]:
    """Return numbers with points or commas, in them, as decimal signs or marks of thousands.

    Args:
        texts: The numbers of one file.
        decimal_commas: Whether the heights of the file have decimal commas.

    Raises:
        InputError: When a comma may be either, or one is no number.
    """
    found = []
    decimal = decimal_commas or any(
        re.fullmatch(r"[^.,]*,[^.,]*", one) and not _THOUSANDS.fullmatch(one) for one in texts
    )
    for one in texts:
        sign = max(".,", key=one.rfind) if {".", ","} <= set(one) else ""
        if not sign and "," in one and not decimal and one.count(",") == 1:
            raise InputError(
                f"it is not clear what the comma in '{one}' means, a size of the map",
                allowed="a decimal point and no marks of thousands",
            )
        if sign:  # what comes last is the decimal sign
            one = one.replace("," if sign == "." else ".", "")
        elif one.count(",") > 1:
            one = one.replace(",", "")
        try:
            found.append(float(one.replace(",", ".")))
        except ValueError:
            raise InputError(f"a size of the map is no number: '{one}'") from None
    return found


def _image(
    comments: list[str], *, decimal_commas: bool
) -> tuple[tuple[float, float] | None, str | None]:
    """Return the sides [mm] that two comments in succession state, and the unit of heights."""
    unit = next((known[1] for line in comments if (known := _VALUE_UNIT.fullmatch(line))), None)
    units = {*LENGTH_UNITS, "µm", "μm"}
    for place, pair in enumerate(pairwise(comments)):
        sizes = [size for line in pair if (size := _SIZE.fullmatch(line)) and size[2] in units]
        if len(sizes) == 2:
            after = (_WORD.fullmatch(line) for line in comments[place + 2 :])
            unit = unit or next((word[1] for word in after if word), None)
            numbers = _sides([size[1] for size in sizes], decimal_commas)
            factors = (LENGTH_UNITS[length_unit(size[2])] for size in sizes)
            x, y = (number * factor for number, factor in zip(numbers, factors, strict=True))
            return (x, y), unit and length_unit(unit)
    return None, unit and length_unit(unit)


def heights_of_points(points: Array) -> FileContent:
    """Return the heights of points on a regular grid, in any order; not a number where none is.

    Args:
        points: Rows x, y, z, in the units of the file.

    Raises:
        InputError: When there are not three columns, or the points lie on no regular grid.
    """
    if points.shape[1] != 3:
        raise InputError(
            "a point list needs three columns x, y, z",
            value=points.shape[1],
            allowed="3 columns; a list of x, z is a profile, not a surface",
        )
    if not np.all(np.abs(points[:, :2]) <= LARGEST):
        raise InputError(f"some coordinates x, y are not finite, or beyond {LARGEST:g} mm")
    (ix, dx), (iy, dy) = _places(points[:, 0], "x"), _places(points[:, 1], "y")
    nx, ny = int(ix.max()) + 1, int(iy.max()) + 1
    taken, times = np.unique(ix * ny + iy, return_counts=True)
    # it is hardly their grid where they take less than half of its places
    if 2 * taken.size < nx * ny or np.any(times != 1):
        raise InputError(
            f"the points do not fill a regular grid of {nx} × {ny}: "
            f"{nx * ny - taken.size} places are empty, "
            f"{np.count_nonzero(times > 1)} taken more than once"
        )
    heights = np.full((nx, ny), np.nan)
    heights[ix, iy] = points[:, 2]
    return FileContent(heights=heights, lengths=(nx * dx, ny * dy), of_points=True)


def lists_points(matrix: Array) -> bool:
    """Tell whether the first two columns of a matrix are the places of a whole regular grid.

    Args:
        matrix: A matrix of three or more columns.
    """
    if len(matrix) < 16 or matrix.shape[1] > 12:  # few rows and many columns are none of points
        return False
    try:
        return heights_of_points(matrix[:, :3]).heights.size == len(matrix)
    except InputError:
        return False


def _rounding(numbers: Array) -> float:
    """Return by how much numbers may be rounded: half of the last digit of the largest."""
    sizes = np.abs(numbers[numbers != 0.0])
    powers = np.floor(np.log10(sizes))
    for digits in range(3, 9):  # few points have fewer, such as 1 and 2
        units = 10.0 ** (powers - digits + 1)
        if np.all(np.abs(sizes / units - np.rint(sizes / units)) < 1e-6):
            return float(0.5 * units.max())
    return 0.0


def _places(coordinate: Array, axis: str) -> tuple[Indices, float]:
    """Return the index of every coordinate on an even division, and the division's step [mm]."""
    lowest, span = coordinate.min(), float(np.ptp(coordinate))
    gaps = np.diff(np.sort(coordinate))
    if not span:
        raise InputError(f"all points have the same {axis}, they are a profile, not a surface")
    steps = gaps[gaps > 0.3 * gaps.max()]  # without rounding noise
    count = round(float(np.rint(steps / np.median(steps)).sum()))
    step = span / count
    place = (coordinate - lowest) / step
    index = np.rint(place).astype(np.intp)
    rounded = 2.0 * _rounding(coordinate) / step  # of a coordinate and of the ends
    if np.max(np.abs(place - index)) > min(0.01 + rounded, 0.25):
        raise InputError(f"the points are not evenly spaced along {axis}")
    return index, step


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
    if separator == "\t" and all(row.startswith(separator) for row in rows):
        rows = [row[1:] for row in rows]
    if separator:
        empty = re.compile(rf"(?:^|(?<={separator})) *(?={separator}|$)")
        rows = [empty.sub("nan", row) for row in rows]
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
        return None if _both_signs(rows) else ","
    return "\t" if any(re.search(r"\t *\t|^\t|\t$", row) for row in rows) else None  # empty cells


def _both_signs(rows: list[str]) -> bool:
    """Whether commas separate numbers and are their decimal signs, too, as in ``0,386,-0,029``.

    Whole numbers have no such zeros.
    """
    return any(re.search(r"-0,|,0\d", row) for row in rows) and all(map(_PAIRS.fullmatch, rows))


def _with_points(lines: list[Line], rows: list[str], separator: str | None) -> list[str]:
    """Return rows with points for decimal commas; refuse commas that may be something else."""
    numbers = {one for one in re.split(r"[\s;]+", "\n".join(rows)) if "," in one}
    marks = all(_THOUSANDS.fullmatch(one) for one in numbers) or any("." in row for row in rows)
    if marks or not all(_WITH_COMMA.fullmatch(one) for one in numbers):
        line, column, cell = next(one for one in _cells(lines, rows, separator) if "," in one[2])
        raise InputError(
            f"not a matrix of numbers: line {line}, column {column}: it is not clear what the "
            f"comma in '{cell[:40]}' means: decimal sign, separator or mark of thousands",
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
            reason = f"line {line}, column {column}: '{cell[:40]}' is no number"
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
