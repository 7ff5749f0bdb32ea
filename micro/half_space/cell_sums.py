"""The contact that a solution on cells is: its spots, its fields, and its sums over patches.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, Surface, overlaps, patch_means
from geometry.contact_state import ContactState
from geometry.rigid_plane import RigidPlane
from micro.half_space.contact_spots import find_spots

if TYPE_CHECKING:
    from micro.half_space.model import HalfSpaceModel

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class CellSolution(NamedTuple):
    """Pressures of the cells and the plane that makes them.

    Attributes:
        plane: The rigid plane.
        pressure: Contact pressures, shape (nx, ny) [MPa].
        yielding: Which cells bear the hardness, shape (nx, ny).
        force: Normal force [N].
        residual: Largest violation of the contact conditions, over the largest interference.
        iterations: Products of the compliance with pressures.
    """

    plane: RigidPlane
    pressure: Array
    yielding: Flags
    force: float
    residual: float
    iterations: int


def contact_state(
    model: HalfSpaceModel,
    solution: CellSolution,
    earlier_depth: Array | None,
    patches: Partition,
    mean_heights: Array,
) -> ContactState:
    """Return the contact of a solution, with sums and means over patches.

    Args:
        model: The model.
        solution: Its solution.
        earlier_depth: Plastic depth that earlier loads left in the cells, shape (nx, ny) [mm].
        patches: The N patches, within the surface's rectangle.
        mean_heights: Mean heights of the patches, shape (N,) [mm].
    """
    plane, pressure, surface = solution.plane, solution.pressure, model.surface
    cell = surface.spacing[0] * surface.spacing[1]
    moved = model.displacement(pressure)
    depth, gap = None, moved - model.interference(plane, earlier_depth)
    displacement = patch_means(Surface(heights=moved, lengths=surface.lengths), patches)
    separation = model.reference_height - plane.means(patches) - mean_heights + displacement
    plastic_work = 0.0
    if model.hardness is not None:
        anew = np.where(solution.yielding, np.maximum(-gap, 0.0), 0.0)
        depth = anew if earlier_depth is None else earlier_depth + anew
        gap = gap + anew
        separation += patch_means(Surface(heights=depth, lengths=surface.lengths), patches)
        plastic_work = model.hardness * float(depth.sum()) * cell
    spots, share = find_spots(
        pressure, surface.spacing, periodic=model.periodic, hardness=model.hardness
    )
    borders = patches.borders_x, patches.borders_y
    along_x, along_y = map(overlaps, borders, surface.lengths, surface.grid)
    return ContactState(
        plane=plane,
        patches=patches,
        force=solution.force,
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
        earlier_depth=earlier_depth,
        elastic_energy=0.5 * float(np.vdot(pressure, moved)) * cell,
        plastic_work=plastic_work,
    )
