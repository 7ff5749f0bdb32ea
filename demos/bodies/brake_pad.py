"""Mesh of a brake pad: a lining with a groove and chamfered ends on its steel back plate.

Dimensions in mm, those of a middle-sized car. The disc turns about the z axis, and the pad face
looks up:

    lining      ring sector, radii 100 … 143, 56° wide, 10 thick; face at z = 15
    groove      3 wide, 6 deep, along the middle radius: the face is in two pieces
    chamfers    4 × 4 at 45° along both ends, where the disc runs in and out
    back plate  ring sector, radii 97 … 146, 64° wide, 5 thick, below z = 5
    piston      ring on the back of the plate, diameters 30 … 44, centre at radius 121.5: the rim of
                a hollow piston, which holds the pad

Run it as `.venv/bin/python demos/bodies/brake_pad.py`; `--size` is the length of edges at the
face [mm], `--out` the file. It writes physical names: volumes `lining` and `back plate`, surfaces
`pad face`, `piston` and `back`, the rest of the plate's rear.
"""

from math import cos, pi, radians, sin

import gmsh
from meshing import in_plane, name, set_size, write_body

PLATE, LINING = 5.0, 10.0
TOP = PLATE + LINING
INNER, OUTER, WIDTH = 100.0, 143.0, radians(56.0)
GROOVE_WIDTH, GROOVE_DEPTH, CHAMFER = 3.0, 6.0, 4.0
PISTON_RADIUS, PISTON_INNER, PISTON_OUTER = 121.5, 15.0, 22.0


def sector(inner: float, outer: float, width: float, z: float, height: float) -> tuple[int, int]:
    """Return a ring sector about the z axis, symmetric to the xz plane."""
    occ, half = gmsh.model.occ, 0.5 * width
    centre = occ.addPoint(0, 0, z)
    corners = [
        occ.addPoint(radius * cos(angle), radius * sin(angle), z)
        for radius, angle in ((inner, -half), (outer, -half), (outer, half), (inner, half))
    ]
    a, b, c, d = corners
    lines = [occ.addLine(a, b), occ.addCircleArc(b, centre, c)]
    lines += [occ.addLine(c, d), occ.addCircleArc(d, centre, a)]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    return next(entity for entity in occ.extrude([(2, face)], 0, 0, height) if entity[0] == 3)


def cutters() -> list[tuple[int, int]]:
    """Return what is cut off the lining: the groove, and a bar on edge along either end."""
    occ, reach, side = gmsh.model.occ, OUTER - INNER + 20.0, CHAMFER * 2.0**0.5
    start = INNER - 10.0
    tools = [
        (3, occ.addBox(start, -GROOVE_WIDTH / 2, TOP - GROOVE_DEPTH, reach, GROOVE_WIDTH, TOP))
    ]
    for end in (-0.5, 0.5):
        bar = (3, occ.addBox(start, -side / 2, TOP - side / 2, reach, side, side))
        occ.rotate([bar], 0, 0, TOP, 1, 0, 0, pi / 4)
        occ.rotate([bar], 0, 0, 0, 0, 0, 1, end * WIDTH)
        tools.append(bar)
    return tools


def build(size: float) -> None:
    """Make the geometry, name its parts and set the length of edges [mm]."""
    occ = gmsh.model.occ
    plate = sector(INNER - 3.0, OUTER + 3.0, radians(64.0), 0.0, PLATE)
    lining = sector(INNER, OUTER, WIDTH, PLATE, LINING)
    (lining,), _ = occ.cut([lining], cutters())
    rim = (2, occ.addDisk(PISTON_RADIUS, 0, 0, PISTON_OUTER, PISTON_OUTER))
    hollow = (2, occ.addDisk(PISTON_RADIUS, 0, 0, PISTON_INNER, PISTON_INNER))
    piston, _ = occ.cut([rim], [hollow])
    # volumes that touch must share nodes, and the ring must be a surface of the plate
    _, pieces = occ.fragment([plate, lining], piston)
    occ.synchronize()

    rear = in_plane(0.0, 200.0)
    held = [tag for dimension, tag in pieces[2] if dimension == 2]
    name(3, [tag for _, tag in pieces[0]], "back plate")
    name(3, [tag for _, tag in pieces[1]], "lining")
    name(2, in_plane(TOP, 200.0), "pad face")
    name(2, held, "piston")
    name(2, [tag for tag in rear if tag not in held], "back")

    set_size(f"{size} * (1 + 0.1 * ({TOP} - z))")  # coarser with the depth below the face


if __name__ == "__main__":
    write_body(__file__, __doc__, 2.0, build)
