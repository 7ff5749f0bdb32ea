"""A user's problems with rough interfaces on all ranks, printed as JSON; for the test beside."""

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

sys.path.insert(0, str(Path(__file__).parents[1]))

from helpers.contact_laws import PowerLaw, RangedLaw
from helpers.plane_problems import at, inner_work, mixed_space, rectangle, rollers, two_rectangles
from helpers.user_problems import (
    DISC,
    HEXAHEDRA,
    HIGH,
    LAWS,
    LOW,
    PAD,
    PATCHES,
    TETRAHEDRA,
    TOP,
    box,
    clamped,
    elastic,
    marked,
    pad_and_disc,
    stacked,
    work,
)

from patchlaw.geometry import BlockShape, Control, Friction, PatchGrid, RigidPlane, ShearControl
from patchlaw.macro import (
    Block,
    ContactProblem,
    Interface,
    LawContactProblem,
    LoadedFace,
    Material,
    block_mesh,
    compat,
    joined_meshes,
)
from patchlaw.support import InputError

COMM = MPI.COMM_WORLD
CONTROLS = {
    "placed": Control(approach=8e-3, tilt=(2e-3, -1e-3)),
    "free": Control(force=6.0, tilt=None),
}


def cube(element, mode):
    """Return the forces of a block, and their differences to those of the same as user code."""
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(4, 4, 3), element=element)
    block = Block(block_mesh(shape, COMM), Material(young_modulus=4000.0, poisson_ratio=0.15))
    problem = LawContactProblem(LoadedFace.of_block(block, PATCHES), LAWS, mode)
    space = compat.vector_space(block.mesh.mesh, int(element[1]))
    nodes = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[2], -1.0))
    support = fem.dirichletbc(np.zeros(3, PETSc.ScalarType), nodes, space)
    u, found = fem.Function(space), {}
    for name, control in CONTROLS.items():
        options = {"patches": PATCHES, "mode": mode, "indenter": control}
        rough = Interface(space, block.mesh.facet_tags, 2, laws=LAWS, **options)
        ContactProblem(elastic(u, degree=block.quadrature_degree), u, [support], rough).solve()
        state = problem.solve(control)
        found[f"{element} {mode} {name}"] = [
            rough.force,
            rough.force / state.force - 1.0,
            float(np.abs(rough.patch_pressure - state.patch_pressure).max()),
        ]
    return found


def bar():
    """A long bar: contact at one end, where most ranks have no facets; in the matrix or not."""
    lengths, found = (0.5, 0.5, 4.0), {}
    mesh = box(cells=(2, 2, 24), cell=HEXAHEDRA, comm=COMM, lengths=lengths)
    tags, space = marked(mesh, lengths), compat.vector_space(mesh, 1)
    for in_matrix in (False, True):
        u = fem.Function(space)
        rough = Interface(space, tags, TOP, laws=LAWS[0], indenter=RigidPlane(approach=2e-2))
        given = len(rough.sampling.weight)
        problem = ContactProblem(elastic(u), u, [clamped(space, tags)], rough, in_matrix=in_matrix)
        problem.solve()
        found[f"bar {in_matrix}"] = [rough.force, problem.reaction()[2] / rough.force - 1.0]
    return found, COMM.allgather(given)


def rubbing():
    """Return shear forces, energies and shifts of a face that slips, step by step, per element."""
    found, laws = {}, [RangedLaw(law.k, law.touch) for law in LAWS]
    shears = [ShearControl(shift=(6e-4, 2e-4)), ShearControl(force=(-0.2, 0.3))]
    for cell, mode in ((TETRAHEDRA, "pointwise"), (HEXAHEDRA, "patchwise")):
        mesh = box(cell=cell, comm=COMM)
        tags, space = marked(mesh), compat.vector_space(mesh, 1)
        u, friction = fem.Function(space), Friction(coefficient=0.3, poisson_ratio=0.2)
        options = {"patches": PATCHES, "mode": mode, "friction": friction}
        force = Control(force=3.0, tilt=None)
        rough = Interface(space, tags, TOP, laws=laws, indenter=force, **options)
        problem = ContactProblem(elastic(u), u, [clamped(space, tags)], rough)
        for k, shear in enumerate((None, *shears)):
            rough.indenter = replace(force, shear=shear)
            problem.solve()
            if k == 1:
                rough.slip_record = rough.slip_record  # as from another run
            values = [*rough.shear_force, rough.dissipated, rough.slip_area, *rough.shift]
            found[f"{mode} {k}"] = [float(value) for value in values]
    rough = Interface(space, tags, TOP, laws=laws, indenter=force, wear=0.1, **options)
    problem = ContactProblem(elastic(u), u, [clamped(space, tags)], rough)
    problem.solve()
    rough.indenter = replace(force, shear=ShearControl(shift=(4e-3, 1e-3)))
    problem.solve()
    problem.slide(3.0)
    values = rough.worn_volume, rough.plane.approach, *rough.shear_force, rough.dissipated
    found["worn"] = [float(value) for value in values]
    return found


