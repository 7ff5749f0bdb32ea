"""Laws of a face whose roughness runs in: between those of surfaces that have worn by some depths.

The state of the roughness under a point is the depth W that has worn off there, volume per area.
Surfaces that wore to the same depth under pressures of 1 to 4 have nearly the same law, and those
that slid the same distance do not (docs/wear.md). A law is a function of c − W, the closure of what
is left, and changes its shape with W: between two depths it is interpolated linearly, and beyond
the last one it stays.

Theory: docs/theory.md, section 18.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from patchlaw.multiscale.laws.patch_law import PatchLaws
from patchlaw.support.arrays import Array, Indices

Function = Callable[[Indices, Array], Any]


class RunningInLaws:
    """N laws that depend on the depth that has worn off: a `ContactLaws` of `macro`.

    Args:
        laws: The laws at all depths together, the N of the first depth first.
        depths: Worn depths of the L levels, rising from 0, shape (L, N) [mm].
    """

    def __init__(self, laws: PatchLaws, depths: Array) -> None:
        self._laws, self._depths = laws, depths

    def __len__(self) -> int:
        return self._depths.shape[1]

    def between(self, patch: Indices, depth: Array) -> tuple[Indices, Indices, Array, Array]:
        """Return the indices of the laws next to depths, and where between them these are.

        Args:
            patch: Patches, shape (n,).
            depth: Worn depths there, shape (n,) [mm].

        Returns:
            Indices among the laws of all levels below and above, share of the way from one to the
            other, and its change with the depth [1/mm], shape (n,) each.
        """
        at = self._depths[:, patch]
        last = len(at) - 2
        level = np.clip((at <= depth).sum(axis=0) - 1, 0, last)
        columns = np.arange(len(patch))
        low, high = at[level, columns], at[level + 1, columns]
        share, inside = (depth - low) / (high - low), depth < high
        first = len(self) * level + patch
        share = np.where(inside, share, 1.0)
        return first, first + len(self), share, np.where(inside, 1.0 / (high - low), 0.0)

    def blended(self, patch: Indices, depth: Array, function: Function) -> Function:
        """Return a function of patches and closures that takes laws by their worn depths.

        Args:
            patch: Patches of n samples.
            depth: Worn depths there, shape (n,) [mm].
            function: Returns values at closures by laws of all levels.
        """
        below, above, share, _ = self.between(patch, depth)

        def at(_: Indices, closure: Array) -> Array:
            return (1.0 - share) * function(below, closure) + share * function(above, closure)

        return at

    def value(
        self, name: str, patch: Indices, closure: Array, depth: Array, *, extend: bool = True
    ) -> Array:
        """Return a field of `LawPoint` at closures and worn depths, shape (n,).

        Args:
            name: Name of the field.
            patch: Patches, shape (n,).
            closure: Closures of what is left there, shape (n,) [mm].
            depth: Worn depths, shape (n,) [mm].
            extend: As of `PatchLaws.at`.

        Raises:
            InputError: As of `PatchLaws.at`.
        """

        def of_laws(index: Indices, closure: Array) -> Array:
            return np.asarray(getattr(self._laws.at(index, closure, extend=extend), name))

        return np.asarray(self.blended(patch, depth, of_laws)(patch, closure))

    def worn(self, patch: Indices, closure: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Return pressures [MPa], and what they change by with closure and with depth [MPa/mm].

        Args:
            patch: Patches, shape (n,).
            closure: Closures of what is left there, shape (n,) [mm].
            depth: Worn depths, shape (n,) [mm].

        Returns:
            Pressures, their derivatives by the closure, and by the depth where the closure stays;
            shape (n,) each.
        """
        below, above, share, rate = self.between(patch, depth)
        low, high = (self._laws.at(one, closure, extend=True) for one in (below, above))
        pressure = (1.0 - share) * low.pressure + share * high.pressure
        slope = (1.0 - share) * low.stiffness + share * high.stiffness
        return pressure, slope, rate * (high.pressure - low.pressure)

    def pressures(self, patch: Indices, closure: Array) -> Array:
        """Return the pressures where nothing has worn off, see `ContactLaws.pressures`."""
        return self._laws.pressures(patch, closure)

    def stiffnesses(self, patch: Indices, closure: Array) -> Array:
        """Return their derivatives, see `ContactLaws.stiffnesses`."""
        return self._laws.stiffnesses(patch, closure)
