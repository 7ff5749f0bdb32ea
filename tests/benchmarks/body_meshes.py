"""Meshes of machine parts in gmsh's files for `body_solvers.py`.

``hex`` and ``layers`` are outlines that are extruded, layer by layer, into hexahedra or into
tetrahedra, and layers can be flatter than they are wide; ``tet`` fills the volumes with tetrahedra
of one length. Volumes are named by numbers from the support up; surfaces are ``support`` (z = 0),
``contact`` (the top) and, where the part has such planes, ``x`` and ``y`` (x = 0, y = 0).
"""

from dataclasses import dataclass

import numpy as np

from geometry.meshes.gmsh_session import gmsh_session

HEIGHTS = {"pad": (5.0, 12.0), "flange": (12.0,), "ring": (0.8,), "L": (20.0,)}
"""Heights of the volumes of a part [mm]."""
_CORNERS = {
    "pad": [(0, 0), (100, 0), (100, 40), (0, 40)],
    "L": [(0, 0), (80, 0), (80, 20), (20, 20), (20, 80), (0, 80)],
}
_SLACK = 1e-6


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part to be meshed.

    Args:
        name: One of `HEIGHTS`.
        cells: ``"hex"``, ``"layers"`` or ``"tet"``.
        size: Length of the cells in the plane [mm].
        flat: Their length over their height; 1 for ``"tet"``.
    """

    name: str
    cells: str
    size: float
    flat: float = 1.0


def write_part(part, path):
    """Mesh a part and write gmsh's file."""
    with gmsh_session(part.name) as gmsh:
        occ, top, volumes = gmsh.model.occ, _outline(gmsh.model.occ, part.name), []
        for height in HEIGHTS[part.name]:
            layers = max(1, round(height * part.flat / part.size))
            how = {"numElements": [layers], "recombine": part.cells == "hex"}
            made = occ.extrude([(2, top)], 0.0, 0.0, height, **(how if part.cells != "tet" else {}))
            top = made[0][1]
            volumes += [tag for dimension, tag in made if dimension == 3]
        occ.synchronize()
        for number, volume in enumerate(volumes, start=1):
            gmsh.model.addPhysicalGroup(3, [volume], number)
        _name_surfaces(gmsh.model, sum(HEIGHTS[part.name]))
        _set_sizes(gmsh, part)
        gmsh.model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(path))


def _outline(occ, name):
    """Return the surface that is extruded."""
    if name in _CORNERS:
        corners = [occ.addPoint(x, y, 0.0) for x, y in _CORNERS[name]]
        pairs = zip(corners, corners[1:] + corners[:1], strict=True)
        return occ.addPlaneSurface([occ.addCurveLoop([occ.addLine(a, b) for a, b in pairs])])
    outer, inner = (60.0, 20.0) if name == "flange" else (42.0, 38.0)
    holes = [(2, occ.addDisk(0.0, 0.0, 0.0, inner, inner))]
    disc = [(2, occ.addDisk(0.0, 0.0, 0.0, outer, outer))]
    if name == "flange":
        for angle in np.arange(6) * np.pi / 3.0:
            x, y = 45.0 * np.cos(angle), 45.0 * np.sin(angle)
            holes.append((2, occ.addDisk(x, y, 0.0, 5.0, 5.0)))
    else:  # a quarter, by symmetry
        disc = occ.intersect(disc, [(2, occ.addRectangle(0.0, 0.0, 0.0, outer, outer))])[0]
    return occ.cut(disc, holes)[0][0][1]


def _name_surfaces(model, height):
    everywhere = np.array([[-1e3] * 3, [1e3] * 3])
    for number, (name, axis, place) in enumerate(
        [("support", 2, 0.0), ("contact", 2, height), ("x", 0, 0.0), ("y", 1, 0.0)], start=1
    ):
        box = everywhere.copy()
        box[:, axis] = place - _SLACK, place + _SLACK
        found = model.getEntitiesInBoundingBox(*box.ravel(), 2)
        if found:
            model.addPhysicalGroup(2, [tag for _, tag in found], number)
            model.setPhysicalName(2, number, name)


def _set_sizes(gmsh, part):
    for name, value in {
        "Mesh.MeshSizeMax": part.size,
        "Mesh.MeshSizeMin": part.size,
        "Mesh.Algorithm3D": 10 if part.cells == "tet" else 1,
    }.items():
        gmsh.option.setNumber(name, value)
    if part.cells == "hex":
        for _, surface in gmsh.model.getEntities(2):
            gmsh.model.mesh.setRecombine(2, surface)
