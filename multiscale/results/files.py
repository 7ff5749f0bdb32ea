"""The files of a run: what tables, maps and fields hold, how they are written and read back."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from io import BytesIO, StringIO
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.geometry import PatchGrid, Regions
from patchlaw.multiscale.loading.column import (
    MODE_COLUMNS,
    RENAMED,
    leaks_of,
    mode_rows,
    modes_by_step,
)
from patchlaw.multiscale.loading.load_step import COLUMNS, LoadStep, PatchState, of_older_run
from patchlaw.multiscale.results.contacts import FIELDS, SPOT_COLUMNS, ContactHistory, ContactRecord
from patchlaw.multiscale.results.history import PATCH_COLUMNS, PATCH_MORE, History
from patchlaw.support import Array, Counts, InputError, check_fields, checked, located
from patchlaw.support.files import (
    OwnFiles,
    check_hdf5,
    csv_text,
    hdf5_bytes,
    read_bytes,
    write_bytes,
    write_text,
)
from patchlaw.support.packages import optional_packages
from patchlaw.support.readable import Displayed, Table, dataset, number, times

Files = Iterable[tuple[str, str | bytes]]
"""Names of files within a folder, and their contents."""

_COUNTS = {one.name for one in fields(LoadStep) if str(one.type).startswith("int")}


def write_files(folder: Path, files: Files, names: Iterable[str]) -> list[Path]:
    """Write files, each whole or not at all, and list them as patchlaw's.

    Args:
        folder: Folder of the results; made when missing.
        files: The files.
        names: Names that they may have; files of others under these names stay.

    Returns:
        The files written.

    Raises:
        NotWritten: When the system refuses one.
    """
    with OwnFiles(folder).writing(names):
        return [
            write_text(folder / name, content)
            if isinstance(content, str)
            else write_bytes(folder / name, content)
            for name, content in files
        ]


def history_files(history: History) -> Iterator[tuple[str, str]]:
    """Yield ``history.csv``, ``patches.csv``, for a reference ``reference.csv``, ``modes.csv``.

    Args:
        history: The load steps.
    """
    rows = ([column.of(step) for column in COLUMNS] for step in history)
    yield "history.csv", csv_text([column.name for column in COLUMNS], rows)
    yield "patches.csv", csv_text(history.patch_columns, history.patch_rows())
    if history.reference is not None:
        columns = history.reference.columns(history.steps)
        yield "reference.csv", csv_text(list(columns), zip(*columns.values(), strict=True))
    if any(step.modes for step in history):
        yield "modes.csv", csv_text(("step", *MODE_COLUMNS), mode_rows(history))


def table_files(tables: Mapping[str, Iterable[Mapping[str, Any]]]) -> Iterator[tuple[str, str]]:
    """Yield tables whose columns are the names of the values in their first row.

    Args:
        tables: Rows by name of the table; one without a row makes no file.
    """
    for name, rows in tables.items():
        rest = iter(rows)
        if (first := next(rest, None)) is not None:
            yield (
                f"{name}.csv",
                csv_text(list(first), (row.values() for row in chain([first], rest))),
            )


def contact_files(contacts: Sequence[ContactRecord]) -> Iterator[tuple[str, str | bytes]]:
    """Yield ``contacts.csv`` and, where fields are known, ``contact.h5``, with a group a load step.

    Args:
        contacts: The contacts; without any there are no files.
    """
    if not contacts:
        return
    rows = (row for record in contacts for row in record.rows())
    yield "contacts.csv", csv_text(("step", "spot", *SPOT_COLUMNS), rows)

    def fill(file: Any) -> None:
        file.attrs["units"] = "mm, N, MPa"
        for record in contacts:
            group = file.create_group(f"step_{record.step}")
            for name in ("approach_mm", "force_N", "unloading"):
                group.attrs[name] = getattr(record, name)
            for name in FIELDS:
                if (data := getattr(record, name)) is not None:
                    # most of a map of pressures is zero
                    group.create_dataset(name, data=data, compression=1)

    if contacts[0].pressure_MPa is not None:
        import h5py

        yield "contact.h5", hdf5_bytes(h5py.File, fill)


@checked
def read_history(folder: str | Path) -> History:
    """Read the history of a run from its results.

    Args:
        folder: Folder that ``patchlaw run`` wrote; ``history.csv``, ``patches.csv`` and
            ``provenance.json`` are read.

    Returns:
        The history. Results of single meshes of a reference are in ``reference.csv`` alone, and
        contacts are read by `read_contact`.

    Raises:
        InputError: When a file is missing, cannot be read or is no result of a run.
    """
    folder = Path(folder)
    rows, patch_rows = csv_rows(folder / "history.csv"), csv_rows(folder / "patches.csv")
    with result_of_a_run(folder / "provenance.json") as provenance:
        lengths, grid = provenance["surface"]["lengths_mm"], provenance["patches"]
        patches: PatchGrid | Regions
        if grid is None:
            patches = Regions(tuple(provenance["regions"]))
        else:
            patches = PatchGrid(grid=tuple(grid), lengths=tuple(lengths))
        steps_written = provenance["steps"]
        for name, table, count in (
            ("history.csv", rows, steps_written),
            ("patches.csv", patch_rows, steps_written * patches.count),
        ):
            if len(table) != count:
                problem = f"has {len(table)} of the {count} rows that the run wrote"
                raise InputError(problem, file=str(folder / name))
        states = _patch_states(patch_rows, patches.count)
        steps = tuple(_load_step(row, state) for row, state in zip(rows, states, strict=True))
        if (path := folder / "modes.csv").is_file():
            modes = modes_by_step(csv_rows(path))
            steps = tuple(replace(one, modes=modes.get(one.step, ())) for one in steps)
        seconds, notes = provenance["seconds"], tuple(provenance["notes"])
    return History(steps=steps, patches=patches, seconds=seconds, notes=notes)


@contextmanager
def result_of_a_run(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the provenance of a run; what does not fit to it there is no result of a run.

    Args:
        path: The file ``provenance.json``.

    Raises:
        InputError: When it cannot be read, or the body finds that something is not as runs write
            it; names the file.
    """
    try:
        yield json.loads(read_bytes(path))
    except InputError as error:
        raise error.located(file=str(path)) from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"is not the result of a run: {type(error).__name__}: {error}", file=str(path)
        ) from None