def wearing():
    """Return what faces wear, patchwise and at points, going on from a record half-way."""
    found = {}
    for cell, mode in ((TETRAHEDRA, "pointwise"), (HEXAHEDRA, "patchwise")):
        mesh = box(cell=cell, comm=COMM)
        tags, space = marked(mesh), compat.vector_space(mesh, 1)
        u, force = fem.Function(space), Control(force=3.0, tilt=None)
        rough = Interface(
            space, tags, TOP, laws=LAWS, patches=PATCHES, mode=mode, indenter=force, wear=1e-6
        )
        problem = ContactProblem(elastic(u), u, [clamped(space, tags)], rough)
        for distance in (50.0, 400.0):
            report = problem.slide(distance)
            rough.wear_record = rough.wear_record  # as from another run
        problem.solve()
        depths = rough.wear_record[:, 2]
        values = rough.plane.approach, *rough.plane.tilt, rough.worn_volume, depths.max()
        found[mode] = [report.steps, *map(float, values), *rough.patch_pressure.tolist()]
    return found


def opposite(*, joined=False):
    """Return forces, and a norm of each of the fields, of two bodies on each other.

    They are volumes of one mesh, or of two that are joined.
    """
    mesh, tags = stacked((5, 3, 2), comm=COMM)
    low, high, disc, pad = LOW, HIGH, DISC, PAD
    if joined:
        whole = joined_meshes(pad_and_disc(COMM, disc=(5, 3, 2)))
        mesh, tags = whole.mesh, whole.facet_tags
        low, high, disc, pad = map(whole.facet_tag, ("disc 1", "pad 2", "disc 3", "pad 4"))
    space = compat.vector_space(mesh, 1)
    u = fem.Function(space)
    held = [clamped(space, tags, tag=low), clamped(space, tags, (1e-3, 0.0, -9e-3), tag=high)]
    rough = Interface(
        space, tags, disc, opposite=pad, laws=RangedLaw(3e4, end=1.0),
        friction=Friction(coefficient=0.3, poisson_ratio=0.2),
    )  # fmt: skip
    problem = ContactProblem(work(u, 0.3), u, held, rough)
    problem.solve()
    sizes = [compat.petsc_vector(one).norm() for one in rough.fields().values()]
    return [rough.force, *rough.shear_force, *sizes], problem.reaction().tolist()


def refusals():
    """Return what all ranks say of a face that is not there, and of a wrong facet on the last."""
    mesh = box(cell=TETRAHEDRA, comm=COMM)
    tags, space, told = marked(mesh), compat.vector_space(mesh, 1), []
    wrong = np.array([10**6] if COMM.rank == COMM.size - 1 else [], dtype=np.int32)
    for given, tag in ((tags, 99), (None, wrong)):
        try:
            Interface(space, given, tag, laws=LAWS[0], indenter=RigidPlane(approach=0.0))
        except InputError as error:
            told.append(str(error))
    return COMM.allgather(told)


@dataclass(frozen=True)
class LeakingLaw(PowerLaw):
    """A law that also tells a transmissivity, which falls with the closure and differs by way."""

    def transmissivities(self, closure, x):
        gap = np.maximum(0.02 - closure, 0.0) * (1.0 + 0.3 * x[:, 0])
        return np.stack([gap**3, 0.3 * gap**3], axis=1)


