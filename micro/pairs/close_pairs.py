"""Pairs of asperities so close that their displacement needs Hertz's exact field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from micro.closed_forms.hertz_field import circular_field, elliptic_field
from micro.pairs.interaction import SINE_MERGED, Interaction

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosePairs:
    """Ordered pairs (k, i): summit k lies within a radius about contact i.

    Args:
        interaction: The n asperities.
        row: Summits k that are displaced, shape (m,).
        column: Contacts i that displace them, shape (m,).
        x_squared: Squared distances along the major axis of i, shape (m,) [mm²].
        y_squared: Squared distances across it, shape (m,) [mm²].
    """

    interaction: Interaction
    row: Indices
    column: Indices
    x_squared: Array
    y_squared: Array

    @classmethod
    def within(cls, interaction: Interaction, radius: Array) -> Self:
        """Find the pairs.

        Args:
            interaction: The n asperities.
            radius: Radii about the contacts, shape (n,) [mm].
        """
        point = np.stack([interaction.x, interaction.y], axis=1)
        found = cKDTree(point).query_ball_point(point, radius)
        column = np.repeat(np.arange(len(point)), [len(part) for part in found])
        row = np.concatenate([np.empty(0, dtype=np.intp), *map(np.asarray, found)]).astype(np.intp)
        row, column = row[row != column], column[row != column]
        apart = point[row] - point[column]
        x, y = interaction.local(apart[:, 0], apart[:, 1], column)
        return cls(interaction=interaction, row=row, column=column, x_squared=x**2, y_squared=y**2)

    @classmethod
    def none(cls, interaction: Interaction) -> Self:
        """Return no pairs, of contacts that do not displace each other's summits.

        Args:
            interaction: The n asperities.
        """
        nobody, nowhere = np.empty(0, dtype=np.intp), np.empty(0)
        return cls(
            interaction=interaction,
            row=nobody,
            column=nobody,
            x_squared=nowhere,
            y_squared=nowhere,
        )

    def lift(self, indentation: Array) -> tuple[Array, Array]:
        """Return the displacements, shape (n,) [mm], and the slopes of all pairs, shape (m,).

        Args:
            indentation: Own indentations, shape (n,) [mm]; only positive ones act.
        """
        all_of, slope = self.interaction, np.zeros(len(self.row))
        acting = np.flatnonzero(indentation[self.column] > 0.0)
        i = self.column[acting]
        s = all_of.size[i] * indentation[i]
        x_squared, y_squared = self.x_squared[acting], self.y_squared[acting]
        if all_of.circular:
            field, rate = circular_field(x_squared + y_squared, s, SINE_MERGED)
        else:
            field, rate = elliptic_field(
                x_squared, y_squared, s, all_of.beta[i], all_of.v_merged[i]
            )
        slope[acting] = rate / all_of.integral[i]
        displacement = field / (all_of.size[i] * all_of.integral[i])
        summed = np.zeros(len(all_of.x))
        summed += np.bincount(self.row[acting], displacement, minlength=len(summed))
        return summed, slope