def csv_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table, each as texts by column.

    Args:
        path: The file.

    Raises:
        InputError: When it cannot be read, or is cut short: its last line does not end, or a row
            has not as many cells as the first one.
    """
    try:
        text = read_bytes(path).decode()
        rows = list(csv.DictReader(StringIO(text, newline=""), strict=True))
        if not text.endswith("\n"):  # a number that is cut is another number
            raise ValueError("the last line does not end; the file is cut short")
        for number, row in enumerate(rows, 2):
            if None in row or None in row.values():
                raise ValueError(f"row {number} has not as many cells as the first one")
        return rows
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=str(path)) from None


def _load_step(row: dict[str, str], patches: PatchState) -> LoadStep:
    """Return a load step of its row."""
    values: dict[str, Any] = {
        RENAMED.get(name, name): _value(name, text) for name, text in row.items()
    }
    values["tilt"] = (values["tilt_x"], values["tilt_y"])
    values["moment_N_mm"] = (values["moment_x_N_mm"], values["moment_y_N_mm"])
    if values.get("first_touch_approach_mm") is not None:
        values["zero_mm"] = values["first_touch_approach_mm"] - values["approach_mm"]
    values["leaks"] = leaks_of(values)
    known = {item.name for item in fields(LoadStep)}
    given = {key: values[key] for key in values.keys() & known}
    return of_older_run(LoadStep(patches=patches, **given))


def _value(name: str, text: str) -> float | int | str | None:
    if name == "reason":
        return text
    return (int(text) if name in _COUNTS else float(text)) if text else None


def _patch_states(rows: list[dict[str, str]], count: int) -> list[PatchState]:
    """Return the states of all patches, at one load step after another."""
    names = (*PATCH_COLUMNS[3:], *(name for name in PATCH_MORE if rows and name in rows[0]))
    values = np.array([[float(row[name]) for name in names] for row in rows])
    steps = values.reshape(-1, count, len(names)).swapaxes(1, 2)
    return [PatchState(**dict(zip(names, step.copy(), strict=True))) for step in steps]


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
    with located(str(path), unreadable="has no maps of these contacts"):
        content = path.read_bytes()
        check_hdf5(content)
        with h5py.File(BytesIO(content), "r") as file:
            groups = {step: file[f"step_{step}"] for step in counts}
            return {
                step: {name: np.asarray(group[name][()]) for name in FIELDS if name in group}
                for step, group in groups.items()
            }


_NAMES = {
    "displacement": "displacement_mm",
    "stress": "stress_MPa",
    "von_Mises": "von_mises_MPa",
    "pressure": "pressure_MPa",
    "fluid_pressure": "fluid_pressure_MPa",
    "worn_depth": "worn_depth_mm",
}
"""Attributes of `BodyFields` by the names that the files have."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class BodyFields(Displayed):
    """Fields of a body on n vertices and m cells at some load steps, which are the first axis.

    Attributes:
        step: Numbers of the load steps, shape (steps,).
        points_mm: Places of the vertices of the undeformed body, shape (n, 3) [mm].
        cells: Vertices of each cell in the order of XDMF and VTK, shape (m, vertices of a cell).
        cell_type: Kind of the cells as XDMF names it, such as ``"Hexahedron"``.
        displacement_mm: Displacements of the vertices, shape (steps, n, 3) [mm].
        stress_MPa: Stresses at the middles of the cells, shape (steps, m, 3, 3) [MPa].
        von_mises_MPa: Equivalent stresses there, shape (steps, m) [MPa].
        pressure_MPa: Contact pressures: on a flat face those of the cells below it, shape
            (steps, m), of a rough block those of its vertices, shape (steps, n) [MPa]; None where
            they were not written.
        fluid_pressure_MPa: Pressures of a fluid that leaks over the face, at its vertices and 0 at
            others, shape (steps, n) [MPa]; None without.
        worn_depth_mm: Depths that have worn off, as the contact pressures [mm]; None without wear.
    """

    step: Counts
    points_mm: Array
    cells: Counts
    cell_type: str
    displacement_mm: Array
    stress_MPa: Array
    von_mises_MPa: Array
    pressure_MPa: Array | None = None
    fluid_pressure_MPa: Array | None = None
    worn_depth_mm: Array | None = None

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    def displayed(self) -> tuple[str, Table]:
        """Return what this is in a line, and a table of the fields with their ranges."""
        steps = ", ".join(map(str, self.step))
        line = (
            f"BodyFields of load step{'s' * (len(self.step) > 1)} {steps}: "
            f"{len(self.points_mm)} vertices, {len(self.cells)} cells ({self.cell_type})"
        )
        fields = {name: getattr(self, name) for name in ("points_mm", *_NAMES.values())}
        rows = [
            (name, times(one.shape), number(one.min()), number(one.max()))
            for name, one in fields.items()
            if one is not None
        ]
        return line, (("field", "shape", "least", "largest"), rows)

    def to_xarray(self) -> Any:
        """Return the fields as an xarray dataset; dimensions are step, point, cell, axis, other.

        Raises:
            ImportError: When xarray, which patchlaw does not require, is not installed.
        """
        values = {
            "displacement_mm": (("step", "point", "axis"), self.displacement_mm),
            "stress_MPa": (("step", "cell", "axis", "other"), self.stress_MPa),
            "von_mises_MPa": (("step", "cell"), self.von_mises_MPa),
            "cells": (("cell", "corner"), self.cells),
        }
        for name in ("pressure_MPa", "worn_depth_mm"):
            if (field := getattr(self, name)) is not None:
                where = "cell" if field.shape[1] == len(self.cells) else "point"
                values[name] = (("step", where), field)
        if self.fluid_pressure_MPa is not None:
            values["fluid_pressure_MPa"] = (("step", "point"), self.fluid_pressure_MPa)
        places = {"step": self.step, "points_mm": (("point", "axis"), self.points_mm)}
        return dataset(values, places, {"units": "mm, MPa", "cell_type": self.cell_type})


