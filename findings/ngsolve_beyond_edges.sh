#!/usr/bin/env bash
# NGSolve, ContactBoundary: a cube under a plate that is wider, with a linear contact law as energy.
#
# Guess: the same force whichever face comes first: 4.167 N, of two springs in series.
# Seen: it is integrated over the first face, and a point of the plate beside the cube is paired with the nearest point of
# the cube, on its edge, up to maxdist away. With the plate first the cube bears 3 to 4 % more, without a word. Put the
# face first that lies within the other.
set -euo pipefail
source "$(dirname "$0")/packages.sh" ngsolve==6.2.2608
python - <<'END'
import ngsolve
from netgen.occ import Box, Compound, OCCGeometry, Z
from ngsolve import InnerProduct, Sym, grad

STIFFNESS = 5000.0  # of the law [MPa/mm], in series with the cube's 1000 N/mm


def force(first, second, wide):
    cube, plate = Box((0, 0, -1), (1, 1, 0)), Box((-wide, -wide, 0), (1 + wide, 1 + wide, 0.25))
    cube.faces.Max(Z).name, cube.faces.Min(Z).name, cube.mat("cube").solids.name = "rough", "base", "cube"
    plate.faces.Min(Z).name, plate.faces.Max(Z).name, plate.mat("plate").solids.name = "counter", "pressed", "plate"
    mesh = ngsolve.Mesh(OCCGeometry(Compound([cube, plate])).GenerateMesh(maxh=0.5))
    space = ngsolve.VectorH1(mesh, order=2, dirichlet="base|pressed", dirichletx=".*", dirichlety=".*")
    u, (trial, test) = ngsolve.GridFunction(space), space.TnT()
    form = ngsolve.BilinearForm(space)
    for part, young in (("cube", 1000.0), ("plate", 1e9)):  # Poisson's ratio 0
        form += young * InnerProduct(Sym(grad(trial)), Sym(grad(test))) * ngsolve.dx(part)
    contact = ngsolve.ContactBoundary(mesh.Boundaries(first), mesh.Boundaries(second))
    place = ngsolve.CF((ngsolve.x, ngsolve.y, ngsolve.z))
    overlap = (place + trial - (place.Other() + trial.Other())) * contact.normal
    contact.AddEnergy(ngsolve.IfPos(overlap, STIFFNESS / 2 * overlap * overlap, 0.0))
    contact.Update(u, form, intorder=8, maxdist=0.1)
    u.Set(ngsolve.CF((0, 0, -0.005)), definedon=mesh.Boundaries("pressed"))
    ngsolve.solvers.Newton(form, u, freedofs=space.FreeDofs(), inverse="sparsecholesky", printing=False)
    return -1000.0 * ngsolve.Integrate(grad(u)[2, 2], mesh, definedon=mesh.Materials("cube"))


for faces, wide, seen in ((("rough", "counter"), 0.25, 1.0), (("counter", "rough"), 0.0, 1.0), (("counter", "rough"), 0.25, 1.035)):
    found = force(*faces, wide)
    print(faces[0], "first, plate", wide, "mm wider on each side:", found, "N")
    assert abs(found / (0.005 / (1 / STIFFNESS + 1 / 1000)) - seen) < (1e-4 if seen == 1.0 else 0.015)
END
