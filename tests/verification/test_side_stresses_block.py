"""Stresses in the surface near a free side, and what they make of slopes, beside a meshed block.

The in-plane strains of quadratic tetrahedra under a smooth pressure know nothing of quarter-spaces.
"""

from itertools import combinations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from helpers.block_cases import rough_contact
from helpers.boussinesq import displacements
from helpers.free_side_points import side_displacements
from helpers.love_stresses import love_stresses
from helpers.reference_cases import COMM, MATERIAL, MODULUS, on_block
from scipy.interpolate import RectBivariateSpline

from patchlaw.geometry import Control, PatchGrid, RefinedShape, Surface, reference_shapes
from patchlaw.macro import Block, LoadedFace, Material, block_mesh
from patchlaw.micro import FreeSides, SideStresses
from patchlaw.multiscale import extrapolated

PLACE, WIDTH, FINE, CELLS = 0.05, 0.06, 0.012, 256
TICKS = (np.arange(CELLS) + 0.5) / CELLS


def hill(x, y):
    """Return the pressure, but for exp, and the height of a paraboloid on a floor, at points."""
    squared = (x - PLACE) ** 2 + (y - 0.5) ** 2
    return -squared / WIDTH**2, np.maximum(-squared / 0.32, -0.05)


def meshed_stresses(nu):
    """Return points on the top of a cube, areas about them, and stresses there for E = 1."""
    radius, angle = np.meshgrid(np.linspace(0.0, 2.5 * WIDTH, 5), np.linspace(0.0, 2 * np.pi, 17))
    rings = np.stack([PLACE + radius * np.cos(angle), 0.5 + radius * np.sin(angle)], axis=-1)
    places = np.abs(rings.reshape(-1, 2))  # what lies beyond the side is as well within
    shape = RefinedShape(
        interface=(1.0, 1.0), height=1.0, places=places, fine=FINE, coarse=0.15, element="P2"
    )
    block = Block(block_mesh(shape, COMM), Material(young_modulus=1.0, poisson_ratio=nu))
    x = ufl.SpatialCoordinate(block.space.mesh)
    pressure = ufl.exp(-((x[0] - PLACE) ** 2 + (x[1] - 0.5) ** 2) / WIDTH**2)
    top = ufl.conditional(ufl.gt(x[2], -1e-9), pressure, 0.0)
    measure = ufl.ds(metadata={"quadrature_degree": 6})
    form = fem.form(-top * ufl.TestFunction(block.space)[2] * measure)
    displaced = block.solve(fem.petsc.assemble_vector(form)).x.array.reshape(-1, 3)[:, :2]
    nodes = block.space.tabulate_dof_coordinates()
    cells = block.space.dofmap.list.array.reshape(-1, 10)
    on_top = np.abs(nodes[cells, 2]) < 1e-9
    facets = cells[on_top.sum(axis=1) == 6][on_top[on_top.sum(axis=1) == 6]].reshape(-1, 6)
    return strained(nodes[facets, :2], displaced[facets], nu)


def strained(corners, displaced, nu):
    """Return centres, areas and stresses of triangles of six nodes, shape (n, 6, 2) each."""
    centres = corners.mean(axis=1)
    x, y = np.moveaxis((corners - centres[:, None]) / FINE, -1, 0)
    powers = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    gradient = np.linalg.solve(powers, displaced)[:, 1:3] / FINE
    xx, yy = gradient[:, 0, 0], gradient[:, 1, 1]
    pressed = nu / (1.0 - nu) * np.exp(hill(*centres.T)[0])
    stresses = (
        (xx + nu * yy) / (1.0 - nu**2) - pressed,
        (yy + nu * xx) / (1.0 - nu**2) - pressed,
        0.5 * (gradient[:, 0, 1] + gradient[:, 1, 0]) / (1.0 + nu),
    )
    halves = [np.linalg.det(corners[:, [b, c]] - corners[:, [a]]) / 2.0 for a, b, c in TRIPLES]
    return centres, np.abs(halves).max(axis=0), np.stack(stresses)


TRIPLES = list(combinations(range(6), 3))  # the largest of their triangles has the corners


