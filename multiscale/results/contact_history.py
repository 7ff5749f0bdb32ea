"""The contacts of all recorded load steps: maps and spots as arrays, read from a run's folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.multiscale.figures import by_matplotlib
from patchlaw.multiscale.readable import column
from patchlaw.multiscale.results.contacts import FIELDS, SPOT_COLUMNS, ContactRecord, ContactScales
from patchlaw.multiscale.results.history import csv_rows, read_history, result_of_a_run
from patchlaw.support.arguments import check_fields, checked
from patchlaw.support.arrays import Array
from patchlaw.support.displayed import Displayed, Table, data_frame, dataset, of_columns, spread
from patchlaw.support.errors import InputError
from patchlaw.support.files import check_hdf5
from patchlaw.support.packages import optional_packages

_MAPS = FIELDS[2:]


_SHAPE = "shape (n, nx, ny), or (n, nodes) of a reference"


def _of_steps(name: str, meaning: str, kind: Any = float) -> Any:
    """Return a property: a number of all contacts."""
    return property(
        lambda history: np.array([getattr(one, name) for one in history.records], kind),
        doc=meaning,
    )


def _map(name: str, meaning: str) -> Any:
    """Return a property: a map of all contacts, or the places that they have in common."""

    def read(history: ContactHistory) -> Array:
        found = history.of_records(name)
        return found if name in _MAPS else found[0]

    return property(read, doc=meaning)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ContactHistory(Displayed, Sequence[ContactRecord]):
    """The contacts of n load steps, one record each; arrays have the load steps as first axis.

    An index gives a record, a slice the contacts of these load steps alone.

    Attributes:
        records: The contacts, by load step.
    """

    records: tuple[ContactRecord, ...]

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    def __len__(self) -> int:
        return len(self.records)

    def __iter__(self) -> Iterator[ContactRecord]:
        return iter(self.records)

    def __getitem__(self, index: Any) -> Any:
        found = self.records[index]
        return ContactHistory(records=found) if isinstance(index, slice) else found

    @checked
    def at(self, step: int) -> ContactRecord:
        """Return the contact of a load step.

        Args:
            step: Number of the load step, from 1.

        Raises:
            InputError: When the contact of this load step was not recorded.
        """
        for record in self.records:
            if record.step == step:
                return record
        recorded = ", ".join(str(record.step) for record in self.records)
        raise InputError(
            "is no load step whose contact was recorded",
            key="step",
            value=step,
            allowed=f"{recorded}; any of a run with output.contact = 'all'",
        )

    step = _of_steps("step", "Numbers of the load steps, shape (n,).", np.int64)
    approach_mm = _of_steps("approach_mm", "Approaches of the plane, shape (n,) [mm].")
    force_N = _of_steps("force_N", "Forces of all spots, shape (n,) [N].")
    unloading = _of_steps("unloading", "Whether the load fell to each load step, shape (n,).", bool)
    x_mm = _map("x_mm", "Abscissae of the nx cells, shape (nx,), or of a reference's nodes [mm].")
    y_mm = _map("y_mm", "Ordinates of the ny cells, shape (ny,), or of a reference's nodes [mm].")
    pressure_MPa = _map("pressure_MPa", f"Contact pressures, {_SHAPE} [MPa].")
    gap_mm = _map("gap_mm", f"Gaps between plane and deformed surface, {_SHAPE} [mm].")
    plastic_depth_mm = _map("plastic_depth_mm", f"Plastic depths that loads left, {_SHAPE} [mm].")

    @property
    def spots(self) -> tuple[Array, ...]:
        """The spots of each load step, the largest force first; see `ContactRecord.spots`."""
        return tuple(record.spots for record in self.records)

    @checked
    def has(self, name: str) -> bool:
        """Tell whether all contacts have a map.

        Args:
            name: Its name, such as ``"plastic_depth_mm"``.
        """
        return bool(self.records) and all(getattr(one, name) is not None for one in self.records)

    @checked
    def of_records(self, name: str) -> Array:
        """Return a map of all contacts, which are all of the same points.

        Args:
            name: Name of the map.

        Raises:
            InputError: When a contact is without it.
        """
        if not self.has(name):
            needed = "a hardness" if name == "plastic_depth_mm" else "a model with cells or nodes"
            raise InputError("is not known of these contacts", key=name, allowed=f"with {needed}")
        return np.stack([getattr(record, name) for record in self.records])

    def records_of_spots(self) -> list[dict[str, Any]]:
        """Return the rows of ``contacts.csv``, each as a dictionary by column."""
        columns = ("step", "spot", *SPOT_COLUMNS)
        rows = (row for record in self.records for row in record.rows())
        return [dict(zip(columns, row, strict=True)) for row in rows]

    def to_dataframe(self) -> Any:
        """Return the rows of ``contacts.csv`` as a pandas data frame.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(self.records_of_spots())

    def to_xarray(self) -> Any:
        """Return maps, loads and spots as an xarray dataset; units end the names.

        Maps have the dimensions ``step``, ``x`` and ``y``, of a reference ``step`` and ``node``.
        Spots have the dimension ``spot``, and ``spot_step`` says of which load step each is.

        Raises:
            ImportError: When xarray, which patchlaw does not require, is not installed.
        """
        names = tuple(f"spot_{name}" for name in SPOT_COLUMNS)
        rows = np.concatenate([np.zeros((0, len(names))), *self.spots])
        owner = np.repeat(self.step, [len(spots) for spots in self.spots])
        columns = zip(names, rows.T, strict=True)
        values: dict[str, Any] = {name: (("spot",), column) for name, column in columns}
        coordinates: dict[str, Any] = {"step": self.step, "spot_step": (("spot",), owner)}
        coordinates |= {
            name: (("step",), getattr(self, name))
            for name in ("approach_mm", "force_N", "unloading")
        }
        maps = [name for name in _MAPS if self.has(name)]
        if maps:
            on_cells = getattr(self, maps[0]).ndim == 3
            axes = ("x", "y") if on_cells else ("node", "node")
            coordinates |= {"x_mm": ((axes[0],), self.x_mm), "y_mm": ((axes[1],), self.y_mm)}
            dimensions = ("step", *dict.fromkeys(axes))
            values |= {name: (dimensions, getattr(self, name)) for name in maps}
        return dataset(values, coordinates, {"units": "mm, N, MPa"})

    def displayed(self) -> tuple[str, Table]:
        """Return what this is in a line, and a table of the load steps."""
        shown = [self.records[place] for place in spread(len(self), 60)]
        peaks = [float(one.peak_pressure_MPa.max(initial=0.0)) for one in shown]
        table = of_columns(
            ["step", *(str(one.step) for one in shown)],
            column("approach", (one.approach_mm for one in shown), "mm"),
            column("force", (one.force_N for one in shown), "N"),
            ["spots", *(str(len(one.spots)) for one in shown)],
            column("peak pressure", peaks, "MPa"),
        )
        maps = [name for name in _MAPS if self.has(name)]
        of = f"; maps: {', '.join(maps)}" if maps else ""
        return f"ContactHistory of {len(self)} load step{'s' * (len(self) != 1)}{of}", table

    @checked
    def plot(self, step: int) -> Any:
        """Draw the contact of a load step; all load steps have the same colour scales.

        Args:
            step: Number of the load step.

        Returns:
            A matplotlib figure; a notebook shows it.

        Raises:
            InputError: When the contact of this load step was not recorded.
        """
        drawn, scales = self.at(step), ContactScales.of(self.records)
        return by_matplotlib("figures.contact.contact_figure", drawn, scales)


