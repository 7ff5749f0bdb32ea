"""Writes the files of an export, each whole or not at all."""

from __future__ import annotations

from pathlib import Path

from geometry import InputError
from multiscale.exports import FORMATS
from multiscale.exports.keywords import abaqus_text, calculix_text
from multiscale.exports.law_module import law_modules
from multiscale.exports.sampling import Conducts
from multiscale.exports.tables import csv_text
from multiscale.laws.law_table import LawTable
from support.whole_files import remove, write_text, written

TOLERANCE = 1e-4
"""Error of straight lines between the rows of tables; that of the laws themselves is larger."""

_TABLES = {
    "csv": ("laws.csv", csv_text),
    "abaqus": ("laws_abaqus.inp", abaqus_text),
    "calculix": ("laws_calculix.inp", calculix_text),
}
_MODULES = "laws_4c"


def export_laws(
    table: LawTable,
    folder: str | Path,
    format: str,
    *,
    tolerance: float = TOLERANCE,
    conducts: Conducts | None = None,
) -> list[Path]:
    """Write patch laws in the form that another program reads.

    ``"csv"`` writes ``laws.csv``; ``"abaqus"`` and ``"calculix"`` write ``laws_abaqus.inp`` and
    ``laws_calculix.inp``, with a surface interaction per law; ``"4c"`` writes a Python module per
    law, ``laws_4c/law_IX_IY.py`` or ``laws_4c/law_REGION.py``. Units are mm, N and MPa.

    Args:
        table: The laws.
        folder: Folder to write to, made when missing; an earlier export of the format is replaced.
        format: One of `multiscale.exports.FORMATS`.
        tolerance: Error of straight lines between the rows of tables, relative to the pressure, or
            to 1 % of the largest of the law where that is more.
        conducts: Conductances per area at stiffnesses of the laws, see
            `Conductances.per_area`; they are columns of the csv file, and the thermal one a
            gap conductance of Abaqus and CalculiX.

    Returns:
        The files written.

    Raises:
        InputError: When there is no such format, or the pressure of a law is a function of
            closure nowhere, which a csv file alone can say.
        NotWritten: When the system refuses.
    """
    texts = export_texts(table, format, tolerance=tolerance, conducts=conducts)
    remove_exports(Path(folder), (format,))
    return [write_text(Path(folder) / name, text) for name, text in texts.items()]


def export_texts(
    table: LawTable,
    format: str,
    *,
    tolerance: float = TOLERANCE,
    conducts: Conducts | None = None,
) -> dict[str, str]:
    """Return the names and contents of the files of an export, see `export_laws`.

    Args:
        table: The laws.
        format: One of `multiscale.exports.FORMATS`.
        tolerance: Error of straight lines between the rows of tables.
        conducts: As for `export_laws`.

    Raises:
        InputError: As `export_laws`.
    """
    if format not in FORMATS:
        allowed = ", ".join(FORMATS)
        raise InputError("unknown format of exported laws", value=format, allowed=allowed)
    if format == "4c":
        return {f"{_MODULES}/{name}": text for name, text in law_modules(table).items()}
    name, text_of = _TABLES[format]
    return {name: text_of(table, tolerance, conducts)}


def remove_exports(folder: Path, formats: tuple[str, ...] = FORMATS) -> None:
    """Remove the files of earlier exports.

    Args:
        folder: Folder that they were written to.
        formats: Formats whose files are removed.

    Raises:
        NotWritten: When the system refuses.
    """
    paths = [folder / _TABLES[format][0] for format in formats if format in _TABLES]
    if "4c" in formats:
        paths += (folder / _MODULES).glob("law_*.py")
    for path in paths:
        with written(path):
            remove(path)
