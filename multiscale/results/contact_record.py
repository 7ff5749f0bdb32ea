"""The contact at one load step: a row for every spot, and maps of pressure and gap."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry.contact_state import ContactState
from patchlaw.multiscale.figures import by_matplotlib
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import column, measured, number
from patchlaw.support.arrays import Array
from patchlaw.support.displayed import Displayed, Table, of_columns

SPOT_COLUMNS = ("x_mm", "y_mm", "area_mm2", "force_N", "peak_pressure_MPa")
"""Columns of ``contacts.csv`` behind the load step and the number of the spot."""

FIELDS = (
    "x_mm", "y_mm", "pressure_MPa", "gap_mm", "plastic_depth_mm",
    "traction_MPa", "slip_mm", "slipping",
)  # fmt: skip
"""Datasets of a load step in ``contact.h5``; plastic depth under a hardness alone, what follows it
with friction."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ContactRecord(Displayed):
    """The contact of all m spots at one load step, the largest force first.

    Attributes:
        step: Number of the load step.
        approach_mm: Approach of the plane [mm].
        force_N: Force of all spots [N].
        unloading: Whether the load fell to this load step.
        lengths_mm: Sides of the surface [mm].
        spots: A row for each spot, see `SPOT_COLUMNS`: the place of its largest pressure, its real
            contact area, its force and that pressure, shape (m, 5).
        x_mm: Abscissae of the nx × ny cells, shape (nx,), or of the n nodes of a reference, shape
            (n,) [mm]; None where only the spots are known.
        y_mm: Their ordinates, shape (ny,) or (n,) [mm].
        pressure_MPa: Contact pressures, shape (nx, ny) or (n,) [MPa].
        gap_mm: Gaps between the plane and the deformed surface, shape (nx, ny) or (n,) [mm].
        plastic_depth_mm: Plastic depth that the loads so far left, by which the heights are lower,
            shape (nx, ny) [mm]; None without a hardness.
        traction_MPa: Tractions along x and y, shape (2, nx, ny) [MPa]; None without friction, as
            the next two.
        slip_mm: Slip of the cells in contact since they touched, shape (2, nx, ny) [mm].
        slipping: Which cells in contact bear the traction μ p, shape (nx, ny).
    """

    step: int
    approach_mm: float
    force_N: float
    lengths_mm: tuple[float, float]
    spots: Array
    x_mm: Array | None = None
    y_mm: Array | None = None
    pressure_MPa: Array | None = None
    gap_mm: Array | None = None
    plastic_depth_mm: Array | None = None
    traction_MPa: Array | None = None
    slip_mm: Array | None = None
    slipping: NDArray[np.bool_] | None = None
    unloading: bool = False

    @classmethod
    def of(
        cls,
        state: ContactState,
        step: LoadStep,
        lengths: tuple[float, float],
        *,
        unloading: bool = False,
    ) -> ContactRecord:
        """Return the record of a load step.

        Args:
            state: The contact, with its spots.
            step: The load step.
            lengths: Sides of the surface [mm].
            unloading: Whether the load fell to it.
        """
        assert state.spots is not None
        shear = state.shear
        columns = (
            state.spots.place.T,
            (
                state.spots.area,
                state.spots.force,
                state.spots.peak_pressure,
            ),
        )
        spots = np.concatenate(columns).T
        order = np.lexsort((spots[:, 1], spots[:, 0], -spots[:, 3]))
        return cls(
            step=step.step,
            approach_mm=step.approach_mm,
            force_N=float(state.spots.force.sum()),
            lengths_mm=(float(lengths[0]), float(lengths[1])),
            spots=np.ascontiguousarray(spots[order]),
            x_mm=state.x,
            y_mm=state.y,
            pressure_MPa=state.pressure,
            gap_mm=state.gap,
            plastic_depth_mm=state.plastic_depth,
            traction_MPa=None if shear is None else shear.traction,
            slip_mm=None if shear is None else shear.slip,
            slipping=None if shear is None else shear.slipping,
            unloading=unloading,
        )

    @property
    def place_mm(self) -> Array:
        """Place of the largest pressure of each spot, shape (m, 2) [mm]."""
        return self.spots[:, :2]

    @property
    def area_mm2(self) -> Array:
        """Real contact area of each spot, shape (m,) [mm²]."""
        return self.spots[:, 2]

    @property
    def spot_force_N(self) -> Array:
        """Force of each spot, shape (m,) [N]."""
        return self.spots[:, 3]

    @property
    def peak_pressure_MPa(self) -> Array:
        """Largest pressure of each spot, shape (m,) [MPa]."""
        return self.spots[:, 4]

    def rows(self) -> Iterator[tuple]:
        """Yield the rows of ``contacts.csv``."""
        for place, spot in enumerate(self.spots.tolist(), 1):
            yield (self.step, place, *spot)

    def displayed(self) -> tuple[str, Table]:
        """Return what this is in a line, and a table of the spots that carry most."""
        count, most = len(self.spots), self.spots[:20]
        line = (
            f"ContactRecord of load step {self.step}: {count} spot{'s' * (count != 1)} at "
            f"{measured(self.approach_mm, None, 'mm')}, {measured(self.force_N, None, 'N')}"
            f"{f'; the {len(most)} that carry most' if len(most) < count else ''}"
        )
        x, y, area, force, peak = most.T
        return line, of_columns(
            ["spot", *map(str, range(1, len(most) + 1))],
            ["x [mm]", *(number(one, 4) for one in x)],
            ["y [mm]", *(number(one, 4) for one in y)],
            column("area", area, "mm²"),
            column("force", force, "N"),
            column("peak pressure", peak, "MPa"),
        )

    def plot(self) -> Any:
        """Draw pressures, gaps, plastic depths and the sizes of the spots.

        Returns:
            A matplotlib figure; a notebook shows it.
        """
        return by_matplotlib("figures.contact.contact_figure", self)
