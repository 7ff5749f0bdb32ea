#!/usr/bin/env bash
# Kratos 10.4.4: cells that meshio 5.3.5 writes as its own format (.mdpa).
#
# Guess: Kratos, whose format it is, reads them and finds the volume 1 of a cube.
# Seen: it refuses them all, as no element is called Tetrahedra3D4 or Hexahedra3D8. With Kratos' names, Element3D4N and so on, linear cells and
# tetrahedra of 10 nodes are right, but hexahedra of 20 and 27 nodes have volumes of -0.2444 and 0.04: the file has VTK's order, which Kratos'
# is not. Of 20 nodes Kratos' is VTK's with the last two fours exchanged; then the volume is 1.
set -euo pipefail
source "$(dirname "$0")/packages.sh" KratosMultiphysics==10.4.4 meshio==5.3.5
python - <<'END'
import KratosMultiphysics as Kratos
import meshio
import numpy as np

Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
eight = np.array([(*at, z) for z in (-1, 1) for at in ring])
around = [(0, 1), (1, 2), (2, 3), (3, 0)]
edges = np.array(around + [(a + 4, b + 4) for a, b in around] + [(a, a + 4) for a in range(4)])
twenty = np.vstack([eight, eight[edges].mean(axis=1)])
faces = [(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1), (0, 0, 0)]  # in VTK's order
four = eight[[0, 1, 3, 4]]
sides = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])
ten = np.vstack([four, four[sides].mean(axis=1)])
cells = {"tetra": four, "hexahedron": eight, "tetra10": ten, "hexahedron20": twenty, "hexahedron27": np.vstack([twenty, faces])}


def read():
    model = Kratos.Model()
    part = model.CreateModelPart("part")
    Kratos.ModelPartIO("cell", Kratos.IO.READ | Kratos.IO.SKIP_TIMER).ReadModelPart(part)
    return sum(element.GetGeometry().DomainSize() for element in part.Elements)


def renamed(nodes=None):
    """Give the element Kratos' name, and these nodes."""
    head, rest = open("cell.mdpa").read().split("Begin Elements")
    row = rest.splitlines()[1].split()
    assert nodes is not None or row[2:] == [str(1 + node) for node in range(count)]
    row[2:] = row[2:] if nodes is None else [str(1 + node) for node in nodes]
    open("cell.mdpa", "w").write(f"{head}Begin Elements Element3D{count}N\n  {' '.join(row)}\nEnd Elements\n")


for kind, points in cells.items():
    count, true = len(points), 1 / 6 if kind.startswith("tetra") else 1.0
    meshio.Mesh((points + 1) / 2, [(kind, [list(range(count))])]).write("cell.mdpa")
    try:
        read()
    except RuntimeError as error:
        print(f"{kind}:", str(error).split("registered")[0] + "registered")
    else:
        raise SystemExit("changed: read as it is")
    renamed()
    found, seen = read(), {20: -0.24444444, 27: 0.04}.get(count, true)
    print(f"  named Element3D{count}N: volume {found:.6f}, in place of {true:.6f}")
    assert abs(found - seen) < 1e-6
    if count == 20:
        renamed([*range(12), *range(16, 20), *range(12, 16)])
        assert abs(read() - 1) < 1e-9
END