@checked
def read_fields(folder: str | Path, *, counter: bool = False) -> BodyFields:
    """Read the fields of a run from its results.

    Args:
        folder: Folder that ``patchlaw run`` wrote with ``output.fields``; ``fields.h5`` is read.
        counter: Whether those of the counter-body are, from ``counter_fields.h5``.

    Returns:
        The fields of the load steps that ``output.fields`` named.

    Raises:
        InputError: When the file is missing, damaged or cut short.
    """
    path = Path(folder) / ("counter_fields.h5" if counter else "fields.h5")
    if not path.is_file():
        allowed = "the results of a run with output.fields = 'last' or 'all', which has a body"
        raise InputError("there are no fields", file=str(path), allowed=allowed)
    mesh, steps, values = _read_functions(path, _NAMES)
    return BodyFields(**mesh, step=np.rint(steps).astype(np.int64), **values)


def read_modes(folder: Path, *, counter: bool = False) -> tuple[dict[str, Any], Array, Array]:
    """Read the natural modes of a run from its results.

    Args:
        folder: Folder of the results; ``modes.h5`` is read.
        counter: Whether those of the counter-body are, from ``counter_modes.h5``.

    Returns:
        Points and cells by the names that `BodyFields` has for them, the m times, and at each of
        them displacements of the n points, shape (m, n, 3); the times are those of
        `macro.fields.write_shapes`.

    Raises:
        InputError: When a file is missing, damaged or cut short.
    """
    path = folder / ("counter_modes.h5" if counter else "modes.h5")
    mesh, times, values = _read_functions(path, {"mode": "mode"})
    return mesh, times, values["mode"]


