"""The same pad and the same law in CalculiX: its input deck, its run, and what it finds."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import gmsh
import numpy as np

PROGRAM = shutil.which("ccx")
_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))  # of C3D4, by its own vertices
_PLATE, _WIDER = 5.0, 10.0  # height of the plate that stands for the disc, and its margin [mm]


class Solution(NamedTuple):
    """What CalculiX finds.

    Attributes:
        force: Force on the disc [N].
        places: Nodes in contact, from the lower corner of the face, shape (n, 2) [mm].
        pressures: Pressures there, shape (n,) [MPa].
    """

    force: float
    places: np.ndarray
    pressures: np.ndarray


def solve(
    mesh: Path, law: Path, face: str, held: str, moduli: dict[str, tuple[float, float]], down: float
) -> Solution:
    """Press a body of linear tetrahedra by a rigid disc.

    Args:
        mesh: The mesh of gmsh [mm].
        law: File of its surface interaction, as `patchlaw laws --export calculix` writes it.
        face: Name of the contact face, which looks along z.
        held: Name of the face that is held.
        moduli: Young's modulus [MPa] and Poisson's ratio by name of the volume.
        down: Approach of the disc, from the plane of the face [mm].
    """
    gmsh.initialize(["", "-v", "2"], readConfigFiles=False)
    gmsh.open(str(mesh))
    deck = mesh.with_suffix(".inp")
    deck.write_text("\n".join(_lines(law, face, held, moduli, down)) + "\n", encoding="ascii")
    gmsh.finalize()
    done = subprocess.run(
        [PROGRAM, "-i", deck.stem],
        cwd=deck.parent,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode or "*ERROR" in done.stdout:
        raise RuntimeError(done.stdout[-2000:])
    return _read(deck, face)


def _group(dimension: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the elements of a named part, and those of their nodes."""
    tag = next(
        tag
        for _, tag in gmsh.model.getPhysicalGroups(dimension)
        if gmsh.model.getPhysicalName(dimension, tag) == name
    )
    numbers, nodes = [], []
    for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag):
        _, own, vertices = gmsh.model.mesh.getElements(dimension, entity)
        numbers.append(own[0])
        nodes.append(vertices[0].reshape(-1, dimension + 1))
    return np.concatenate(numbers).astype(int), np.concatenate(nodes).astype(int)


def _lines(
    law: Path, face: str, held: str, moduli: dict[str, tuple[float, float]], down: float
) -> Iterator[str]:
    """Yield the lines of the input deck."""
    number, place, _ = gmsh.model.mesh.getNodes()
    place = place.reshape(-1, 3)
    yield "*NODE"
    for n, (x, y, z) in zip(number, place, strict=True):
        yield f"{n}, {x:.12g}, {y:.12g}, {z:.12g}"
    touching = {tuple(sorted(nodes)) for nodes in _group(2, face)[1]}
    slaves = []
    for name, (young, poisson) in moduli.items():
        label = name.upper().replace(" ", "_")
        yield f"*ELEMENT, TYPE=C3D4, ELSET={label}"
        for element, nodes in zip(*_group(3, name), strict=True):
            yield f"{element}, " + ", ".join(map(str, nodes))
            slaves += [
                f"{element}, S{side + 1}"
                for side, corners in enumerate(_FACES)
                if tuple(sorted(nodes[list(corners)])) in touching
            ]
        yield from (f"*MATERIAL, NAME={label}", "*ELASTIC", f"{young:.12g}, {poisson:.12g}")
        yield f"*SOLID SECTION, ELSET={label}, MATERIAL={label}"
    top = place[number == _group(2, face)[1][0, 0]][0, 2]
    first, (x0, y0, _), (x1, y1, _) = int(number.max()) + 1, place.min(axis=0), place.max(axis=0)
    x0, y0, x1, y1 = x0 - _WIDER, y0 - _WIDER, x1 + _WIDER, y1 + _WIDER
    yield "*NODE, NSET=DISC"
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    for k, (x, y) in enumerate(2 * corners):
        yield f"{first + k}, {x:.12g}, {y:.12g}, {top + _PLATE * (k > 3):.12g}"
    yield "*ELEMENT, TYPE=C3D8, ELSET=DISC"
    element = int(max(_group(3, name)[0].max() for name in moduli)) + 1
    yield f"{element}, " + ", ".join(str(first + k) for k in range(8))
    yield f"*SOLID SECTION, ELSET=DISC, MATERIAL={next(iter(moduli)).upper().replace(' ', '_')}"
    yield f"*INCLUDE, INPUT={law.resolve()}"
    behaviour = re.search(r"\*SURFACE INTERACTION, *NAME=(\S+)", law.read_text(encoding="ascii"))[1]
    yield from ("*SURFACE, NAME=FACE, TYPE=ELEMENT", *slaves)
    yield from ("*SURFACE, NAME=COUNTER, TYPE=ELEMENT", f"{element}, S1")
    yield f"*CONTACT PAIR, INTERACTION={behaviour}, TYPE=NODE TO SURFACE"
    yield from ("FACE, COUNTER", "*NSET, NSET=HELD")
    yield from (f"{node}," for node in np.unique(_group(2, held)[1]))
    # residuals and corrections of 1e-8 instead of 5e-3
    yield from ("*STEP, INC=200", "*STATIC", "0.25, 1.")
    yield from ("*CONTROLS, PARAMETERS=FIELD", "1e-8, 1e-8, , , 1e-8")
    yield from ("*BOUNDARY", "HELD, 1, 3, 0.", "DISC, 1, 2, 0.", f"DISC, 3, 3, {-down:.12e}")
    yield from ("*NODE PRINT, NSET=DISC, TOTALS=ONLY", "RF", "*CONTACT PRINT", "CSTR", "*END STEP")


def _read(deck: Path, face: str) -> Solution:
    """Read what the last increment printed."""
    blocks = re.split(r"\n\s*\n", deck.with_suffix(".dat").read_text(encoding="ascii"))
    tables = dict(zip((title.strip() for title in blocks[::2]), blocks[1::2], strict=False))

    def last(start: str) -> np.ndarray:
        body = [body for title, body in tables.items() if title.startswith(start)][-1]
        return np.array([[float(word) for word in line.split()] for line in body.splitlines()])

    gmsh.initialize(["", "-v", "2"], readConfigFiles=False)
    gmsh.open(str(deck.with_suffix(".msh")))
    number, place, _ = gmsh.model.mesh.getNodes()
    nodes = np.unique(_group(2, face)[1])
    gmsh.finalize()
    place = place.reshape(-1, 3)[np.argsort(number), :2]
    number, contact = np.sort(number), last("contact stress")
    corner = place[np.searchsorted(number, nodes)].min(axis=0)
    where = place[np.searchsorted(number, contact[:, 0].astype(int))] - corner
    return Solution(-float(last("total force")[0, 2]), where, contact[:, 1])
