"""A rough surface pressed as a whole: rows of the laws of all its patches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from micro import Field, MicroModel, Response, RigidPlane
from multiscale.coupling import tilted_approaches
from multiscale.law_tables.refinement import law_of, refined
from multiscale.law_tables.spread import ContactSpread, Sinking, divides
from multiscale.laws import PatchLaw

Array = NDArray[np.float64]

_BENT = 0.3  # of the approach: more bending is left to the load steps
_TOUCH = 1e-3  # first touch under a tilt, relative to what the tilt adds to the approach


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeSurface:
    """A rough surface pressed as a whole by a rigid plane, seen patch by patch.

    The closure of a patch is its local approach less the mean displacement of the patch by the mean
    pressures of all patches, c_i = s_i − Σ_j Λ_ij p_j / (π E*): what a block answers with. What a
    patch sinks beyond that (`PatchLaw.relief`) is told from its first touch on; before, by that
    there. Laws made under a tilt know how it shares the load, and laws made on a block how it
    bends: the surface is then pressed a second time, by a plane that sags as the block does under
    the forces found first. What it sinks in the mean is left out, as a plane that comes less near.

    Attributes:
        model: Micro model of the whole surface.
        patches: Its partition.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        compliance: Λ / (π E*), shape (N, N) [mm/MPa].
        tilt: Slopes of the plane.
        sinking: What the block sinks more than the half-space; None on a half-space.
    """

    model: MicroModel
    patches: PatchGrid
    mean_heights: Array
    compliance: Array
    tilt: tuple[float, float] = (0.0, 0.0)
    sinking: Sinking | None = None

    @cached_property
    def lean(self) -> Array:
        """Local approach of every patch over that at the middle, shape (N,) [mm]."""
        return tilted_approaches(self.patches, 0.0, self.tilt)

    @cached_property
    def first_touch(self) -> float:
        """Approach at the middle at first contact under the tilt [mm]."""
        if self.tilt == (0.0, 0.0):
            return self.model.first_touch
        reach = 0.5 * float(np.abs(self.tilt) @ np.asarray(self.patches.lengths))
        below = self.model.first_touch - reach
        return below + _first_loaded(lambda way: self._force(below + way), 2.0 * reach)

    def rows(self, approaches: Array) -> Array:
        """Return rows of all patches at increasing approaches of the first, shape (m, N, 7).

        The columns are local approach, closure, pressure, area fraction, contacts, relief, and
        whether the model warns.
        """
        middle = approaches - self.lean[0]
        response = self.model.respond(
            middle, patches=self.patches, mean_heights=self.mean_heights, tilt=self.tilt
        )
        return self._rows(middle, middle[:, None] + self.lean, response)

    def _rows(self, middle: Array, local: Array, response: Response) -> Array:
        pressure = response.patch_pressure.copy()
        pressure[middle <= self.first_touch] = 0.0  # whatever round-off makes of it
        displacement = pressure @ self.compliance
        touched = pressure > 0.0
        columns = (
            local,
            local - displacement,
            pressure,
            np.where(touched, response.patch_contact_area / self.patches.area, 0.0),
            np.where(touched, response.patch_contacts, 0),
            response.patch_displacement - displacement,
            np.broadcast_to((response.warning != "")[:, None], pressure.shape),
        )
        return np.stack(columns, axis=2).astype(np.float64)

    def rows_on(self, block: Sinking, approaches: Array) -> tuple[Array, Array]:
        """Return rows on a block that bends, and the forces on its rectangles, shape (m, M)."""
        middle = approaches - self.lean[0]
        nowhere: Array = np.zeros(block.loads.count)
        responses, locals_, forces, start = [], [], [], None
        for approach in middle:
            plane = RigidPlane(approach=approach, tilt=self.tilt, centre=self._middle)
            first, start = self.model.press(
                plane, patches=block.loads, mean_heights=nowhere, start=start
            )
            plane = replace(plane, sag=self._bending(block, first.patch_force[0], approach))
            found, start = self.model.press(
                plane, patches=self.patches, mean_heights=self.mean_heights, start=start
            )
            responses.append(found)
            locals_.append(plane.means(self.patches))
            forces.append(first.patch_force[0])
        local = np.array(locals_)
        rows = [
            self._rows(middle[[k]], local[[k]], response) for k, response in enumerate(responses)
        ]
        return np.concatenate(rows), np.array(forces)

    def _bending(self, block: Sinking, forces: Array, approach: float) -> Field | None:
        """Return what the block sinks but for its mean under the forces, within limits."""
        total = float(forces.sum())
        if total <= 0.0:
            return None
        sag = block.sag(forces)
        sunk = sag(*block.loads.centres.T)
        mean = float(sunk @ forces) / total
        furthest = _BENT * (approach - self.first_touch + float(np.abs(self.lean).max()))
        bent = float(np.abs(sunk - mean).max())
        share = min(1.0, furthest / bent) if bent else 1.0
        return lambda x, y: share * (sag(x, y) - mean)

    def _reserve(self, approach: float) -> float:
        """Return how much further laws must go where the block bends, twice what it does [mm].

        Patches that sag end at smaller local approaches; a step's own forces bend it once more.
        """
        if self.sinking is None:
            return 0.0
        plane = RigidPlane(approach=approach, tilt=self.tilt, centre=self._middle)
        loads = self.sinking.loads
        found = self.model.press(plane, patches=loads, mean_heights=np.zeros(loads.count))
        sag = self._bending(self.sinking, found.response.patch_force[0], approach)
        return 0.0 if sag is None else 2.0 * float(np.abs(sag(*loads.centres.T)).max())

    @property
    def _middle(self) -> tuple[float, float]:
        x, y = self.patches.middle
        return float(x), float(y)

    def laws(self, rows: Array) -> list[PatchLaw]:
        """Return the laws of all patches through rows (m, N, 7), the plane coming nearer."""
        reaches = self.model.datum - self.mean_heights
        return [_law(rows[:, index], float(reach)) for index, reach in enumerate(reaches)]

    def tabulated(
        self, approach_end: float, tolerance: float, most_rows: int
    ) -> tuple[list[PatchLaw], float, ContactSpread | None]:
        """Return all laws up to an approach, the error of the force, and where the contacts are."""
        seen: list[tuple[Array, Array, Array]] = []

        def solve(approaches: Array) -> Array:
            if self.sinking is None:
                return self.rows(approaches)
            rows, forces = self.rows_on(self.sinking, approaches)
            seen.append((approaches, rows[:, :, 0], forces))
            return rows

        if approach_end <= self.first_touch:
            laws, error = self.laws(solve(np.array([approach_end]) + self.lean[0])), 0.0
        else:
            laws, error = refined(
                solve,
                self.laws,
                self.first_touch + self.lean[0],
                approach_end + self._reserve(approach_end) + self.lean[0],
                compliance=self.compliance,
                tolerance=tolerance,
                most_rows=most_rows,
            )
        return laws, error, self._spread(seen)

    def _spread(self, seen: list[tuple[Array, Array, Array]]) -> ContactSpread | None:
        if self.sinking is None or not divides(self.sinking.loads, self.patches):
            return None
        asked, local, forces = (np.concatenate(parts) for parts in zip(*seen, strict=True))
        order = np.argsort(asked, kind="stable")
        loads = self.sinking.loads
        return ContactSpread(
            patches=self.patches,
            loads=loads,
            approach=np.maximum.accumulate(local[order], axis=0),  # see `_law`
            forces=forces[order],
            correction=np.divide(self.sinking.patch_compliance(loads), loads.areas),
        )

    def _force(self, approach: float) -> float:
        response = self.model.respond(
            [approach], patches=self.patches, mean_heights=self.mean_heights, tilt=self.tilt
        )
        return float(response.force[0])


def _first_loaded(force: Callable[[float], float], way: float) -> float:
    """Return the way on which a force appears, to a thousandth below."""
    low, high = 0.0, way
    while high - low > _TOUCH * way:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if force(middle) <= 0.0 else (low, middle)
    return low


def _law(rows: Array, reach: float) -> PatchLaw:
    """Return the law of one patch out of all rows (m, 7), those before its touch included.

    Where contacts join, a block may begin to sag so much that a patch falls behind a plane that
    comes nearer: rows that do not get beyond those before them are left out.
    """
    furthest = np.maximum.accumulate(rows[:, 0])
    rows = rows[np.append(True, rows[1:, 0] > furthest[:-1])]
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
