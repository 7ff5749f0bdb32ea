"""From the pressures on cells to the response of the surface and its patches."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, Surface, overlaps, patch_means
from micro.half_space.contact_spots import true_area
from micro.half_space.state import HalfSpaceState

Array = NDArray[np.float64]

_ROUNDING = 1e-9
"""Of a cell: a centre that is no further beyond a border lies on it."""


def response_row(
    surface: Surface,
    state: HalfSpaceState,
    patches: Partition,
    mean_heights: Array,
    reference_height: float,
) -> dict[str, Any]:
    """Return the fields of a response at one approach: sums and means over patches.

    Pressure, area and displacement of a cell that straddles a border are shared by area; force and
    area outside of all patches count for the nearest. A contact counts for the patch that holds
    its largest pressure.

    Args:
        surface: The surface.
        state: The contact on its cells.
        patches: The N patches, within the surface's rectangle.
        mean_heights: Mean heights of the patches, shape (N,) [mm].
        reference_height: Height z_M that approaches count from [mm].
    """
    plane, contacts = state.plane, state.contacts
    displacement = patch_means(
        Surface(heights=state.displacement, lengths=surface.lengths), patches
    )
    separation = reference_height - plane.means(patches) - mean_heights + displacement
    borders = patches.borders_x, patches.borders_y
    x, y = map(overlaps, borders, surface.lengths, surface.grid)
    area = true_area(state.in_contact, periodic=state.periodic)
    forces = state.pressure * (surface.spacing[0] * surface.spacing[1])
    owner = patches.index_of(*_inside(contacts.peak, patches, surface.spacing).T)
    return {
        "approach": plane.approach,
        "force": state.force,
        "moment": plane.moment(surface.x[:, None], surface.y, forces),
        "contact_area": state.contact_area,
        "contacts": len(contacts),
        "mean_separation": np.average(separation, weights=patches.areas),
        "iterations": state.iterations,
        "residual": state.residual,
        "overlapping_contacts": 0,
        "patch_force": (x @ state.pressure @ y.T).ravel(),
        "patch_contact_area": (x @ area @ y.T).ravel(),
        "patch_contacts": np.bincount(owner, minlength=patches.count),
        "patch_displacement": displacement,
        "patch_separation": separation,
        "warning": "",
    }


def _inside(centres: Array, patches: Partition, spacing: tuple[float, float]) -> Array:
    """Move centres that lie beyond the outer borders by rounding alone onto these."""
    x, y = patches.borders_x, patches.borders_y
    nearest = np.clip(centres, (x[0], y[0]), (x[-1], y[-1]))
    beyond = np.abs(centres - nearest) > _ROUNDING * np.array(spacing)
    return np.where(beyond, centres, nearest)
