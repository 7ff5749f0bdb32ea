"""Finite slopes of two rough bodies in contact: each adds its own to the compliance.

Theory: docs/theory.md, section 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from micro.compliance.finite_slopes import FiniteSlopes

Array = NDArray[np.float64]


class SlopeTerm(Protocol):
    """What finite slopes add to the displacements of a surface."""

    def displacement(self, pressure: Array, /) -> Array:
        """Return the displacement that is added, positive where the bodies part.

        Args:
            pressure: Pressures on all cells, shape (nx, ny) [MPa].

        Returns:
            Shape (nx, ny) [mm].
        """
        ...

    def error(self, pressure: Array, /) -> float:
        """Return what ∫ p u dA may be off by, as higher orders of the slopes are left out [N mm].

        Args:
            pressure: Pressures on all cells, shape (nx, ny) [MPa].
        """
        ...

    def on_half_space(self) -> SlopeTerm:
        """Return the same slopes on half-spaces."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class SlopesOfBodies:
    """The sum of what the slopes of several bodies add, all on the cells of one contact.

    Two bodies that are mirror images of each other touch in a plane, as each of them would touch a
    rigid one. Where they differ, contacts are inclined by what is left between the two halves of
    the roughness, and the tangential part of their pressures is not counted.

    Args:
        parts: The slopes of each body, with its own material.
    """

    parts: tuple[FiniteSlopes, ...]

    def displacement(self, pressure: Array) -> Array:
        """Return the sum of the displacements; see `FiniteSlopes.displacement`."""
        return np.asarray(sum(part.displacement(pressure) for part in self.parts))

    def error(self, pressure: Array) -> float:
        """Return the sum of the errors; see `FiniteSlopes.error`."""
        return sum(part.error(pressure) for part in self.parts)

    def on_half_space(self) -> SlopesOfBodies:
        """Return the same slopes on half-spaces."""
        return SlopesOfBodies(tuple(part.on_half_space() for part in self.parts))
