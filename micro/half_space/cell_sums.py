"""The contact that a solution on cells is: its spots, its fields, and its sums over patches.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from geometry import Partition, Surface, overlaps, patch_means
from geometry.contact_state import ContactState
from geometry.rigid_plane import RigidPlane
from micro.half_space.contact_spots import find_spots
from support.arrays import Array, Flags


class CellSolution(NamedTuple):
    """A solution of the contact problem of a plane and the cells of a surface.

    Attributes:
        plane: The rigid plane.
        pressure: Contact pressures, shape (nx, ny) [MPa].
        displacement: Displacements of the surface, shape (nx, ny) [mm].
        gap: Gaps, negative where cells bear the hardness, shape (nx, ny) [mm].
        yielding: Which cells bear it, shape (nx, ny).
        earlier_depth: Plastic depth that earlier loads left in the cells, shape (nx, ny) [mm].
        residual: Largest violation of the contact conditions, over the largest interference.
        iterations: Products of the compliance with pressures.
    """

    plane: RigidPlane
    pressure: Array
    displacement: Array
    gap: Array
    yielding: Flags
    earlier_depth: Array | None
    residual: float
    iterations: int

    @property
    def plastic_depth(self) -> Array:
        """Plastic depth that the load has left in the cells, shape (nx, ny) [mm]."""
        return np.where(self.yielding, np.maximum(-self.gap, 0.0), 0.0)


def contact_state(
    solution: CellSolution,
    surface: Surface,
    patches: Partition,
    depths: Array,
    *,
    periodic: bool,
    hardness: float | None,
) -> ContactState:
    """Return the contact of a solution, with sums and means over patches.

    Args:
        solution: The solution.
        surface: The surface.
        patches: The N patches, within the surface's rectangle.
        depths: Mean depths of the patches below the height that the approach counts from, (N,)
            [mm].
        periodic: Whether contacts continue over the borders.
        hardness: Largest pressure [MPa]; None where contacts are elastic.
    """
    plane, pressure, moved, gap = solution[:4]
    cell = surface.spacing[0] * surface.spacing[1]

    def means(field: Array) -> Array:
        return patch_means(Surface(heights=field, lengths=surface.lengths), patches)

    displacement, depth, work = means(moved), None, 0.0
    separation = depths - plane.means(patches) + displacement
    if hardness is not None:
        anew, earlier = solution.plastic_depth, solution.earlier_depth
        depth, gap = anew if earlier is None else earlier + anew, gap + anew
        separation += means(depth)
        work = hardness * float(depth.sum()) * cell
    spots, share = find_spots(pressure, surface.spacing, periodic=periodic, hardness=hardness)
    borders = patches.borders_x, patches.borders_y
    along_x, along_y = map(overlaps, borders, surface.lengths, surface.grid)
    return ContactState(
        plane=plane,
        patches=patches,
        force=float(pressure.sum()) * cell,
        moment=plane.moment(surface.x[:, None], surface.y, pressure * cell),
        contact_area=float(spots.area.sum()),
        contacts=len(spots),
        peak_pressure=float(pressure.max()),
        mean_separation=float(np.average(separation, weights=patches.areas)),
        iterations=solution.iterations,
        residual=solution.residual,
        patch_force=(along_x @ pressure @ along_y.T).ravel(),
        patch_area=(along_x @ share @ along_y.T).ravel(),
        patch_contacts=spots.per_patch(patches),
        patch_displacement=displacement,
        patch_separation=separation,
        spots=spots,
        x=surface.x,
        y=surface.y,
        pressure=pressure,
        gap=gap,
        displacement=moved,
        yielding=solution.yielding,
        plastic_depth=depth,
        earlier_depth=solution.earlier_depth,
        elastic_energy=0.5 * float(np.vdot(pressure, moved)) * cell,
        plastic_work=work,
    )
