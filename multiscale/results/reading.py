"""Reads the history of a run back from its folder of results."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from geometry.patches import PatchGrid, Regions
from multiscale.loading.leak import leaks_of
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.removed import refuse_removed_results
from multiscale.results.history import PATCH_COLUMNS, PATCH_STIFFNESS, History
from support.errors import InputError

_TEXT = "reason"
_COUNTS = {one.name for one in fields(LoadStep) if str(one.type).startswith("int")}


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
        states = _patch_states(patch_rows, patches.count)
        steps = tuple(_load_step(row, state) for row, state in zip(rows, states, strict=True))
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
        provenance = json.loads(path.read_text(encoding="utf-8"))
        refuse_removed_results(provenance["scene_given"])
        yield provenance
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
        InputError: When it cannot be read.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=str(path)) from None


def _load_step(row: dict[str, str], patches: PatchState) -> LoadStep:
    """Return a load step of its row."""
    values: dict[str, Any] = {
        name: text if name == _TEXT else _number(name, text) for name, text in row.items()
    }
    values["tilt"] = (values["tilt_x"], values["tilt_y"])
    values["moment_N_mm"] = (values["moment_x_N_mm"], values["moment_y_N_mm"])
    if values.get("first_touch_approach_mm") is not None:
        values["zero_mm"] = values["first_touch_approach_mm"] - values["approach_mm"]
    values["leaks"] = leaks_of(values)
    known = {item.name for item in fields(LoadStep)}
    return LoadStep(patches=patches, **{key: values[key] for key in values.keys() & known})


def _number(name: str, text: str) -> float | int | None:
    if not text:
        return None
    return int(text) if name in _COUNTS else float(text)


def _patch_states(rows: list[dict[str, str]], count: int) -> list[PatchState]:
    """Return the states of all patches, at one load step after another."""
    names = [
        *PATCH_COLUMNS[3:],
        *([PATCH_STIFFNESS] if rows and PATCH_STIFFNESS in rows[0] else []),
    ]
    columns = {name: np.array([float(row[name]) for row in rows]) for name in names}
    tables = {name: column.reshape(-1, count) for name, column in columns.items()}
    steps = len(rows) // count
    return [PatchState(**{name: tables[name][k] for name in tables}) for k in range(steps)]
