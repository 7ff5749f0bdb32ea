"""Mesh of a bolted pipe flange with a raised face.

Dimensions in mm, close to a DN 50 flange of PN 40. The axis is z, and the raised face looks up:

    disc         diameter 165, 18 thick, from z = 0 to z = 18
    raised face  ring of diameters 55 … 102, 2 high; contact face at z = 20
    bore         diameter 55
    bolt holes   4, diameter 18, on a circle of diameter 125, at 45° to the axes
    washers      rings of diameters 18 … 30 on the rear at z = 0, where the bolts' heads pull:
                 452.4 mm² each
    neck         pipe of diameters 55 … 71, 40 long, below z = 0; its end holds the flange

Run it as `.venv/bin/python demos/bodies/flange.py`; `--size` is the length of edges at the outer
rim of the raised face [mm], where it will touch, `--out` the file. It writes physical names:
volume `flange`, surfaces `raised face`, `bore`, `rim` (the outer wall of the raised face),
`washers` and `pipe end`.
"""

from math import cos, pi, sin

import gmsh
from meshing import in_plane, name, set_size, write_body

DISC, RAISED, NECK = 18.0, 2.0, 40.0
TOP = DISC + RAISED
BORE, OUTER, FACE, PIPE = 27.5, 82.5, 51.0, 35.5
BOLTS, HOLE, WASHER = 62.5, 9.0, 15.0


def cylinder(z: float, height: float, radius: float, x: float = 0.0, y: float = 0.0) -> tuple:
    """Return an upright cylinder."""
    return 3, gmsh.model.occ.addCylinder(x, y, z, 0, 0, height, radius)


def around_axis(radius: float) -> list[int]:
    """Return the surfaces that lie on an upright cylinder about the axis."""
    wide = radius + 1e-3
    box = gmsh.model.getEntitiesInBoundingBox(-wide, -wide, -1e3, wide, wide, 1e3, 2)
    return [tag for _, tag in box if gmsh.model.getType(2, tag) == "Cylinder"]


def build(size: float) -> None:
    """Make the geometry, name its parts and set the length of edges [mm]."""
    occ = gmsh.model.occ
    solid, _ = occ.fuse(
        [cylinder(0, DISC, OUTER)], [cylinder(DISC, RAISED, FACE), cylinder(-NECK, NECK, PIPE)]
    )
    places = [
        (BOLTS * cos(pi * k / 2 + pi / 4), BOLTS * sin(pi * k / 2 + pi / 4)) for k in range(4)
    ]
    holes = [cylinder(-1, DISC + 2, HOLE, x, y) for x, y in places]
    solid, _ = occ.cut(solid, [cylinder(-NECK - 1, NECK + TOP + 2, BORE), *holes])
    rings = []
    for x, y in places:
        disc, hole = ((2, occ.addDisk(x, y, 0, radius, radius)) for radius in (WASHER, HOLE))
        rings += occ.cut([disc], [hole])[0]
    _, pieces = occ.fragment(solid, rings)  # the rings become surfaces of the rear
    occ.synchronize()

    name(3, [tag for _, tag in pieces[0]], "flange")
    name(2, in_plane(TOP, FACE + 1), "raised face")
    name(2, [tag for ring in pieces[1:] for _, tag in ring], "washers")
    name(2, in_plane(-NECK, PIPE + 1), "pipe end")
    name(2, around_axis(BORE), "bore")
    inner = around_axis(PIPE)
    name(2, [tag for tag in around_axis(FACE) if tag not in inner], "rim")

    away = f"(({TOP} - z)^2 + ({FACE} - (x^2 + y^2)^0.5)^2)^0.5"
    set_size(f"{size} * (1 + 0.15 * {away})")  # coarser with the distance from the face's rim


if __name__ == "__main__":
    write_body(__file__, __doc__, 2.0, build)
