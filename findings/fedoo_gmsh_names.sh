#!/usr/bin/env bash
# fedoo 1.1.0: named faces and bodies of a gmsh mesh, by Mesh.read (which its documentation prefers) and mesh.import_msh.
#
# Guess: physical groups of gmsh become sets of elements of the same name, whichever of its formats the file has.
# Seen: of format 4.1 they do. Of format 2.2, which meshio reads with its names as well, no set is made, without a word, by either function: the
# triangles of all faces come as one mesh. Write format 4.1 (Mesh.MshFileVersion).
set -euo pipefail
source "$(dirname "$0")/packages.sh" fedoo==1.1.0 gmsh==4.15.2 meshio==5.3.5 scipy==1.17.1
python - <<'END'
import fedoo
import gmsh
import meshio

gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 1)
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
groups = {"body": (3, 1), "rough": (2, 6), "held": (2, 5)}
for name, (dimension, entity) in groups.items():
    gmsh.model.addPhysicalGroup(dimension, [entity], name=name)
gmsh.model.mesh.generate(3)
for version in (2.2, 4.1):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.write("cube.msh")
    assert set(meshio.read("cube.msh").field_data) == set(groups)
    for read in (fedoo.Mesh.read, fedoo.mesh.import_msh):
        fedoo.ModelingSpace("3D")
        parts = read("cube.msh").mesh_dict
        sets = {kind: sorted({*part.element_sets, *part.node_sets} & set(groups)) for kind, part in parts.items()}
        print(f"format {version}, {read.__name__}: elements", {kind: part.n_elements for kind, part in parts.items()}, "sets", sets)
        assert sets == ({"tri3": ["held", "rough"], "tet4": ["body"]} if version > 4 else {"tri3": [], "tet4": []})
        assert all(part.n_elements > 12 for part in parts.values())
END
