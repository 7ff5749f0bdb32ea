"""Meshes of four machine parts for `body_solvers.py`, by gmsh: outlines that are extruded or filled.

``hex`` and ``layers`` are extruded, layer by layer, into hexahedra or into tetrahedra; ``tet`` fills
the volumes with tetrahedra of one size. Layers can be flatter than they are wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.collective import on_root
from geometry.meshes.gmsh_session import gmsh_session

PARTS = {
    # outline, heights of the volumes from the support up [mm]
    "pad": ("rectangle", (5.0, 12.0)),
    "flange": ("flange", (12.0,)),
    "ring": ("ring", (0.8,)),
    "quarter ring": ("quarter ring", (0.8,)),
    "L": ("L", (20.0,)),
}


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part to be meshed.

    Args:
        name: One of `PARTS`.
        cells: ``"hex"``, ``"layers"`` or ``"tet"``.
        size: Length of the cells in the plane [mm].
        flat: Their length over their height.
    """

    name: str
    cells: str
    size: float
    flat: float = 1.0


def part_model(gmsh, part):
    """Mesh a part in the current gmsh model; volumes are numbered from the support up."""
    kind, heights = PARTS[part.name]
    occ = gmsh.model.occ
    faces = [_outline(occ, kind)]
    bodies = []
    for height in heights:
        layers = max(1, round(height * part.flat / part.size))
        more = {} if part.cells == "tet" else {"numElements": [layers], "recombine": part.cells == "hex"}
        made = occ.extrude([(2, faces[-1])], 0.0, 0.0, height, **more)
        faces.append(made[0][1])
        bodies += [tag for dim, tag in made if dim == 3]
    occ.synchronize()
    for number, body in enumerate(bodies, start=1):
        gmsh.model.addPhysicalGroup(3, [body], number)
    for name, value in {
        "Mesh.MeshSizeMax": part.size,
        "Mesh.MeshSizeMin": part.size,
        "Mesh.Algorithm3D": 10 if part.cells == "tet" else 1,
    }.items():
        gmsh.option.setNumber(name, value)
    if part.cells == "hex":
        gmsh.model.mesh.setRecombine(2, faces[0])
    gmsh.model.mesh.generate(3)


def _outline(occ, kind):
    if kind == "rectangle":
        return occ.addRectangle(0.0, 0.0, 0.0, 100.0, 40.0)
    if kind == "L":
        points = [(0, 0), (80, 0), (80, 20), (20, 20), (20, 80), (0, 80)]
        corners = [occ.addPoint(x, y, 0.0) for x, y in points]
        pairs = zip(corners, corners[1:] + corners[:1], strict=True)
        return occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(a, b) for a, b in pairs])])
    outer, inner = (60.0, 20.0) if kind == "flange" else (42.0, 38.0)
    holes = [(2, occ.addDisk(0.0, 0.0, 0.0, inner, inner))]
    if kind == "flange":
        for angle in np.arange(6) * np.pi / 3.0:
            x, y = 45.0 * np.cos(angle), 45.0 * np.sin(angle)
            holes.append((2, occ.addDisk(x, y, 0.0, 5.0, 5.0)))
    disc = [(2, occ.addDisk(0.0, 0.0, 0.0, outer, outer))]
    if kind == "quarter ring":
        disc = occ.intersect(disc, [(2, occ.addRectangle(0.0, 0.0, 0.0, outer, outer))])[0]
    return occ.cut(disc, holes)[0][0][1]


def part_mesh(part, comm):
    """Return the distributed mesh of a part and, for its cells, the number of their volume."""
    from dolfinx.io import gmshio

    from macro import compat

    sessions = []
    on_root(comm, lambda: sessions.append(_opened(part)))
    model = sessions[0][1].model if sessions else None
    with compat.quiet_compiler():
        mesh, cell_tags, _ = gmshio.model_to_mesh(model, comm, 0, gdim=3)
    if sessions:
        sessions[0][0].__exit__(None, None, None)
    return mesh, cell_tags


def _opened(part):
    session = gmsh_session(part.name)
    gmsh = session.__enter__()
    part_model(gmsh, part)
    return session, gmsh
