"""A chip off the face of a brake pad: a column of lining on a piece of its steel plate."""

from pathlib import Path

import gmsh

HEIGHTS = {"back plate": 1.0, "lining": 2.0}
"""Heights of both volumes, from below [mm]."""


def write_chip(path: Path, side: float, size: float) -> Path:
    """Mesh the chip; faces `face` and `rear`, volumes `lining` and `back plate`.

    Args:
        path: File to write.
        side: Side of its square face [mm].
        size: Length of edges [mm].
    """
    gmsh.initialize(["", "-v", "2"], readConfigFiles=False)
    occ, below, boxes = gmsh.model.occ, 0.0, []
    for height in HEIGHTS.values():
        boxes.append((3, occ.addBox(0, 0, below, side, side, height)))
        below += height
    _, pieces = occ.fragment(boxes[:1], boxes[1:])
    occ.synchronize()
    for name, volumes in zip(HEIGHTS, pieces, strict=True):
        named(3, [tag for _, tag in volumes], name)
    for name, z in (("rear", 0.0), ("face", below)):
        flat = gmsh.model.getEntitiesInBoundingBox(-1, -1, z - 1e-3, 99, 99, z + 1e-3, 2)
        named(2, [tag for _, tag in flat], name)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(path))
    gmsh.finalize()
    return path


def named(dimension: int, tags: list[int], name: str) -> None:
    """Make a physical group with a name."""
    gmsh.model.setPhysicalName(dimension, gmsh.model.addPhysicalGroup(dimension, tags), name)
