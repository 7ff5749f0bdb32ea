"""Writes boxes of hexahedra as .msh files of gmsh's format 2.2, with named faces and a volume."""

from pathlib import Path

import numpy as np

FACES = {"top": 1, "bottom": 2, "left": 3, "right": 4, "front": 5, "back": 6}
CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
BETWEEN = {
    4: [(0, 1), (1, 2), (2, 3), (3, 0), (0, 1, 2, 3)],
    8: [
        *[(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6)],
        *[(6, 7), (0, 1, 2, 3), (0, 1, 5, 4), (0, 3, 7, 4), (1, 2, 6, 5), (2, 3, 7, 6)],
        *[(4, 5, 6, 7), range(8)],
    ],
}
"""Corners between which nodes of second order lie: "Node ordering" of gmsh's manual."""


def write_box(path, ticks, *, turn=None, shift=(0, 0, 0), halves=False, crown=0.0, order=1):
    """Write a box between ticks along x, y and z, turned and then shifted.

    Args:
        path: The file.
        ticks: Coordinates of the lattice along each axis.
        turn: A rotation, shape (3, 3).
        shift: A shift.
        halves: Whether the cells and the top beyond the middle along x have names of their own.
        crown: Curvature of the top along x, about its middle.
        order: Order of the cells, 1, or 2 with nodes between the corners.
    """
    cells = np.array([len(axis) - 1 for axis in ticks])
    if order == 2:
        ticks = [
            np.interp(np.arange(2 * n + 1) / 2, range(n + 1), axis)
            for n, axis in zip(cells, ticks, strict=True)
        ]
    counts = np.array([len(axis) for axis in ticks])
    number = np.arange(counts.prod()).reshape(counts) + 1
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    below = (points[:, 2] - ticks[2][0]) / (ticks[2][-1] - ticks[2][0])
    points[:, 2] -= 0.5 * crown * (points[:, 0] - 0.5 * (ticks[0][0] + ticks[0][-1])) ** 2 * below
    points = points @ np.asarray(np.eye(3) if turn is None else turn).T + np.asarray(shift)
    names = {**FACES, "upper half": 7}
    lines, volumes = [], {"body": 10, "other": 11}
    middle = 0.5 * (ticks[0][0] + ticks[0][-1])

    def second(i):
        return halves and ticks[0][order * i] + ticks[0][order * (i + 1)] > 2.0 * middle

    square, cube = (_nodes(corners, order) for corners in (SQUARE, CUBE))

    for axis, sides in ((0, (3, 4)), (1, (5, 6)), (2, (2, 1))):
        others = [other for other in range(3) if other != axis]
        for end, tag in zip((0, -1), sides, strict=True):
            nodes = number.take(end, axis=axis)
            for i, j in np.ndindex(*cells[others]):
                corner = nodes[tuple((square + order * np.array([i, j])).T)]
                here = 7 if tag == 1 and second(i) else tag
                lines.append((3 if order == 1 else 10, here, corner))
    for cell in np.ndindex(*cells):
        corner = number[tuple((cube + order * np.array(cell)).T)]
        lines.append((5 if order == 1 else 12, 11 if second(cell[0]) else 10, corner))
    used = {tag for _, tag, _ in lines}
    named = [(2, tag, name) for name, tag in names.items() if tag in used]
    named += [(3, tag, name) for name, tag in volumes.items() if tag in used]
    text = ["$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames", str(len(named))]
    text += [f'{dim} {tag} "{name}"' for dim, tag, name in named]
    text += ["$EndPhysicalNames\n$Nodes", str(len(points))]
    text += [f"{k + 1} {x:.17g} {y:.17g} {z:.17g}" for k, (x, y, z) in enumerate(points)]
    text += ["$EndNodes\n$Elements", str(len(lines))]
    text += [
        f"{k + 1} {kind} 2 {tag} {tag} {' '.join(map(str, corner))}"
        for k, (kind, tag, corner) in enumerate(lines)
    ]
    Path(path).write_text("\n".join([*text, "$EndElements", ""]), encoding="utf-8")
    return Path(path)


def _nodes(corners, order):
    """Return where the nodes of a cell lie in a lattice of all nodes, in gmsh's order."""
    if order == 1:
        return corners
    between = [corners[list(ends)].mean(axis=0) for ends in BETWEEN[len(corners)]]
    return (2.0 * np.concatenate([corners, between])).astype(int)


def cube_section(folder, cells, *, margin=0.0, above=False):
    """Write a cube of 1 mm, below its contact face or above it; return its section of a scene."""
    path = folder / f"{cells}-{margin}-{above}.msh"
    across = np.linspace(-margin, 1.0 + margin, cells + 1)
    levels = np.linspace(0.0, 1.0, cells + 1) if above else np.linspace(-1.0, 0.0, cells + 1)
    write_box(path, (across, across, levels))
    contact, held = ("bottom", "top") if above else ("top", "bottom")
    return {"mesh": str(path), "contact": contact, "supports": [{"surface": held}]}
