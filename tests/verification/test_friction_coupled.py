"""Pressures and tractions that see each other: closed forms, an oracle, and the coupling's limits.

Without slip a flat punch on a body of Poisson's ratio ν is stiffer than without friction by
(1 − ν) ln(3 − 4ν)/(1 − 2ν) (Mossakovskii 1954; Spence 1968). With friction the stick radius c
of a punch of radius a, whose pressures do not know of the tractions, obeys
ln((1 + c)/(1 − c))/(2c) = (μ/β) K'(c) (Spence 1973), K' being the complete elliptic integral.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers import dense_friction
from helpers.sheared_sphere import (
    LOAD,
    MU,
    NU,
    RATIO,
    STIFFNESS,
    on_nodes,
    path,
    sheared_by_interface,
    sphere,
)  # fmt: skip
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import brentq
from scipy.special import ellipk

from patchlaw.geometry import Control, Material, MaterialPair, ShearControl, ShearState, Surface
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.micro.boundary_elements.half_space_grid import HalfSpaceGrid
from patchlaw.micro.friction.coupled import press_coupled
from patchlaw.micro.friction.tangential_grid import CrossCompliance, cerruti_kernels

APPROACH, RADIUS = 1e-3, 0.4
PRESSED = Control(approach=APPROACH, shear=ShearControl(shift=(0.0, 0.0)))


def punch(cells, nu, coefficient):
    """Return a flat punch, and what rubs below it."""
    pair = MaterialPair(first=Material(young_modulus=1000.0, poisson_ratio=nu))
    x = (np.arange(cells) + 0.5) / cells - 0.5
    heights = np.where(np.hypot(x[:, None], x) <= RADIUS, 0.0, -1.0)
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    normal = HalfSpaceModel(surface, contact_modulus=pair.contact_modulus, highest=0.0)
    friction = FrictionModel(
        materials=pair, coefficient=coefficient, spacing=surface.spacing, coupled=True
    )
    return normal, friction


@pytest.mark.long
@pytest.mark.parametrize("nu", [0.0, 0.1, 0.3])
def test_a_punch_that_does_not_slip_is_stiffer_by_mossakovskii(nu):
    exact = (1.0 - nu) * np.log(3.0 - 4.0 * nu) / (1.0 - 2.0 * nu)
    off = []
    for cells in (32, 64):
        normal, friction = punch(cells, nu, 1e3)
        state, shear = press_coupled(normal, friction, PRESSED, None)
        off.append(state.force / normal.press(PRESSED).force / exact - 1.0)
        assert not shear.slipping.any()
        assert np.abs(shear.force).max() < 1e-7 * state.force  # symmetry
    # the singular edge errs by the first power of the cells
    assert abs(off[1]) < 0.6 * abs(off[0])
    assert abs(off[1]) < 1.5e-3


@pytest.mark.parametrize(("nu", "coefficient"), [(0.0, 0.3), (0.3, 0.2), (0.3, 0.3)])
def test_pressures_alone_pull_a_punch_as_spence_found(nu, coefficient):
    normal, friction = punch(96, nu, coefficient)
    shear = friction.advance(None, normal.press(PRESSED).pressures, PRESSED.shear)
    beta = friction.materials.dundurs_beta

    def residual(c):
        return np.log((1.0 + c) / (1.0 - c)) / (2.0 * c) - coefficient / beta * ellipk(1.0 - c * c)

    exact = brentq(residual, 1e-9, 1.0 - 1e-12)
    found = np.sqrt(np.count_nonzero(shear.sticking) / np.count_nonzero(shear.closed))
    assert found == pytest.approx(exact, abs=0.5 / (96 * RADIUS))  # half a cell


def oracle(case, passes=8000):
    """Solve one load step by projecting pressures and tractions along their residuals.

    Args:
        case: Has matrices of all cells, interference, shift and coefficient.
        passes: Number of steps.
    """
    n = len(case.interference)
    p, q = np.zeros(n), np.zeros((2, n))
    rate = 0.4 / np.abs(case.normal).sum(axis=1).max()
    for _ in range(passes):
        across = case.cross[0] @ q[0] + case.cross[1] @ q[1]
        gap = case.normal @ p + across - case.interference
        sideways = np.stack([each.T @ p for each in case.cross])  # reciprocity
        sheared = np.einsum("abmn,bn->am", case.tangential, q)
        slip = case.shift[:, None] - sideways - sheared
        p = np.maximum(p - rate * gap, 0.0)
        q = q + rate * slip
        size, bound = np.hypot(*q), case.coefficient * p
        q = q * np.where(size > bound, bound / np.maximum(size, 1e-99), 1.0)
    return p, q


@pytest.mark.long
@pytest.mark.parametrize(("nu", "coefficient"), [(0.0, 0.6), (0.28, 0.23), (0.0, 0.05)])
def test_rough_cells_are_those_of_an_oracle(nu, coefficient):
    random, n = np.random.default_rng(17), 10
    pair = MaterialPair(first=Material(young_modulus=1.0 - nu**2, poisson_ratio=nu))  # E* = 1
    x = np.linspace(-1.0, 1.0, n)
    heights = -0.02 * np.hypot(x[:, None], x) ** 2 + 0.004 * random.random((n, n))
    surface = Surface(heights=heights, lengths=(1.0, 1.3))
    normal = HalfSpaceModel(surface, contact_modulus=1.0, highest=float(heights.max()))
    friction = FrictionModel(
        materials=pair, coefficient=coefficient, spacing=surface.spacing, coupled=True
    )
    shift = 0.4 * coefficient * 0.012 * np.array([0.8, 0.6])
    control = Control(approach=0.012, shear=ShearControl(shift=tuple(shift)))
    state, shear = press_coupled(normal, friction, control, None)
    case = dense(surface, pair, nu)
    case.interference = normal.interference(state.plane).ravel()
    case.shift, case.coefficient = shift, coefficient
    p, q = oracle(case)
    assert np.count_nonzero(p) in range(10, 90)
    slips = np.count_nonzero(shear.slipping)
    assert 0 < slips <= np.count_nonzero(shear.closed)
    # both stop at 1e-6 of displacements
    np.testing.assert_allclose(state.pressures.ravel(), p, atol=1e-4 * p.max())
    np.testing.assert_allclose(shear.traction.reshape(2, -1), q, atol=1e-4 * np.hypot(*q).max())
    neglected = normal.press(control)
    assert abs(neglected.force / state.force - 1.0) > 1e-3  # it matters


def dense(surface, pair, nu):
    """Return matrices of all cells, column by column."""
    grid, spacing = surface.grid, surface.spacing
    count = grid[0] * grid[1]
    half_space = HalfSpaceGrid(grid, spacing, periodic=False)
    cross = CrossCompliance(grid, spacing, pair, periodic=False)
    xx, yy, xy = cerruti_kernels(grid, spacing, nu)
    i, j = np.divmod(np.arange(count), grid[1])
    di, dj = i[:, None] - i, j[:, None] - j
    place = np.abs(di), np.abs(dj)
    sign = np.sign(di) * np.sign(dj)
    tangential = np.array([[xx[place], sign * xy[place]], [sign * xy[place], yy[place]]])
    normal, across = np.empty((count, count)), np.empty((2, count, count))
    for cell in range(count):
        one = np.eye(1, count, cell).reshape(grid)
        normal[:, cell] = half_space.compliance(one.copy()).ravel()
        for axis in range(2):
            both = np.zeros((2, *grid))
            both[axis] = one
            across[axis, :, cell] = cross.across(both).ravel()
    return SimpleNamespace(normal=normal, tangential=tangential, cross=across)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nu", "coefficient"), [pytest.param(0.0, 9.7, marks=pytest.mark.slow), (0.21, 6.3)]
)
def test_friction_that_holds_far_more_than_pressures_pull_converges_to_one_solution(
    nu, coefficient
):
    """A pass changes the displacements by μ β times what they are off: up to 4.9 of it here."""
    random, n = np.random.default_rng(8), 16
    pair = MaterialPair(first=Material(young_modulus=1000.0, poisson_ratio=nu))
    x = (np.arange(n) + 0.5) / n - 0.5
    heights = -0.1 * (x[:, None] ** 2 + x**2) + 2e-4 * random.random((n, n))
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    normal = HalfSpaceModel(surface, contact_modulus=pair.contact_modulus)
    friction = FrictionModel(
        materials=pair, coefficient=coefficient, spacing=surface.spacing, coupled=True
    )
    state, shear, force = None, None, 11.0
    for share, *shift in (
        (0.6, 0.0, 0.0),
        (1.0, 0.004, 0.0),
        (0.9, 0.011, 0.006),
        (1.0, -0.01, 0.0),
    ):
        load = ShearControl(shift=(coefficient * shift[0], coefficient * shift[1]))
        before, start = shear, None if state is None else state.start
        control = Control(force=share * force, shear=load)
        state, shear = press_coupled(normal, friction, control, before, start=start)
        # from nothing, not from the load step before: the same to the tolerance
        _, again = press_coupled(normal, friction, control, before)
        size = np.hypot(*shear.force) + 1e-3 * force
        assert np.hypot(*np.subtract(again.force, shear.force)) <= 1e-4 * size


def test_like_half_spaces_are_not_coupled():
    material = Material(young_modulus=1000.0, poisson_ratio=0.2)
    normal, friction = punch(24, 0.2, 0.3)
    like = FrictionModel(
        materials=MaterialPair(first=material, second=material),
        coefficient=0.3, spacing=friction.spacing, coupled=True,
    )  # fmt: skip
    state, shear = press_coupled(normal, like, PRESSED, None)
    assert not shear.traction.any()
    np.testing.assert_array_equal(state.pressures, normal.press(PRESSED).pressures)


@pytest.mark.long
def test_a_path_under_varying_load_loses_energy_at_every_step():
    random = np.random.default_rng(4)
    normal, friction = punch(24, 0.1, 0.4)
    heights = normal.surface.heights + 2e-4 * random.random((24, 24))
    surface, modulus = Surface(heights=heights, lengths=(1.0, 1.0)), normal.contact_modulus
    normal = HalfSpaceModel(surface, contact_modulus=modulus, highest=float(heights.max()))
    shear = ShearState.none((24, 24))
    for _ in range(12):
        approach, shift = 1e-3 * random.random(), 4e-4 * (random.random(2) - 0.5)
        control = Control(approach=approach, shear=ShearControl(shift=tuple(shift)))
        state, after = press_coupled(normal, friction, control, shear)
        size = np.hypot(*after.traction)
        assert (size <= 0.4 * state.pressures * (1.0 + 1e-9)).all()
        assert after.dissipated_in_step >= 0.0
        shear = after


N, PARTS, POINTS = 6, 8, 8


@pytest.mark.slow
def test_interface_sticks_slips_and_turns_as_dense_matrices():
    """A cap of facets on a block, 8 × 8 points on every facet."""
    cells, ticks = (N, N, N // 2), np.linspace(0.0, 1.0, N + 1)
    depth = RegularGridInterpolator((ticks, ticks), sphere(ticks[:, None], ticks))
    points, weight, rule = dense_friction.midpoints(cells[:2], (1.0, 1.0), 2 * (POINTS * N,))
    stiffness, relative = dense_friction.under_plane(cells, (1.0, 1.0, 1.0), LOAD, NU, rule)
    oracle = dense_friction.Sliders(
        stiffness, relative, weight, depth(points), STIFFNESS, STIFFNESS / RATIO, MU
    )
    ends = [oracle.step(one.approach, one.shear.shift) for one in path(PARTS)]
    expected = np.array(ends[PARTS - 1 :: PARTS][1:])

    def facets(x, y):
        return depth(np.clip(np.column_stack([x, y]), 0.0, 1.0))

    found, last = sheared_by_interface(on_nodes(cells), PARTS, facets)
    off = np.hypot(*(found - expected[:, :2]).T) / np.hypot(*expected[:, :2].T)
    # 0.85, 0.51, 0.44, 0.20 %, force 0.23 %: the quadrature of the facets at the rim of a contact
    # three facets wide, over which the slope of sticking ends at once
    assert off.max() < 0.012
    assert off[3] < 3e-3
    assert last.force == pytest.approx(expected[-1, 2], rel=4e-3)
