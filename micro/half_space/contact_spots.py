"""Connected contacts on a map of pressures: their number, forces, areas and perimeters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geometry import Partition
from micro.contact_detail import peaks_of

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

EDGE_EXCESS = (np.pi - 1.0 + np.log(2.0)) / 24.0
"""Area, in cells, by which an edge of the counted contact makes it too large on average."""
_ROUNDING = 1e-9
"""Of a cell: a centre that is no further beyond a border lies on it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contacts:
    """The m contacts of a map, connected over the edges of its cells.

    Args:
        labels: Number 1 … m of the contact that holds each cell, 0 outside, shape (nx, ny).
        share: Part of every cell that is in contact, corrected by the perimeter, shape (nx, ny).
        force: Forces, shape (m,) [N].
        area: Areas corrected by the perimeter, shape (m,) [mm²].
        peak_pressure: Largest pressures, shape (m,) [MPa].
        peak: Centres of the cells that carry them, shape (m, 2) [mm].
    """

    labels: Labels
    share: Array
    force: Array
    area: Array
    peak_pressure: Array
    peak: Array

    def __len__(self) -> int:
        return len(self.force)

    def per_patch(self, patches: Partition, spacing: tuple[float, float]) -> NDArray[np.int64]:
        """Return how many contacts have their largest pressure in each patch, shape (N,).

        Args:
            patches: The N patches.
            spacing: Sides of a cell [mm]; peaks that rounding alone puts beyond the outer borders
                count as within.
        """
        x, y = patches.borders_x, patches.borders_y
        nearest = np.clip(self.peak, (x[0], y[0]), (x[-1], y[-1]))
        beyond = np.abs(self.peak - nearest) > _ROUNDING * np.array(spacing)
        owner = patches.index_of(*np.where(beyond, self.peak, nearest).T)
        return np.bincount(owner, minlength=patches.count)


def find_contacts(
    pressure: Array,
    spacing: tuple[float, float],
    *,
    periodic: bool,
    hardness: float | None = None,
) -> Contacts:
    """Find the connected contacts of a map of pressures.

    Args:
        pressure: Pressures ≥ 0, shape (nx, ny) [MPa].
        spacing: Sides of a cell [mm].
        periodic: Whether contacts continue over the borders.
        hardness: Largest pressure that contacts can bear [MPa]; none when not given. The load of a
            cell needs p/H of its area at least, so that cells that yield are in contact whole.
    """
    labels, count = ndimage.label(pressure > 0.0)
    if periodic and count:
        labels, count = _joined(labels, count)
    owner = labels.ravel()
    cells = np.flatnonzero(owner)
    which, load = owner[cells] - 1, pressure.ravel()[cells]
    cell = np.float64(spacing[0] * spacing[1])
    share = true_area(pressure > 0.0, periodic=periodic)
    if hardness is not None:
        np.maximum(share, pressure / hardness, out=share)
    top = cells[peaks_of(which, load, count)]
    middle = np.stack(np.unravel_index(top, pressure.shape), axis=1) + 0.5
    return Contacts(
        labels=labels.astype(np.int64),
        share=share,
        force=np.bincount(which, load, minlength=count) * cell,
        area=np.bincount(which, share.ravel()[cells], minlength=count) * cell,
        peak_pressure=pressure.ravel()[top],
        peak=np.multiply(middle, spacing),
    )


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
    inner = slice(1, -1)
    neighbours = (around[2:, inner], around[:-2, inner], around[inner, 2:], around[inner, :-2])
    edges = np.sum([contact & ~neighbour for neighbour in neighbours], axis=0)
    return np.asarray(contact - EDGE_EXCESS * edges)


def _joined(labels: Labels, count: int) -> tuple[Labels, int]:
    """Merge the contacts that meet over the borders of a period."""
    sides = ((labels[0], labels[-1]), (labels[:, 0], labels[:, -1]))
    one, other = (np.concatenate(part) for part in zip(*sides, strict=True))
    both = (one > 0) & (other > 0)
    links = (np.ones(both.sum()), (one[both] - 1, other[both] - 1))
    merged, name = connected_components(coo_array(links, shape=(count, count)), directed=False)
    return np.concatenate(([0], name + 1))[labels], merged
