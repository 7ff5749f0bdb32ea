#!/usr/bin/env bash
# meshio: a mesh of gmsh (.msh 4.1) with named faces, and a face in two groups.
#
# Guess: it can be written to .vtu, .vtk and .xdmf with its groups, and gmsh:physical has all groups of a face.
# Seen: .vtu and .vtk end with IndexError: among the sets of cells is one, gmsh:bounding_entities, which holds no
# cells but signed numbers of gmsh's entities. Without it they are written. .xdmf has no sets, and in gmsh:physical
# a face of two groups has the first alone.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 meshio==5.3.5 h5py==3.16.0
python - <<'END'
import gmsh
import meshio

gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 0)
box = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
faces = [face for _, face in gmsh.model.getEntities(2)]
gmsh.model.addPhysicalGroup(3, [box], 1, "solid")
gmsh.model.addPhysicalGroup(2, faces[:1], 2, "first")
gmsh.model.addPhysicalGroup(2, faces[:2], 3, "both")
gmsh.option.setNumber("Mesh.MeshSizeMin", 1.0)
gmsh.model.mesh.generate(3)
gmsh.write("part.msh")
mesh = meshio.read("part.msh")
physical = {int(n) for block in mesh.cell_data["gmsh:physical"][:1] for n in block}
sets = [name for name, blocks in mesh.cell_sets.items() if name in mesh.field_data and len(blocks[0])]
print("first face: gmsh:physical", physical, "sets", sets)
assert physical == {2} and sets == ["first", "both"]
for ending in ("vtu", "vtk"):
    try:
        meshio.write(f"part.{ending}", meshio.read("part.msh"))
    except IndexError as error:
        print(ending, "IndexError:", error)
    else:
        raise SystemExit(f"{ending} is written now")
meshio.write("part.xdmf", mesh)
found = meshio.read("part.xdmf")
print("xdmf: cell data", list(found.cell_data), "sets", found.cell_sets)
assert not found.cell_sets
del mesh.cell_sets["gmsh:bounding_entities"]
for ending in ("vtu", "vtk"):
    meshio.write(f"part.{ending}", meshio.Mesh(mesh.points, mesh.cells, cell_sets=mesh.cell_sets))
    print(ending, "without gmsh:bounding_entities:", list(meshio.read(f"part.{ending}").cell_data))
END
