#!/usr/bin/env bash
# pyuff: elements of second order in universal files (.unv, data set 2412), as gmsh writes them.
#
# Guess: elements of 10 and 20 nodes are read like those of 4 and 8.
# Seen: a line of this data set has at most 8 nodes, and pyuff takes the next one for another element. Eight hexahedra of 20
# nodes become 16 elements, 8 of them of types and numbers that no element has, and each of the others has 8 nodes, no word
# said; tetrahedra of 10 nodes end in "Error reading data-set #2412". Elements of first order are right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 pyuff==2.5.8
python - <<'END'
import gmsh
import pyuff


def written(order, bricks):
    """Write a box of tetrahedra or of eight hexahedra, and return how many nodes gmsh says that each has."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 2.0)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.occ.addBox(0, 0, 0, 1, 2, 3)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    if bricks:
        for _, curve in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(curve, 3)
        for _, face in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(face)
            gmsh.model.mesh.setRecombine(2, face)
        gmsh.model.mesh.setTransfiniteVolume(1)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    gmsh.write("box.unv")
    (kind,), ((*elements,),), ((*nodes,),) = gmsh.model.mesh.getElements(3)
    gmsh.finalize()
    return len(elements), len(nodes) // len(elements)


for order, bricks in ((1, False), (1, True), (2, True), (2, False)):
    count, nodes = written(order, bricks)
    file = pyuff.UFF("box.unv")
    at = list(file.get_set_types()).index(2412)
    try:
        found = [one for kind, some in file.read_sets(at).items() if isinstance(kind, int) for one in some]
    except Exception as error:
        print(count, "elements of", nodes, "nodes:", error, "/", error.__context__)
        assert (order, bricks) == (2, False) and "2412" in str(error.__context__)
        continue
    lengths = sorted({len(one["nodes_nums"]) for one in found})
    print(count, "elements of", nodes, "nodes: pyuff has", len(found), "of", lengths, sorted({one["fe_descriptor"] for one in found}))
    right = len(found) == count and lengths == [nodes]
    assert right == (order == 1)
    assert order == 1 or len(found) == 2 * count
END
