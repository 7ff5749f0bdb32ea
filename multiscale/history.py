"""The record of a run: one row per load step, one per patch and load step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid

if TYPE_CHECKING:  # which itself is made of load steps
    from multiscale.reference.record import ReferenceRecord

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
)
PATCH_COLUMNS = ("step", "ix", "iy", "closure_mm", "pressure_MPa", "contact_area_fraction")


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchState:
    """What every patch carries at one load step.

    Attributes:
        closure_mm: Mean closure of each patch, shape (N,) [mm].
        pressure_MPa: Mean pressure on each patch, shape (N,) [MPa].
        contact_area_fraction: Real over nominal contact area of each patch, shape (N,).
    """

    closure_mm: Array
    pressure_MPa: Array
    contact_area_fraction: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadStep:
    """One accepted load step; the fields up to `reason` are columns of ``history.csv``.

    Attributes:
        step: Number of the step, from 1.
        approach_mm: Approach of the rigid plane from first touch [mm].
        force_N: Normal force on the plane [N].
        mean_pressure_MPa: Force over nominal contact area [MPa].
        contact_area_fraction: Real over nominal contact area.
        mean_separation_mm: Mean gap between the plane and the deformed surface [mm].
        contacts: Number of asperities in contact.
        newton_iterations: Newton steps spent, on halved steps too; without laws the iterations of
            the micro model (analytic) or its presses (concurrent).
        linear_iterations: Iterations of the linear solver spent.
        wall_s: Wall time of the step [s].
        reason: Name of the reason for which the iteration stopped.
        patches: The state of every patch.
        imbalance: Force on the plane minus reaction of the support, relative to the force; None
            where no support takes part.
        residuals: Norms of the residual over the Newton steps, relative to the interface load.
        tilt: Slopes (tx, ty) of the approach about the middle of the interface [mm/mm].
        moment_N_mm: First moments (Σ P (x − xc), Σ P (y − yc)) of the forces about the middle
            [N mm].
        warnings: Why the micro model, where it was solved itself, is outside its range of
            validity; empty within it.
        meshes: Approach [mm], force [N] and contact area fraction on every mesh of a reference,
            the finest, which the step is of, last; empty with other couplings.
    """

    step: int
    approach_mm: float
    force_N: float
    mean_pressure_MPa: float
    contact_area_fraction: float
    mean_separation_mm: float
    contacts: int
    newton_iterations: int
    linear_iterations: int
    wall_s: float
    reason: str
    patches: PatchState
    imbalance: float | None = None
    residuals: tuple[float, ...] = ()
    tilt: tuple[float, float] = (0.0, 0.0)
    moment_N_mm: tuple[float, float] = (0.0, 0.0)
    warnings: tuple[str, ...] = ()
    meshes: tuple[tuple[float, float, float], ...] = ()

    @property
    def tilt_x(self) -> float:
        """Slope of the approach along x."""
        return self.tilt[0]

    @property
    def tilt_y(self) -> float:
        """Slope of the approach along y."""
        return self.tilt[1]

    @property
    def moment_x_N_mm(self) -> float:
        """First moment of the forces along x [N mm]."""
        return self.moment_N_mm[0]

    @property
    def moment_y_N_mm(self) -> float:
        """First moment of the forces along y [N mm]."""
        return self.moment_N_mm[1]


@dataclass(frozen=True, kw_only=True)
class History:
    """All load steps of a run; every column of ``history.csv`` is an attribute, as an array.

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
        return np.array([getattr(step, name) for step in self.steps])

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
