"""Elastic bodies: a block, and a body on any mesh with materials, supports and tractions.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from dolfinx import fem

from geometry.materials import Material
from macro.elastic_body import ElasticBody, Held
from macro.linear_solvers.multigrid import Lattice, lattice_of
from macro.mesh.block import FLAT, BlockMesh
from macro.mesh.supports import Support, Traction
from macro.mesh.tagged import TaggedMesh
from support.collective import together
from support.errors import InputError

Sides = Literal["free", "roller"]


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
    def materials(self) -> Material:
        """The one material."""
        return self.material

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
        bottom = np.flatnonzero(above < FLAT * shape.height).astype(np.int32)
        held = [Held(axis, bottom) for axis in range(3)]
        for axis in (0, 1) if self.sides == "roller" else ():
            low, high = -shape.margin, shape.interface[axis] + shape.margin
            slack, place = FLAT * (high - low), points[:, axis]
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


@dataclass(frozen=True, eq=False)
class MeshedBody(ElasticBody):
    """A linear elastic body on a mesh of tetrahedra or hexahedra.

    Args:
        mesh: The mesh with its markers.
        materials: Elastic constants by marker of the volumes, or those of the whole body.
        supports: Surfaces whose displacement is prescribed; they must hold the body.
        tractions: Loaded surfaces, beside the contact.
        normal: Direction out of the contact face, along which `reaction` is taken, shape (3,).
        order: Degree of the displacements, 1 or 2.

    Raises:
        InputError: When a cell has no material.

    Note:
        Construction and every method are collective over the mesh's communicator.
    """

    mesh: TaggedMesh
    materials: Material | Mapping[int, Material]
    supports: Sequence[Support]
    tractions: Sequence[Traction] = ()
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    order: int = 1

    def __post_init__(self) -> None:
        together(self.comm, lambda: self.cell_lame)

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.order

    @property
    def poisson_ratio(self) -> float:
        """Largest Poisson's ratio in the body."""
        if isinstance(self.materials, Material):
            return self.materials.poisson_ratio
        return max(material.poisson_ratio for material in self.materials.values())

    @cached_property
    def cell_lame(self) -> tuple[Any, Any]:
        """Lamé's constants of this rank's cells: numbers, or arrays of shape (cells,) [MPa]."""
        if isinstance(self.materials, Material):
            return self.materials.lame
        cells = self.mesh.mesh.topology.index_map(3)
        constants = np.zeros((2, cells.size_local + cells.num_ghosts))
        tags = self.mesh.cell_tags
        for tag, material in self.materials.items() if tags is not None else ():
            constants[:, tags.find(tag)] = np.array(material.lame)[:, None]
        bare = int(np.sum(constants[1] == 0.0))
        if bare:
            raise InputError(
                f"{bare} cells of the body have no material",
                key="materials",
                value=sorted(self.materials),
                allowed="the markers of all volumes",
            )
        return constants[0], constants[1]

    @cached_property
    def held(self) -> list[Held]:
        """What the supports prescribe."""
        tags = self.mesh.facet_tags
        self.mesh.mesh.topology.create_connectivity(2, 3)
        held = []
        for support in self.supports:
            facets = tags.find(support.tag)
            nodes = np.sort(fem.locate_dofs_topological(self.space, 2, facets))
            values = enumerate(support.displacement)
            held += [Held(axis, nodes, value) for axis, value in values if value is not None]
        return held

    @cached_property
    def linear(self) -> MeshedBody:
        """The same body with linear displacements."""
        return replace(self, order=1)
