"""Writes boxes of hexahedra as .msh files of gmsh's format 2.2, with named faces and a volume."""

from pathlib import Path

import numpy as np

FACES = {"top": 1, "bottom": 2, "left": 3, "right": 4, "front": 5, "back": 6}
CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def write_box(path, ticks, *, turn=None, shift=(0, 0, 0), halves=False, crown=0.0):
    """Write a box between ticks along x, y and z, turned and then shifted.

    Args:
        path: The file.
        ticks: Coordinates of the lattice along each axis.
        turn: A rotation, shape (3, 3).
        shift: A shift.
        halves: Whether the cells and the top beyond the middle along x have names of their own.
        crown: Curvature of the top along x, about its middle.
    """
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
        return halves and ticks[0][i] + ticks[0][i + 1] > 2.0 * middle

    for axis, sides in ((0, (3, 4)), (1, (5, 6)), (2, (2, 1))):
        others = [other for other in range(3) if other != axis]
        for end, tag in zip((0, -1), sides, strict=True):
            nodes = number.take(end, axis=axis)
            for i, j in np.ndindex(*(counts[others] - 1)):
                corner = nodes[tuple((SQUARE + np.array([i, j])).T)]
                here = 7 if tag == 1 and second(i) else tag
                lines.append((3, here, corner))
    for cell in np.ndindex(*(counts - 1)):
        corner = number[tuple((CUBE + np.array(cell)).T)]
        lines.append((5, 11 if second(cell[0]) else 10, corner))
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
