"""A block that stands on boxes, such as an L, small cells at its top: meshed flat, and rough."""

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

import gmsh

import mpi4py.MPI  # noqa: F401  # isort: skip  (its library is loaded before dolfinx)
import numpy as np
from dolfinx import mesh as dmesh
from helpers.mesh_files import gmsh_session
from scipy.spatial import cKDTree

from patchlaw.geometry import RefinedShape
from patchlaw.macro import TaggedMesh
from patchlaw.macro.mesh.block import move_onto
from patchlaw.support import on_root

ROUGH = "rough"
"""Name of the contact face."""

_AT_SEAMS = 0.2
"""Edge length at re-entrant edges, where stresses are singular, over that far from contact. With
the same length there, 0.1 mm, the compliance of an L 1.5 mm high is too small by 0.1 %."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SteppedShape:
    """A block, its top the contact face, joined to boxes below it.

    The block occupies [0, Lx] × [0, Ly] × [−height, 0]; its sides are free over its whole height.
    Cells grow with the distance from the places on its top, and near the edges where the block
    stands on the boxes.

    Args:
        block: The block under the contact face, and the sizes of the cells.
        boxes: Lower and upper corners of the boxes, shape (n, 2, 3) [mm]; with the block they are
            one body.
    """

    block: RefinedShape
    boxes: list

    @property
    def degree(self):
        """Polynomial degree of the element."""
        return self.block.degree

    @property
    def fine(self):
        """Edge length where contact can occur [mm]."""
        return self.block.fine

    @property
    def unit(self):
        """Length that gmsh meshes the body in, its largest extent [mm]."""
        corners = np.concatenate([np.reshape(self.boxes, (-1, 3)), np.zeros((1, 3))])
        sides = (*self.block.interface, self.block.height)
        return max(*sides, float(np.ptp(corners, axis=0).max()))

    @contextmanager
    def meshed(self):
        """Mesh the body in gmsh for as long as the context lasts."""
        shape = in_unit(self.block, self.unit)
        with gmsh_session("a stepped block"):
            add_box = gmsh.model.occ.addBox
            block = add_box(0.0, 0.0, -shape.height, *shape.interface, shape.height)
            boxes = np.asarray(self.boxes) / self.unit
            tools = [(3, add_box(*low, *(high - low))) for low, high in boxes]
            ((_, body),), _ = gmsh.model.occ.fuse([(3, block)], tools)
            points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in shape.places]
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(3, [body], 1)
            fields, least = gmsh.model.mesh.field, _AT_SEAMS * shape.coarse
            sizes = [
                size_near("PointsList", points, shape.fine, shape),
                size_near("CurvesList", _seams(shape), least, shape),
            ]
            smallest = fields.add("Min")
            fields.setNumbers(smallest, "FieldsList", sizes)
            fields.setAsBackgroundMesh(smallest)
            generate(shape)
            yield gmsh.model


def _seams(shape):
    """Return the curves at the bottom of a block along which boxes are joined to it."""
    slack, seams = 1e-6 * shape.height, []
    width, depth = shape.interface
    for _, curve in gmsh.model.getEntities(1):
        x, y, z, x_end, y_end, z_end = gmsh.model.getBoundingBox(1, curve)
        level = max(abs(z + shape.height), abs(z_end + shape.height)) < slack
        if level and min(x, y) > -slack and x_end < width + slack and y_end < depth + slack:
            seams.append(curve)
    return seams


def stepped_mesh(shape, planes, comm):
    """Mesh a block on boxes, distributed over all ranks; collective.

    Args:
        shape: The body and its cells.
        planes: Surfaces to mark, such as those of supports: by name the axis that a plane is
            perpendicular to (0, 1, 2) and its coordinate [mm]. The contact face is ``ROUGH``.
        comm: MPI communicator that the mesh will live on.
    """
    with ExitStack() as session:
        models = []
        on_root(comm, lambda: models.append(session.enter_context(shape.meshed())))
        mesh = mesh_from_gmsh(models[0] if models else None, comm)
    mesh.geometry.x[:] *= shape.unit
    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    middles = dmesh.compute_midpoints(mesh, 2, facets)
    markers, names = np.zeros(len(facets), dtype=np.int32), {}
    for number, (name, (axis, at)) in enumerate({ROUGH: (2, 0.0), **planes}.items(), start=1):
        markers[np.abs(middles[:, axis] - at) < 1e-9 * shape.unit] = names[name] = number
    tags = dmesh.meshtags(mesh, 2, facets[markers > 0], markers[markers > 0])
    return TaggedMesh(mesh=mesh, facet_tags=tags, facet_names=names)


def rough_stepped_mesh(shape, planes, surface, comm):
    """Mesh a block on boxes and move its nodes onto the roughness; see `move_onto`."""
    flat = stepped_mesh(shape, planes, comm)
    return flat, move_onto(flat.mesh, surface, shape.block.height)


def mesh_from_gmsh(model, comm):
    """Distribute the gmsh model of rank 0; collective."""
    try:
        from dolfinx.io import gmsh as reader
    except ImportError:
        from dolfinx.io import gmshio as reader
    data = reader.model_to_mesh(model, comm, 0, gdim=3)
    return data.mesh if hasattr(data, "mesh") else data[0]


def in_unit(shape, unit):
    """Return a refined block in a unit of length; gmsh takes lengths below 1e-7 for nothing."""
    sizes = {name: getattr(shape, name) / unit for name in ("height", "fine", "coarse")}
    places = np.clip(shape.places / unit, 0.0, np.divide(shape.interface, unit))
    interface = tuple(np.divide(shape.interface, unit))
    return replace(shape, interface=interface, places=places, **sizes)


def generate(shape):
    """Mesh by the frontal algorithm, and again by Delaunay's if it has missed a place.

    The frontal algorithm makes better triangles, but evaluates sizes only at its own nodes and can
    step over a small region between large edges.
    """
    gmsh.model.mesh.generate(2)
    _, nodes, _ = gmsh.model.mesh.getNodes(2, -1, includeBoundary=True)
    nodes = np.reshape(nodes, (-1, 3))
    top = nodes[np.abs(nodes[:, 2]) < 1e-9 * shape.height, :2]
    if np.any(cKDTree(top).query(shape.places)[0] > shape.fine):
        gmsh.model.mesh.clear()
        gmsh.option.setNumber("Mesh.Algorithm", 5)  # Delaunay's
        gmsh.model.mesh.generate(2)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(shape.degree)


def size_near(kind, tags, least, shape):
    """Return gmsh's field of an edge length that grows linearly with the distance from something.

    Args:
        kind: Name of gmsh's list of what it grows from.
        tags: The list.
        least: The edge length there, in the model's unit.
        shape: The block in that unit.
    """
    fields = gmsh.model.mesh.field
    near = fields.add("Distance")
    fields.setNumbers(near, kind, tags)
    size = fields.add("Threshold")
    values = {
        "DistMin": 2.0 * least,
        "DistMax": 2.0 * least + (shape.coarse - least) / shape.growth,
        "SizeMin": least,
        "SizeMax": shape.coarse,
        "InField": near,
    }
    for option, value in values.items():
        fields.setNumber(size, option, value)
    return size
