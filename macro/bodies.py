"""Elastic bodies: a block, and a body on any mesh with materials, supports and tractions.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from dolfinx import fem

from patchlaw.geometry import Material
from patchlaw.macro.elastic_body import ElasticBody, Held
from patchlaw.macro.linear_solvers.multigrid import Lattice, lattice_of
from patchlaw.macro.mesh.block import FLAT, BlockMesh
from patchlaw.macro.mesh.supports import Loads, Support, check_loads
from patchlaw.macro.mesh.tagged import TaggedMesh
from patchlaw.support import InputError, together

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

    def of_degree(self, degree: int) -> Block:
        """Return the same block with displacements of a degree."""
        shape = self.mesh.shape
        other = replace(shape, element=f"{shape.element[0]}{degree}")
        return Block(replace(self.mesh, shape=other), self.material, self.sides)

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
        loads: What loads it beside contact and supports: one state, or several that load steps
            pass from one to the next.
        normal: Direction out of the contact face, along which `reaction` is taken, shape (3,).
        order: Degree of the displacements, 1 or 2.

    Raises:
        InputError: When the mesh is plane, a cell has no material, or a load acts on facets inside
            the body.

    Note:
        Construction and every method are collective over the mesh's communicator.
    """

    mesh: TaggedMesh
    materials: Material | Mapping[int, Material]
    supports: Sequence[Support]
    loads: Sequence[Loads] = (Loads(),)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    order: int = 1

    def __post_init__(self) -> None:
        if self.mesh.mesh.topology.dim != 3:
            raise InputError(
                "the mesh of a body has cells that do not fit",
                value=self.mesh.mesh.topology.cell_name(),
                allowed="tetrahedra or hexahedra",
            )
        together(self.comm, lambda: self.cell_lame)
        for loads in dict.fromkeys(self.loads):
            check_loads(self.mesh, self.supports, loads.on_surfaces)

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.order

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

    def of_degree(self, degree: int) -> MeshedBody:
        """Return the same body with displacements of a degree."""
        return replace(self, order=degree)
