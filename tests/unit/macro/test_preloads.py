"""Loads of bodies besides the contact: displacements, stresses and moments in closed form."""

import numpy as np
import pytest
from helpers.body_meshes import HIGH, LOW, box
from mpi4py import MPI

from patchlaw.macro import Loads, Material, MeshedBody, Support, Traction
from patchlaw.macro.fields import cell_stresses

E, NU, STRAIN = 4000.0, 0.3, 2e-3
STEEL = Material(young_modulus=E, poisson_ratio=NU)
HEATED = Loads(strain=((None, STRAIN),))
HELD = (0.0, 0.0, 0.0)


def loaded(*states, upper=None, cell="hexahedron", order=1):
    """Return a box that is held below, and above if it is told how."""
    mesh = box((0, 0, 0), (2, 1, 0.5), (4, 3, 2), cell)
    supports = [Support(tag=LOW, displacement=HELD)]
    if upper is not None:
        supports.append(Support(tag=HIGH, displacement=upper))
    return MeshedBody(mesh, STEEL, supports, states, order=order)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_body_that_may_grow_has_no_stress(cell, order):
    mesh = box((0, 0, 0), (2, 1, 0.5), (4, 3, 2), cell)
    # the axis of z alone holds the middle: the bottom slides, but for what rounding would move
    free = MeshedBody(mesh, STEEL, [Support(tag=LOW, displacement=(None, None, 0.0))], [HEATED],
                      order=order)  # fmt: skip
    points = free.space.tabulate_dof_coordinates()
    grown = free.function((STRAIN * points).ravel())
    np.testing.assert_allclose(cell_stresses(free, grown), 0.0, atol=1e-9 * E * STRAIN)
    # that displacement is in equilibrium with the loads
    (form,) = free._load_forms(HEATED)
    from patchlaw.macro import compat

    forces = compat.assemble_vector(compat.compile_form(form)).array_r
    internal = free._product(grown).array_r
    np.testing.assert_allclose(forces, internal, atol=1e-10 * np.abs(internal).max())


def test_a_body_that_may_not_grow_is_under_pressure():
    body = loaded(HEATED)
    rest = body.function(np.zeros(body.owned_dofs))
    pressure = E * STRAIN / (1.0 - 2.0 * NU)
    stress = cell_stresses(body, rest)
    expected = np.broadcast_to(-pressure * np.eye(3), stress.shape)
    np.testing.assert_allclose(stress, expected, rtol=1e-12, atol=1e-12)


def test_states_are_mixed_on_the_way_from_one_to_the_next():
    pulled = Loads(tractions=(Traction(tag=HIGH, stress=(0.0, 0.0, 3.0)),))
    body = loaded(Loads(), HEATED, pulled)
    hot, stretched = body.preload(1), body.preload(2)
    np.testing.assert_array_equal(body.preload(0), 0.0)
    np.testing.assert_allclose(body.preload(0.25), 0.25 * hot, rtol=1e-14)
    np.testing.assert_allclose(body.preload(1.5), 0.5 * (hot + stretched), rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(body.free_strain(0.25), 0.25 * STRAIN)
    assert loaded(Loads()).preload() is None


def test_a_pressure_acts_against_the_outward_normal():
    by_stress = loaded(Loads(tractions=(Traction(tag=HIGH, stress=(0.0, 0.0, -3.0)),)))
    by_pressure = loaded(Loads(tractions=(Traction(tag=HIGH, pressure=3.0),)))
    np.testing.assert_allclose(by_pressure.preload(), by_stress.preload(), rtol=1e-10, atol=1e-18)


def test_moments_of_a_pull_are_those_of_its_resultant():
    body = loaded()
    pull = Loads(pulls=(Traction(tag=HIGH, stress=(0.0, 0.0, 3.0)),))
    moments = body.pull_moments(pull, np.array([0.25, 0.0, 9.0]), np.eye(3)[:2])
    # 6 N in the middle of a face of 2 mm × 1 mm
    assert moments == pytest.approx([6.0 * 0.75, 6.0 * 0.5], rel=1e-12)
    assert body.comm.size == MPI.COMM_SELF.size