_CELL_TYPES = {
    4: "Tetrahedron", 8: "Hexahedron", 10: "Tetrahedron_10", 20: "Hexahedron_20",
    27: "Hexahedron_27",
}  # fmt: skip
"""Names that XDMF has for cells, by their numbers of vertices."""


def _read_functions(
    path: Path, names: Mapping[str, str]
) -> tuple[dict[str, Any], Array, dict[str, Any]]:
    """Return mesh, times, and values at all times, by the names that those of the file have.

    dolfinx writes a function at a time as ``/Function/name/time``, with ``_`` for the point of the
    time, and the mesh into a group of ``/Mesh``.
    """
    with optional_packages():
        import h5py
    times, values = [0.0], dict[str, Any]()
    with located(str(path), unreadable="cannot be read"), h5py.File(path, "r") as file:
        (mesh,) = file["Mesh"].values()
        cells = mesh["topology"][()].astype(np.int64)
        for name, function in file["Function"].items():
            at = {float(time.replace("_", ".")): one[()] for time, one in function.items()}
            times = sorted(at)
            values[names[name]] = np.stack([_shaped(at[time]) for time in times])
        found = {"points_mm": mesh["geometry"][()], "cells": cells}
        return found | {"cell_type": _CELL_TYPES[cells.shape[1]]}, np.array(times), values


def _shaped(array: Array) -> Array:
    """Return rows as what they are: tensors of 9 components, vectors of 3, numbers."""
    if array.shape[1] == 9:
        return array.reshape(-1, 3, 3)
    return array[:, 0] if array.shape[1] == 1 else array
