"""Meshes for tests, and files of them written line by line or by gmsh."""

import signal
from contextlib import contextmanager

import numpy as np
from dolfinx import mesh as dmesh

from patchlaw.macro import TaggedMesh

KINDS = {2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 9: 6, 11: 10}
"""Nodes of gmsh's kinds: triangle, square, tetrahedron, hexahedron, prism, 6 and 10 nodes."""

SIDES = {"left": 1, "right": 2, "front": 3, "behind": 4, "below": 5, "above": 6}
"""Names of a box's faces across x, y and z, and their tags."""


@contextmanager
def gmsh_session(name):
    """Yield gmsh, silent and with a new model; the handler of SIGINT stays as it was."""
    handler = signal.getsignal(signal.SIGINT)
    import gmsh  # which replaces it, release 4.8 by its import alone

    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    try:
        for option in ("MeshSizeFromPoints", "MeshSizeExtendFromBoundary"):  # fields alone decide
            gmsh.option.setNumber(f"Mesh.{option}", 0)
        gmsh.model.add(name)
        yield gmsh
    finally:
        gmsh.finalize()
        signal.signal(signal.SIGINT, handler)


def write_msh2(path, points, elements, names=(), first=1):
    """Write format 2 as text.

    Args:
        path: The file.
        points: Nodes.
        elements: (kind, physical group, entity, rows of points) of every element.
        names: (dimension, group, name) of groups.
        first: Number of the first node.
    """
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    if names:
        lines += ["$PhysicalNames", str(len(names))]
        lines += [f'{dimension} {group} "{name}"' for dimension, group, name in names]
        lines += ["$EndPhysicalNames"]
    lines += ["$Nodes", str(len(points))]
    for k, point in enumerate(np.asarray(points, float).tolist()):
        lines.append(" ".join([str(first + k), *map(repr, point)]))
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    for k, (kind, group, entity, rows) in enumerate(elements):
        assert len(rows) == KINDS[kind]
        nodes = " ".join(str(first + row) for row in rows)
        lines.append(f"{k + 1} {kind} 2 {group} {entity} {nodes}")
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path


@contextmanager
def gmsh_boxes(size=0.6):
    """Yield gmsh with a mesh of a box on another: volumes and the upper and lower face named."""
    with gmsh_session("boxes for a test") as gmsh:
        lower = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        upper = gmsh.model.occ.addBox(0, 0, 1, 1, 1, 0.5)
        gmsh.model.occ.fragment([(3, lower)], [(3, upper)])
        gmsh.model.occ.synchronize()
        for tag, volume, name in ((10, lower, "plate"), (11, upper, "lining")):
            gmsh.model.addPhysicalGroup(3, [volume], tag)
            gmsh.model.setPhysicalName(3, tag, name)
        for tag, height, name in ((5, 1.5, "pad face"), (6, 0.0, "back")):
            box = (-1, -1, height - 0.1, 2, 2, height + 0.1)
            faces = [face for _, face in gmsh.model.getEntitiesInBoundingBox(*box, 2)]
            gmsh.model.addPhysicalGroup(2, faces, tag)
            gmsh.model.setPhysicalName(2, tag, name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        yield gmsh


def write_boxes(path, version=4.1, binary=False):
    """Write the boxes with gmsh in a version of its format."""
    with gmsh_boxes() as gmsh:
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
    return path


def tagged_box(comm, lengths=(1.0, 1.0, 1.0), cells=(3, 2, 2), kind="tetrahedron"):
    """Return a box from the origin with tags on its faces, as dolfinx makes it."""
    corners = [np.zeros(3), np.array(lengths)]
    mesh = dmesh.create_box(comm, corners, list(cells), getattr(dmesh.CellType, kind))
    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    middle = dmesh.compute_midpoints(mesh, 2, facets)
    values = np.zeros(len(facets), np.int32)
    for tag, (axis, end) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)), start=1):
        values[np.abs(middle[:, axis] - end * lengths[axis]) < 1e-12] = tag
    tags = dmesh.meshtags(mesh, 2, facets, values)
    return TaggedMesh(mesh=mesh, facet_tags=tags, facet_names=SIDES)
