"""Writes CalculiX input decks of a cube under a plate and reads the forces of both.

Used by the scripts calculix_*.sh beside it. A unit cube (E = 1000 MPa, nu = 0, no displacement
along the face, linear hexahedra, clamped below in z) is pressed by a plate through a contact law.
It is a bar: the law's spring and the cube lie in series, so the force follows from two stiffnesses.
"""

import os
import re
import subprocess

TABLE = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n50., 0.01"  # 5000 MPa/mm


def deck(
    *,
    cells=1,
    law=TABLE,
    kind="NODE TO SURFACE",
    slave="ELEMENT",
    halves=False,
    shift="0.005",
    gap=0.0,
    first="",
    shear="",
    stretch=0.0,
    geometry="",
    more="",
    printed="*CONTACT PRINT\nCSTR",
):
    """Return the text of a deck.

    Args:
        cells: Cells along every edge of the cube.
        law: Lines of the surface interaction.
        kind: Type of the contact pair.
        slave: Type of the slave surface, ELEMENT or NODE.
        halves: Whether the face is dealt to two slave surfaces, along x.
        shift: Displacement of the plate towards the cube [mm], as text.
        gap: Distance of the plate from the cube before [mm].
        first: Lines before the material of cube and plate, such as another material.
        shear: Displacement of the plate along x [mm], as text; nothing holds it at 0.
        stretch: Strain along x at which the cube is held.
        geometry: What follows *STEP, such as ", NLGEOM".
        more: Lines behind the contact pair.
        printed: Lines of what else to print.
    """
    edge = cells + 1

    def number(i, j, k):
        return 1 + i + edge * (j + edge * k)

    places = [(i, j, k) for k in range(edge) for j in range(edge) for i in range(edge)]
    nodes = [(number(*at), *(one / cells for one in at[:2]), at[2] / cells - 1.0) for at in places]
    ring = ((0, 0), (1, 0), (1, 1), (0, 1))
    below = [(i, j, k) for i, j, k in places if max(i, j, k) < cells]
    bricks = [[number(i + a, j + b, k + c) for c in (0, 1) for a, b in ring] for i, j, k in below]
    plate = len(nodes) + 1
    corners = [(1.5 * a - 0.25, 1.5 * b - 0.25, gap + c) for c in (0, 0.25) for a, b in ring]
    top = [n + 1 for n, (_, _, k) in enumerate(below) if k == cells - 1]
    lines = ["*NODE, NSET=CUBE", *(f"{n}, {x:.9g}, {y:.9g}, {z:.9g}" for n, x, y, z in nodes)]
    lines += [
        "*NODE, NSET=PLATE",
        *(f"{plate + n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(corners)),
    ]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=CUBE"]
    lines += [f"{n + 1}, {', '.join(map(str, brick))}" for n, brick in enumerate(bricks)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=PLATE"]
    lines += [f"{len(bricks) + 1}, {', '.join(str(plate + n) for n in range(8))}"]
    lines += [*first.splitlines(), "*MATERIAL, NAME=CUBE", "*ELASTIC", "1000., 0."]
    lines += [f"*SOLID SECTION, ELSET={part}, MATERIAL=CUBE" for part in ("CUBE", "PLATE")]
    lines += ["*SURFACE INTERACTION, NAME=LAW", *law.splitlines()]
    lines += ["*SURFACE, NAME=MASTER, TYPE=ELEMENT", f"{len(bricks) + 1}, S1"]
    if slave == "NODE":
        lines += ["*NSET, NSET=TOP", *(f"{n}," for n, _, _, z in nodes if z == 0.0)]
    lines += [f"*SURFACE, NAME=SLAVE, TYPE={slave}"]
    lines += ["TOP"] if slave == "NODE" else [f"{n}, S2" for n in top]
    lines += [f"*CONTACT PAIR, INTERACTION=LAW, TYPE={kind}", "SLAVE, MASTER"]
    if halves:
        right = [n for n in top if (n - 1) % cells >= cells / 2]
        lines = [one for one in lines if one not in {f"{n}, S2" for n in right}]
        lines += ["*SURFACE, NAME=OTHER, TYPE=ELEMENT", *(f"{n}, S2" for n in right)]
        lines += [f"*CONTACT PAIR, INTERACTION=LAW, TYPE={kind}", "OTHER, MASTER"]
    lines += more.splitlines()
    lines += ["*NSET, NSET=BASE", *(f"{n}," for n, _, _, z in nodes if z == -1.0)]
    held = "BASE" if kind == "MORTAR" else "CUBE"  # MORTAR wants slave nodes free
    lines += [f"*STEP, INC=1000{geometry}", "*STATIC", "1., 1."]
    lines += ["*CONTROLS, PARAMETERS=FIELD", "1e-8, 1e-8, , , 1e-8"]
    lines += ["*BOUNDARY", "BASE, 3, 3, 0.", f"{held}, 1, 2, 0.", "PLATE, 2, 2, 0."]
    if stretch:
        lines += [f"{n}, 1, 1, {stretch * x:.9g}" for n, x, _, _ in nodes]
    lines += [f"PLATE, 1, 1, {shear or '0.'}", f"PLATE, 3, 3, -{shift}"]
    for part in ("BASE", "PLATE"):
        lines += [f"*NODE PRINT, NSET={part}, TOTALS=ONLY", "RF"]
    lines += printed.splitlines()
    return "\n".join([*lines, "*END STEP", ""])


def forces(**options):
    """Return the last forces on base and plate [N], and how many rows of contact stress."""
    return forces_of(deck(**options))


def forces_of(text):
    """Return the same of a deck that a script has changed."""
    with open("deck.inp", "w") as file:
        file.write(text)
    done = subprocess.run(
        [os.environ["CCX"], "-i", "deck"], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout[-1000:]
    with open("deck.dat") as file:
        printed = file.read()
    rows = {}
    for part in ("BASE", "PLATE"):
        line = re.findall(rf"for set {part} .*?\n\s*\n(.*?)\n", printed)[-1]
        rows[part] = [float(word) for word in line.split()]
    contact = printed.partition("contact stress")[2].splitlines()
    return rows["BASE"], rows["PLATE"], sum(len(line.split()) == 4 for line in contact)


def expect(what, found, seen):
    """Print a figure, and end with 1 where it is not what was seen when the script was written."""
    print(f"{what}: {found:.6g}")
    if abs(found - seen) > 1e-4 * max(abs(seen), 1e-3):
        raise SystemExit(f"changed: {seen:.6g} was seen with CalculiX 2.20")
