"""A scene with a law of samples on a body once more, as a user's own dolfinx program."""

from mpi4py import MPI  # isort: skip  (its library is loaded before dolfinx)
import numpy as np
from dolfinx import fem
from helpers.user_problems import elastic

from benchmarks.twin_scenes import scene_of, written
from patchlaw import ContactProblem, Control, Interface, vector_space
from patchlaw.geometry import Friction
from patchlaw.macro import read_mesh
from patchlaw.multiscale import Run


def differences_of_program(data):
    """Yield what `Interface` finds otherwise than the scene: name, relative difference, what.

    Args:
        data: A drawn scene of one law of samples, pressed by a plane on a body from a mesh.
    """
    run = Run(scene_of(data))
    steps, table = list(run.load_steps()), run.coupling.table
    rough, problem = _program(data, run.scene.body.element == "quadratic", table)
    area, slid = run.coupling.parts.area, 0.0
    for step in steps:
        rough.indenter, control = step.control, step.control
        if control.slid > slid:
            problem.slide(control.slid - slid)
        else:
            problem.solve()
        slid = control.slid
        yield from _compared(data, rough, step, area)
    run.close()
    if "leak" in data:
        fluid = data["leak"]
        leak = rough.leak(
            fluid["inlet"],
            fluid["outlet"],
            viscosity=1e-6 * fluid["viscosity"],
            pressures=tuple(fluid["pressures"]),
        )
        name = "leak_mm3_per_s"
        yield name, abs(leak.rate / getattr(step, name) - 1.0), f"{leak.rate}"


def _program(data, quadratic, table):
    """Return interface and problem of a program that knows nothing of the scene but its law."""
    body = data["body"]
    mesh = read_mesh(written(data)["body"]["mesh"], MPI.COMM_SELF)
    space = vector_space(mesh.mesh, 2 if quadratic else 1)
    mesh.mesh.topology.create_connectivity(2, 3)
    held = []
    for support in body["supports"]:
        facets = mesh.facet_tags.find(mesh.facet_tag(support["surface"]))
        for axis, value in enumerate(support["displacement"]):
            if value != "free":
                part = space.sub(axis)
                nodes = fem.locate_dofs_topological(part, 2, facets)
                held.append(fem.dirichletbc(np.float64(value), nodes, part))
    options = {}
    if "wear" in data:
        options["wear"] = data["wear"]["coefficient"]
    elif "friction" in data:
        ratio = body["poisson_ratio"]
        options["friction"] = Friction(
            coefficient=data["friction"]["coefficient"], poisson_ratio=ratio
        )
    rough = Interface(space, mesh, "top", laws=table, indenter=Control(force=0.0), **options)
    u = fem.Function(space)
    form = elastic(u, body["young_modulus"], body["poisson_ratio"])
    return rough, ContactProblem(form, u, held, rough)


def _compared(data, rough, step, area):
    force = step.force_N or 1.0
    pairs = {
        "force_N": (rough.force, step.force_N, force),
        "moment_N_mm": (rough.moment, step.moment_N_mm, force * area**0.5),
        "approach_mm": (rough.plane.approach, step.approach_mm, step.approach_mm),
        "tilt": (rough.plane.tilt, step.tilt, step.approach_mm / area**0.5),
        "contact_area_fraction": (rough.area / area, step.contact_area_fraction, 1e-2),
    }
    if "wear" in data:
        worn = step.worn_volume_mm3 or 0.0
        pairs["worn_volume_mm3"] = rough.worn_volume, worn, worn
    if "friction" in data and "wear" not in data and step.shear_force_x_N is not None:
        bound = data["friction"]["coefficient"] * force
        shear = step.shear_force_x_N, step.shear_force_y_N
        pairs["shear_force_N"] = rough.shear_force, shear, bound
        slip = rough.slip_area / area, step.slip_area_fraction, step.contact_area_fraction
        pairs["slip_area_fraction"] = slip
        pairs["dissipated_mJ"] = rough.dissipated, step.dissipated_mJ, bound * step.approach_mm
    for name, (found, known, size) in pairs.items():
        apart = np.abs(np.subtract(found, known)).max() / (abs(size) or 1.0)
        yield name, float(apart), f"{found} and {known}"
