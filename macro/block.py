"""The elastic block: its supports, and the lattice that its nodes form.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from geometry.materials import Material
from macro.elastic_body import ElasticBody, Held
from macro.linear_solvers.multigrid import Lattice, lattice_of
from macro.mesh.block import BlockMesh
from support.errors import InputError

Sides = Literal["free", "roller"]

_FLAT = 1e-9
"""Distance from a face, relative to the size of the block, that is rounding."""


@dataclass(frozen=True, eq=False)
class Block(ElasticBody):
    """An elastic block, clamped at the bottom, ready to be loaded on its top.

    Args:
        mesh: Mesh with marked faces.
        material: Elastic constants.
        sides: ``"free"`` of traction, or ``"roller"``: no normal displacement on the four side
            planes, no shear traction.

    Raises:
        InputError: When ``sides`` is neither.

    Note:
        Construction and every method are collective over the mesh's communicator.
    """

    mesh: BlockMesh
    material: Material
    sides: Sides = "free"

    def __post_init__(self) -> None:
        if self.sides not in get_args(Sides):
            raise InputError(
                "unknown support of the sides", value=self.sides, allowed="free, roller"
            )

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.mesh.shape.degree

    @property
    def poisson_ratio(self) -> float:
        """Poisson's ratio."""
        return self.material.poisson_ratio

    @property
    def cell_lame(self) -> tuple[float, float]:
        """Lamé's constants [MPa]."""
        return self.material.lame

    @cached_property
    def held(self) -> list[Held]:
        """The clamped bottom, which the roughness does not move, and the rollers on request."""
        shape, points = self.mesh.shape, self.space.tabulate_dof_coordinates()
        above = points[:, 2] + shape.height
        bottom = np.flatnonzero(above < _FLAT * shape.height).astype(np.int32)
        held = [Held(axis, bottom) for axis in range(3)]
        for axis in (0, 1) if self.sides == "roller" else ():
            low, high = -shape.margin, shape.interface[axis] + shape.margin
            slack, place = _FLAT * (high - low), points[:, axis]
            across = np.flatnonzero((place < low + slack) | (place > high - slack))
            held.append(Held(axis, across.astype(np.int32)))
        return held

    @cached_property
    def linear(self) -> Block:
        """The same block with linear displacements."""
        shape = self.mesh.shape
        linear = replace(shape, element=f"{shape.element[0]}1")
        return Block(replace(self.mesh, shape=linear), self.material, self.sides)

    @cached_property
    def lattice(self) -> Lattice | None:
        """The rectangular lattice of the nodes; None where they form none."""
        return lattice_of(self.space, self.mesh)
