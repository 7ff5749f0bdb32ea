"""The contacts of all recorded load steps: maps and spots as arrays, read from a run's folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiscale.figures import by_matplotlib
from multiscale.figures.contact_scales import ContactScales
from multiscale.readable import column
from multiscale.results.contact_record import FIELDS, SPOT_COLUMNS, ContactRecord
from multiscale.results.reading import csv_rows, read_history, result_of_a_run
from support.arrays import Array
from support.checked_store import check_hdf5
from support.displayed import Displayed, Table, data_frame, dataset, of_columns, spread
from support.errors import InputError
from support.packages import optional_packages

_MAPS = FIELDS[2:]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ContactHistory(Displayed, Sequence[ContactRecord]):
    """The contacts of n load steps, one record each; arrays have the load steps as first axis.

    An index gives a record, a slice the contacts of these load steps alone.

    Attributes:
        records: The contacts, by load step.
    """

    records: tuple[ContactRecord, ...]

    def __len__(self) -> int:
        return len(self.records)

    def __iter__(self) -> Iterator[ContactRecord]:
        return iter(self.records)

    def __getitem__(self, index: Any) -> Any:
        found = self.records[index]
        return ContactHistory(records=found) if isinstance(index, slice) else found

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

    @property
    def step(self) -> NDArray[np.int64]:
        """Numbers of the load steps, shape (n,)."""
        return np.array([record.step for record in self.records], np.int64)

    @property
    def approach_mm(self) -> Array:
        """Approaches of the plane, shape (n,) [mm]."""
        return np.array([record.approach_mm for record in self.records])

    @property
    def force_N(self) -> Array:
        """Forces of all spots, shape (n,) [N]."""
        return np.array([record.force_N for record in self.records])

    @property
    def unloading(self) -> NDArray[np.bool_]:
        """Whether the load fell to each of the load steps, shape (n,)."""
        return np.array([record.unloading for record in self.records], bool)

    @property
    def x_mm(self) -> Array:
        """Abscissae of the nx cells, shape (nx,), or of the nodes of a reference [mm]."""
        return self._of_records("x_mm")[0]

    @property
    def y_mm(self) -> Array:
        """Ordinates of the ny cells, shape (ny,), or of the nodes of a reference [mm]."""
        return self._of_records("y_mm")[0]

    @property
    def pressure_MPa(self) -> Array:
        """Contact pressures, shape (n, nx, ny), or (n, nodes) of a reference [MPa]."""
        return self._of_records("pressure_MPa")

    @property
    def gap_mm(self) -> Array:
        """Gaps between plane and deformed surface, shape (n, nx, ny) or (n, nodes) [mm]."""
        return self._of_records("gap_mm")

    @property
    def plastic_depth_mm(self) -> Array:
        """Plastic depths that the loads so far left, shape (n, nx, ny) [mm]."""
        return self._of_records("plastic_depth_mm")

    @property
    def spots(self) -> tuple[Array, ...]:
        """The spots of each load step, the largest force first; see `ContactRecord.spots`."""
        return tuple(record.spots for record in self.records)

    def has(self, name: str) -> bool:
        """Tell whether all contacts have a map.

        Args:
            name: Its name, such as ``"plastic_depth_mm"``.
        """
        return bool(self.records) and all(getattr(one, name) is not None for one in self.records)

    def _of_records(self, name: str) -> Array:
        """Return a map of all contacts, which are all of the same points."""
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
