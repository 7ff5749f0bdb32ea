"""The record of a run: one row per load step, one per patch and load step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from multiscale.loading.load_step import LoadStep
from multiscale.results.reference_record import ReferenceRecord

Array = NDArray[np.float64]

COLUMNS = (
    "step",
    "approach_mm",
    "force_N",
    "mean_pressure_MPa",
    "contact_area_fraction",
    "mean_separation_mm",
    "contacts",
    "newton_iterations",
    "linear_iterations",
    "wall_s",
    "reason",
    "tilt_x",
    "tilt_y",
    "moment_x_N_mm",
    "moment_y_N_mm",
    "force_error_N",
    "approach_error_mm",
)
PATCH_COLUMNS = ("step", "ix", "iy", "closure_mm", "pressure_MPa", "contact_area_fraction")


@dataclass(frozen=True, kw_only=True)
class History:
    """All load steps of a run; every column of ``history.csv`` is an attribute, as an array.

    What was not measured is NaN there.

    Attributes:
        steps: The load steps.
        patches: The partition of the interface.
        seconds: Wall time of each phase of the run [s].
        notes: What the run has to say about its own approximations.
        reference: What the meshes of a reference say together; None with other couplings.
    """

    steps: tuple[LoadStep, ...]
    patches: PatchGrid
    seconds: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    reference: ReferenceRecord | None = None

    def __len__(self) -> int:
        return len(self.steps)

    def __iter__(self) -> Iterator[LoadStep]:
        return iter(self.steps)

    def __getattr__(self, name: str) -> NDArray:
        if name not in COLUMNS:
            raise AttributeError(
                f"a history has no column {name!r} (columns: {', '.join(COLUMNS)})"
            )
        values = [getattr(step, name) for step in self.steps]
        return np.array([np.nan if value is None else value for value in values])

    @property
    def patch_pressure_MPa(self) -> Array:
        """Mean pressure of each patch at each step, shape (steps, N) [MPa]."""
        return np.array([step.patches.pressure_MPa for step in self.steps])

    @property
    def closure_mm(self) -> Array:
        """Mean closure of each patch at each step, shape (steps, N) [mm]."""
        return np.array([step.patches.closure_mm for step in self.steps])

    def rows(self) -> Iterator[tuple]:
        """Yield the rows of ``history.csv``."""
        for step in self.steps:
            yield tuple(getattr(step, name) for name in COLUMNS)

    def records(self) -> list[dict[str, Any]]:
        """Return the rows of ``history.csv`` by column, as data frames take them."""
        return [dict(zip(COLUMNS, row, strict=True)) for row in self.rows()]

    def patch_records(self) -> list[dict[str, Any]]:
        """Return the rows of ``patches.csv`` by column, as data frames take them."""
        return [dict(zip(PATCH_COLUMNS, row, strict=True)) for row in self.patch_rows()]

    def patch_rows(self) -> Iterator[tuple]:
        """Yield the rows of ``patches.csv``."""
        for step in self.steps:
            state = step.patches
            values = zip(
                state.closure_mm, state.pressure_MPa, state.contact_area_fraction, strict=True
            )
            for index, (closure, pressure, area) in enumerate(values):
                yield (step.step, *self.patches.unravel(index), closure, pressure, area)
