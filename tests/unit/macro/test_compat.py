"""What the rest of macro expects from every dolfinx release."""

import logging
import weakref

import numpy as np
import pytest
from helpers.body_meshes import box, standing
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import PatchGrid
from patchlaw.macro import Material, compat
from patchlaw.support import InputError

SOFT = Material(young_modulus=1000.0, poisson_ratio=0.3)
WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("degree", [1, 2])
def test_basis_is_nodal_and_sums_to_one(cell, degree):
    points = np.random.default_rng(0).uniform(0.0, 0.3, (7, 3))
    values = compat.lagrange_values(cell, degree, points)
    vertices, _ = compat.reference_facets(cell)
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-14)  # round-off
    at_vertices = compat.lagrange_values(cell, degree, vertices)[:, : len(vertices)]
    np.testing.assert_allclose(at_vertices, np.eye(len(vertices)), atol=1e-14)


def test_basis_on_no_points_is_empty():
    assert compat.lagrange_values("hexahedron", 2, np.empty((0, 3))).shape == (0, 27)


@pytest.mark.parametrize("degree", [1, 2, 4, 8])
def test_triangle_rule_is_exact_to_its_degree(degree):
    (x, y), weights = compat.triangle_rule(degree)[0].T, compat.triangle_rule(degree)[1]
    for i in range(degree + 1):
        # ∫ xⁱ y^(d−i) over the unit triangle = i! (d−i)! / (d+2)!
        factorial = np.vectorize(lambda n: float(np.prod(np.arange(1, n + 1))))
        exact = factorial(i) * factorial(degree - i) / factorial(degree + 2)
        assert weights @ (x**i * y ** (degree - i)) == pytest.approx(exact, rel=1e-12)


def test_facets_of_a_hexahedron_are_affine_squares():
    vertices, facets = compat.reference_facets("hexahedron")
    corners = vertices[facets]
    # vertices 0 and 3 are opposite: what the cutting of facets relies on
    np.testing.assert_array_equal(corners[:, 0] + corners[:, 3], corners[:, 1] + corners[:, 2])


def test_compiling_leaves_logging_as_it_was():
    root = logging.getLogger()
    before = root.level, root.manager.disable, list(root.handlers)
    with compat.quiet_compiler():
        root.setLevel(logging.DEBUG)
        assert not logging.getLogger("any").isEnabledFor(logging.INFO)
    assert (root.level, root.manager.disable, list(root.handlers)) == before


@pytest.mark.parametrize(
    "error", [PermissionError(13, "Permission denied", "settings.json"), ValueError("no JSON")]
)
def test_settings_that_dolfinx_cannot_read_are_told(monkeypatch, error):
    def fail():
        raise error

    name = "get_options" if hasattr(compat.jit, "get_options") else "get_parameters"
    monkeypatch.setattr(compat.jit, name, fail)
    with pytest.raises(InputError, match=r"dolfinx cannot read its settings \(.*set XDG_CONFIG"):
        compat.compile_form(None)


class Doubling:
    """A linear map for PETSc."""

    def mult(self, _matrix, x, y):
        x.copy(y)
        y.scale(2.0)


def test_what_python_has_dropped_is_freed():
    vector = PETSc.Vec().createMPI(3, comm=MPI.COMM_SELF)
    context = Doubling()
    matrix = PETSc.Mat().createPython((3, 3), context, comm=MPI.COMM_SELF)
    matrix.setUp()
    alive = weakref.ref(context)
    del matrix, context
    compat.collect_garbage(vector.comm)
    assert alive() is None  # PETSc held the only reference


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_half_of_a_symmetric_matrix_is_all_of_it(cell):
    body = standing(box((0, 0, -0.5), (1, 1, 0), (3, 2, 2), cell), SOFT, WHOLE, 2).body
    half, form = body.stiffness, compat.compile_form(body.form)
    whole = compat.assemble_matrix(form, body.conditions, "baij")
    x = whole.createVecRight()
    x.array[:] = np.random.default_rng(3).standard_normal(x.local_size)
    expected = (whole * x).array_r
    # round-off of some hundred terms
    np.testing.assert_allclose((half * x).array_r, expected, rtol=0, atol=1e-13 * expected.max())
    facts, nodes = half.getInfo(), body.owned_dofs // 3
    assert facts["nz_used"] == (whole.getInfo()["nz_used"] + 9 * nodes) / 2  # with the diagonal
    assert facts["nz_allocated"] == facts["nz_used"]
    assert facts["mallocs"] == 0


def test_errors_of_functions_that_petsc_calls_are_raised_as_they_are():
    def residual(_snes, _x, _values):
        raise InputError("such a thing is not there", value=3)

    vector = PETSc.Vec().createSeq(1)
    snes = PETSc.SNES().create(MPI.COMM_SELF)
    snes.setFunction(residual, vector.duplicate())
    with pytest.raises(InputError, match="such a thing"), compat.errors_of_callbacks():
        snes.solve(None, vector)
    with pytest.raises(PETSc.Error), compat.errors_of_callbacks():
        PETSc.KSP().create(MPI.COMM_SELF).setType("no such type")
