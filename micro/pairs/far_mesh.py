"""Distant pairs of very many asperities: neighbours by multipoles, the rest through a mesh.

The point-force field is split as 1/r = erfc(α r)/r + erf(α r)/r. The first part is negligible
beyond 3.2/α and summed over neighbours, with the moments up to the fourth; the second is smooth
and goes through a mesh (`micro.pairs.spline_mesh`), with the moments up to the second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from scipy.special import erfc

from micro.pairs.close_pairs import ClosePairs
from micro.pairs.interaction import Interaction
from micro.pairs.multipoles import angular_polynomials, pair_terms
from micro.pairs.spline_mesh import SHARPNESS, SplineMesh, smooth_kernel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

TERMS = 3
"""Terms of the series for neighbours."""

REACH = (6.0, 10.0)
"""Distance of the closest pairs of the series in major semi-axes, the larger where it exceeds the
cut-off: there the mesh alone acts, without the fourth moments."""

_NEIGHBOURS = 80.0
_CUT_OFF = 3.2
_BLOCK = 2**19


@dataclass(frozen=True, kw_only=True, eq=False)
class Neighbourhood:
    """Places of n asperities: the mesh and the neighbours within the cut-off.

    Args:
        interaction: The asperities.
        mesh: The mesh.
        row: Summits of the ordered pairs of neighbours, ascending, shape (m,).
        column: Their contacts, shape (m,).
        radius: Cut-off [mm].
    """

    interaction: Interaction
    mesh: SplineMesh
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    radius: float

    @classmethod
    def of(cls, interaction: Interaction) -> Self:
        """Find the neighbours; the mesh is chosen so that there are some 80 of each."""
        x, y = interaction.x, interaction.y
        wide, high = float(np.ptp(x)), float(np.ptp(y))
        share = _NEIGHBOURS / len(x)  # of a rectangle, or of a line
        radius = max(np.sqrt(share / np.pi * wide * high), 0.5 * share * max(wide, high))
        pairs = cKDTree(np.stack([x, y], axis=1)).query_pairs(radius, output_type="ndarray")
        pairs = np.concatenate([pairs, pairs[:, ::-1]]).astype(np.int32)
        order = np.lexsort((pairs[:, 1], pairs[:, 0]))
        return cls(
            interaction=interaction,
            mesh=SplineMesh.over(x, y, radius * SHARPNESS / _CUT_OFF),
            row=pairs[order, 0],
            column=pairs[order, 1],
            radius=radius,
        )

    def reach(self, semi_major: Array) -> Array:
        """Return the radii about contacts within which pairs are close [mm].

        Args:
            semi_major: Major semi-axes of the contacts, shape (n,) [mm].
        """
        inner, outer = (factor * semi_major for factor in REACH)
        return np.where(outer <= self.radius, inner, outer)

    def among(self, index: Indices) -> Neighbourhood:
        """Return what some of the asperities keep of it."""
        number = np.full(len(self.interaction.x), -1, dtype=np.int32)
        number[index] = np.arange(len(index), dtype=np.int32)
        row, column = number[self.row], number[self.column]
        kept = (row >= 0) & (column >= 0)
        return Neighbourhood(
            interaction=self.interaction.subset(index),
            mesh=self.mesh.subset(index),
            row=row[kept],
            column=column[kept],
            radius=self.radius,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class FarMesh:
    """Far field of n asperities for given close pairs.

    Args:
        interaction: The asperities.
        near: Corrections of the mesh for neighbours and close pairs, one (n, n) for each term.
        mesh: The mesh.
    """

    interaction: Interaction
    near: Sequence[csr_array]
    mesh: SplineMesh
    terms = TERMS

    @classmethod
    def of(cls, places: Neighbourhood, close: ClosePairs) -> Self:
        """Evaluate neighbours and take close pairs, and contacts themselves, off the mesh."""
        count = len(places.interaction.x)
        own = np.arange(count, dtype=np.int32)
        taken = [np.concatenate([part.astype(np.int32), own]) for part in (close.row, close.column)]
        key = places.row.astype(np.int64) * count + places.column
        other = ~np.isin(key, taken[0].astype(np.int64) * count + taken[1])
        del key
        pairs = np.stack([places.row[other], places.column[other]])
        values = np.concatenate(
            [
                _corrections(places, *pairs, distant=True),
                _corrections(places, *taken, distant=False),
            ],
            axis=1,
        )
        row, column = np.concatenate([pairs, taken], axis=1)
        near = [csr_array((part, (row, column)), shape=(count, count)) for part in values[:2]]
        last = csr_array((values[2, : pairs.shape[1]], (pairs[0], pairs[1])), shape=(count, count))
        near.append(last)
        return cls(interaction=places.interaction, near=near, mesh=places.mesh)

    def displacement(self, moments: Array) -> Array:
        """Return the displacements of the summits by moments of the contacts [mm].

        Args:
            moments: Moments of all terms, shape (`TERMS`, n) [mm^(2 + 2j)].
        """
        near = sum(part @ moment for part, moment in zip(self.near, moments, strict=True))
        return near + self.mesh.displacement(
            moments[0], *(moments[1] * part for part in self._axes)
        )

    def leading(self, moment: Array) -> Array:
        """Return the displacements by point forces alone [mm].

        Args:
            moment: P/(π E*) of the contacts, shape (n,) [mm²].
        """
        return self.near[0] @ moment + self.mesh.displacement(moment)

    @cached_property
    def _axes(self) -> tuple[Array, Array, Array]:
        """Coefficients of D/a² in the derivatives xx, xy, yy."""
        beta, angle = self.interaction.beta, self.interaction.angle
        mean, half = 0.5 * (1.0 + beta), 0.5 * (1.0 - beta)
        along, cross = half * np.cos(2.0 * angle), half * np.sin(2.0 * angle)
        return mean + along, 2.0 * cross, mean - along


def _corrections(
    places: Neighbourhood,
    row: NDArray[np.int32],
    column: NDArray[np.int32],
    *,
    distant: bool,
) -> Array:
    """Return the three terms of pairs less the mesh's, those of pairs that are not distant 0."""
    values = np.empty((TERMS, len(row)))
    for first in range(0, len(row), _BLOCK):  # blocks bound the memory
        block = slice(first, first + _BLOCK)
        values[:, block] = _correction(places, row[block], column[block], distant)
    return values


def _correction(
    places: Neighbourhood, row: NDArray[np.int32], column: NDArray[np.int32], distant: bool
) -> Array:
    i, alpha = places.interaction, places.mesh.sharpness
    dx, dy = i.x[row] - i.x[column], i.y[row] - i.y[column]
    distance = np.hypot(dx, dy)
    along, _ = i.local(dx, dy, column)
    cosine = 2.0 * (along / np.where(distance > 0.0, distance, 1.0)) ** 2 - 1.0
    value, slope, curvature = smooth_kernel(distance, alpha)
    beta = i.beta[column]
    mean, half = 0.5 * (1.0 + beta), 0.5 * (1.0 - beta) * cosine
    second = (mean + half) * curvature + (mean - half) * slope
    if not distant:
        return np.stack([-value, -second, np.zeros_like(value)])
    terms = list(pair_terms(distance, cosine, angular_polynomials(beta, TERMS)))
    return np.stack([erfc(alpha * distance) / distance, terms[1] - second, terms[2]])
