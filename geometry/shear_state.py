"""What is prescribed of a plane that shifts along a surface, and the shear of the contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from support.arrays import Array, Flags
from support.checks import finite_pair
from support.errors import InputError

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShearControl:
    """Shift of the plane along the surface, or shear force on it, at one load step.

    Args:
        shift: Shift of the plane along x and y from where it first touched [mm]; None when the
            force is prescribed.
        force: Shear force on the plane along x and y [N]; None when the shift is prescribed.

    Raises:
        InputError: When not exactly one of them is given, or it is no pair of finite numbers.
    """

    shift: Pair | None = None
    force: Pair | None = None

    def __post_init__(self) -> None:
        if (self.shift is None) == (self.force is None):
            raise InputError(
                "a load step prescribes either the shift or the shear force",
                value=(self.shift, self.force),
                allowed="exactly one of them",
            )
        pair = self.shift if self.force is None else self.force
        finite_pair(pair, "needs two finite numbers", allowed="along x and y")

    def __str__(self) -> str:
        """Say what shears, as in "shear force (2, 0) N"."""
        if self.force is not None:
            return f"shear force ({self.force[0]:.6g}, {self.force[1]:.6g}) N"
        assert self.shift is not None
        return f"shift ({self.shift[0]:.6g}, {self.shift[1]:.6g}) mm"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShearState:
    """Tangential tractions and slip of a contact on nx × ny cells, and what follows from them.

    Args:
        shift: Shift of the plane along x and y from where it first touched [mm].
        force: Shear force on the plane along x and y [N].
        traction: Tractions on the surface along x and y, shape (2, nx, ny) [MPa].
        slip: Slip of the cells in contact since they touched, 0 elsewhere, shape (2, nx, ny) [mm].
        bound: Coulomb's bound μ p of the tractions, 0 out of contact, shape (nx, ny) [MPa].
        slipping: Which cells in contact bear the traction μ p, shape (nx, ny).
        direction: Unit vector of the last change of the shift.
        dissipated: Energy lost to friction in all load steps so far [N mm].
        dissipated_in_step: Part of it that was lost in the last one [N mm].
        residual: Largest violation of the conditions over the largest shift of a cell.
        products: Products of the tangential compliance in the last load step.
    """

    shift: Pair
    force: Pair
    traction: Array
    slip: Array
    bound: Array
    slipping: Flags
    direction: Pair = (1.0, 0.0)
    dissipated: float = 0.0
    dissipated_in_step: float = 0.0
    residual: float = 0.0
    products: int = 0

    @classmethod
    def none(cls, grid: tuple[int, int]) -> ShearState:
        """Return the state of a surface that nothing touches.

        Args:
            grid: Numbers of cells (nx, ny).
        """
        return cls(
            shift=(0.0, 0.0),
            force=(0.0, 0.0),
            traction=np.zeros((2, *grid)),
            slip=np.zeros((2, *grid)),
            bound=np.zeros(grid),
            slipping=np.zeros(grid, bool),
        )

    @property
    def closed(self) -> Flags:
        """Which cells are in contact, shape (nx, ny)."""
        return np.asarray(self.bound > 0.0)

    @property
    def sticking(self) -> Flags:
        """Which cells are in contact and stick, shape (nx, ny)."""
        return self.closed & ~self.slipping
