"""A rough surface pressed as a whole: rows of the laws of all its patches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import together
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from micro import MicroModel, Response, RigidPlane
from multiscale.laws.patch_law import PatchLaw
from multiscale.laws.plane_path import PlanePath
from multiscale.laws.refinement import law_of, refined

Array = NDArray[np.float64]
Displacements = Callable[[Array], Array]
"""From pressures of N patches at m load steps to their mean displacements, [MPa] to [mm]."""

_SHARE = 2
"""Rows that one rank solves together, each starting from the one before: however many ranks there
are, rows start from the same ones. On 64² to 256² cells it takes up to 7 % more iterations than 4,
which would leave most of the ranks idle beyond two."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeSurface:
    """A rough surface pressed as a whole by a rigid plane, seen patch by patch.

    A row is the contact problem at one approach, its plane tilted as given or free to turn. The
    closure of patch i is its local approach less what the macro model lets it sink by the mean
    pressures of all patches, c_i = s_i − (C p)_i. The macro model that the laws are for therefore
    finds every row again, whatever its partition or mesh.

    Args:
        model: Micro model of the whole surface, on the body.
        patches: Its partition.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        displacements: C p of the macro model, collective.
        tilt: Slopes of the plane; None lets it turn.
        comm: MPI communicator, whose ranks share the rows; None for this process alone.
    """

    model: MicroModel
    patches: PatchGrid
    mean_heights: Array
    displacements: Displacements
    tilt: tuple[float, float] | None = (0.0, 0.0)
    comm: Any = None
    _seen: dict[float, tuple[Response, RigidPlane]] = field(default_factory=dict, init=False)

    def rows(self, approaches: Array) -> Array:
        """Return rows of all patches at increasing approaches at the middle, shape (m, N, 7).

        The columns are approach, closure, pressure, area fraction, contacts, relief, and whether
        the model warns. The approach is the local one; a plane that turns may leave a patch while
        it comes nearer, and then it is that at the middle for all patches.

        Note:
            Collective.
        """
        solved = self._solved(approaches)
        self._seen.update(zip(map(float, approaches), solved, strict=True))
        pressure = np.array([response.patch_pressure[0] for response, _ in solved])
        sunk = self.displacements(pressure)
        local = np.array([plane.means(self.patches) for _, plane in solved])
        along = (
            local if self.tilt is not None else np.broadcast_to(approaches[:, None], local.shape)
        )
        touched = pressure > 0.0
        area, contacts, displacement = (
            np.array([getattr(response, name)[0] for response, _ in solved])
            for name in ("patch_contact_area", "patch_contacts", "patch_displacement")
        )
        warned = np.array([response.warning[0] != "" for response, _ in solved])
        columns = (
            along,
            local - sunk,
            pressure,
            np.where(touched, area / self.patches.area, 0.0),
            np.where(touched, contacts, 0),
            displacement - sunk,
            np.broadcast_to(warned[:, None], pressure.shape),
        )
        return np.stack(columns, axis=2).astype(np.float64)

    @property
    def path(self) -> PlanePath:
        """The planes of all rows so far."""
        seen = [self._seen[approach] for approach in sorted(self._seen)]
        return PlanePath(
            approach=np.array([plane.approach for _, plane in seen]),
            tilt=np.array([plane.tilt for _, plane in seen]),
            force=np.array([response.force[0] for response, _ in seen]),
            moment=np.array([response.moment[0] for response, _ in seen]),
        )

    def _solved(self, approaches: Array) -> list[tuple[Response, RigidPlane]]:
        """Solve the contact problem at all approaches, shared by the ranks."""
        parts = [approaches[k : k + _SHARE] for k in range(0, len(approaches), _SHARE)]
        rank, size = (0, 1) if self.comm is None else (self.comm.rank, self.comm.size)
        before = -(-len(self._seen) // _SHARE)  # parts of earlier calls: the next rank goes on
        own = parts[(rank - before) % size :: size]
        mine = together(self.comm, lambda: [self._along(part) for part in own])
        if size == 1:
            return [row for part in mine for row in part]
        gathered = self.comm.allgather(mine)
        return [row for k in range(len(parts)) for row in gathered[(k + before) % size][k // size]]

    def _along(self, approaches: Array) -> list[tuple[Response, RigidPlane]]:
        found, start = [], None
        for approach in approaches:
            response, plane, start = self.model.press(
                Control(approach=float(approach), tilt=self.tilt),
                patches=self.patches,
                mean_heights=self.mean_heights,
                start=start,
            )
            found.append((response, plane))
        return found

    def laws(self, rows: Array) -> list[PatchLaw]:
        """Return the laws of all patches through rows (m, N, 7), the plane coming nearer."""
        reaches = self.model.reference_height - self.mean_heights
        return [_law(rows[:, index], float(reach)) for index, reach in enumerate(reaches)]

    def tabulated(
        self,
        first_touch: float,
        approach_end: float,
        *,
        compliance: Array,
        tolerance: float,
        most_rows: int,
    ) -> tuple[list[PatchLaw], float]:
        """Return all laws up to an approach, and the error of the force between rows.

        Args:
            first_touch: Approach at the middle at first contact [mm].
            approach_end: Largest approach at the middle [mm].
            compliance: Of the patches, roughly that of the macro model, shape (N, N) [mm/MPa].
            tolerance: Interpolation error of the force, see `refinement.refined`.
            most_rows: Rows that are solved at most.

        Note:
            Collective.
        """
        if approach_end <= first_touch:
            return self.laws(self.rows(np.array([approach_end]))), 0.0
        return refined(
            self.rows,
            self.laws,
            first_touch,
            approach_end,
            compliance=compliance,
            tolerance=tolerance,
            most_rows=most_rows,
        )


def _law(rows: Array, reach: float) -> PatchLaw:
    """Return the law of one patch out of all rows (m, 7), those before its touch included.

    Where contacts join, a block may begin to sag so much that a patch falls behind a plane that
    comes nearer: rows that do not get beyond those before them are left out.
    """
    plane_at_largest_load = np.maximum.accumulate(rows[:, 0])
    rows = rows[np.append(True, rows[1:, 0] > plane_at_largest_load[:-1])]
    loaded = np.flatnonzero(rows[:, 2] > 0.0)
    if not loaded.size:
        return law_of(rows[:0], float(rows[:, 1].max()), reach)
    first = max(int(loaded[0]), 1)
    start = _touch(rows[first - 1 :])
    return law_of(np.vstack((start, rows[first:])), float(start[1]), reach)


def _touch(rows: Array) -> Array:
    """Return the row of first touch, between an open row and the first one in contact.

    The straight line of p^(2/3) through the first two rows in contact tells the approach (Hertz'
    law); closure and relief are taken between the open row and the first in contact.
    """
    before, after = rows[:2]
    share = 0.0
    if len(rows) > 2 and rows[2, 2] > after[2]:
        root, later = rows[1:3, 2] ** (2 / 3)
        back = root / (later - root) * (rows[2, 0] - after[0])
        share = np.clip(1.0 - back / (after[0] - before[0]), 0.0, 0.99)
    start = before + share * (after - before)
    start[2:5], start[6] = 0.0, before[6]
    return np.asarray(start)
