#!/usr/bin/env bash
# FElupe: the stiffness of ContactRigidPlane.
#
# Guess: its multiplier is a pressure per overclosure, so that a linear contact law keeps its force on any mesh.
# Seen: it is a force per overclosure of every node, whatever area the node has: the same cube under the same plane
# bears 2.86, 4.56, 6.97 N on 1, 2, 4 cells an edge where pressures would give 0.91 N on each. Nodes at corners and
# edges carry as much as others. Divide it by the number of nodes, or take it as a penalty alone.
set -euo pipefail
source "$(dirname "$0")/packages.sh" felupe==11.3.0
python - <<'END'
import felupe
import numpy as np

for cells, seen in ((1, 2.857), (2, 4.563), (4, 6.968)):
    mesh = felupe.Cube(n=cells + 1)
    mesh.add_points([0.5, 0.5, 1.0])  # the plane's point
    mesh.points_without_cells = mesh.points_without_cells[:-1]
    plane = np.arange(mesh.npoints) == mesh.npoints - 1
    base, top = (~plane & np.isclose(mesh.points[:, 2], z) for z in (0.0, 1.0))
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(mesh), dim=3)])
    solid = felupe.SolidBody(felupe.LinearElastic(E=1000.0, nu=0.0), field)  # a bar of 1000 N/mm
    contact = felupe.ContactRigidPlane(
        field, points=np.flatnonzero(top), centerpoint=mesh.npoints - 1, normal=np.array([0.0, 0.0, -1.0]), multiplier=100.0
    )
    along = {"skip": (False, False, True)}
    held = {
        "base": felupe.Boundary(field[0], mask=base),
        "sides": felupe.Boundary(field[0], mask=~plane, **along),
        "plane": felupe.Boundary(field[0], mask=plane, **along),
        "pressed": felupe.Boundary(field[0], mask=plane, skip=(True, True, False), value=-0.01),
    }
    felupe.Job([felupe.Step([solid, contact], boundaries=held)]).evaluate(verbose=False)
    force = felupe.tools.force(field, solid.results.force, held["base"])[2]
    print(cells, "cells an edge:", force, "N; by pressures", 0.01 / (1 / 100 + 1 / 1000), "N")
    assert abs(force - seen) < 2e-3 * seen
END
