"""A user's problems with rough interfaces on all ranks, printed as JSON; for the test beside."""

from dataclasses import dataclass, replace

import numpy as np
import ufl
from dolfinx import fem
from helpers.block_cases import block_of
from helpers.contact_laws import PowerLaw, RangedLaw
from helpers.faces import at
from helpers.on_ranks import tell
from helpers.plane_problems import inner_work, mixed_space, rectangle, rollers, two_rectangles
from helpers.user_problems import (
    DISC,
    HEXAHEDRA,
    HIGH,
    LAWS,
    LOW,
    PAD,
    PATCHES,
    TETRAHEDRA,
    box,
    clamped,
    elastic,
    marked,
    pad_and_disc,
    pressed_box,
    pressed_face,
    stacked,
    work,
)
from mpi4py import MPI

from patchlaw.geometry import Control, Friction, PatchGrid, RigidPlane, ShearControl
from patchlaw.macro import (
    ContactProblem,
    Interface,
    LawContactProblem,
    LoadedFace,
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
    block, found = block_of(cells=(4, 4, 3), element=element, comm=COMM), {}
    problem = LawContactProblem(LoadedFace.of_block(block, PATCHES), LAWS, mode)
    space = compat.vector_space(block.mesh.mesh, int(element[1]))
    for name, control in CONTROLS.items():
        rough, own = pressed_face(
            space, block.mesh.facet_tags, 2, laws=LAWS, patches=PATCHES, mode=mode,
            indenter=control, held=[clamped(space, block.mesh.facet_tags, tag=1)],
            work=lambda u: elastic(u, degree=block.quadrature_degree),
        )  # fmt: skip
        own.solve()
        state = problem.solve(control)
        found[f"{element} {mode} {name}"] = [
            rough.force,
            rough.force / state.force - 1.0,
            float(np.abs(rough.patch_pressure - state.patch_pressure).max()),
        ]
    return found


def bar():
    """A long bar: contact at one end, where most ranks have no facets; in the matrix or not."""
    long, found = {"cells": (2, 2, 24), "cell": HEXAHEDRA, "lengths": (0.5, 0.5, 4.0)}, {}
    for in_matrix in (False, True):
        rough, problem = pressed_box(
            **long, comm=COMM, laws=LAWS[0], indenter=RigidPlane(approach=2e-2),
            solver={"in_matrix": in_matrix},
        )  # fmt: skip
        given = len(rough.sampling.weight)
        problem.solve()
        found[f"bar {in_matrix}"] = [rough.force, problem.reaction()[2] / rough.force - 1.0]
    return found, COMM.allgather(given)


def rubbing():
    """Return shear forces, energies and shifts of a face that slips, step by step, per element."""
    found, laws = {}, [RangedLaw(law.k, law.touch) for law in LAWS]
    shears = [ShearControl(shift=(6e-4, 2e-4)), ShearControl(force=(-0.2, 0.3))]
    for cell, mode in ((TETRAHEDRA, "pointwise"), (HEXAHEDRA, "patchwise")):
        force, friction = (
            Control(force=3.0, tilt=None),
            Friction(coefficient=0.3, poisson_ratio=0.2),
        )
        options = {"cell": cell, "comm": COMM, "patches": PATCHES, "mode": mode}
        options |= {"laws": laws, "indenter": force, "friction": friction}
        rough, problem = pressed_box(**options)
        for k, shear in enumerate((None, *shears)):
            rough.indenter = replace(force, shear=shear)
            problem.solve()
            if k == 1:
                rough.slip_record = rough.slip_record  # as from another run
            values = [*rough.shear_force, rough.dissipated, rough.slip_area, *rough.shift]
            found[f"{mode} {k}"] = [float(value) for value in values]
    rough, problem = pressed_box(wear=0.1, **options)
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
        rough, problem = pressed_box(
            cell=cell, comm=COMM, laws=LAWS, patches=PATCHES, mode=mode, wear=1e-6,
            indenter=Control(force=3.0, tilt=None),
        )  # fmt: skip
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
    rough, problem = pressed_face(
        space, tags, disc, opposite=pad, laws=RangedLaw(3e4, end=1.0),
        friction=Friction(coefficient=0.3, poisson_ratio=0.2), work=lambda u: work(u, 0.3),
        held=[clamped(space, tags, tag=low), clamped(space, tags, (1e-3, 0.0, -9e-3), tag=high)],
    )  # fmt: skip
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
    found, several = {}, [LeakingLaw(k) for k in (3e4, 1e4, 5e4, 2e4)]
    for cell, laws, patches in ((TETRAHEDRA, LeakingLaw(3e4), None), (HEXAHEDRA, several, PATCHES)):
        mesh = box(cells=(6, 5, 3), cell=cell, comm=COMM)
        tags, space = marked(mesh), compat.vector_space(mesh, 1)
        left, right = at(mesh, 0, 0.0), at(mesh, 0, 1.0)
        plane = RigidPlane(approach=8e-3, tilt=(2e-3, -1e-3))
        rough, own = pressed_face(space, tags, laws=laws, patches=patches, indenter=plane)
        own.solve()
        water = {"viscosity": 1e-9, "pressures": (0.4, 0.1)}
        flow = rough.leak(left, right, **water)
        turned = [
            rough.leak(left, right, **water, axes="polar", centre=one).rate
            for one in (None, (-0.4, 0.3, 0.0))
        ]
        whole = ufl.dx(domain=mesh)
        moments = [
            COMM.allreduce(fem.assemble_scalar(fem.form(flow.pressure**k * whole))) for k in (1, 2)
        ]
        found[f"{cell.name} {rough.mode}"] = [flow.rate, *moments, *turned], flow.imbalance
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
    found = {"values": result, "bar": ends, "facets": facets, "errors": errors, "leaks": leaks}
    found |= {"rubbed": rubbed, "opposite": pair, "plane": planes, "worn": worn, "joined": joined}
    tell(found)
