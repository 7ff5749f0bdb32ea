"""Sessions of gmsh for meshes of tests, and rough blocks meshed by it: another family of meshes."""

from contextlib import ExitStack, contextmanager
from dataclasses import replace

import gmsh
import numpy as np
from dolfinx import mesh as dmesh
from scipy.spatial import cKDTree

from macro.mesh.block import BOTTOM, FLAT, SIDES, TOP, BlockMesh
from macro.mesh.facets import exterior_facets
from support.collective import on_root


@contextmanager
def gmsh_session(name):
    """Open a silent session of gmsh with a new model of this name for as long as it lasts."""
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    try:
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.model.add(name)
        yield gmsh
    finally:
        gmsh.finalize()


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


@contextmanager
def meshed_block(shape, unit):
    """Mesh a refined block with one edge length at its places, for as long as the context lasts."""
    shape = in_unit(shape, unit)
    with gmsh_session("refined block"):
        box = gmsh.model.occ.addBox(0.0, 0.0, -shape.height, *shape.interface, shape.height)
        points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in shape.places]
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [box], 1)
        size = size_near("PointsList", points, shape.fine, shape)
        gmsh.model.mesh.field.setAsBackgroundMesh(size)
        generate(shape)
        yield gmsh.model


def gmsh_block(shape, comm):
    """Return the mesh of a refined block that gmsh makes instead of bisection; collective."""
    unit = max(*shape.interface, shape.height)
    with ExitStack() as session:
        models = []
        on_root(comm, lambda: models.append(session.enter_context(meshed_block(shape, unit))))
        mesh = mesh_from_gmsh(models[0] if models else None, comm)
    mesh.geometry.x[:] *= unit
    facets = exterior_facets(mesh)
    level = dmesh.compute_midpoints(mesh, 2, facets)[:, 2] / shape.height
    markers = np.select([level < -1.0 + FLAT, level > -FLAT], [BOTTOM, TOP], SIDES)
    tags = dmesh.meshtags(mesh, 2, facets, markers.astype(np.int32))
    return BlockMesh(mesh=mesh, facet_tags=tags, shape=shape)
