#!/usr/bin/env bash
# gmsh: a rough face from heights by addBSplineSurface.
#
# Guess: the surface passes through the points that it is given, as addSpline does with curves.
# Seen: they are the control points of a cubic spline: waves of 4 points a period keep 44 % of their rms height. The
# bounding box, that of the control points, shows the full heights. Splines through the rows and addThruSections
# keep 96 %.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2
python - <<'END'
import gmsh
import numpy as np

gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 0)
n = 17
x = np.linspace(0.0, 1.0, n)
wave = np.cos(2 * np.pi * 4 * x)
heights = 0.02 * wave[:, None] * wave
rows = [[gmsh.model.occ.addPoint(x[j], x[i], heights[i, j]) for j in range(n)] for i in range(n)]
spline = gmsh.model.occ.addBSplineSurface([point for row in rows for point in row], n)
lines = [gmsh.model.occ.addWire([gmsh.model.occ.addSpline(row)]) for row in rows]
(_, through), *_ = gmsh.model.occ.addThruSections(lines, makeSolid=False)
gmsh.model.occ.synchronize()
for name, face, kept in (("addBSplineSurface", spline, 0.44), ("addThruSections", through, 0.956)):
    low, high = gmsh.model.getParametrizationBounds(2, face)
    u, v = (np.linspace(a, b, 101) for a, b in zip(low, high))
    places = np.stack(np.meshgrid(u, v), -1).ravel()
    z = np.array(gmsh.model.getValue(2, face, places))[2::3]
    fine = np.cos(2 * np.pi * 4 * np.linspace(0.0, 1.0, 101))
    share = z.std() / (0.02 * fine[:, None] * fine).std()
    print(name, "rms height", share, "of the map's, highest", z.max(), "box", gmsh.model.getBoundingBox(2, face)[2::3])
    assert abs(share - kept) < 0.02
assert abs(gmsh.model.getBoundingBox(2, spline)[2] + 0.02) < 1e-3
END
