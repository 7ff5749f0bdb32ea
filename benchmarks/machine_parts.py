"""Machine parts as bodies on meshes in gmsh's files, for tests and benchmarks of solvers.

``hex`` and ``layers`` are outlines that are extruded, layer by layer, into hexahedra or into
tetrahedra, and layers can be flatter than they are wide; ``tet`` fills the volumes with tetrahedra
of one length. Volumes are named by numbers from the support up; surfaces are ``support`` (z = 0),
``contact`` (the top) and, where the part has such planes, ``x`` and ``y`` (x = 0, y = 0).
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from helpers.mesh_files import gmsh_session

from patchlaw.macro import Material, MeshedBody, Support, read_mesh
from patchlaw.support import on_root

STEEL = Material(young_modulus=210e3, poisson_ratio=0.3)

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
        fast: Whether gmsh's fastest algorithm makes them, not always the same ones.
    """

    name: str
    cells: str
    size: float
    flat: float = 1.0
    fast: bool = False


def read_part(part, comm, reading=read_mesh, file=None):
    """Mesh a part on rank 0, and read its file on all ranks; a file that exists is taken."""
    with tempfile.TemporaryDirectory() as folder:
        path = comm.bcast(Path(folder) / "part.msh" if file is None else Path(file))
        on_root(comm, lambda: path.exists() or write_part(part, path))
        found = reading(path, comm)
        comm.Barrier()
    return found


def part_body(tagged, degree=1, second=STEEL, rollers=False):
    """Return a part of steel, clamped on its support, or on rollers on three planes.

    Args:
        tagged: Its mesh.
        degree: Degree of the displacements.
        second: Material of the second volume, such as the lining of a pad.
        rollers: Whether only normal displacements are held, on the support and where x, y = 0.
    """
    names = tagged.facet_names
    materials = dict(zip(sorted(tagged.cell_names.values()), (STEEL, second), strict=False))
    held = [Support(tag=names["support"], displacement=(None if rollers else 0.0,) * 2 + (0.0,))]
    if rollers:
        held.append(Support(tag=names["x"], displacement=(0.0, None, None)))
        held.append(Support(tag=names["y"], displacement=(None, 0.0, None)))
    return MeshedBody(tagged, materials if len(materials) > 1 else STEEL, held, order=degree)


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
        "Mesh.RecombinationAlgorithm": 3,  # no triangle is left
        "Mesh.Algorithm3D": 10 if part.fast else 1,
    }.items():
        gmsh.option.setNumber(name, value)
    if part.cells == "hex":
        for _, surface in gmsh.model.getEntities(2):
            gmsh.model.mesh.setRecombine(2, surface)
