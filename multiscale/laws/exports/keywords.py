"""Patch laws as surface interactions of Abaqus and CalculiX: tables of pressure over overclosure.

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

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from patchlaw.multiscale.laws.exports.sampling import (
    LEAST_PRESSURE,
    Conducts,
    LawSample,
    made_by,
    places,
    sample_law,
    zero_text,
)
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw

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
TYPE=MORTAR: linear and quadratic elements. No two rough faces may share nodes, which would count
twice. The printed reaction of the pressed part is 0: read the force where the body is held.
TYPE=NODE TO SURFACE: C3D4, C3D8, C3D10; C3D20 and C3D20R carry 0.6 to 2 % too little. It takes no
gap from *CLEARANCE: place the faces as they are.
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


def keyword_text(
    program: Program,
    table: LawTable,
    tolerance: float,
    conducts: Conducts | None = None,
    friction: Sequence[float] | None = None,
    name: str = "",
) -> str:
    """Return the surface interactions of all laws.

    Args:
        program: The program that reads them.
        table: The laws.
        tolerance: Largest error of straight lines between rows, as in `LawSample`; larger where the
            program's rows do not suffice.
        conducts: Conductances per area at stiffnesses; none are written when not given.
        friction: Coefficients of friction of the laws; none are written when not given.
        name: What names of interactions begin with.

    Raises:
        InputError: When the pressure of a law is a function of closure nowhere.
    """
    narrow = program.rows is not None
    earliest = min([0.0, *(law.first_touch for law in table.laws if not law.is_open)])
    lift = -earliest if narrow else 0.0
    above = f"{lift:.9g} mm above" if lift else "at the height of"
    head = _HEAD.format(zero=zero_text(table), least=LEAST_PRESSURE, lift=above)
    lines = _comments(f"{head}\n{program.remarks}\nMade by: {made_by(table)}")
    coefficients = friction or [0.0] * len(table.laws)
    for place, counted, coefficient in zip(places(table), table.laws, coefficients, strict=True):
        law = counted.shifted(lift) if lift else counted
        lines += _comments("", f"Law of {place.subject} {place.extent}".rstrip())
        lines += _comments(f"mean plane {law.initial_separation:.9g} mm below overclosure 0")
        sample = sample_law(
            law, tolerance=tolerance, most=program.rows, convex=narrow, subject=place.subject
        )
        if not len(sample):
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
