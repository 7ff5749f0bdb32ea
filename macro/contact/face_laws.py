"""The samples of a contact face, and the contact laws that hold at them.

Laws are functions of closures and, where roughness runs in, of worn depths.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any, Protocol, runtime_checkable

import numpy as np
from petsc4py import PETSc

from patchlaw.support import Array, Indices, InputError, real_array

Crown = Callable[[Array, Array], Array] | None
"""Depth of a face below its plane at points (x, y) of that; None: none [mm]."""


@dataclass(frozen=True, eq=False)
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
    patch: Indices
    count: int

    def displacements(self, displacement: PETSc.Vec) -> Array:
        """Return the displacements of this rank's samples into the body, shape (n,) [mm].

        Args:
            displacement: Nodal displacements [mm].
        """
        self.operator.multTranspose(displacement, self.values)
        return np.asarray(self.values.array_r / self.weight)

    def below(self, crown: Crown | Sequence[Crown]) -> Array:
        """Return the depths of this rank's samples on a crowned face, shape (n,) [mm].

        Args:
            crown: Further depth at points (x, y) of the plane [mm], None: none; or that of each
                patch.

        Raises:
            InputError: When it gives no numbers, or not one for every point.
        """
        if not isinstance(crown, Sequence):
            return self.depth + crown_depth(crown, self.x, self.y)
        depth = self.depth.copy()
        for i, one in enumerate(crown):
            depth[self.patch == i] += crown_depth(one, *self.places[self.patch == i].T)
        return depth

    @property
    def places(self) -> Array:
        """Places of this rank's samples, shape (n, 2) [mm]."""
        return np.column_stack((self.x, self.y))

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


class ContactLaw(Protocol):
    """Contact pressure p of a patch as a function of its closure c.

    Closure is the approach of the plane minus the downward displacement of the block's surface
    [mm]. Pressures are positive in compression [MPa], and the stiffness is dp/dc ≥ 0 [MPa/mm]. Both
    must be defined for every closure, because Newton's iterates may leave the range of a tabulated
    law: whoever tabulates laws extends them and checks the converged closures.
    """

    def pressure(self, closure: Array, /) -> Array:
        """Return the pressures at closures of shape (n,)."""
        ...

    def stiffness(self, closure: Array, /) -> Array:
        """Return the exact derivative of the pressures at closures of shape (n,)."""
        ...


@runtime_checkable
class ContactLaws(Protocol):
    """The laws of all patches, evaluated together: as quick for many patches as for one.

    All take patches, shape (n,), the closures there of what is left, and the depths that have worn
    off, volume per area, (n,) each [mm]. Laws that do not run in take no notice of the depths.
    """

    laws: tuple[Any, ...]
    """One law per patch."""

    def __len__(self) -> int:
        """Return the number of patches."""
        ...

    def pressures(self, patch: Indices, closure: Array, depth: Array, /) -> Array:
        """Return the pressures, shape (n,) [MPa]; see `ContactLaw`."""
        ...

    def stiffnesses(self, patch: Indices, closure: Array, depth: Array, /) -> Array:
        """Return their exact derivatives by the closures, shape (n,) [MPa/mm]."""
        ...

    def rates(self, patch: Indices, closure: Array, depth: Array, /) -> tuple[Array, Array, Array]:
        """Return pressures, these derivatives, and what they fall by with wear, (n,) each.

        As wear goes on under a plane that stays, closures fall by what wears off.
        """
        ...


@runtime_checkable
class RunningIn(ContactLaws, Protocol):
    """Laws that change with the depth that has worn off."""

    new: ContactLaws
    """The laws of the face before it wore, whose springs friction has."""

    def at_pressures(
        self, patch: Indices, pressure: Array, depth: Array | float, /
    ) -> tuple[Array, Array]:
        """Return closures of what is left at pressures, and stiffnesses there, shape (n,) each."""
        ...


class SingleLaws:
    """The laws of patches, evaluated one by one, and checked: they may be a user's functions.

    Args:
        laws: One law per patch.
    """

    def __init__(self, laws: Sequence[ContactLaw]) -> None:
        self.laws: tuple[Any, ...] = tuple(laws)

    def __len__(self) -> int:
        return len(self.laws)

    def pressures(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return the pressures, see `ContactLaws.pressures`."""
        return by_patch([law.pressure for law in self.laws], patch, closure)

    def stiffnesses(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return the stiffnesses, see `ContactLaws.stiffnesses`."""
        return by_patch([law.stiffness for law in self.laws], patch, closure)

    def rates(self, patch: Indices, closure: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Return pressures and stiffnesses, by which wear lessens them; see `ContactLaws.rates`."""
        slope = self.stiffnesses(patch, closure, depth)
        return self.pressures(patch, closure, depth), slope, slope

    def know(self, name: str) -> bool:
        """Tell whether all laws have an attribute."""
        return all(hasattr(law, name) for law in self.laws)

    def read_off(self, name: str, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return what laws with ``at`` give besides, on tangents beyond their tables, (n,)."""

        def given(law: Any) -> Callable[[Array], Array]:
            return lambda closure: np.asarray(getattr(law.at(closure, extend=True), name))

        return by_patch([given(law) for law in self.laws], patch, closure)

    def check_range(self, patch: Indices, closure: Array, depth: Array) -> None:
        """Refuse closures beyond the tables of laws; those without ``at`` have none."""
        for index in np.unique(patch):
            getattr(self.laws[index], "at", np.asarray)(closure[patch == index])

    def transmissivities(
        self, patch: Indices, closure: Array, depth: Array, places: Array
    ) -> Array:
        """Return the transmissivities of laws at points, shape (n, 2) [mm³].

        Args:
            patch: Patch of every point, shape (n,).
            closure: Closures there, shape (n,) [mm].
            depth: Worn depths, which these laws take no notice of.
            places: Places there in coordinates of the face, shape (n, 2) [mm]. A law whose
                ``transmissivities`` takes ``x`` beside the closure is told them.

        Raises:
            InputError: When a law has no ``transmissivities``, or gives no numbers ≥ 0 of that
                shape.
        """
        found = np.empty((len(closure), 2))
        for index, law in enumerate(self.laws):
            if not callable(getattr(law, "transmissivities", None)):
                raise InputError(
                    "the law knows no leak",
                    value=law,
                    allowed="a law with transmissivities(closure) of shape (n, 2) [mm³], such as "
                    "representative_law(…, leak=True)",
                )
            here = patch == index
            given = {"x": places[here]} if _takes_places(law.transmissivities) else {}
            values = real_array(law.transmissivities(closure[here], **given))
            if values.shape != (int(here.sum()), 2) or not (values >= 0.0).all():
                raise InputError(
                    f"law {index} gives no transmissivities",
                    value=values.shape,
                    allowed="numbers ≥ 0 along both axes for every closure",
                )
            found[here] = values
        return found


def _takes_places(function: Any) -> bool:
    """Tell whether a function takes ``x`` beside the closure, which may have any name."""
    try:
        return "x" in list(signature(function).parameters)[1:]
    except ValueError:  # functions of compiled modules may have none
        return False


def by_patch(
    functions: Sequence[Callable[[Array], Array]], patch: Indices, closure: Array
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
        values[part] = one_each(functions[i](closure[part]), closure[part], f"law {i}")
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
    depth = one_each(crown(x, y), x, "the crown")
    if not np.isfinite(depth).all():
        raise InputError("the crown has depths that are not finite")
    return depth


def one_each(values: Any, points: Array, what: str) -> Array:
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
