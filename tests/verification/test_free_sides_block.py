"""Contacts at a block's free sides: the quarter-space beside finite elements that know it not.

The meshed block is the independent witness: of what a side adds to the half-space, and of the
force of a ball that a side cuts in half.
"""

import numpy as np
import pytest
from helpers.boussinesq import displacements
from helpers.free_side_points import side_displacements
from helpers.reference_cases import COMM, MATERIAL, MODULUS, on_block
from scipy.interpolate import RectBivariateSpline

from patchlaw.geometry import Control, PatchGrid, RefinedShape, Surface, reference_shapes
from patchlaw.macro import Block, LoadedFace, UnilateralContactProblem, block_mesh, rough_block_mesh
from patchlaw.micro import FreeSides
from patchlaw.multiscale import extrapolated

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
        block = Block(rough_block_mesh(shape, top, COMM)[0], MATERIAL)
        problem = UnilateralContactProblem(block, top.highest - top.mean_height)
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
