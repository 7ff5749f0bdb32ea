"""The results of a run: a row for every load step and every patch in it, notes; read back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, SupportsIndex, overload

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry import PatchGrid, Regions
from patchlaw.multiscale.loading.column import Column, unknown_column
from patchlaw.multiscale.loading.load_step import CLEAR, COLUMNS, LOOSE, LoadStep
from patchlaw.multiscale.results.accuracy import AccuracyVerdict, ReferenceRecord
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.support import Array, Count, Flags, InputError, check_fields, checked
from patchlaw.support.packages import by_matplotlib
from patchlaw.support.readable import (
    Caution,
    Displayed,
    Table,
    column,
    data_frame,
    dataset,
    of_columns,
    span,
    spread,
)

if TYPE_CHECKING:  # only laws take it
    from patchlaw.multiscale.laws.law_table import LawTable

PATCH_COLUMNS = ("step", "ix", "iy", "closure_mm", "pressure_MPa", "contact_area_fraction")
"""Columns of ``patches.csv``; those of `PATCH_MORE` that are known follow."""
PATCH_MORE = (
    "interface_stiffness_MPa_per_mm", "force_N", "contact_area_mm2", "leak_mm3_per_s",
)  # fmt: skip
"""Columns of the derivative −dp/dū of a patch's law, and of what regions bear, touch and leak."""