@checked
def read_contact(folder: str | Path) -> ContactHistory:
    """Read the contacts of a run from its results: maps of pressure and gap, and all spots.

    Args:
        folder: Folder that ``patchlaw run`` wrote; ``contacts.csv`` and, where the model has cells
            or nodes, ``contact.h5`` are read, with the load steps in ``history.csv``.

    Returns:
        The contacts of those load steps that ``output.contact`` named.

    Raises:
        InputError: When a file is missing, damaged or cut short, or the run recorded no contacts.
    """
    folder = Path(folder)
    history, path = read_history(folder), folder / "contacts.csv"
    with result_of_a_run(folder / "provenance.json") as provenance:
        spots = {int(one["step"]): int(one["spots"]) for one in provenance["contacts"]}
        lengths = tuple(float(length) for length in provenance["surface"]["lengths_mm"])
    if not spots:
        allowed = "a run with output.contact = 'last' or 'all'"
        raise InputError("has no contacts: none were recorded", file=str(folder), allowed=allowed)
    tables, maps = _spots(path, spots), _maps(folder / "contact.h5", spots)
    falls = dict(zip(history.step.tolist(), history.unloading.tolist(), strict=True))
    steps = {step.step: step for step in history}
    if missing := [number for number in spots if number not in steps]:
        raise InputError(f"lacks load step {missing[0]}", file=str(folder / "history.csv"))
    return ContactHistory(
        records=tuple(
            ContactRecord(
                step=number,
                approach_mm=steps[number].approach_mm,
                force_N=float(tables[number][:, 3].sum()),
                lengths_mm=(lengths[0], lengths[1]),
                spots=tables[number],
                unloading=falls[number],
                **maps.get(number, {}),
            )
            for number in spots
        )
    )


def _spots(path: Path, counts: dict[int, int]) -> dict[int, Array]:
    """Return the spots of every load step, each of which has as many as were written."""
    rows: dict[int, list[list[float]]] = {step: [] for step in counts}
    for line, row in enumerate(csv_rows(path), 2):
        try:
            rows[int(row["step"])].append([float(row[name]) for name in SPOT_COLUMNS])
        except (KeyError, ValueError, TypeError):
            problem = f"line {line} is no row of a spot of this run"
            raise InputError(problem, file=str(path)) from None
    for step, count in counts.items():
        if len(rows[step]) != count:
            problem = f"has {len(rows[step])} of the {count} spots of load step {step}"
            raise InputError(problem, file=str(path))
    return {step: np.array(found).reshape(-1, len(SPOT_COLUMNS)) for step, found in rows.items()}


def _maps(path: Path, counts: dict[int, int]) -> dict[int, dict[str, Any]]:
    """Return the maps of every load step by name; none of a run that wrote none."""
    if not path.is_file():
        return {}
    with optional_packages():
        import h5py
    try:
        content = path.read_bytes()
        check_hdf5(content)
        with h5py.File(BytesIO(content), "r") as file:
            groups = {step: file[f"step_{step}"] for step in counts}
            return {
                step: {name: np.asarray(group[name][()]) for name in FIELDS if name in group}
                for step, group in groups.items()
            }
    except InputError as error:
        raise error.located(file=str(path)) from None
    except Exception as error:  # h5py raises errors of many families
        raise InputError(f"has no maps of these contacts: {error}", file=str(path)) from None
