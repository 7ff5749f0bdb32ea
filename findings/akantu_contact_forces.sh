#!/usr/bin/env bash
# akantu: a block that lies 0.01 within another one, 1.2 wide, with contact by a penalty of 50000 (contact_resolution penalty_linear).
#
# Guess: forces of the upper face, the slave, are penalty × depth × area, 600 in all, and with is_master_deformable the lower face bears as much
# downwards.
# Seen: with is_master_deformable the upper face bears half of it, 300, and the lower face 160, 65 or 170 with 4, 3 or 8 elements below 3, 6 or 5:
# what several nodes of the upper face give to one node below is not added, the last one stays. Without it the upper face bears all 600, the
# lower one nothing. Depths count positive.
set -euo pipefail
source "$(dirname "$0")/packages.sh" akantu==5.0.7.post1 gmsh==4.15.2
cat >blocks.py <<'END'
import sys

import akantu
import gmsh
import numpy as np

lower, upper, deformable = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 2)
gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
for name, elements, half, heights in (("lower", lower, 1.0, (0.0, 1.0)), ("upper", upper, 0.6, (0.99, 2.0))):
    ring = [(-half, heights[0]), (half, heights[0]), (half, heights[1]), (-half, heights[1])]
    points = [gmsh.model.geo.addPoint(x, y, 0) for x, y in ring]
    lines = [gmsh.model.geo.addLine(points[n], points[(n + 1) % 4]) for n in range(4)]
    surface = gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])
    for n, line in enumerate(lines):
        gmsh.model.geo.mesh.setTransfiniteCurve(line, 3 if n % 2 else elements + 1)
    gmsh.model.geo.mesh.setTransfiniteSurface(surface)
    gmsh.model.geo.mesh.setRecombine(2, surface)
    gmsh.model.geo.synchronize()
    gmsh.model.addPhysicalGroup(2, [surface], name=name)
    gmsh.model.addPhysicalGroup(1, [lines[2 if name == "lower" else 0]], name=f"{name}_face")
gmsh.model.mesh.generate(2)
gmsh.write("blocks.msh")
gmsh.finalize()
text = "".join(f"material elastic [\n name = {name}\n rho = 1\n E = 1000\n nu = 0\n]\n" for name in ("lower", "upper"))
text += "contact_detector [\n type = explicit\n master = lower_face\n slave = upper_face\n projection_tolerance = 1e-10\n"
text += " max_iterations = 100\n extension_tolerance = 1e-5\n]\n"
text += "contact_resolution penalty_linear [\n name = upper_face\n mu = 0\n epsilon_n = 50000\n epsilon_t = 50000\n"
with open("blocks.dat", "w") as file:
    file.write(f"{text} is_master_deformable = {deformable}\n]\n")
akantu.parseInput("blocks.dat")
mesh = akantu.Mesh(2)
mesh.read("blocks.msh")
coupler = akantu.CouplerSolidContact(mesh)
solid, contact = coupler.getSolidMechanicsModel(), coupler.getContactMechanicsModel()
solid.setMaterialSelector(akantu.MeshDataMaterialSelectorString("physical_names", solid))
coupler.initFull(_analysis_method=akantu._explicit_lumped_mass)
contact.getContactDetector().setSurfaceSelector(akantu.PhysicalSurfaceSelector(mesh))
coupler.assembleResidual()
force, gap, area = (np.array(one) for one in (contact.getNormalForce(), contact.getGaps(), contact.getNodalArea()))
over = np.isclose(np.array(mesh.getNodes())[:, 1], 0.99)
found = [50000 * (gap * area)[over].sum(), force[over, 1].sum(), force[~over, 1].sum()]
print(f"elements {lower} and {upper}, is_master_deformable = {deformable}: penalty × depth × area {found[0]:.6g},", end=" ")
print(f"force of the upper face {found[1]:.6g}, of the lower face {found[2]:.6g}")
assert np.allclose(found, [600, *(float(one) for one in sys.argv[4:])])
END
python blocks.py 4 3 true 300 -160
python blocks.py 3 6 true 300 -65
python blocks.py 8 5 true 300 -170.4
python blocks.py 4 3 false 600 0
