"""Numbers of a section of gmsh's files, as text or as bytes, taken in their order."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from support.arrays import Array
from support.errors import InputError

Table = NDArray[np.int64]


class TextNumbers:
    """Numbers between spaces and line ends.

    Args:
        content: The section.

    Raises:
        InputError: When something else stands there.
    """

    def __init__(self, content: bytes) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self._values = np.fromstring(content, sep=" ")
            except (DeprecationWarning, ValueError):
                raise InputError("a section has something else than numbers") from None
        self._at = 0

    def table(self, rows: int, kinds: str) -> Array:
        """Return the next rows of numbers, shape (rows, len(kinds)).

        Args:
            rows: Number of rows.
            kinds: What stands in a row: ``i`` an int, ``u`` a size, ``d`` a double.

        Raises:
            InputError: When the section ends before.
        """
        end = self._at + rows * len(kinds)
        if rows < 0 or end > len(self._values):
            raise _too_short()
        part = self._values[self._at : end].reshape(rows, len(kinds))
        self._at = end
        return part

    def line(self) -> int:
        """Return the next number, which stands on a line of its own, as text in any file."""
        return int(whole(self.table(1, "i"))[0, 0])

    def rest(self) -> Table:
        """Return all further numbers, which are whole."""
        return whole(self._values[self._at :])


class ByteNumbers:
    """Numbers as bytes.

    Args:
        data: The file.
        at: Where the section begins.
        order: ``<`` or ``>``, as numpy calls the order of bytes.

    Attributes:
        at: Where the next number begins.
    """

    def __init__(self, data: bytes, at: int, order: str) -> None:
        self._data, self.at = data, at
        self._types = {"i": f"{order}i4", "u": f"{order}u8", "d": f"{order}f8"}

    def table(self, rows: int, kinds: str) -> Array:
        """Return the next rows; see `TextNumbers.table`."""
        row = np.dtype([(str(k), self._types[kind]) for k, kind in enumerate(kinds)])
        if rows < 0 or self.at + rows * row.itemsize > len(self._data):
            raise _too_short()
        parts = np.frombuffer(self._data, row, rows, self.at)
        numbers = np.column_stack([parts[name] for name in row.names or ()]).astype(np.float64)
        self.at += rows * row.itemsize
        return numbers

    def line(self) -> int:
        """Return the number on the next line."""
        end = self._data.find(b"\n", self.at)
        text = self._data[self.at : max(end, self.at)].strip()
        self.at = end + 1
        if not text.isdigit():
            raise _too_short()
        return int(text)


Numbers = TextNumbers | ByteNumbers
"""The numbers of a section from its beginning on."""


def whole(values: Array) -> Table:
    """Return numbers that must be whole, such as tags.

    Args:
        values: The numbers.

    Raises:
        InputError: When one is not, or too large.
    """
    exact = np.abs(values) <= 2.0**53  # as floats
    if not exact.all() or (values != np.rint(values)).any():
        raise InputError("a number or a count of the mesh is no whole number")
    return values.astype(np.int64)


def _too_short() -> InputError:
    return InputError("a section of the file ends before all that it announces")