@dataclass(frozen=True, kw_only=True, repr=False)
class History(Displayed):
    """All load steps of a run; every column of ``history.csv`` is an attribute, as an array.

    ``history[-1]`` is a `LoadStep`, ``history[2:5]`` the history of these load steps alone.
    Printed, or in a notebook, a history is a table. Columns are declared in `LoadStep`.

    Attributes:
        steps: The load steps.
        patches: The partition of the interface, or regions of a contact face.
        seconds: Wall time of each phase of the run [s].
        notes: Remarks of the run on its own approximations.
        accuracy: Whether the requested accuracy is kept; None where none was requested.
        reference: Results of all meshes of a reference; None with other couplings.
        contact_records: The contacts of those load steps that the scene asks for.
        before: Of a part of a history the load step before the first of the part, if there is one.
    """

    steps: tuple[LoadStep, ...]
    patches: PatchGrid | Regions
    seconds: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    accuracy: AccuracyVerdict | None = None
    reference: ReferenceRecord | None = None
    contact_records: tuple[ContactRecord, ...] = ()
    before: LoadStep | None = None

    def __getattr__(self, column: str) -> NDArray[Any]:
        """Tell what a column that is unknown is called now; others are attributes."""
        raise unknown_column(self, column)

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    def __len__(self) -> int:
        return len(self.steps)

    def __iter__(self) -> Iterator[LoadStep]:
        return iter(self.steps)

    @overload
    def __getitem__(self, index: SupportsIndex) -> LoadStep: ...

    @overload
    def __getitem__(self, index: slice) -> History: ...

    def __getitem__(self, index: SupportsIndex | slice) -> LoadStep | History:
        if not isinstance(index, slice):
            return self.steps[index]
        places = range(len(self.steps))[index]
        if places.step < 0:
            raise InputError("a history goes forward", value=index, allowed="a step of 1 or more")
        steps = self.steps[index]
        numbers = {step.step for step in steps}
        return replace(
            self,
            steps=steps,
            contact_records=tuple(one for one in self.contact_records if one.step in numbers),
            reference=None if self.reference is None else self.reference.at(index),
            before=self.steps[places.start - 1] if places.start else self.before,
        )

    def counted_from(self, zero: float) -> History:
        """Return the history with approaches and closures counted from another height.

        Args:
            zero: Approach at which the plane is at this height, as the history counts it [mm].
        """
        if not zero:
            return self
        contacts = (
            replace(one, approach_mm=one.approach_mm - zero) for one in self.contact_records
        )
        return replace(
            self,
            steps=tuple(step.counted_from(zero) for step in self.steps),
            reference=None if self.reference is None else self.reference.counted_from(zero),
            contact_records=tuple(contacts),
            before=None if self.before is None else self.before.counted_from(zero),
        )

    @property
    def patch_pressure_MPa(self) -> Array:
        """Mean pressure of each patch at each step, shape (steps, N) [MPa]."""
        return np.array([step.patches.pressure_MPa for step in self.steps])

    @property
    def closure_mm(self) -> Array:
        """Mean closure of each patch at each step, shape (steps, N) [mm]."""
        return np.array([step.patches.closure_mm for step in self.steps])

    @property
    def unloading(self) -> Flags:
        """Whether the load fell to each load step, shape (steps,)."""
        before = (self.before, *self.steps)
        return np.array(
            [step.is_unloading(last) for step, last in zip(self.steps, before, strict=False)], bool
        )

    @property
    def contact(self) -> ContactRecord | None:
        """The contact recorded last, spots and maps; None where none was requested."""
        return self.contact_records[-1] if self.contact_records else None

    def records(self) -> list[dict[str, Any]]:
        """Return the rows of ``history.csv``, each as a dictionary by column."""
        return [{column.name: column.of(step) for column in COLUMNS} for step in self.steps]

    def patch_records(self) -> list[dict[str, Any]]:
        """Return the rows of ``patches.csv``, each as a dictionary by column."""
        columns = self.patch_columns
        return [dict(zip(columns, row, strict=True)) for row in self.patch_rows()]

    def patch_rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of ``patches.csv``."""
        places = self._places
        for step in self.steps:
            values = (getattr(step.patches, name) for name in self._patch_values)
            for place, *row in zip(places, *values, strict=True):
                yield (step.step, *place, *row)

    @property
    def patch_columns(self) -> tuple[str, ...]:
        """Columns of ``patches.csv``: of regions their names instead of places on a grid."""
        places = PATCH_COLUMNS[1:3] if isinstance(self.patches, PatchGrid) else ("region",)
        return (PATCH_COLUMNS[0], *places, *self._patch_values)

    @property
    def _patch_values(self) -> tuple[str, ...]:
        """Columns of ``patches.csv`` behind the place, those of laws and regions among them."""
        states = [step.patches for step in self.steps]
        known = all if states else any  # without load steps nothing is
        more = (name for name in PATCH_MORE if known(getattr(s, name) is not None for s in states))
        return (*PATCH_COLUMNS[3:], *more)

    @property
    def _places(self) -> list[tuple[int | str, ...]]:
        """The patches' places on the grid, or the names of regions."""
        if isinstance(self.patches, PatchGrid):
            return [self.patches.unravel(index) for index in range(self.patches.count)]
        return [(name,) for name in self.patches.names]

    def to_dataframe(self) -> Any:
        """Return the rows of ``history.csv`` as a pandas data frame.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(self.records())

    def to_xarray(self) -> Any:
        """Return all columns and the state of the patches as an xarray dataset.

        Columns without a value in any load step are left out. Of patches the dimensions are
        ``step``, ``ix`` and ``iy``, of regions ``step`` and ``region``.

        Raises:
            ImportError: When xarray, which patchlaw does not require, is not installed.
        """
        known = [one for one in COLUMNS if any(one.of(step) is not None for step in self.steps)]
        values: dict[str, Any] = {
            one.name: (("step",), getattr(self, one.name), _attributes(one)) for one in known
        }
        places: dict[str, Any] = {"step": values.pop("step", (("step",), self.step))}
        if isinstance(self.patches, PatchGrid):
            axes = dict(zip(("ix", "iy"), self.patches.grid, strict=True))
        else:
            axes, places["region"] = {"region": self.patches.count}, list(self.patches.names)
        for name in self._patch_values:
            column = np.array([getattr(step.patches, name) for step in self.steps])
            shaped = column.reshape(len(self.steps), *axes.values())
            values[f"patch_{name}"] = (("step", *axes), shaped)
        return dataset(values, places, {"units": "mm, N, MPa"})

    def displayed(self) -> tuple[str, Table]:
        """Return what the history is in a line, and the curve with the solver's work as a table."""
        if not self.steps:
            return "History without a load step", ((), ())
        count = len(self.steps)
        ranges = span(self.approach_mm, "mm"), span(self.force_N, "N")
        line = f"History of {count} load step{'s' * (count > 1)}: {', '.join(ranges)}"
        return line, self.table(most=60)

    @checked
    def table(self, *names: str, most: Count = 1000) -> Table:
        """Return headings and rows of the tables that reports and terminals show.

        Units have the prefixes that suit the largest value of their column. A reference has one
        more column, with its values at mesh size zero.

        Args:
            *names: The tables, see `Column.table`, each with the number of the load step; by
                default the curve and the solver's work.
            most: Load steps that are shown; of more as many at equal distances, and a last row says
                how many lie between.
        """
        names, chosen = names or ("curve", "solver"), spread(len(self.steps), most)
        shown = [self.steps[place] for place in chosen]
        texts = dict(
            column.shown(shown)
            for column in COLUMNS
            if column.heading
            and (column.table in names or column.name == "step")
            and (column.table != "more" or any(column.of(step) for step in shown))
        )
        if "curve" in names and (falls := self.unloading).any():
            ways = ["unloading" if falls[place] else "loading" for place in chosen]
            texts = {"step": texts.pop("step"), "load": ways, **texts}
        if self.reference is not None and "curve" in names:
            heading, cells = self.reference.cells
            texts[heading] = [cells[place] for place in chosen]
        rows = list(zip(*texts.values(), strict=True))
        if left := len(self.steps) - len(shown):
            rows.append(("…", f"{left} more", *[""] * (len(texts) - 2)))
        return list(texts), rows

    def zone_table(self) -> Table:
        """Return headings and rows of what the named regions of the face bear at the last step.

        It has no rows where the face is in one piece, or the partition a grid.
        """
        zones = () if isinstance(self.patches, PatchGrid) else self.patches.names
        last = self.steps[-1].patches if self.steps else None
        if last is None or len(zones) < 2 or last.force_N is None or last.contact_area_mm2 is None:
            return (), ()
        columns = [
            ["zone", *zones],
            column("force", last.force_N, "N"),
            column("mean pressure", last.pressure_MPa, "MPa"),
            column("contact area", last.contact_area_mm2, "mm²"),
            column("of the zone", last.contact_area_fraction, "%"),
        ]
        if (stiffness := last.interface_stiffness_MPa_per_mm) is not None:
            columns.append(column("interface stiffness per area", stiffness, "MPa/mm"))
        if last.leak_mm3_per_s is not None:
            columns.append(column("leaves there", last.leak_mm3_per_s, "mm³/s"))
        return of_columns(*columns)

    @checked
    def plot(self, label: str = "history") -> Any:
        """Draw mean pressure, contact area and mean separation.

        Args:
            label: Name of the curves.

        Returns:
            A matplotlib figure; a notebook shows it.
        """
        return by_matplotlib("multiscale.results.figures.curves.history_figure", self, label)