def slope_effect(stresses, x, y, weights, nu):
    """Return ∫ θ (σ_zz ε_zz − σ_t : ε_t) dA, heights θ counted from the middle of the load."""
    exponent, heights = hill(x, y)
    pressure = np.exp(exponent)
    grid = np.exp(hill(TICKS[:, None], TICKS)[0]), hill(TICKS[:, None], TICKS)[1]
    level = np.sum(grid[0] * grid[1]) / grid[0].sum()
    xx, yy, xy = stresses
    lateral = xx**2 + yy**2 - 2.0 * nu * xx * yy + 2.0 * (1.0 + nu) * xy**2
    return float(np.sum((heights - level) * (pressure**2 - lateral) * weights))


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.0, 0.45])
def test_stresses_beside_a_side_are_those_of_a_meshed_block(nu):
    centres, areas, meshed = meshed_stresses(nu)
    spacing = (1.0 / CELLS,) * 2
    pressure = np.exp(hill(TICKS[:, None], TICKS)[0])
    half_space = love_stresses(Material(young_modulus=1.0, poisson_ratio=nu), pressure, spacing)
    sides = FreeSides(lengths=(1.0, 1.0), poisson_ratio=nu, decay_length=0.25)
    both = half_space + SideStresses(sides, spacing).stresses(pressure)
    places = np.clip(centres, TICKS[0], TICKS[-1]).T

    def at_centres(fields):
        return np.stack([RectBivariateSpline(TICKS, TICKS, part).ev(*places) for part in fields])

    near = (np.hypot(*(centres - [PLACE, 0.5]).T) < 2.0 * WIDTH) & (centres[:, 0] > TICKS[0])
    error = np.sqrt(np.mean((meshed - at_centres(both))[:, near] ** 2, axis=1))
    # of the largest pressure; 0.2 to 0.8 %, most of it the mesh's
    assert (error < 0.009).all()
    alone = np.sqrt(np.mean((meshed - at_centres(half_space))[:, near] ** 2, axis=1))
    assert error.max() < 0.06 * alone.max()

    def effect(fields):
        """Return the effect of slopes, and how far the meshed block's is from it."""
        exact = slope_effect(fields, TICKS[:, None], TICKS, 1.0 / CELLS**2, nu)
        parts = [slope_effect(part, *centres.T, areas, nu) for part in (meshed, at_centres(fields))]
        return exact, parts[0] - parts[1]

    found, beyond = effect(both)
    assert abs(beyond) < 0.02 * found  # 0.7 %
    found, beyond = effect(half_space)
    assert beyond > 0.5 * found


SQUARE = (1.0, 1.0)
SIDES = FreeSides(lengths=SQUARE, poisson_ratio=MATERIAL.poisson_ratio, decay_length=0.25)
APPROACH, FLAT = 3e-3, 0.01


@pytest.mark.long
def test_what_is_left_beside_a_side_is_smooth():
    """One square at the side presses a block of quadratic tetrahedra."""
    patches = PatchGrid(grid=(16, 16), lengths=SQUARE)
    square, index = patches.single(8), 8
    x = np.linspace(*square.borders_x[[0, -1]], 5), np.linspace(*square.borders_y[[0, -1]], 5)
    places = np.stack([part.ravel() for part in np.meshgrid(*x)], axis=1)
    shape = RefinedShape(
        interface=SQUARE,
        height=1.0,
        places=places,
        fine=0.012,
        coarse=0.15,
        growth=0.3,
        element="P2",
    )
    interface = LoadedFace.of_block(Block(block_mesh(shape, COMM), MATERIAL), patches)
    pressure = np.zeros(patches.count)
    pressure[index] = 1.0
    nodes = interface.body.space.tabulate_dof_coordinates()
    down = -interface.body.solve(interface.load(pressure)).x.array.reshape(-1, 3)[:, 2]
    at = (np.abs(nodes[:, 2]) < 1e-9) & (np.abs(nodes[:, 1] - square.centres[0, 1]) < 0.01)
    at &= (nodes[:, 0] > 1e-3) & (nodes[:, 0] < 0.06)
    x, y, _ = nodes[at].T
    beyond = down[at] - displacements(MATERIAL, x, y, np.zeros_like(x), square)[2, :, 0]
    grid = np.linspace(1e-3, 0.06, 60), np.linspace(y.min(), y.max(), 5)
    side = (
        RectBivariateSpline(*grid, side_displacements(SIDES, *grid, square)[:, :, 0]).ev(x, y)
        / MODULUS
    )
    left = beyond - side
    straight = np.polyval(np.polyfit(x, left, 1), x)
    # 0.7 % of the largest, of which most is the mesh's
    assert np.abs(left - straight).max() < 0.012 * beyond.max()
    assert np.ptp(left) < 0.06 * np.ptp(beyond)  # 5.1 % here
    assert 0.0 < left.min() < left.max() < 0.15 * beyond.max()


def cut_ball(points):
    """Return a ball of radius 0.5 mm about the middle of the side x = 0."""
    x = (np.arange(points) + 0.5) / points
    return Surface(heights=-(x[:, None] ** 2 + (x - 0.5) ** 2), lengths=SQUARE)


def meshed_force():
    """Return the force of the meshed ball, low as the half-space takes it, and its error."""
    ball, forces = cut_ball(256), []
    shapes = reference_shapes(ball, APPROACH, 1.0, count=2, fine=0.0095)
    top = ball.scaled(FLAT)
    for shape in shapes:
        problem = rough_contact(shape, top, MATERIAL)
        forces.append(problem.solve(Control(approach=APPROACH * FLAT)).force / FLAT)
    found = extrapolated(np.array(forces)[:, None], [s.fine for s in shapes], 4.0)
    return float(found.value[0]), float(found.error[0])


@pytest.mark.slow
def test_ball_cut_by_a_side_carries_what_the_meshed_one_does():
    ball = cut_ball(128)
    known, unknown = (
        on_block(ball, known=known).press(Control(approach=APPROACH)).force
        for known in (True, False)
    )
    expected, bar = meshed_force()
    assert bar < 2e-3 * expected
    # 0.2 % with the sides in the half-space
    assert known == pytest.approx(expected, rel=0.005)
    # the modes of the body alone resolve a contact on the side to a few per cent
    assert abs(unknown / expected - 1.0) > 0.01
