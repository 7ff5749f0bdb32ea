"""The contact on cells as a whole: its connected spots and its sums over patches.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface, overlaps
from patchlaw.geometry.contact_state import Spots, peaks_of
from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_rows

Labels = NDArray[np.integer]

EDGE_EXCESS = (np.pi - 1.0 + np.log(2.0)) / 24.0
"""Area, in cells, by which an edge of the counted contact makes it too large on average."""


def find_spots(
    pressure: Array,
    spacing: tuple[float, float],
    *,
    periodic: bool,
    hardness: Array | float | None = None,
) -> tuple[Spots, Array]:
    """Find the contacts of a map of pressures, connected over the edges of its cells.

    Args:
        pressure: Pressures ≥ 0, shape (nx, ny) [MPa].
        spacing: Sides of a cell [mm].
        periodic: Whether contacts continue over the borders.
        hardness: Largest pressure that the cells can bear [MPa], shape (nx, ny) or a number; none
            when not given. The load of a cell needs p/H of its area at least, so that cells that
            yield are in contact whole.

    Returns:
        The spots, their areas corrected by the perimeter; and the part of every cell that is in
        contact, likewise, shape (nx, ny).
    """
    contact = pressure > 0.0
    labels, count = scipy.ndimage.label(contact)
    cells = np.flatnonzero(contact)
    which, load = labels.take(cells) - 1, pressure.take(cells)
    if periodic and count:
        name, count = _joined(labels, count)
        which = name[which]
    cell = np.float64(spacing[0] * spacing[1])
    share = true_area(contact, periodic=periodic)
    if hardness is not None:
        np.maximum(share, pressure / hardness, out=share)
    top = cells[peaks_of(which, load, count)]
    middle = np.stack(np.unravel_index(top, pressure.shape), axis=1) + 0.5
    spots = Spots(
        place=np.multiply(middle, spacing),
        area=np.bincount(which, share.take(cells), minlength=count) * cell,
        force=np.bincount(which, load, minlength=count) * cell,
        peak_pressure=pressure.ravel()[top],
    )
    return spots, share


def true_area(contact: NDArray[np.bool_], *, periodic: bool) -> Array:
    """Return the part of every cell that is in contact, corrected for the jagged perimeter.

    Cells that the true perimeter crosses carry a pressure as wholes, too many of them on average.
    Each edge between a cell in contact and one that is not takes (π − 1 + ln 2)/24 of the cell's
    area off; on cells that are not square too, where the source has squares. Borders where a
    surface ends are no edges.

    Args:
        contact: Cells in contact, shape (nx, ny).
        periodic: Whether the map continues over its borders.

    Returns:
        Shares, 0 outside the contact, shape (nx, ny).

    Source:
        Yastrebov, Anciaux & Molinari 2017, doi 10.1016/j.triboint.2017.04.023.
    """
    around = np.pad(contact, 1, mode="wrap" if periodic else "edge")
    share, inner = np.empty(contact.shape), slice(1, -1)

    def work(rows: slice) -> None:
        here, edges = contact[rows], np.zeros(contact[rows].shape, np.int8)
        beside = around[rows.start : rows.stop + 2]
        sides = (beside[2:, inner], beside[:-2, inner], beside[inner, 2:], beside[inner, :-2])
        for neighbour in sides:
            edges += here > neighbour
        np.subtract(here, np.multiply(edges, EDGE_EXCESS, dtype=float), out=share[rows])

    on_rows(work, contact.shape)
    return share


def _joined(labels: Labels, count: int) -> tuple[Labels, int]:
    """Return the numbers of contacts whose parts meet over a period's borders, and their count."""
    sides = ((labels[0], labels[-1]), (labels[:, 0], labels[:, -1]))
    one, other = (np.concatenate(part) for part in zip(*sides, strict=True))
    both = (one > 0) & (other > 0)
    name = np.arange(count)
    for pair in {*zip(one[both] - 1, other[both] - 1, strict=True)}:  # quicker than a sparse matrix
        first, last = np.sort(name[[*pair]])
        name[name == last] = first
    kept, name = np.unique(name, return_inverse=True)
    return name, len(kept)


def sums_of(
    pressure: Array,
    surface: Surface,
    plane: RigidPlane,
    patches: PatchGrid,
    *,
    periodic: bool,
    hardness: float | None,
) -> dict[str, Any]:
    """Return what pressures and their spots sum up to, by the names that `ContactState` has.

    Args:
        pressure: Pressures of all cells, shape (nx, ny) [MPa].
        surface: The surface.
        plane: The plane, about whose centre moments are.
        patches: The patches.
        periodic: Whether contacts continue over the borders.
        hardness: Largest pressure of the cells [MPa]; None where contacts are elastic.
    """
    spots, share = find_spots(pressure, surface.spacing, periodic=periodic, hardness=hardness)
    along_x, along_y = overlaps(patches, surface.lengths, surface.grid)
    cell = surface.spacing[0] * surface.spacing[1]
    moment_x, moment_y = plane.moment(surface.x[:, None], surface.y, pressure)
    return {
        "moment": (cell * moment_x, cell * moment_y),
        "contact_area": float(spots.area.sum()),
        "contacts": len(spots),
        "peak_pressure": float(pressure.max()),
        "patch_force": (along_x @ pressure @ along_y.T).ravel(),
        "patch_area": (along_x @ share @ along_y.T).ravel(),
        "patch_contacts": spots.per_patch(patches),
        "spots": spots,
    }


def check_plane(
    control: Control,
    interference: Array,
    area: float,
    slopes: Sequence[FiniteSlopes],
    bounded: bool,
) -> None:
    """Refuse a plane that is not level, an approach beyond full contact, a force beyond all.

    Args:
        control: What is prescribed.
        interference: Interference at zero free motions, shape (nx, ny) [mm].
        area: Area of the period [mm²].
        slopes: What finite slopes of the bodies add.
        bounded: Whether no approach closes all gaps, as cells yield or wear.

    Raises:
        InputError: When there is no such contact.
    """
    if control.tilt is None or any(control.tilt):
        problem, value = "a plane over a periodic surface must be level", control.tilt or "free"
        raise InputError(problem, value=value, allowed="tilt (0, 0)")
    mean = float(interference.mean())
    # finite slopes change the last one
    if control.approach is not None and mean >= 0.0 and not (bounded or slopes):
        raise no_gap_left(control.approach, mean)
    young = min((one.material.young_modulus for one in slopes), default=np.inf)
    mean = 0.0 if control.force is None else control.force / area
    if mean >= young:
        problem = "finite slopes end where the mean pressure is the Young's modulus"
        raise InputError(problem, value=control.force, allowed=f"a pressure < {young:.6g} MPa")


def no_gap_left(approach: float, beyond: float) -> InputError:
    """Return the error on an approach at which no gap is left.

    Args:
        approach: The approach [mm].
        beyond: How far it is beyond the last one with a gap [mm].
    """
    allowed = f"< {approach - beyond:.6g} mm; beyond it give the force"
    problem = "a periodic surface has no gap left at this approach"
    return InputError(problem, value=approach, allowed=allowed)
