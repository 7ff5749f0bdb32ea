"""Bodies that were meshed apart, as the volumes of one mesh."""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from helpers.contact_laws import PowerLaw, Spring
from helpers.faces import at, tagged
from helpers.plane_problems import rectangle
from helpers.user_problems import (
    APART,
    DISC,
    DISC_HEIGHT,
    DISC_YOUNG,
    HEXAHEDRA,
    HIGH,
    LOW,
    PAD,
    PAD_HEIGHT,
    PAD_YOUNG,
    SIDES,
    TETRAHEDRA,
    clamped,
    pad_and_disc,
    pressed_face,
    stacked,
    work,
)
from mpi4py import MPI

from patchlaw.macro import ContactProblem, Interface, TaggedMesh, compat, joined_meshes
from patchlaw.macro.mesh.tagged import surface_area
from patchlaw.support import InputError


def force(mesh, tags, faces, law, poisson=0.3):
    """The force between pad and disc in one mesh."""
    space, (low, high, disc, pad) = compat.vector_space(mesh, 1), faces
    held = [clamped(space, tags, tag=low), clamped(space, tags, (0.0, 0.0, -9e-3), tag=high)]
    own = {"work": lambda u: work(u, poisson), "held": held}
    rough, problem = pressed_face(space, tags, disc, opposite=pad, laws=law, **own)
    problem.solve()
    return rough.force


def tags_of(whole):
    """The four faces of joined bodies in the order of `force`."""
    return [whole.facet_tag(name) for name in ("disc 1", "pad 2", "disc 3", "pad 4")]


def test_two_meshes_are_as_one_with_both_volumes():
    """Against the mesh that was made of both at once: the same cells, the same force."""
    law = PowerLaw(3e4)
    whole = joined_meshes(pad_and_disc(MPI.COMM_SELF))
    known = force(*stacked(), (LOW, HIGH, DISC, PAD), law)
    assert force(whole.mesh, whole.facet_tags, tags_of(whole), law) == pytest.approx(
        known, rel=1e-9
    )


def test_bars_of_two_meshes_are_in_series_with_their_law():
    """Without Poisson's effect, with volumes by name; facets of the pad are cut by the disc's."""
    parts = pad_and_disc(MPI.COMM_SELF, TETRAHEDRA)
    whole = joined_meshes(parts)
    assert whole.cell_names == {"disc": 1, "pad": 2}
    space = compat.vector_space(whole.mesh, 1)
    u, v = fem.Function(space), ufl.TestFunction(space)
    low, high, _, _ = tags_of(whole)
    held = [
        clamped(space, whole.facet_tags, tag=low),
        clamped(space, whole.facet_tags, (0.0, 0.0, -9e-3), tag=high),
    ]
    strain = [ufl.sym(ufl.grad(each)) for each in (u, v)]
    dx = ufl.Measure("dx", domain=whole.mesh, subdomain_data=whole.cell_tags)
    form = sum(
        young * ufl.inner(*strain) * dx(whole.cell_tag(name))
        for name, young in (("disc", DISC_YOUNG), ("pad", PAD_YOUNG))
    )
    rough = Interface(space, whole, "disc 3", opposite="pad 4", laws=Spring(7e3))
    ContactProblem(form, u, held, rough).solve()
    known = (9e-3 - APART) / (DISC_HEIGHT / DISC_YOUNG + PAD_HEIGHT / PAD_YOUNG + 1.0 / 7e3)
    assert rough.force == pytest.approx(known * SIDES[0] * SIDES[1], rel=1e-8)


def test_names_areas_and_volumes_of_several_groups():
    """A body of two volumes beside one of none; faces by name, or by number without one."""
    parts = pad_and_disc(MPI.COMM_SELF)
    disc = parts["disc"]
    x = disc.mesh.geometry.x[compat.cell_vertices(disc.mesh)]
    values = np.where(x[:, :, 2].mean(axis=1) < 0.5 * DISC_HEIGHT, 8, 5).astype(np.int32)
    cells = dmesh.meshtags(disc.mesh, 3, np.arange(len(values), dtype=np.int32), values)
    groups = {"foot": SimpleNamespace(dim=3, tag=8), "face": SimpleNamespace(dim=2, tag=DISC)}
    parts["disc"] = SimpleNamespace(
        mesh=disc.mesh, facet_tags=disc.facet_tags, cell_tags=cells, physical_groups=groups
    )
    whole = joined_meshes(parts)
    assert set(whole.cell_names) == {"disc 5", "disc foot", "pad"}
    assert set(whole.facet_names) == {"disc 1", "disc face", "pad 2", "pad 4"}
    for name in whole.facet_names:
        assert surface_area(whole, whole.facet_tag(name)) == pytest.approx(6.0, rel=1e-12)
    one = fem.Constant(whole.mesh, 1.0)
    dx = ufl.Measure("dx", domain=whole.mesh, subdomain_data=whole.cell_tags)
    sizes = {
        name: fem.assemble_scalar(compat.compile_form(one * dx(tag)))
        for name, tag in whole.cell_names.items()
    }
    assert sizes == pytest.approx({"disc 5": 3.0, "disc foot": 3.0, "pad": 12.0}, rel=1e-12)


