#!/usr/bin/env bash
# gmsh: names and numbers of groups through other formats, .med (of Salome, Code_Aster), .unv, .bdf.
#
# Guess: a face called "rough face" with number 3 keeps both, or loses the name where the format has none.
# Seen: through .med its name is filled up with blanks to 80 characters, which a .msh file made of it keeps, and it gets number
# 1; through .unv it becomes rough_face, with number 3; through .bdf, .vtk and .mesh the name is lost.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2
python - <<'END'
import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
box = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
top = [face for _, face in gmsh.model.getEntities(2) if gmsh.model.occ.getCenterOfMass(2, face)[2] > 0.99]
gmsh.model.addPhysicalGroup(3, [box], tag=7, name="pad")
gmsh.model.addPhysicalGroup(2, top, tag=3, name="rough face")
gmsh.model.mesh.generate(3)
seen = {"msh": (3, "rough face"), "med": (1, "rough face".ljust(80)), "unv": (3, "rough_face"), "bdf": None, "vtk": None, "mesh": None}
for ending in seen:
    gmsh.write(f"box.{ending}")
for ending, expected in seen.items():
    gmsh.clear()
    gmsh.merge(f"box.{ending}")
    groups = [(tag, gmsh.model.getPhysicalName(2, tag)) for _, tag in gmsh.model.getPhysicalGroups(2)]
    print(f".{ending}: {groups}")
    assert [one for one in groups if one[1]] == ([expected] if expected else [])
    if ending == "med":
        gmsh.write("again.msh")
        assert f'"{expected[1]}"' in open("again.msh").read()
END
