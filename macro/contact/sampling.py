"""Where contact laws are evaluated on a face, and the loads by their pressures.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from patchlaw.support.arrays import Array
from patchlaw.support.checks import real_array
from patchlaw.support.errors import InputError


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampling:
    """The samples that laws are evaluated at, and the loads by their pressures.

    A sample is a whole patch or a quadrature point. With the nodal displacements u, the pressures p
    and the weights w of the samples, the nodal load is ``B p`` and the displacement of the
    samples into the body is ``(Bᵀ u) / w``. The same operator in both makes every tangent
    symmetric.

    Args:
        operator: B, rows like the displacements, columns like the samples [mm²].
        weight: Area of each of this rank's samples, shape (n,) [mm²].
        x: Abscissae of this rank's samples, shape (n,) [mm].
        y: Ordinates of this rank's samples, shape (n,) [mm].
        depth: Depths of the undeformed face below its plane at this rank's samples, (n,) [mm].
        patch: Flat patch index of this rank's samples, ascending, shape (n,).
        count: Number of patches N.
    """

    operator: PETSc.Mat
    weight: Array
    x: Array
    y: Array
    depth: Array
    patch: NDArray[np.intp]
    count: int

    def displacements(self, displacement: PETSc.Vec) -> Array:
        """Return the displacements of this rank's samples into the body, shape (n,) [mm].

        Args:
            displacement: Nodal displacements [mm].
        """
        self.operator.multTranspose(displacement, self.values)
        return np.asarray(self.values.array_r / self.weight)

    def below(self, crown: Callable[[Array, Array], Array] | None) -> Array:
        """Return the depths of this rank's samples on a crowned face, shape (n,) [mm].

        Args:
            crown: Further depth at points (x, y) of the plane [mm]; None: none.

        Raises:
            InputError: When it gives no numbers, or not one for every point.
        """
        return self.depth + crown_depth(crown, self.x, self.y)

    @cached_property
    def values(self) -> PETSc.Vec:
        """Work space for a value of every sample; PETSc would keep one of every product."""
        return self.operator.createVecRight()

    def stiffness_of_elements(self, matrix: PETSc.Mat) -> float:
        """Return the stiffness against pressures that change from element to element [MPa/mm].

        Args:
            matrix: Stiffness of the bodies.

        Note:
            Collective.
        """
        rough, forces = matrix.createVecs()
        self.values.array[:] = np.random.default_rng(1).choice([-1.0, 1.0], self.x.shape)
        self.operator.mult(self.values, rough)
        square = float(self.weight @ self.displacements(rough) ** 2)
        matrix.mult(rough, forces)
        return float(forces.dot(rough)) / float(matrix.comm.tompi4py().allreduce(square))

    def patch_sums(self, values: Array) -> Array:
        """Return the integrals of sampled values over every patch, shape (N,); collective."""
        local = np.bincount(self.patch, weights=self.weight * values, minlength=self.count)
        return self.operator.comm.tompi4py().allreduce(local)


def by_patch(
    functions: Sequence[Callable[[Array], Array]], patch: NDArray[np.intp], closure: Array
) -> Array:
    """Return functions of closure, one per patch, at samples, shape (n,).

    Args:
        functions: One function per patch.
        patch: Flat patch index of the samples, ascending, shape (n,).
        closure: Closures of the samples, shape (n,) [mm].

    Raises:
        InputError: When a function's values are no numbers, or not one for every closure.
    """
    values = np.empty_like(closure)
    ends = np.searchsorted(patch, np.arange(len(functions) + 1))
    for i in np.flatnonzero(np.diff(ends)):
        part = slice(ends[i], ends[i + 1])
        values[part] = _one_each(functions[i](closure[part]), closure[part], f"law {i}")
    return values


def crown_depth(crown: Any, x: Array, y: Array) -> Array:
    """Return the depth of a crown at points of the plane, shapes (n,) [mm].

    Args:
        crown: A function of x and y; None: no crown.
        x: Abscissae of the points [mm].
        y: Their ordinates [mm].

    Raises:
        InputError: When it is no function, gives no finite numbers, or not one for every point.
    """
    if crown is None:
        return np.zeros_like(x)
    if not callable(crown):
        raise InputError("the crown is no function", value=crown, allowed="depth(x, y) in mm")
    depth = _one_each(crown(x, y), x, "the crown")
    if not np.isfinite(depth).all():
        raise InputError("the crown has depths that are not finite")
    return depth


def _one_each(values: Any, points: Array, what: str) -> Array:
    """Return what a user's function gives at points as numbers, one for each."""
    try:
        numbers = real_array(values)  # what is masked is not a number
    except InputError as error:
        raise InputError(f"{what} gives no numbers: {error.problem}", value=values) from None
    if numbers.shape not in ((), points.shape):
        raise InputError(
            f"{what} does not give one value for each of {len(points)} points",
            value=numbers.shape,
            allowed=str(points.shape),
        )
    return numbers if numbers.shape else np.broadcast_to(numbers, points.shape)
