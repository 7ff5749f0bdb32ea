"""CalculiX solves our meshes under exported laws: input decks, runs, results."""

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from patchlaw.macro import LoadedFace, compat
from patchlaw.macro.fields import node_numbers
from patchlaw.macro.mesh.contact_face import FacetQuadrature

PROGRAM = shutil.which("ccx")
_HEIGHT, _MARGIN = 0.25, 0.25  # of the plate that stands for the rigid plane [mm]
_TOP = 1e-9  # distance from a face that is rounding [mm]
_INCREMENTS = {False: "1., 1.", True: "0.005, 1., 1e-6, 0.1"}
_SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
# by our element: CalculiX' element, and its order of our nodes
_ELEMENTS = {
    "P1": ("C3D4", [0, 1, 2, 3]),
    "P2": ("C3D10", [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]),
    "Q1": ("C3D8", [0, 1, 3, 2, 4, 5, 7, 6]),
    # without those in the middle of faces and cells
    "Q2": ("C3D20", [0, 1, 3, 2, 4, 5, 7, 6, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 15, 14]),
}
# by the first letter: faces by CalculiX' vertices
_FACES = {
    "P": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "Q": [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
}


class NodalFace(LoadedFace):
    """A contact face with laws at its nodes, as CalculiX' node-to-face contact has them.

    Every node has its share of the area of every facet around it: the trapezoidal rule.
    """

    @cached_property
    def quadrature(self):
        """Quadrature points at the vertices of the facets."""
        facets, vertices = self.facets, self.facets.corners.shape[1]
        facet = np.repeat(np.arange(len(facets.corners)), vertices)
        local = np.tile(np.array([[0, 0], [1, 0], [0, 1], [1, 1]])[:vertices], (len(facet), 1))
        local = local[: len(facet)].astype(float)
        points = facets.corners.reshape(-1, 2)
        middle = facets.corners.mean(axis=1)[facet]
        patch = self.patches.index_of(*middle.T)
        order = np.argsort(patch, kind="stable")
        cell = facets.cell[facet]
        reference = facets.pull_back(facet, local)
        values = compat.lagrange_values(self.space.mesh.topology.cell_name(), 1, reference)
        return FacetQuadrature(
            x=points[order, 0],
            y=points[order, 1],
            depth=facets.depth.ravel()[order],
            weight=(facets.area / vertices)[facet][order],
            patch=patch[order],
            cell=cell[order],
            nodes=compat.cell_nodes(self.space)[cell][order],
            values=values[order],
            reference=reference[order],
        )


@dataclass(frozen=True, eq=False)
class Solution:
    """What CalculiX found.

    Attributes:
        force: Force on the plane [N]; with mortar contact CalculiX prints 0.
        reaction: Force that the bottom bears [N].
        displacement: Displacements of the block's nodes, in our order, shape (n, 3) [mm].
        pressure: Pressures at the nodes in contact, by our number of the node [MPa].
        shear: Shear forces on the plane after every shift, shape (m, 2) [N].
        reactions: Forces that the bottom bears after every control and shift, shape (l, 3) [N].
    """

    force: float
    reaction: float
    displacement: np.ndarray
    pressure: dict
    shear: np.ndarray
    reactions: np.ndarray


def solve(
    folder,
    face,
    laws,
    *controls,
    crown=None,
    shifts=(),
    pairs="NODE TO SURFACE",
    reduced=False,
    interactions=None,
):
    """Press a block under exported laws with CalculiX, then shift the plane along it.

    Args:
        folder: Folder for the files.
        face: The block's contact face with its patches.
        laws: File or files of surface interactions, as exported; included as they are.
        controls: Approaches and tilts of the plane, one after the other.
        crown: Depth of the face at (x, y) [mm], by which its nodes are lowered; None: flat.
        shifts: Shifts (x, y) of the plane one after the other, after the last control [mm].
        pairs: CalculiX' type of contact pairs.
        reduced: Whether 20-node hexahedra are integrated at eight points.
        interactions: Names of surface interactions by patch; those of one export by default.
    """
    files = laws if isinstance(laws, list) else [laws]
    named = interactions or [
        "PATCH_{}_{}".format(*face.patches.unravel(one)) for one in range(face.patches.count)
    ]
    steps = [(one, (0.0, 0.0)) for one in controls] + [(controls[-1], one) for one in shifts]
    lines = _deck(face, files, named, steps, crown, pairs, "R" if reduced else "")
    (folder / "block.inp").write_text("\n".join(lines) + "\n")
    return _read(printed(folder, "block"), face.space.tabulate_dof_coordinates().shape, len(shifts))


def frequencies(folder, space, springs, young, poisson, density, count):
    """Return frequencies of a box of linear elements, held below, on springs of a file [Hz].

    Args:
        folder: Folder for the files, where that of the springs is.
        space: Space of the displacements.
        springs: Name of that file, for nodes numbered as in the mesh's file.
        young: Young's modulus [MPa].
        poisson: Poisson's ratio.
        density: Density [t/mm³].
        count: How many.
    """
    numbers, nodes = node_numbers(space), space.tabulate_dof_coordinates()
    name = space.mesh.topology.cell_name()
    kind, order = _ELEMENTS[{"tetrahedron": "P1", "hexahedron": "Q1"}[name]]
    cells = numbers[_oriented(compat.cell_nodes(space)[:, order], nodes)]
    bottom = numbers[nodes[:, 2] < nodes[:, 2].min() + _TOP]
    lines = ["*NODE, NSET=BODY"]
    lines += [
        f"{i}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in zip(numbers, nodes, strict=True)
    ]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=BODY"]
    lines += [f"{i + 1}, " + ", ".join(map(str, cell)) for i, cell in enumerate(cells)]
    lines += ["*MATERIAL, NAME=ELASTIC", "*ELASTIC", f"{young}, {poisson}"]
    lines += ["*DENSITY", f"{density}", "*SOLID SECTION, ELSET=BODY, MATERIAL=ELASTIC"]
    lines += [f"*INCLUDE, INPUT={springs}", "*NSET, NSET=BOTTOM", *(f"{i}," for i in bottom)]
    lines += ["*BOUNDARY", "BOTTOM, 1, 3, 0.", "*STEP", "*FREQUENCY", f"{count}", "*END STEP"]
    (folder / "modes.inp").write_text("\n".join(lines) + "\n")
    table = re.split(r"CYCLES/TIME.*\n", printed(folder, "modes"))[1]
    rows = table.strip().splitlines()[:count]
    return [float(row.split()[3]) for row in rows]


def printed(folder, deck):
    """Run CalculiX on an input deck of a folder; return what it prints to the deck's file."""
    done = subprocess.run(
        [PROGRAM, "-i", deck],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode == 0 and "*ERROR" not in done.stdout, done.stdout[-2000:]
    return (folder / f"{deck}.dat").read_text()


def _deck(face, laws, interactions, steps, crown, pairs, reduced):
    """Yield the lines of the input deck."""
    block, nodes = face.body, face.space.tabulate_dof_coordinates().copy()
    top = np.abs(nodes[:, 2]) < _TOP
    element = face.body.mesh.shape.element
    (kind, order), sides = _ELEMENTS[element], _FACES[element[0]]
    cells = _oriented(compat.cell_nodes(face.space)[:, order], nodes)
    plate = len(nodes) + 1 + np.arange(8).reshape(2, 4)
    corner = np.array(face.patches.lengths) * _SQUARE + _MARGIN * (2 * _SQUARE - 1)
    nodes[top, 2] = 0.0 if crown is None else -crown(*nodes[top, :2].T)
    yield "*NODE, NSET=BODY"
    yield from (
        "{}, {:.12g}, {:.12g}, {:.12g}".format(i + 1, *nodes[i]) for i in np.unique(cells).tolist()
    )
    yield "*NODE, NSET=PLANE"
    for z, row in zip((0.0, _HEIGHT), plate, strict=True):
        yield from (f"{i}, {x:.12g}, {y:.12g}, {z}" for i, (x, y) in zip(row, corner, strict=True))
    yield f"*ELEMENT, TYPE={kind}{reduced}, ELSET=BODY"
    for number, cell in enumerate(cells, start=1):
        words = [str(one) for one in (number, *(cell + 1).tolist())]
        yield ", ".join(words[:11]) + "," * (len(words) > 11)  # a line holds 16 numbers
        if len(words) > 11:
            yield ", ".join(words[11:])
    yield "*ELEMENT, TYPE=C3D8, ELSET=PLANE"
    yield f"{len(cells) + 1}, " + ", ".join(map(str, plate.ravel()))
    yield from ("*MATERIAL, NAME=ELASTIC", "*ELASTIC")
    yield f"{block.material.young_modulus:.12g}, {block.material.poisson_ratio:.12g}"
    yield from (f"*SOLID SECTION, ELSET={name}, MATERIAL=ELASTIC" for name in ("BODY", "PLANE"))
    yield from (f"*INCLUDE, INPUT={one}" for one in laws)
    yield from ("*SURFACE, NAME=MASTER, TYPE=ELEMENT", f"{len(cells) + 1}, S1")
    faces = [
        (cell, side, face.patches.index_of(*nodes[at, :2].mean(axis=0)))
        for cell, numbers in enumerate(cells)
        for side, corners in enumerate(sides)
        if np.all(top[at := numbers[list(corners)]])
    ]
    for index in range(face.patches.count):
        yield f"*SURFACE, NAME=FACE_{index}, TYPE=ELEMENT"
        yield from (f"{cell + 1}, S{side + 1}" for cell, side, patch in faces if patch == index)
        yield f"*CONTACT PAIR, INTERACTION={interactions[index]}, TYPE={pairs}"
        yield f"FACE_{index}, MASTER"
    yield "*NSET, NSET=BOTTOM"
    low = np.flatnonzero(nodes[:, 2] < nodes[:, 2].min() + _TOP)
    yield from (f"{i + 1}," for i in np.intersect1d(low, cells))
    for control, (x, y) in steps:
        approach = control.approach + (corner - face.patches.middle) @ np.array(control.tilt)
        # residuals and corrections of 1e-8 instead of 5e-3: what is compared is the discretisation
        shifts = any(shift != (0.0, 0.0) for _, shift in steps)
        yield from ("*STEP, INC=1000", "*STATIC", _INCREMENTS[shifts])
        yield from ("*CONTROLS, PARAMETERS=FIELD", "1e-8, 1e-8, , , 1e-8")
        yield from ("*BOUNDARY", "BOTTOM, 1, 3, 0.")
        yield from (f"PLANE, 1, 1, {x:.12e}", f"PLANE, 2, 2, {y:.12e}")
        for row in plate:
            yield from (f"{i}, 3, 3, {-down:.12e}" for i, down in zip(row, approach, strict=True))
        yield from ("*NODE PRINT, NSET=BODY, FREQUENCY=1000", "U")
        yield from ("*NODE PRINT, NSET=PLANE, TOTALS=ONLY, FREQUENCY=1000", "RF")
        yield from ("*NODE PRINT, NSET=BOTTOM, TOTALS=ONLY, FREQUENCY=1000", "RF")
        yield from ("*CONTACT PRINT, FREQUENCY=1000", "CSTR", "*END STEP")


def _oriented(cells, nodes):
    """Return tetrahedra whose fourth vertex lies above the other three, as CalculiX wants it."""
    if cells.shape[1] in (4, 10):
        edges = nodes[cells[:, 1:4]] - nodes[cells[:, :1]]
        turned = np.linalg.det(edges) < 0.0
        swapped = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8][: cells.shape[1]]
        cells[turned] = cells[turned][:, swapped]
    return cells


def _read(text, shape, shifts):
    """Read the results that were printed at the end of every step; those of the last one."""
    blocks = re.split(r"\n\s*\n", text)
    tables = list(zip(blocks[::2], blocks[1::2], strict=False))

    def rows(start):
        found = [body for title, body in tables if title.strip().startswith(start)]
        return [
            np.array([[float(word) for word in line.split()] for line in body.splitlines()])
            for body in found
        ]

    plane = -np.concatenate(rows("total force (fx,fy,fz) for set PLANE"))
    bottom = np.concatenate(rows("total force (fx,fy,fz) for set BOTTOM"))
    last = rows("displacements")[-1]
    moved = np.full(shape, np.nan)
    moved[last[:, 0].astype(int) - 1] = last[:, 1:]
    stress = [part[:, :2] for part in rows("contact stress") if part.size]
    return Solution(
        force=plane[-1, 2],
        reaction=float(bottom[-1, 2]),
        displacement=moved,
        pressure={int(node) - 1: pressure for node, pressure in stress[-1]} if stress else {},
        shear=-plane[len(plane) - shifts :, :2],
        reactions=bottom,
    )
