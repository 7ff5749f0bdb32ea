"""Writes the files of an export, each whole or not at all."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Annotated

import numpy as np

from patchlaw.geometry import Regions
from patchlaw.geometry.spring_bed import Coefficient, Friction, stiffness_ratios
from patchlaw.multiscale.laws.exports import FORMATS
from patchlaw.multiscale.laws.exports.keywords import ABAQUS, CALCULIX, keyword_text
from patchlaw.multiscale.laws.exports.law_module import law_modules
from patchlaw.multiscale.laws.exports.sampling import Conducts, places, sample_law
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.support.arguments import Limits, checked
from patchlaw.support.errors import InputError
from patchlaw.support.files import OwnFiles, cell, write_text

TOLERANCE = 1e-4
"""Error of straight lines between the rows of tables; that of the laws themselves is larger."""

_MODULES = "laws_4c"

CSV_COLUMNS = (
    "approach_mm", "closure_mm", "pressure_MPa", "stiffness_MPa_per_mm",
    "contact_area_fraction", "separation_mm", "contacts",
)  # fmt: skip
"""Columns of ``laws.csv`` after those that say where the law holds: ix and iy, or the region.

Conductances per area follow where they are asked for, and `FLOW_COLUMNS` where a leak is.
Laws of regions have the scatter of pressures between their samples as a last column.
"""
FLOW_COLUMNS = "transmissivity_x_mm3", "transmissivity_y_mm3"
"""Columns of ``laws.csv`` where laws know what leaks through their gaps."""
_TANGENTIAL = "tangential_stiffness_MPa_per_mm"
_STIFFNESS = CSV_COLUMNS.index("stiffness_MPa_per_mm")
_SEPARATION = CSV_COLUMNS.index("separation_mm")


def laws_csv(
    table: LawTable,
    tolerance: float,
    conducts: Conducts | None = None,
    friction: Sequence[float] | None = None,
) -> str:
    """Return the text of ``laws.csv``: points on the laws, one after the other, along the approach.

    Where the pressure is a function of closure, rows are chosen as for contact programs; beyond,
    they are the rows of the law. A patch that stays open has none.

    Args:
        table: The laws.
        tolerance: Largest error of straight lines between rows, as in `LawSample`.
        conducts: Conductances per area at stiffnesses; further columns where given.
        friction: Coefficients of friction of the laws; where given, the tangential stiffness of
            sticking is a column.
    """
    text = StringIO()
    writer = csv.writer(text)
    regions = isinstance(table.patches, Regions)
    where, scatter = (("region",), ("pressure_scatter_MPa",)) if regions else (("ix", "iy"), ())
    names = () if conducts is None else tuple(conducts(np.zeros(1)))
    names = names if friction is None else (_TANGENTIAL, *names)
    leaks = all(law.transmissivity is not None for law in table.laws)
    flows = FLOW_COLUMNS if leaks else ()
    writer.writerow((*where, *CSV_COLUMNS, *names, *flows, *scatter))
    for place, law in zip(places(table), table.laws, strict=True):
        for row in _rows_of(law, tolerance):
            more = (float(law.pressure_scatter(row[1])),) if regions else ()  # over the closure
            known = law.interface_stiffness(law.along(row[0]))
            conductances = [] if conducts is None else conducts(known).values()
            further = [] if friction is None else [row[_STIFFNESS] / law.stiffness_ratio]
            further += [float(one) for one in conductances]
            further += _flows_of(law, row[_SEPARATION]) if leaks else []
            writer.writerow((*map(cell, place.cells), *row, *further, *more))
    return text.getvalue()


def _flows_of(law: PatchLaw, separation: float) -> list[float]:
    """Return the transmissivities of a law at a separation; none where it does not know them."""
    flow = law.transmissivity
    return [] if flow is None else flow.at(np.array([separation]))[0].tolist()


def _rows_of(law: PatchLaw, tolerance: float) -> Iterator[tuple[float, ...]]:
    """Yield the rows of one law, from the approach on."""
    try:
        chosen = sample_law(law, tolerance=tolerance).approach
    except InputError:  # the pressure is a function of closure nowhere
        chosen = law.rows.approach[:1]
    approach = np.union1d(chosen, law.rows.approach[law.rising_rows :])
    point = law.along(approach)
    columns = (
        approach,
        point.closure,
        point.pressure,
        point.stiffness,
        point.contact_area_fraction,
        point.separation,
        point.contacts,
    )
    yield from zip(*(column.tolist() for column in columns), strict=True)


_TABLES: dict[str, tuple[str, Callable[..., str]]] = {
    "csv": ("laws.csv", laws_csv),
    "abaqus": ("laws_abaqus.inp", partial(keyword_text, ABAQUS)),
    "calculix": ("laws_calculix.inp", partial(keyword_text, CALCULIX)),
}


@checked
def export_laws(
    table: LawTable,
    folder: str | Path,
    format: str,
    *,
    tolerance: Annotated[float, Limits(ge=1e-9, lt=1)] = TOLERANCE,
    conducts: Conducts | None = None,
    friction: Coefficient | Friction | list[Coefficient | Friction] | None = None,
    name: str = "",
) -> list[Path]:
    """Write patch laws in the form that another program reads.

    ``"csv"`` writes ``laws.csv``; ``"abaqus"`` and ``"calculix"`` write ``laws_abaqus.inp`` and
    ``laws_calculix.inp``, with a surface interaction per law; ``"4c"`` writes a Python module per
    law, ``laws_4c/law_NAME_IX_IY.py`` or ``laws_4c/law_NAME_REGION.py``. Units are mm, N and MPa.

    Of interactions or modules with one name a program takes the first, and says nothing: exports
    that meet in one input need different names.

    Args:
        table: The laws.
        folder: Folder to write to, made when missing; an earlier export of the format is replaced.
        format: One of `multiscale.laws.exports.FORMATS`.
        tolerance: Error of straight lines between the rows of tables, relative to the pressure, or
            to 1 % of the largest of the law where that is more.
        conducts: Conductances per area at stiffnesses of the laws, see
            `Conductances.per_area`; they are columns of the csv file, and the thermal one a
            gap conductance of Abaqus and CalculiX.
        friction: Coefficient of friction, or that of each law; or a `Friction` with the bodies'
            Poisson's ratio too, which laws made by a scene know: a keyword of Abaqus and CalculiX,
            with a stiffness of sticking, and that stiffness as a column of the csv file. Modules of
            4C have pressures alone.
        name: What names of interactions begin with, and part of the names of modules, which
            have eight digits that tell tables apart where none is given.

    Returns:
        The files written.

    Raises:
        InputError: When there is no such format, or the pressure of a law is nowhere a
            function of closure, which only a csv file can hold; or when a law does not know its
            stiffness of sticking, which friction needs; or when the folder has a file of the same
            name that patchlaw did not write.
        NotWritten: When the system refuses.
    """
    texts = export_texts(
        table, format, tolerance=tolerance, conducts=conducts, friction=friction, name=name
    )
    own = OwnFiles(Path(folder))
    own.refuse_others(texts, allowed="another folder, or the file moved away", key="folder")
    remove_exports(Path(folder), (format,))
    with own.writing(texts):
        return [write_text(Path(folder) / name, text) for name, text in texts.items()]


def export_texts(
    table: LawTable,
    format: str,
    *,
    tolerance: float = TOLERANCE,
    conducts: Conducts | None = None,
    friction: float | Friction | Sequence[float | Friction] | None = None,
    name: str = "",
) -> dict[str, str]:
    """Return the names and contents of the files of an export, see `export_laws`.

    Args:
        table: The laws.
        format: One of `multiscale.laws.exports.FORMATS`.
        tolerance: Error of straight lines between the rows of tables.
        conducts: As for `export_laws`.
        friction: As for `export_laws`.
        name: As for `export_laws`.

    Raises:
        InputError: As `export_laws`.
    """
    if format not in FORMATS:
        allowed = ", ".join(FORMATS)
        raise InputError("unknown format of exported laws", value=format, allowed=allowed)
    check_name(name)
    if format == "4c":
        return {f"{_MODULES}/{path}": text for path, text in law_modules(table, name).items()}
    file, text_of = _TABLES[format]
    coefficients = None
    if friction is not None:
        each = (
            friction
            if isinstance(friction, Sequence | np.ndarray)
            else [friction] * len(table.laws)
        )
        if len(each) != len(table.laws):
            allowed = f"one of each of {len(table.laws)} laws"
            raise InputError("is not that of each law", key="friction", value=each, allowed=allowed)
        known = [one if isinstance(one, Friction) else Friction(coefficient=one) for one in each]
        pairs = zip(table.laws, known, strict=True)
        ratios = [float(stiffness_ratios([law], one)[0]) for law, one in pairs]
        table = table.with_stiffness_ratios(ratios)
        coefficients = [one.coefficient for one in known]
    named = {} if format == "csv" else {"name": name}
    return {file: text_of(table, tolerance, conducts, coefficients, **named)}


def check_name(name: str) -> None:
    """Refuse what cannot be part of the names of interactions and modules.

    Args:
        name: The name; empty for none.

    Raises:
        InputError: When it is not a letter, followed by at most 19 letters, digits, underscores.
    """
    if not re.fullmatch(r"([A-Za-z][A-Za-z0-9_]{0,19})?", name):
        allowed = "a letter, then up to 19 letters, digits and underscores"
        problem = "does not fit into names of exported laws"
        raise InputError(problem, key="name", value=name, allowed=allowed)


def remove_exports(folder: Path, formats: tuple[str, ...] = FORMATS) -> None:
    """Remove the files of earlier exports, but none of those that patchlaw did not write.

    Args:
        folder: Folder that they were written to.
        formats: Formats whose files are removed.

    Raises:
        NotWritten: When the system refuses.
    """
    OwnFiles(folder).remove(export_names(folder, formats))


def export_names(folder: Path, formats: Sequence[str]) -> list[str]:
    """Return the names of the files that exports write, as far as there may be some in a folder.

    Args:
        folder: The folder.
        formats: Formats of the exports.
    """
    names = [_TABLES[format][0] for format in formats if format in _TABLES]
    modules = (folder / _MODULES).glob("law_*.py") if "4c" in formats else ()
    return names + [f"{_MODULES}/{path.name}" for path in modules]
