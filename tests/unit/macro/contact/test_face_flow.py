"""Flow over triangles of a face: closed forms of rings and strips, and finite elements."""

import numpy as np
import pytest

from patchlaw.macro.contact.face_leak import TriangleFace

INNER, OUTER = 22.0, 24.5


def triangles(x, y):
    """Return a lattice of points, shape (m, n) each, as triangles."""
    points = np.stack([x, y], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[:-1, 1:], points[1:, 1:]
    both = [np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)]
    return np.concatenate([one.reshape(-1, 3, 2) for one in both])


def quarter_ring(across, around):
    """Return triangles of a quarter of a ring, and the nodes on its bore and its rim."""
    radius = np.linspace(INNER, OUTER, across + 1)[:, None]
    angle = np.linspace(0.0, 0.5 * np.pi, around + 1)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    edges = (np.column_stack([x[k], y[k]]) for k in (0, -1))
    return triangles(x, y), *edges


def strip(nx=8, ny=5, length=2.0, width=0.6):
    x, y = np.meshgrid(np.linspace(0, length, nx + 1), np.linspace(0, width, ny + 1), indexing="ij")
    corners = triangles(x, y)
    return corners, TriangleFace(
        corners, np.column_stack([x[0], y[0]]), np.column_stack([x[-1], y[-1]])
    )


@pytest.mark.parametrize("lay", [7.9, 1.0 / 7.9])
def test_ring_whose_lay_follows_it(lay):
    """Radial flow knows T along the radius alone, with the square of the size; cut into four too.

    The error is that of T around, which pressures of straight elements drive a little flow by.
    """
    exact, moved = 0.5 * np.pi * 3e-9 / np.log(OUTER / INNER), np.array([5.0, -3.0])
    errors = []
    for across in (4, 8, 16):
        corners, bore, rim = (one + moved for one in quarter_ring(across, 12 * across))
        face = TriangleFace(corners, bore, rim, moved)
        one = np.tile([3e-9, lay * 3e-9], (len(corners), 1))
        errors.append(abs(face.flow(one).total / exact - 1.0))
        finer = face.quartered().flow(np.repeat(one, 4, axis=0)).total
        assert abs(finer / exact - 1.0) < 0.5 * errors[-1]
    assert errors[-1] < 1e-4
    assert np.log2(errors[0] / errors[1]) > 1.9
    # along x and y of the ring both count
    along = TriangleFace(corners, bore, rim).flow(one).total
    assert min(1.0, lay) * 1.5 < along / exact < max(1.0, lay) / 1.5


@pytest.mark.parametrize(("across", "around"), [(1, 20), (2, 40)])
def test_triangles_cut_into_four_tell_the_error_of_their_size(across, around):
    """Leaks fall with the square of the size; a ring one element wide has no node between."""
    faces, flows = [TriangleFace(*quarter_ring(across, around))], []
    for _ in range(4):
        count = len(faces[-1].corners)
        flows.append(faces[-1].flow(np.full((count, 2), 3e-9)).total)
        faces.append(faces[-1].quartered())
    changes = -np.diff(flows)
    assert np.all(changes > 0.0)
    rates = changes[:-1] / changes[1:]  # tends to 4
    assert np.all(rates > 2.5)
    exact = flows[-1] - changes[-1] / (rates[-1] - 1.0)
    assert changes[0] < flows[0] - exact < 2.0 * changes[0]  # what runs state
    # straight edges are in none of them
    ring = 0.5 * np.pi * 3e-9 / np.log(OUTER / INNER)
    assert exact == pytest.approx(ring, rel=5e-3)


@pytest.mark.parametrize(("across", "around"), [(2, 4), (8, 4), (4, 8), (8, 8), (16, 16)])
def test_straight_sides_of_a_curve_are_in_the_stated_error(across, around):
    """Cut into four between straight sides, the quarter of a ring is a polygon for ever."""
    face = TriangleFace(*quarter_ring(across, around))
    one = np.full((len(face.corners), 2), 3e-9)
    four, bent = np.repeat(one, 4, axis=0), face.most_bent
    own, straight = face.flow(one).total, face.quartered().flow(four).total
    rounder = face.quartered(bent).flow(four).total
    true = abs(own - 0.5 * np.pi * 3e-9 / np.log(OUTER / INNER))
    by_size = 2.0 * abs(straight - own)
    assert by_size < 0.9 * true
    # what runs state
    assert true < by_size + 4.0 / 3.0 * abs(rounder - straight) / bent < 2.0 * true


def test_corners_stay_and_sides_with_them():
    _, face = strip()
    assert face.most_bent == 1.0
    assert face.quartered(1.0).corners == pytest.approx(face.quartered().corners, abs=1e-15)