for _column in COLUMNS:
    setattr(History, _column.name, _column)


def _attributes(column: Column) -> dict[str, str]:
    """Return the attributes of a column in a dataset, which its axes are labelled with."""
    return {"long_name": column.meaning} | ({"units": column.unit} if column.unit else {})


def _without_range(table: LawTable) -> str:
    """Return what has no range of validity, unlike the model of a table of laws."""
    if table.made_by["model"].startswith("half-space"):
        return "micro.finite_slopes = false leaves out what holds up to there alone"
    return "micro.model = 'half-space' has no such range"


def range_notes(steps: Sequence[LoadStep], table: LawTable | None) -> Iterator[str]:
    """Yield a sentence when load steps lie outside the range of validity of the micro model.

    Args:
        steps: The load steps.
        table: The patch laws; None where the micro model is solved itself.
    """
    if table is None and not any(step.warnings for step in steps):
        return
    of_tilt = LOOSE, CLEAR
    for text in of_tilt:
        if loose := [step.step for step in steps if text in step.warnings]:
            yield Caution(f"load step {loose[0]}{' and others' * (len(loose) > 1)}: {text}")
    known = ((step.step, one) for step in steps for one in step.warnings if one not in of_tilt)
    outside = dict(known)
    if table is not None:
        limit = np.array([law.warning_pressure for law in table.laws])
        for step in steps:
            pressure = step.patches.pressure_MPa
            if count := int(np.sum((pressure > 0.0) & (pressure >= limit))):
                outside[step.step] = (
                    f"{count} of {limit.size} patches are loaded beyond the range of the model "
                    f"{table.made_by['model']}; {_without_range(table)}"
                )
    if outside:
        first = min(outside)
        yield Caution(
            f"load steps outside the micro model's range of validity: {len(outside)} of "
            f"{len(steps)}; first step {first}: {outside[first]}"
        )
