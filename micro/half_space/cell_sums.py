"""The contact on cells as a whole: its spots, its energies, and its sums over patches.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geometry import Surface, overlaps
from geometry.contact_state import ContactState
from geometry.patches import field_means
from micro.half_space.contact_spots import find_spots
from support.arrays import Array


def summed(
    state: ContactState,
    surface: Surface,
    depths: Array,
    *,
    periodic: bool,
    hardness: Array | float | None,
) -> ContactState:
    """Return a contact with all that follows from its plane and its fields.

    Args:
        state: The contact, with pressures, displacements and gaps of all cells; where cells yield,
            these are negative by the plastic depth that the load leaves.
        surface: The surface.
        depths: Mean depths of the patches below the height that the approach counts from, (N,)
            [mm].
        periodic: Whether contacts continue over the borders.
        hardness: Largest pressure of the cells [MPa], shape (nx, ny) or a number; None
            where contacts are elastic.
    """
    plane, patches, pressure = state.plane, state.patches, state.pressures
    moved, gap, yielding = state.displacement, state.gap, state.yielding
    assert moved is not None and gap is not None and yielding is not None
    cell = surface.spacing[0] * surface.spacing[1]

    def means(field: Array) -> Array:
        return field_means(field, surface.lengths, patches)

    displacement, depth, work = means(moved), None, 0.0
    separation = depths - plane.means(patches) + displacement
    if hardness is not None:
        anew = np.where(yielding, np.maximum(-gap, 0.0), 0.0)
        depth = anew if state.earlier_depth is None else state.earlier_depth + anew
        gap = gap + anew
        separation += means(depth)
        left = depth > 0.0
        spent = np.multiply(hardness, depth, out=np.zeros_like(depth), where=left)
        work = float(spent.sum()) * cell
    spots, share = find_spots(pressure, surface.spacing, periodic=periodic, hardness=hardness)
    along_x, along_y = overlaps(patches, surface.lengths, surface.grid)
    return replace(
        state,
        moment=plane.moment(surface.x[:, None], surface.y, pressure * cell),
        contact_area=float(spots.area.sum()),
        contacts=len(spots),
        peak_pressure=float(pressure.max()),
        mean_separation=float(np.average(separation, weights=patches.areas)),
        patch_force=(along_x @ pressure @ along_y.T).ravel(),
        patch_area=(along_x @ share @ along_y.T).ravel(),
        patch_contacts=spots.per_patch(patches),
        patch_displacement=displacement,
        patch_separation=separation,
        spots=spots,
        gap=gap,
        plastic_depth=depth,
        elastic_energy=0.5 * float(np.vdot(pressure, moved)) * cell,
        plastic_work=work,
    )
