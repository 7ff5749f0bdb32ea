"""Distant pairs of asperities by multipoles, one dense matrix for each term."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from micro.pairs.interaction import Interaction
from micro.pairs.multipoles import angular_polynomials, pair_terms

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

TERMS = 5
"""Terms of the series; with `REACH` they leave out less than 2e-11 of a pair's displacement."""

REACH = 8.0
"""Distance of the closest pairs of the series in major semi-axes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FarPairs:
    """Geometry of all pairs of n asperities.

    Args:
        matrices: T_j r^(−1−2j) of contact i (column) at summit k, 0 for pairs left out, shape
            (`TERMS`, n, n) [mm^(−1−2j)].
    """

    matrices: Array
    terms = TERMS

    @classmethod
    def of(cls, interaction: Interaction) -> Self:
        """Evaluate all pairs but those at one place."""
        i = interaction
        dx, dy = i.x[:, None] - i.x, i.y[:, None] - i.y
        distance = np.hypot(dx, dy)
        here = distance == 0.0
        distance[here] = np.inf
        along, _ = i.local(dx, dy, slice(None))
        cosine = 2.0 * (along / distance) ** 2 - 1.0
        polynomials = angular_polynomials(i.beta, TERMS)
        return cls(matrices=np.stack(list(pair_terms(distance, cosine, polynomials))))

    def among(self, index: Indices, row: Indices, column: Indices) -> Self:
        """Return the pairs among some of the asperities, without close ones.

        Args:
            index: The m asperities kept, ascending.
            row: Summits of the close pairs, numbered among those kept.
            column: Their contacts.
        """
        whole = len(index) == self.matrices.shape[1]
        matrices = self.matrices.copy() if whole else self.matrices[:, index[:, None], index]
        matrices[:, row, column] = 0.0
        return replace(self, matrices=matrices)

    def displacement(self, moments: Array) -> Array:
        """Return the displacements of the summits by moments of the contacts [mm].

        Args:
            moments: Moments of all terms, shape (`TERMS`, n) [mm^(2 + 2j)].
        """
        return sum(matrix @ part for matrix, part in zip(self.matrices, moments, strict=True))

    def leading(self, moment: Array) -> Array:
        """Return the displacements by point forces alone, in single precision [mm].

        Args:
            moment: P/(π E*) of the contacts, shape (n,) [mm²].
        """
        return (self._leading @ moment.astype(np.float32)).astype(np.float64)

    @cached_property
    def _leading(self) -> NDArray[np.float32]:
        return self.matrices[0].astype(np.float32)
