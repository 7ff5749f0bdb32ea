"""Small elastic problems as users write them in dolfinx, without any part of patchlaw."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

from helpers.contact_laws import PowerLaw, RangedLaw  # noqa: F401
from helpers.faces import at, tagged
from patchlaw.geometry import PatchGrid
from patchlaw.macro import ContactProblem, Interface, TaggedMesh, compat

HEXAHEDRA, TETRAHEDRA = dmesh.CellType.hexahedron, dmesh.CellType.tetrahedron
TOP, BOTTOM = 7, 3
PATCHES = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))


LAWS = [PowerLaw(k, touch) for k, touch in ((3e4, 0.0), (1e4, 2e-3), (5e4, 4e-3), (2e4, 1e-3))]


def box(cells=(4, 4, 3), cell=TETRAHEDRA, comm=MPI.COMM_SELF, lengths=(1.0, 1.0, 1.0)):
    """A box below the plane z = 0, from (0, 0)."""
    lower, upper = np.array([0.0, 0.0, -lengths[2]]), np.array([lengths[0], lengths[1], 0.0])
    return dmesh.create_box(comm, [lower, upper], list(cells), cell)


def marked(mesh, lengths=(1.0, 1.0, 1.0)):
    """Facet tags of top and bottom; call it before the mesh is turned."""
    return tagged(mesh, {TOP: at(mesh, 2, 0.0), BOTTOM: at(mesh, 2, -lengths[2])})


def clamped(space, tags, value=(0.0, 0.0, 0.0), tag=BOTTOM):
    """All displacements of a face prescribed; without tags, of the facets given for it."""
    space.mesh.topology.create_connectivity(2, 3)
    nodes = fem.locate_dofs_topological(space, 2, tag if tags is None else tags.find(tag))
    return fem.dirichletbc(np.array(value, dtype=PETSc.ScalarType), nodes, space)


def elastic(displacement, young=4000.0, poisson=0.15, degree=None, thermal=0.0):
    """Inner virtual work of a linear elastic body; Young's modulus may be UFL, thermal a strain."""
    space = displacement.function_space
    test = ufl.TestFunction(space)
    lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    shear = young / (2.0 * (1.0 + poisson))
    strain = ufl.sym(ufl.grad(displacement)) - thermal * ufl.Identity(3)
    stress = lame * ufl.tr(strain) * ufl.Identity(3) + 2.0 * shear * strain
    degree = 2 * compat.lagrange_degree(space) if degree is None else degree
    dx = ufl.Measure("dx", domain=space.mesh, metadata={"quadrature_degree": degree})
    return ufl.inner(stress, ufl.sym(ufl.grad(test))) * dx


def pressed_face(space, tags, tag=TOP, *, work=None, held=None, solver=None, **face):
    """An interface on a face of an elastic body, clamped at its bottom, and the problem of both.

    Args:
        space: Of the displacements.
        tags: Of the mesh's facets.
        tag: Of the face.
        work: The body's virtual work, by its displacement.
        held: Conditions in place of the clamp.
        solver: Further arguments of `ContactProblem`.
        face: Those of `Interface`.
    """
    u = fem.Function(space)
    rough = Interface(space, tags, tag, **face)
    held = [clamped(space, tags)] if held is None else held
    return rough, ContactProblem((work or elastic)(u), u, held, rough, **(solver or {}))


def pressed_box(*, cells=(4, 4, 3), cell=TETRAHEDRA, degree=1, comm=MPI.COMM_SELF,
                lengths=(1.0, 1.0, 1.0), **given):  # fmt: skip
    """The top of a box as an interface, and its problem; see `box` and `pressed_face`."""
    mesh = box(cells, cell, comm, lengths)
    return pressed_face(compat.vector_space(mesh, degree), marked(mesh, lengths), **given)


LOW, HIGH, DISC, PAD = 1, 2, 3, 4
SIDES, DISC_HEIGHT, PAD_HEIGHT, APART = (3.0, 2.0), 1.0, 2.0, 2e-3
DISC_YOUNG, PAD_YOUNG = 5000.0, 1300.0


def cells_of(lower, upper, counts):
    """Hexahedra of a box and their points."""
    lines = [np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, counts, strict=True)]
    points = np.stack([part.ravel() for part in np.meshgrid(*lines, indexing="ij")], axis=1)
    number = np.arange(len(points)).reshape([n + 1 for n in counts])
    corners = [
        number[i : i + counts[0], j : j + counts[1], k : k + counts[2]].ravel()
        for k in (0, 1) for j in (0, 1) for i in (0, 1)
    ]  # fmt: skip
    return np.stack(corners, axis=1), points


def stacked(disc=(6, 4, 2), pad=(3, 2, 2), comm=MPI.COMM_SELF):
    """A pad over a disc, apart by a little, in one mesh, with tags of their faces."""
    base = DISC_HEIGHT + APART
    parts = [
        cells_of((0, 0, 0), (*SIDES, DISC_HEIGHT), disc),
        cells_of((0, 0, base), (*SIDES, base + PAD_HEIGHT), pad),
    ]
    (one, first), (other, second) = parts
    cells, points = np.vstack([one, other + len(first)]), np.vstack([first, second])
    if comm.rank:
        cells, points = cells[:0], points[:0]
    mesh = compat.mesh_from_cells(cells.astype(np.int64), points, None, comm)
    heights = {LOW: 0.0, DISC: DISC_HEIGHT, PAD: base, HIGH: base + PAD_HEIGHT}
    return mesh, tagged(mesh, {tag: at(mesh, 2, z) for tag, z in heights.items()})


def pad_and_disc(comm, cell=HEXAHEDRA, disc=(6, 4, 2), pad=(3, 2, 2)):
    """The same pad and disc, each as a mesh of its own with tags of its faces."""
    found, base = {}, DISC_HEIGHT + APART
    for name, below, height, cells, (low, high) in (
        ("disc", 0.0, DISC_HEIGHT, disc, (LOW, DISC)),
        ("pad", base, PAD_HEIGHT, pad, (PAD, HIGH)),
    ):
        ends = [[0.0, 0.0, below], [*SIDES, below + height]]
        mesh = dmesh.create_box(comm, ends, list(cells), cell)
        faces = {low: at(mesh, 2, below), high: at(mesh, 2, below + height)}
        found[name] = TaggedMesh(mesh=mesh, facet_tags=tagged(mesh, faces))
    return found


def work(u, poisson=0.0):
    """Inner work of both, which differ in stiffness."""
    mesh = u.function_space.mesh
    x, v = ufl.SpatialCoordinate(mesh), ufl.TestFunction(u.function_space)
    young = ufl.conditional(ufl.lt(x[2], DISC_HEIGHT + 0.5 * APART), DISC_YOUNG, PAD_YOUNG)
    strain = ufl.sym(ufl.grad(u))
    stress = strain + poisson / (1 - 2 * poisson) * ufl.tr(strain) * ufl.Identity(3)
    return ufl.inner(young / (1 + poisson) * stress, ufl.sym(ufl.grad(v))) * ufl.dx
