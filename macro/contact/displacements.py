"""The displacements among a user's unknowns: all of them, or a part of a mixed space.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.macro import compat
from patchlaw.support.errors import InputError


@dataclass(frozen=True, eq=False)
class Displacements:
    """Where the displacements of nodes stand among the unknowns of a problem.

    Args:
        space: Vector space of the displacements alone, Lagrange of degree 1 or 2.
        whole: The space of all unknowns, or the displacements' part of it.
        taken: Unknown of this rank of each of its displacements, ghosts included, (nodes d,);
            None: they are all unknowns.
        axisymmetric: Whether a plane mesh is turned about x = 0.
    """

    space: Any
    whole: Any
    taken: NDArray[np.int32] | None = None
    axisymmetric: bool = False

    @classmethod
    def of(cls, space: Any, *, axisymmetric: bool = False) -> Displacements:
        """Return the displacements of a space, or of a part ``W.sub(i)`` of a mixed one.

        Args:
            space: The space.
            axisymmetric: As above.

        Raises:
            InputError: On all ranks, when these are no displacements as contact takes them.
        """
        whole, taken = space, None
        if space.component() and space.num_sub_spaces:
            space, taken = compat.collapsed(space)
        fits = compat.holds_displacements(space)
        if not (fits and compat.cell_vertices(space.mesh).shape[1] in (3, 4, 6, 8, 9, 10, 27)):
            raise InputError(
                "the cells do not fit" if fits else "the space of the displacements does not fit",
                value=str(whole.ufl_element()),
                allowed="a continuous Lagrange space of degree 1 or 2, or a part W.sub(i) of a "
                "mixed space, with three components on tetrahedra or hexahedra, or two on "
                "triangles or quadrilaterals, of first or second order",
            )
        if axisymmetric:
            _check_radii(space.mesh)
        return cls(space, whole, taken, axisymmetric)

    @property
    def dimension(self) -> int:
        """Components of a displacement, 2 or 3."""
        return int(self.space.dofmap.index_map_bs)

    @property
    def owned(self) -> int:
        """Number of unknowns that this rank owns."""
        return int(self.whole.dofmap.index_map.size_local * self.whole.dofmap.index_map_bs)

    @property
    def total(self) -> int:
        """Number of unknowns of all ranks."""
        return int(self.whole.dofmap.index_map.size_global * self.whole.dofmap.index_map_bs)

    @cached_property
    def own(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Unknowns that this rank owns and that are displacements, and the axis of each.

        Whoever owns a displacement in its own space may not own the unknown.
        """
        nodes = self.space.dofmap.index_map
        count = (nodes.size_local + nodes.num_ghosts) * self.dimension
        axis, every = np.arange(count, dtype=np.int32) % self.dimension, self.taken
        every = np.arange(count, dtype=np.int32) if every is None else every
        return every[every < self.owned], axis[every < self.owned]

    def columns(self, nodes: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return the global unknowns of this rank's nodes along x, y, z; −1: none, shape (…, 3)."""
        dimension = self.dimension
        local = dimension * nodes[..., None] + np.arange(dimension, dtype=np.int32)
        local = local if self.taken is None else self.taken[local]
        known, size = self.whole.dofmap.index_map, self.whole.dofmap.index_map_bs
        place, part = np.divmod(local, size)
        found = np.full((*nodes.shape, 3), -1, dtype=np.int64)
        found[..., :dimension] = part + size * known.local_to_global(
            place.ravel().astype(np.int32)
        ).reshape(place.shape)
        return found


def _check_radii(mesh: Any) -> None:
    """Refuse what is no half of a section through an axis of symmetry at x = 0.

    Raises:
        InputError: On all ranks.
    """
    least = mesh.comm.allreduce(float(mesh.geometry.x[:, 0].min(initial=np.inf)), min)
    largest = mesh.comm.allreduce(float(np.abs(mesh.geometry.x[:, 0]).max(initial=0.0)), max)
    if mesh.topology.dim != 2 or least < -1e-9 * largest:
        raise InputError(
            "the mesh is no half of a section through the axis x = 0",
            key="axisymmetric",
            value=f"{mesh.topology.dim} dimensions, x from {least:.6g} mm",
            allowed="a plane mesh whose x is the radius",
        )