def leak():
    """Return what leaks over a bent box's face, its balance, and integrals of its pressure."""
    found = {}
    for cell in (TETRAHEDRA, HEXAHEDRA):
        mesh = box(cells=(6, 5, 3), cell=cell, comm=COMM)
        tags, space = marked(mesh), compat.vector_space(mesh, 1)
        left, right = (
            dmesh.locate_entities_boundary(mesh, 2, lambda x, at=at: np.isclose(x[0], at))
            for at in (0.0, 1.0)
        )
        for laws in (LeakingLaw(3e4), [LeakingLaw(k) for k in (3e4, 1e4, 5e4, 2e4)]):
            u = fem.Function(space)
            patches = PATCHES if isinstance(laws, list) else None
            plane = RigidPlane(approach=8e-3, tilt=(2e-3, -1e-3))
            rough = Interface(space, tags, TOP, laws=laws, patches=patches, indenter=plane)
            ContactProblem(elastic(u), u, [clamped(space, tags)], rough).solve()
            water = {"viscosity": 1e-9, "pressures": (0.4, 0.1)}
            flow = rough.leak(left, right, **water)
            turned = [
                rough.leak(left, right, **water, axes="polar", centre=one).rate
                for one in (None, (-0.4, 0.3, 0.0))
            ]
            whole = ufl.dx(domain=mesh)
            moments = [
                COMM.allreduce(fem.assemble_scalar(fem.form(flow.pressure**k * whole)))
                for k in (1, 2)
            ]
            name = f"{cell.name} {rough.mode}"
            found[name] = [flow.rate, *moments, *turned], flow.imbalance
    return found


def plane():
    """Return forces and moments of plane, axisymmetric, opposite and mixed problems."""
    found, law = {}, RangedLaw(3e3, end=1.0)
    rubs = {"laws": law, "friction": Friction(coefficient=0.3, poisson_ratio=0.3)}
    shoved = Control(force=1.0, tilt=None, shear=ShearControl(shift=(1e-3, 0.0)))
    laws = [law, PowerLaw(2e3), PowerLaw(1e3)]
    rows = {"laws": laws, "patches": PatchGrid(grid=(3, 1), lengths=(3.0, 1.0))}
    cases = {
        "rubs": {"indenter": shoved, **rubs},
        "turned": {"indenter": Control(force=50.0), "axisymmetric": True, **rows},
    }
    mesh = rectangle((2.0, 0.0), (5.0, 1.0), (7, 3), "triangle", COMM)
    mixed = mixed_space(mesh, (1, 1), (1, 2))
    cases["mixed"] = {"indenter": replace(shoved, shear=None), **rows}
    for name, options in cases.items():
        whole = mixed if name == "mixed" else compat.vector_space(mesh, 2)
        w = fem.Function(whole)
        if name == "mixed":
            (heat, u), (q, v), space = ufl.split(w), ufl.TestFunctions(whole), whole.sub(1)
            conducts = (ufl.inner(ufl.grad(heat), ufl.grad(q)) + (heat - 20.0) * q) * ufl.dx
            inner = inner_work(u, v, mesh, thermal=1e-5 * heat) + conducts
        else:
            u, v, space = w, ufl.TestFunction(whole), whole
            inner = inner_work(u, v, mesh, turned="axisymmetric" in options)
        rough = Interface(space, None, at(mesh, 1, 1.0), **options)
        held = rollers(space, (1, 0.0), (0, 2.0))
        problem = ContactProblem(inner, w, held, rough)
        problem.solve()
        sizes = [compat.petsc_vector(one).norm() for one in rough.fields().values()]
        found[name] = [rough.plane.approach, rough.plane.tilt[0], *rough.patch_pressure, *sizes]
        found[name] += [rough.force, *problem.reaction()]
    mesh = two_rectangles(comm=COMM)
    space = compat.vector_space(mesh, 1)
    u, v = fem.Function(space), ufl.TestFunction(space)
    over = {"opposite": at(mesh, 1, 1.001), "indenter": RigidPlane(approach=6e-3), "laws": law}
    rough = Interface(space, None, at(mesh, 1, 1.0), **over)
    held = rollers(space, (1, 0.0), (1, 1.501), (0, 0.0))
    ContactProblem(inner_work(u, v, mesh), u, held, rough).solve()
    return found | {"opposite": [rough.force, *rough.moment]}


if __name__ == "__main__":
    result = {}
    for element, mode in (("Q1", "patchwise"), ("P2", "pointwise")):
        result |= cube(element, mode)
    ends, facets = bar()
    errors, leaks = refusals(), leak()
    rubbed, pair, planes, worn = rubbing(), opposite(), plane(), wearing()
    joined = opposite(joined=True)
    if COMM.rank == 0:
        values = {"values": result, "bar": ends, "facets": facets, "errors": errors, "leaks": leaks}
        values |= {"rubbed": rubbed, "opposite": pair, "plane": planes, "worn": worn}
        values["joined"] = joined
        sys.stdout.write(json.dumps(values) + "\n")