def test_ring_whose_transmissivity_falls_outwards():
    """T = T₀ (r₀/r)³ along all directions: ∫ dr/(r T) across the ring."""
    corners, bore, rim = quarter_ring(24, 100)
    radius = np.linalg.norm(corners.mean(axis=1), axis=1)
    transmissivity = np.repeat(3e-9 * (INNER / radius[:, None]) ** 3, 2, axis=1)
    found = TriangleFace(corners, bore, rim).flow(transmissivity)
    exact = 0.5 * np.pi * 3e-9 * 3.0 / ((OUTER / INNER) ** 3 - 1.0)
    assert found.total == pytest.approx(exact, rel=2e-4)
    assert (found.pressure.min(), found.pressure.max()) == (0.0, 1.0)
    assert 0.0 < found.pressure.mean(axis=1).min()
    assert found.leaving.sum() == pytest.approx(found.total, rel=1e-10)
    assert (found.leaving[radius < 0.99 * OUTER * 0.99] == 0.0).all()


@pytest.mark.parametrize("along", [True, False])
def test_strips_of_two_directions_and_of_layers(along):
    corners, face = strip()
    each = np.tile([4e-9, 1e-15], (len(corners), 1))
    assert face.flow(each).total == pytest.approx(4e-9 * 0.6 / 2.0, rel=1e-9)
    middle = corners.mean(axis=1)
    part = middle[:, 1] < 0.24 if along else middle[:, 0] < 0.5
    layered = np.where(part, 1e-9, 1e-14)[:, None] * [1.0, 1.0]
    one, other = 1e-9 / 1e-14 * 0.4, 0.6  # shares of the width
    expected = (one + other) * 1e-14 * 0.6 / 2.0
    if not along:
        expected = 0.6 / (0.5 / 1e-9 + 1.5 / 1e-14)
    assert face.flow(layered).total == pytest.approx(expected, rel=1e-7)


def test_a_closed_ring_lets_nothing_through():
    corners, bore, rim = quarter_ring(6, 40)
    face = TriangleFace(corners, bore, rim)
    radius = np.linalg.norm(corners.mean(axis=1), axis=1)
    closed = (radius > 23.0) & (radius < 23.7)
    transmissivity = np.where(closed, 0.0, 1e-9)[:, None] * [1.0, 1.0]
    found = face.flow(transmissivity)
    assert found.total == 0.0
    assert np.nanmin(found.pressure[radius < 22.5]) == 1.0
    assert np.nanmax(found.pressure[radius > 24.2]) == 0.0
    angle = np.arctan2(*corners.mean(axis=1).T)
    transmissivity[closed & (np.abs(angle - 0.7) < 0.05)] = 1e-12  # a path through it
    through = face.flow(transmissivity)
    assert 0.0 < through.total < 1e-10
    assert np.isnan(through.pressure).any()
    assert face.flow(np.zeros_like(transmissivity)).total == 0.0


def test_elements_of_dolfinx_on_the_same_triangles():
    """The same discretisation: equal but for rounding."""
    ufl = pytest.importorskip("ufl")
    from dolfinx import fem
    from dolfinx import mesh as dmesh
    from mpi4py import MPI

    from patchlaw.macro.compat import assemble_matrix, cell_vertices, compile_form, scalar_space

    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0.0, 0.0], [2.0, 0.6]], [7, 6])
    space, constant = scalar_space(mesh, 1), scalar_space(mesh, 0, "DG", shape=(2,))
    count = mesh.topology.index_map(2).size_local
    corners = mesh.geometry.x[cell_vertices(mesh)[:count], :2]
    values = 10.0 ** np.random.default_rng(2).uniform(-3.0, 0.0, (count, 2))
    cube = fem.Function(constant)
    cube.x.array[:] = values.ravel()
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    flow = ufl.as_vector([cube[k] * ufl.grad(trial)[k] for k in (0, 1)])
    matrix = assemble_matrix(compile_form(ufl.inner(flow, ufl.grad(test)) * ufl.dx), [])
    dense = matrix.getValues(range(matrix.size[0]), range(matrix.size[1]))
    x = space.tabulate_dof_coordinates()[:, 0]
    high, low = np.isclose(x, 0.0), np.isclose(x, 2.0)
    free = ~(high | low)
    pressure = high.astype(float)
    pressure[free] = np.linalg.solve(dense[np.ix_(free, free)], -dense[free] @ pressure)
    nodes = mesh.geometry.x[:, :2]
    ends = (nodes[np.isclose(nodes[:, 0], at)] for at in (0.0, 2.0))
    found = TriangleFace(corners, *ends).flow(values)
    assert found.total == pytest.approx(float(pressure @ dense @ pressure), rel=1e-10)
