"""Mesh of a quarter of a mechanical seal's ring, of hexahedra.

Dimensions in mm. The axis is z, and the narrow sealing face looks up:

    ring      radii 20 … 26, 8 high, from z = 0 to z = 8
    nose      radii 22 … 24.5, 2 high: its top at z = 10 is the sealing face
    shoulder  the ring's top outside the nose, radii 24.5 … 26, which the sealed fluid presses on
    seat      the ring's bottom, radii 20 … 22, which the ring stands on

A quarter is meshed: `plane x` and `plane y` are the planes of symmetry x = 0 and y = 0.

Run it as `.venv/bin/python demos/bodies/seal_ring.py`; `--size` is the length of edges [mm] in the
section, `--out` the file. It writes physical names: volume `ring`, surfaces `sealing face`, `bore`
and `rim` (the walls of the nose inside and outside), `shoulder`, `seat`, `plane x` and `plane y`.
"""

from math import ceil, pi

import gmsh
from meshing import in_box, name, write_body

RADII = (20.0, 22.0, 24.5, 26.0)
RING, NOSE = 8.0, 2.0
TOP = RING + NOSE
SLOWER = 4.0
"""Length of cells around the axis over that in the section."""


def section(size: float) -> list[tuple[int, int]]:
    """Return the section in the xz plane as rectangles that share their sides, cut into squares."""
    occ = gmsh.model.occ
    blocks = [(*RADII[k : k + 2], 0.0, RING) for k in range(3)] + [(RADII[1], RADII[2], RING, TOP)]
    faces = []
    for left, right, low, high in blocks:
        corners = [(left, low), (right, low), (right, high), (left, high)]
        points = [occ.addPoint(x, 0, z) for x, z in corners]
        lines = [occ.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
        faces.append((2, occ.addPlaneSurface([occ.addCurveLoop(lines)])))
    faces, _ = occ.fragment(faces, [])
    occ.synchronize()
    for _, line in gmsh.model.getEntities(1):
        length = occ.getMass(1, line)
        gmsh.model.mesh.setTransfiniteCurve(line, ceil(length / size - 1e-9) + 1)
    for _, face in faces:
        gmsh.model.mesh.setTransfiniteSurface(face)
        gmsh.model.mesh.setRecombine(2, face)
    return faces


def between(z: float, inner: float, outer: float) -> list[int]:
    """Return the surfaces in a plane across z between two radii."""
    inside = set(in_box((0, 0, z), (inner, inner, z)))
    return [tag for tag in in_box((0, 0, z), (outer, outer, z)) if tag not in inside]


def nose_wall(radius: float) -> list[int]:
    """Return the cylindrical surfaces of the nose at a radius."""
    within = in_box((0, 0, RING), (radius, radius, TOP))
    boxes = {tag: gmsh.model.getBoundingBox(2, tag) for tag in within}
    return [
        tag
        for tag, (x, y, z, right, back, top) in boxes.items()
        if top - z > 0.9 * NOSE and min(right - x, back - y) > 0.9 * radius
    ]


def build(size: float) -> None:
    """Make the geometry, name its parts and set the length of edges [mm]."""
    layers = ceil(0.5 * pi * RADII[1] / (SLOWER * size))
    gmsh.model.occ.revolve(section(size), 0, 0, 0, 0, 0, 1, 0.5 * pi, [layers], recombine=True)
    gmsh.model.occ.synchronize()

    name(3, [tag for _, tag in gmsh.model.getEntities(3)], "ring")
    name(2, between(TOP, RADII[1], RADII[2]), "sealing face")
    name(2, between(RING, RADII[2], RADII[3]), "shoulder")
    name(2, between(0.0, RADII[0], RADII[1]), "seat")
    name(2, nose_wall(RADII[1]), "bore")
    name(2, nose_wall(RADII[2]), "rim")
    name(2, in_box((0, 0, 0), (0, RADII[3], TOP)), "plane x")
    name(2, in_box((0, 0, 0), (RADII[3], 0, TOP)), "plane y")


if __name__ == "__main__":
    write_body(__file__, __doc__, 0.25, build)
