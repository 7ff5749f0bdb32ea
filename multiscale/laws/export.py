"""Writes laws for other programs, each file whole or not at all.

Patch laws as surface interactions of Abaqus and CalculiX: tables of pressure over overclosure.

Both programs take rows of pressure and overclosure, the first without pressure, and interpolate
linearly. Beyond the last row Abaqus continues the last line. CalculiX (2.20) keeps the last
pressure, so that a last row continues the tangent there. Its mortar contact provides for 40 rows,
and loses the pressure where slopes fall; across gaps it has none. So its tables have no more rows,
their slopes rise as far as the law allows, and they begin no earlier than the faces touch.

Conductance per area over pressure is a further table of the same surface interaction, for Abaqus
with the parameter PRESSURE; it continues the first and last values. CalculiX (2.20) finds the
pressure behind a conductance from linear and exponential overclosures alone: of a tabular one it
takes the first row, without heat. Its table is therefore a comment, from which the user takes a
value. Units are those of mm, N, s and K: 1 W/m²K is 0.001 N/(mm s K).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from patchlaw.geometry import Friction, Regions
from patchlaw.geometry.spring_bed import Coefficient, stiffness_ratios
from patchlaw.multiscale.laws import FORMATS
from patchlaw.multiscale.laws.exported_law import (
    LEAST_PRESSURE,
    Conducts,
    LawSample,
    law_modules,
    made_by,
    places,
    sample_law,
    zero_text,
)
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.support import InputError, Limits, checked
from patchlaw.support.files import OwnFiles, csv_text, write_text

_HEAT = "thermal_conductance_W_per_m2K"
_HEAT_UNITS = "Conductance of the contacts [N/(mm s K) = mW/(mm2 K)] over pressure [MPa]:"
_BY_HAND = """
CalculiX does not know the pressure of such a law in its heat conduction, and would take the first
row, without heat. Write *GAP CONDUCTANCE with the value at your pressure below it."""

_HEAD = """\
Contact laws of a rough surface, written by patchlaw.
Units: mm, N, MPa. One surface interaction per law, pressure [MPa] over overclosure [mm].
Overclosure 0: a rigid plane {lift} {zero}.
Flat faces of the mesh that just touch stand for this state; the mean plane of the heights lies
below, as stated.
Straight lines between the rows are within the stated error of the pressure, or of {least:g} of the
largest pressure of the law where that is more."""
_ABAQUS = "Beyond the last row Abaqus continues the last line: the laws are not known there."
_CALCULIX = """\
The last row of each table continues the tangent beyond the end of the law, because CalculiX keeps
the last pressure: overclosures beyond the stated end are outside the law.
Use *CONTACT PAIR with the rough face first, as a surface of element faces (TYPE=ELEMENT).
Which TYPE: MORTAR, the safest: linear and quadratic elements, loads taken back as well. The
printed reaction of the pressed part is 0 there: read the force where the body is held.
NODE TO SURFACE only where rough faces share nodes, which MORTAR counts twice, or faces stick by
friction, or a table says so; with C3D4, C3D8, C3D10, as C3D20 and C3D20R carry up to 2 % too
little. It takes no gap from *CLEARANCE: place the faces as they are. Taken back in large
increments, faces on laws much stiffer than the body open for good, silently: unload in 1000 parts.
With SURFACE TO SURFACE CalculiX 2.20 finds no pressure in such a table, and says nothing."""
_STICKS = """\
Friction: one stiffness of sticking up to the coefficient times the pressure, that of the law at
{:.3g} MPa; over the table it goes from {:.3g} to {:.3g} MPa/mm.
Partial slip within the roughness has no keyword: loops lose less here than the law says."""
_STICKS_BY_NODES = "Under TYPE=MORTAR sticking depends on the increments: take NODE TO SURFACE."
_FALLS = "Its slope falls: TYPE=NODE TO SURFACE alone. MORTAR can lose all its pressure, silently."
_OPEN = "It stays open: no surface interaction, leave it out of contact. First touch: {:.9g} mm."


class Program(NamedTuple):
    """How a program takes surface interactions.

    Attributes:
        remarks: What is said of them at the beginning.
        rows: Rows of a table at most; beyond the last the tangent continues; slopes that rise, and
            overclosures from 0 on, are wanted; None for any rows.
        heat: What is said before a table of conductance, as a comment.
        mark: What every line of that table begins with.
        elastic_slip: Whether sticking is stated by the slip at which it ends, not by a stiffness.
    """

    remarks: str
    rows: int | None
    heat: str
    mark: str
    elastic_slip: bool


ABAQUS = Program(_ABAQUS, None, "", "", elastic_slip=True)
CALCULIX = Program(
    _CALCULIX, 39, _BY_HAND, "** ", elastic_slip=False
)  # and one more, for the tangent


class Export(NamedTuple):
    """What is exported.

    Attributes:
        table: The laws.
        tolerance: Largest error of straight lines between rows, as in `LawSample`; larger where the
            program's rows do not suffice.
        conducts: Conductances per area at stiffnesses; None: none are written.
        friction: Coefficients of friction of the laws; None: none are written.
        name: What names of interactions and modules begin with.
    """

    table: LawTable
    tolerance: float
    conducts: Conducts | None
    friction: list[float] | None
    name: str


def keyword_text(program: Program, export: Export) -> str:
    """Return the surface interactions of all laws.

    Args:
        program: The program that reads them.
        export: The laws, and what is written of them.

    Raises:
        InputError: When the pressure of a law is a function of closure nowhere.
    """
    narrow, (table, tolerance, conducts, friction, name) = program.rows is not None, export
    earliest = min([0.0, *(law.first_touch for law in table.laws if not law.is_open)])
    lift = -earliest if narrow else 0.0
    above = f"{lift:.9g} mm above" if lift else "at the height of"
    head = _HEAD.format(zero=zero_text(table), least=LEAST_PRESSURE, lift=above)
    lines = _comments(f"{head}\n{program.remarks}\n{made_by(table)}".rstrip())
    for place, coefficient in zip(places(table), friction or repeat(0.0), strict=False):
        law = place.law.shifted(lift) if lift else place.law
        lines += _comments("", f"Law of {place.subject} {place.extent}".rstrip())
        lines += _comments(f"mean plane {law.initial_separation:.9g} mm below overclosure 0")
        sample = sample_law(law, tolerance, program.rows, convex=narrow, subject=place.subject)
        if not len(sample.closure):
            lines += _comments(_OPEN.format(law.first_touch))
            continue
        called = "_".join(filter(None, (name, place.kind, place.label))).upper()
        lines += _interaction(called, law, sample, extended=narrow)
        if coefficient:
            lines += _friction(program, law, sample, coefficient)
        if conducts is not None:
            lines += _heat(program, law, sample, conducts)
    return "".join(f"{line}\n" for line in lines)


def _interaction(name: str, law: PatchLaw, sample: LawSample, *, extended: bool) -> Iterator[str]:
    """Yield the lines of a surface interaction; further behaviour of the interface goes last."""
    start, end = float(sample.closure[0]), float(sample.closure[-1])
    yield from _comments(f"first touch at {start:.9g} mm, end of the law at {end:.9g} mm")
    yield from _comments(f"largest error of straight lines between the rows: {sample.error:.1e}")
    if not law.is_function:
        yield from _comments("The law ends where pressure stops being a function of closure.")
    if sample.repair:
        yield from _comments(f"falling pressures evened out by {sample.repair:.1e} of the largest")
    if extended and not sample.convex:
        yield from _comments(_FALLS)
    yield f"*SURFACE INTERACTION, NAME={name}"
    yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
    rows = list(zip(sample.pressure.tolist(), sample.closure.tolist(), strict=True))
    if extended:
        further = 2.0 * end - start
        last = np.diff(sample.pressure[-2:]) / np.diff(sample.closure[-2:])
        slope = max(float(law.stiffness(end)), float(last[0]) if sample.convex else 0.0)
        rows.append((rows[-1][0] + slope * (further - end), further))
    yield from (f"{pressure:.12e}, {closure:.12e}" for pressure, closure in rows)


def _friction(
    program: Program, law: PatchLaw, sample: LawSample, coefficient: float
) -> Iterator[str]:
    """Yield the lines of friction, with the stiffness of sticking at half the largest pressure."""
    row = int(np.searchsorted(sample.pressure, 0.5 * sample.pressure[-1]))
    pressure = float(sample.pressure[row])
    stiffness = law.stiffness(sample.closure[[1, row, -1]]) / law.stiffness_ratio
    yield from _comments(_STICKS.format(pressure, *stiffness[[0, 2]]))
    if program.rows is not None:
        yield from _comments(_STICKS_BY_NODES)
    if program.elastic_slip:
        yield f"*FRICTION, ELASTIC SLIP={coefficient * pressure / stiffness[1]:.9e}"
        yield f"{coefficient:.9g},"
    else:
        yield from ("*FRICTION", f"{coefficient:.9g}, {stiffness[1]:.9e}")


def _heat(program: Program, law: PatchLaw, sample: LawSample, conducts: Conducts) -> Iterator[str]:
    """Yield the lines of conductance [N/(mm s K)] over pressure [MPa], from zero on."""
    point = law.along(sample.approach)
    known = conducts(law.interface_stiffness(point)).get(_HEAT)
    if known is None:
        return
    yield from _comments(f"{_HEAT_UNITS}{program.heat}")
    yield f"{program.mark}*GAP CONDUCTANCE, PRESSURE"
    heat = np.maximum(1e-3 * known, 0.0).tolist()
    for row in zip(heat, point.pressure.tolist(), strict=True):
        yield program.mark + "{:.12e}, {:.12e}".format(*row)


def _comments(*texts: str) -> list[str]:
    """Return lines of comment."""
    return [f"** {line}".rstrip() for text in texts for line in text.split("\n")]


TOLERANCE = 1e-4
"""Error of straight lines between the rows of tables; that of the laws themselves is larger."""

_MODULES = "laws_4c"

CSV_COLUMNS = {
    "closure_mm": "closure", "pressure_MPa": "pressure", "stiffness_MPa_per_mm": "stiffness",
    "contact_area_fraction": "contact_area_fraction", "separation_mm": "separation",
    "contacts": "contacts",
}  # fmt: skip
"""Columns of ``laws.csv`` after the approach and those that say where the law holds: ix and
iy, or the region.

