"""Patch laws as a table of numbers, for spreadsheets and scripts."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from io import StringIO

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Regions
from multiscale.exports.sampling import Conducts, sample_law
from multiscale.laws.law_table import LawTable
from multiscale.laws.patch_law import PatchLaw

CSV_COLUMNS = (
    "approach_mm", "closure_mm", "pressure_MPa", "stiffness_MPa_per_mm",
    "contact_area_fraction", "separation_mm", "contacts",
)  # fmt: skip
"""Columns of ``laws.csv`` after those that say where the law holds: ix and iy, or the region.

Conductances per area follow where they are asked for.
Laws of regions have the scatter of pressures between their samples as a last column.
"""
_STIFFNESS = CSV_COLUMNS.index("stiffness_MPa_per_mm")


def csv_text(table: LawTable, tolerance: float, conducts: Conducts | None = None) -> str:
    """Return the text of ``laws.csv``: points on the laws, one after the other, along the approach.

    Where the pressure is a function of closure, rows are chosen as for contact programs; beyond,
    they are the rows of the law. A patch that stays open has none.

    Args:
        table: The laws.
        tolerance: Largest error of straight lines between rows, as in `LawSample`.
        conducts: Conductances per area at stiffnesses; further columns where given.
    """
    text = StringIO()
    writer = csv.writer(text)
    regions = isinstance(table.patches, Regions)
    where, scatter = (("region",), ("pressure_scatter_MPa",)) if regions else (("ix", "iy"), ())
    names = () if conducts is None else tuple(conducts(np.zeros(1)))
    writer.writerow((*where, *CSV_COLUMNS, *names, *scatter))
    for index, law in enumerate(table.laws):
        place = _place(table, index)
        for row in _rows_of(law, tolerance):
            more = (float(law.pressure_scatter(row[1])),) if regions else ()  # over the closure
            conductances = [] if conducts is None else conducts(np.array(row[_STIFFNESS])).values()
            writer.writerow((*place, *row, *map(float, conductances), *more))
    return text.getvalue()


def _place(table: LawTable, index: int) -> tuple[int | str, ...]:
    """Return what says in a row where its law holds."""
    if isinstance(table.patches, Regions):
        return (table.patches.names[index],)
    return table.patches.unravel(index)


def _rows_of(law: PatchLaw, tolerance: float) -> Iterator[tuple[float, ...]]:
    """Yield the rows of one law, from the approach on."""
    approach = np.union1d(_chosen(law, tolerance), law.rows.approach[law.rising_rows :])
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


def _chosen(law: PatchLaw, tolerance: float) -> NDArray[np.float64]:
    """Return the approaches of the rows where the pressure is a function of closure [mm]."""
    try:
        return sample_law(law, tolerance=tolerance).approach
    except InputError:  # it is a function nowhere
        return law.rows.approach[:1]
