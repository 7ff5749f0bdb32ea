"""A plane with the gap of a sphere presses a block and shifts along it, by two discretisations.

The law is the line p = K c, one spring with one slider a point: at the nodes of the block's face,
or at the points of an `Interface` in a problem of dolfinx.
"""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import locate_entities_boundary

from helpers import calculix
from helpers.block_cases import block_of
from patchlaw.geometry import Control, Friction, PatchGrid, ShearControl
from patchlaw.geometry.materials import mindlin_ratio
from patchlaw.geometry.spring_bed import SpringBed
from patchlaw.macro import ContactProblem, Interface, LawContactProblem, LoadedFace

LOAD, APPROACH, MU, NU = 1e9, 8e-6, 0.3, 0.15
PATCHES = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
FRICTION = Friction(coefficient=MU, poisson_ratio=NU)
RATIO = mindlin_ratio(NU)
STIFFNESS = 40.0 * LOAD
"""Of the law [MPa/mm]: contacts give way by a tenth of what the block does."""
DEPTH = 4.0 * APPROACH
"""Gap of the sphere 0.5 mm from the middle [mm]: the contact's radius is 0.25 mm."""
FULL = MU * APPROACH
WAY = ((0.1 * FULL, 0.0), (0.6 * FULL, 0.0), (0.6 * FULL, 0.6 * FULL), (-2.0 * FULL, 0.0))
"""Shifts: sticking, partial slip, a turn, and back to nearly sliding [mm]."""


class Line:
    """The law p = K c, one spring."""

    springs = SpringBed(start=np.zeros(1), width=np.zeros(1), stiffness=np.array([STIFFNESS]))

    def pressure(self, closure):
        return STIFFNESS * np.maximum(closure, 0.0)

    def stiffness(self, closure):
        return np.where(np.asarray(closure) > 0.0, STIFFNESS, 0.0)


def sphere(x, y):
    return 4.0 * DEPTH * ((x - 0.5) ** 2 + (y - 0.5) ** 2)


def path(parts):
    """Yield the loads in parts: the plane presses, then goes through all shifts."""
    for part in range(1, parts + 1):
        approach = part / parts * APPROACH
        yield Control(approach=approach, shear=ShearControl(shift=(0.0, 0.0)))
    last = np.zeros(2)
    for end in map(np.array, WAY):
        for part in range(1, parts + 1):
            x, y = last + part / parts * (end - last)
            yield Control(approach=APPROACH, shear=ShearControl(shift=(x, y)))
        last = end


def shear_forces(press, parts):
    """Return the shear forces at the end of every shift by ``press``, and what it returned last."""
    found = [press(control) for control in path(parts)]
    return np.array([one.shear.force for one in found[2 * parts - 1 :: parts]]), found[-1]


def on_nodes(cells):
    block = block_of(cells=cells, young_modulus=LOAD)
    face = LoadedFace.of_block(block, PATCHES)
    return calculix.NodalFace(block, face.facets, PATCHES)


def sheared_on_nodes(face, parts):
    laws = [Line()]
    problem = LawContactProblem(face, laws, "pointwise", crown=sphere, friction=FRICTION)
    return shear_forces(problem.solve, parts)


def sheared_by_interface(face, parts, crown=sphere):
    """Shear the same mesh as a user does: an `Interface` in a problem of dolfinx."""
    space, block = face.space, face.body
    u, v = fem.Function(space), ufl.TestFunction(space)
    lame, shear = block.material.lame
    strain = ufl.sym(ufl.grad(u))
    stress = lame * ufl.tr(strain) * ufl.Identity(3) + 2.0 * shear * strain
    place = space.tabulate_dof_coordinates()[:, 2]
    bottom = np.flatnonzero(np.isclose(place, -1.0)).astype(np.int32)
    top = locate_entities_boundary(space.mesh, 2, lambda x: np.isclose(x[2], 0.0))
    held = fem.dirichletbc(np.zeros(3), bottom, space)
    rough = Interface(
        space, None, top, laws=Line(), indenter=Control(approach=0.0),
        crown=crown, friction=FRICTION,
    )  # fmt: skip
    problem = ContactProblem(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx, u, [held], rough)

    def press(control):
        rough.indenter = control
        problem.solve()
        return rough.state

    return shear_forces(press, parts)