def test_plane_meshes_are_joined():
    def strip(lower, upper, cells):
        mesh = rectangle(lower, upper, cells)
        ends = {1: at(mesh, 1, lower[1]), 2: at(mesh, 1, upper[1])}
        return TaggedMesh(mesh=mesh, facet_tags=tagged(mesh, ends))

    whole = joined_meshes(
        {"foot": strip([0, 0], [3, 1], [6, 2]), "head": strip([0, 1], [3, 3], [3, 3])}
    )
    space = compat.vector_space(whole.mesh, 1)
    u, v = fem.Function(space), ufl.TestFunction(space)

    def held(tag, value):
        nodes = fem.locate_dofs_topological(space, 1, whole.facet_tags.find(whole.facet_tag(tag)))
        return fem.dirichletbc(np.array(value), nodes, space)

    conditions = [held("foot 1", (0.0, 0.0)), held("head 2", (0.0, -4e-3))]
    form = 3000.0 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
    rough = Interface(space, whole, "foot 2", opposite="head 1", laws=Spring(9e3))
    ContactProblem(form, u, conditions, rough).solve()
    assert rough.force == pytest.approx(3.0 * 4e-3 / (3.0 / 3000.0 + 1.0 / 9e3), rel=1e-8)


def test_curved_cells_stay_curved():
    """Of second order, moved onto a paraboloid: the volume below it."""

    def bowl(shift):
        mesh, tags = stacked_curved()
        mesh.geometry.x[:, 0] += shift
        return TaggedMesh(mesh=mesh, facet_tags=tags)

    whole = joined_meshes({"one": bowl(0.0), "two": bowl(5.0)})
    assert compat.geometry_degree(whole.mesh) == 2
    volume = fem.assemble_scalar(compat.compile_form(fem.Constant(whole.mesh, 1.0) * ufl.dx))
    # ∫ 1 + x²/10 + y²/7 over [0, 1]²
    assert volume == pytest.approx(2.0 * (1.0 + 1.0 / 30.0 + 1.0 / 21.0), rel=1e-12)


def stacked_curved():
    """Hexahedra of second order below z = 1 + x²/10 + y²/7, with a tag on their top."""
    lines = np.linspace(0.0, 1.0, 5)
    grid = np.stack(np.meshgrid(lines, lines, lines, indexing="ij"), axis=-1).reshape(-1, 3)
    points = compat.lagrange_points("hexahedron", 2)
    corners = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    places = np.rint(2.0 * (corners[:, None] + points[None])).astype(int)
    cells = (places * np.array([25, 5, 1])).sum(axis=2)
    grid[:, 2] *= 1.0 + grid[:, 0] ** 2 / 10.0 + grid[:, 1] ** 2 / 7.0
    mesh = compat.mesh_from_cells(cells.astype(np.int64), grid, None, MPI.COMM_SELF)
    top = dmesh.locate_entities_boundary(
        mesh, 2, lambda x: np.isclose(x[2], 1.0 + x[0] ** 2 / 10.0 + x[1] ** 2 / 7.0)
    )
    return mesh, tagged(mesh, {3: top})


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda parts: {"pad": parts["pad"]}, "two meshes or more"),
        (lambda parts: list(parts.values()), "two meshes or more"),
        (lambda parts: dict(enumerate(parts.values())), "two meshes or more by name"),
        (lambda parts: parts | {"pad": parts["pad"].mesh}, "pad.*no mesh with tags"),
        (
            lambda parts: parts | {"pad": pad_and_disc(MPI.COMM_SELF, TETRAHEDRA)["pad"]},
            "pad = 'tetrahedron in 3.*different cells.*hexahedron in 3.* for all.*counter_body",
        ),
        (lambda parts: parts | {"pad": pad_and_disc(MPI.COMM_WORLD)["pad"]}, None),
    ],
)
def test_what_cannot_be_joined_is_refused(change, problem):
    parts = change(pad_and_disc(MPI.COMM_SELF, HEXAHEDRA))
    if problem is None:  # congruent on one rank
        assert joined_meshes(parts).cell_names == {"disc": 1, "pad": 2}
        return
    with pytest.raises(InputError, match=problem):
        joined_meshes(parts)


def test_groups_that_would_share_a_name_are_refused():
    parts = pad_and_disc(MPI.COMM_SELF)
    named = {
        "disc": replaced(parts["disc"], {"a": LOW, "b a": DISC}),
        "disc b": replaced(parts["pad"], {"a": HIGH}),
    }
    with pytest.raises(InputError, match="disc b = 'disc b a': two groups would have one name"):
        joined_meshes(named)


def replaced(tagged, names):
    return TaggedMesh(mesh=tagged.mesh, facet_tags=tagged.facet_tags, facet_names=names)
