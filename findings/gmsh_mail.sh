#!/usr/bin/env bash
# gmsh: export to .mail, the suffix of Code_Aster's meshes (LIRE_MAILLAGE, FORMAT="ASTER").
#
# Guess: it is that format: COOR_3D, groups of elements by their names, FINSF.
# Seen: it is another program's list of points and triangles. Of a box with the groups "top" (a face) and "body" it has the
# triangles of the face, without a name, and no tetrahedron; of second order their corners alone, besides all points. No
# warning. Write .med for Code_Aster.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2
python - <<'END'
import gmsh

for order in (1, 2):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 2.0)
    gmsh.model.occ.addBox(0, 0, 0, 1, 2, 3)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [6], name="top")
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    gmsh.logger.start()
    gmsh.write("box.mail")
    log = [line for line in gmsh.logger.get() if not line.startswith("Info")]
    gmsh.logger.stop()
    points, (tetrahedra,) = len(gmsh.model.mesh.getNodes()[0]), gmsh.model.mesh.getElements(3)[1]
    triangles = gmsh.model.mesh.getElements(2, 6)[1][0]
    gmsh.finalize()
    lines = open("box.mail").read().splitlines()
    faces = lines[1 + points : 1 + points + len(triangles)]
    print("order", order, "first line", repr(lines[0]), "words", sorted({w for line in lines for w in line.split() if w.isalpha()}))
    print(len(tetrahedra), "tetrahedra and", len(triangles), "triangles; the file has", len(lines), "lines; a triangle:", faces[0])
    assert lines[0].split() == [str(points), str(len(triangles))] and not log, (lines[0], log)
    assert all(len(face.split()) == 3 for face in faces) and not any(w.isalpha() for line in lines for w in line.split())
    assert len(lines) == 1 + points + 2 * len(triangles) and len(tetrahedra) > 0
END
