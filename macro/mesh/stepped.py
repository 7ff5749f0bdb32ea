"""Meshes of blocks that stand on boxes, flat or with their roughness, with marked surfaces.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh

from geometry.meshes.stepped import SteppedShape
from geometry.surface import Surface
from macro import compat
from macro.mesh.rough_surface import MeshQuality, check_cover, move_onto
from macro.mesh.tagged import TaggedMesh
from support.collective import on_root
from support.errors import InputError

ROUGH = "rough"
"""Name of the contact face."""

_FLAT = 1e-9
"""Distance from a plane, relative to the body, that is rounding."""


def stepped_mesh(
    shape: SteppedShape, planes: Mapping[str, tuple[int, float]], comm: Any
) -> TaggedMesh:
    """Mesh a block on boxes, distributed over all ranks.

    Args:
        shape: The body and its cells.
        planes: Surfaces to mark, such as those of supports: by name the axis that a plane is
            perpendicular to (0, 1, 2) and its coordinate [mm]. The contact face is marked as
            ``ROUGH``.
        comm: MPI communicator that the mesh will live on.

    Raises:
        InputError: When gmsh cannot make the body, or no facet lies in a plane.

    Note:
        Collective. It is meshed whole on rank 0, as refined blocks are.
    """
    with ExitStack() as gmsh_session:
        models: list[Any] = []
        on_root(comm, lambda: models.append(gmsh_session.enter_context(shape.meshed())))
        mesh = compat.mesh_from_gmsh(models[0] if models else None, comm)
    mesh.geometry.x[:] *= shape.unit
    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    middles = dmesh.compute_midpoints(mesh, 2, facets)
    markers, names = np.zeros(len(facets), dtype=np.int32), {}
    for number, (name, (axis, at)) in enumerate({ROUGH: (2, 0.0), **planes}.items(), start=1):
        inside = np.abs(middles[:, axis] - at) < _FLAT * shape.unit
        if not comm.allreduce(int(inside.sum())):
            raise InputError(
                f"no outer facet lies in the plane {name!r}", value=at, allowed="a face of the body"
            )
        markers[inside], names[name] = number, number
    marked = markers > 0
    tags = dmesh.meshtags(mesh, 2, facets[marked], markers[marked])
    return TaggedMesh(mesh=mesh, facet_tags=tags, facet_names=names)


def rough_stepped_mesh(
    shape: SteppedShape, planes: Mapping[str, tuple[int, float]], surface: Surface, comm: Any
) -> tuple[TaggedMesh, MeshQuality]:
    """Mesh a block on boxes and move its nodes onto the roughness; see `rough_block_mesh`.

    Args:
        shape: The flat body; the top of its block is the surface's rectangle.
        planes: Surfaces to mark, see `stepped_mesh`.
        surface: The rough surface.
        comm: MPI communicator.

    Raises:
        InputError: As `rough_block_mesh` and `stepped_mesh` do.

    Note:
        Collective.
    """
    check_cover(shape.block, surface)
    flat = stepped_mesh(shape, planes, comm)
    return flat, move_onto(flat.mesh, surface, shape.block.height)
