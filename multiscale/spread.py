"""Where within the patches the contacts are: shares of small rectangles in a patch's force."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from geometry.collective import on_root
from geometry.errors import InputError
from geometry.patches import PatchGrid
from micro import MicroModel
from multiscale.coupling import tilted_approaches

Array = NDArray[np.float64]

_ROWS = 17  # the contacts' places change slowly with the load
_SHORTEST = 1e-9  # of the diagonal, that the rows reach over


class Shares(NamedTuple):
    """Shares of M rectangles in what happens to their patches; they add up to 1 over a patch.

    Attributes:
        force: Share in the patch's force, shape (M,).
        dforce: Its derivative over the patch's local approach, shape (M,) [1/mm].
        stiffness: Share in the derivative of the patch's force, shape (M,).
        dstiffness: Its derivative over the patch's local approach, shape (M,) [1/mm].
    """

    force: Array
    dforce: Array
    stiffness: Array
    dstiffness: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactSpread:
    """Forces of the contacts on rectangles that divide the patches, along the local approach.

    A block yields under contacts where they are, and what it yields counts where contacts are
    stiff. A patch alone knows its mean pressure; the shares tell how it is spread.

    Args:
        patches: The N patches.
        loads: M rectangles that divide them.
        approach: Approaches of the plane at K rows, ascending, shape (K,) [mm].
        lean: What the local approach of each patch is more than that, shape (N,) [mm].
        forces: Forces on the rectangles, shape (K, M) [N].

    Raises:
        InputError: When the rectangles do not divide the patches or the shapes do not fit.
    """

    patches: PatchGrid
    loads: PatchGrid
    approach: Array
    lean: Array
    forces: Array

    def __post_init__(self) -> None:
        counts = np.divide(self.loads.grid, self.patches.grid)
        if not np.all(counts == np.round(counts)):
            raise InputError(
                "the rectangles of the loads must divide the patches",
                value=self.loads.grid,
                allowed=f"multiples of {self.patches.grid}",
            )
        fits = self.forces.shape == (len(self.approach), self.loads.count)
        if not fits or self.lean.shape != (self.patches.count,):
            raise InputError(
                "the rows of a spread do not fit",
                value=(self.forces.shape, self.lean.shape),
                allowed=f"{(len(self.approach), self.loads.count)}, {(self.patches.count,)}",
            )

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """Flat index of the patch that holds each rectangle, shape (M,)."""
        return self.patches.index_of(*self.loads.centres.T)

    def shares(self, local: Array) -> Shares:
        """Return the shares at local approaches of the patches.

        Between rows forces are interpolated by monotone cubics. Before its first row under load a
        patch has that row's shares, beyond the last row the last one's; without any load the
        rectangles' shares are equal.

        Args:
            local: Local approaches, shape (N,) [mm].
        """
        asked = local - self.lean
        held = np.clip(asked, self._first, self.approach[-1])
        moving = (asked == held)[self.owner]
        row = np.clip(np.searchsorted(self.approach, held, side="right") - 1, 0, self._last_piece)
        along = (held - self.approach[row])[self.owner]
        a, b, c, d = self._pieces[:, row[self.owner], np.arange(self.loads.count)]
        force = ((a * along + b) * along + c) * along + d
        slope = (3.0 * a * along + 2.0 * b) * along + c
        bend = 6.0 * a * along + 2.0 * b
        return Shares(*self._normed(force, slope, moving), *self._normed(slope, bend, moving))

    def _normed(self, part: Array, change: Array, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Divide by the sums over patches, and give the derivative of the quotient."""
        total, rise = (
            np.bincount(self.owner, values, minlength=self.patches.count)[self.owner]
            for values in (part, change)
        )
        none = total <= 0.0
        total = np.where(none, 1.0, total)
        share = np.where(none, self.patches.count / self.loads.count, part / total)
        return share, np.where(none | ~moving, 0.0, (change - share * rise) / total)

    @cached_property
    def _pieces(self) -> Array:
        """Coefficients of the cubics, shape (4, K − 1, M)."""
        return np.asarray(PchipInterpolator(self.approach, self.forces, axis=0).c)

    @property
    def _last_piece(self) -> int:
        return len(self.approach) - 2

    @cached_property
    def _first(self) -> Array:
        """Approach of the first row under load of every patch, shape (N,) [mm]."""
        by_patch = np.zeros((self.patches.count, len(self.forces)))
        np.add.at(by_patch, self.owner, self.forces.T)
        loaded = by_patch > 0.0
        first = np.where(loaded.any(axis=1), loaded.argmax(axis=1), len(self.approach) - 1)
        return np.asarray(self.approach[first])


def contact_spread(
    model: MicroModel,
    patches: PatchGrid,
    loads: PatchGrid,
    *,
    approach_end: float,
    tilt: tuple[float, float] = (0.0, 0.0),
    comm: Any = None,
) -> ContactSpread:
    """Find where the contacts of a whole surface are, up to an approach.

    Args:
        model: Micro model of the surface.
        patches: Its patches.
        loads: Rectangles that divide them.
        approach_end: Largest approach at the middle [mm].
        tilt: Slopes of the plane.
        comm: MPI communicator (mpi4py) or None; its first rank solves for all.

    Note:
        Collective.
    """
    lean = tilted_approaches(patches, 0.0, tilt)
    below = approach_end - _SHORTEST * float(np.hypot(*patches.lengths))  # a touch may lie beyond
    lowest = min(model.first_touch, below) - float(np.abs(lean).max())
    rows = np.linspace(lowest, approach_end, _ROWS)

    def forces() -> Array:
        response = model.respond(rows, patches=loads, mean_heights=np.zeros(loads.count), tilt=tilt)
        return response.patch_force

    return ContactSpread(
        patches=patches,
        loads=loads,
        approach=rows,
        lean=lean,
        forces=on_root(comm, forces),
    )