Conductances per area follow where they are asked for, and `FLOW_COLUMNS` where a leak is.
Laws of regions have the scatter of pressures between their samples as a last column.
"""
FLOW_COLUMNS = "transmissivity_x_mm3", "transmissivity_y_mm3"
"""Columns of ``laws.csv`` where laws know what leaks through their gaps."""
_TANGENTIAL = "tangential_stiffness_MPa_per_mm"
_SCATTER = "pressure_scatter_MPa"


def laws_csv(export: Export) -> str:
    """Return the text of ``laws.csv``: points on the laws, one after the other, along the approach.

    Where the pressure is a function of closure, rows are chosen as for contact programs; beyond,
    they are the rows of the law. A patch that stays open has none. With friction the tangential
    stiffness of sticking is a column.

    Args:
        export: The laws, and what is written of them.
    """
    table, tolerance, conducts, friction, _ = export
    regions = isinstance(table.patches, Regions)
    leaks = all(law.transmissivity is not None for law in table.laws)
    rows: list[tuple[Any, ...]] = []
    for place in places(table):
        law = place.law
        try:
            chosen = sample_law(law, tolerance).approach
        except InputError:  # the pressure is a function of closure nowhere
            chosen = law.rows.approach[:1]
        approach = np.union1d(chosen, law.rows.approach[law.rising_rows :])
        point = law.along(approach)
        columns = {"approach_mm": approach}
        columns |= {column: getattr(point, name) for column, name in CSV_COLUMNS.items()}
        if friction is not None:
            columns[_TANGENTIAL] = point.stiffness / law.stiffness_ratio
        if conducts is not None:
            columns |= conducts(law.interface_stiffness(point))
        if leaks and law.transmissivity is not None:
            flows = law.transmissivity.at(point.separation).T
            columns |= zip(FLOW_COLUMNS, flows, strict=True)
        if regions:
            columns[_SCATTER] = law.pressure_scatter(point.closure)
        rows += ((*place.cells, *row) for row in zip(*columns.values(), strict=True))
    return csv_text([*(("region",) if regions else ("ix", "iy")), *columns], rows)


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
        format: One of `multiscale.laws.FORMATS`.
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
    texts = export_texts(table, format, tolerance, conducts, friction, name)
    own = OwnFiles(Path(folder))
    own.refuse_others(texts, allowed="another folder, or the file moved away", key="folder")
    remove_exports(Path(folder), (format,))
    with own.writing(texts):
        return [write_text(Path(folder) / name, text) for name, text in texts.items()]


def export_texts(
    table: LawTable,
    format: str,
    tolerance: float = TOLERANCE,
    conducts: Conducts | None = None,
    friction: float | Friction | Sequence[float | Friction] | None = None,
    name: str = "",
) -> dict[str, str]:
    """Return the names and contents of the files of an export, see `export_laws`.

    Args:
        table: The laws.
        format: One of `multiscale.laws.FORMATS`.
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
        several = isinstance(friction, Sequence | np.ndarray)
        each: Any = friction if several else [friction] * len(table.laws)
        if len(each) != len(table.laws):
            allowed = f"one of each of {len(table.laws)} laws"
            raise InputError("is not that of each law", key="friction", value=each, allowed=allowed)
        known = [one if isinstance(one, Friction) else Friction(coefficient=one) for one in each]
        pairs = zip(table.laws, known, strict=True)
        ratios = [float(stiffness_ratios([law], one)[0]) for law, one in pairs]
        table = table.with_stiffness_ratios(ratios)
        coefficients = [one.coefficient for one in known]
    return {file: text_of(Export(table, tolerance, conducts, coefficients, name))}


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
