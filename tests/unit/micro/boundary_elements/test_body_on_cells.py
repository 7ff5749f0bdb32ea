"""A body's compliance on cells: symmetry, boxes, cells that the body lifts into contact."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.free_motions import contact_problem

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import BodyModes, HalfSpaceModel
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.complementarity import solver
from patchlaw.micro.complementarity.active_set import solve

E_STAR = 4000.0
GRID, SPACING = (64, 48), (1.0 / 64, 0.75 / 48)
LENGTHS = (1.0, 0.75)


def seesaw(size):
    """Return a body that turns under a load beside the middle: what it raises is far from it."""
    matrix = np.zeros((9, 9))
    matrix[3, 3] = size  # the first mode along x, even along y
    return BodyModes(LENGTHS, matrix)


def random_body(seed=0, size=1e-3):
    half = np.random.default_rng(seed).standard_normal((9, 9))
    return BodyModes(LENGTHS, size * half @ half.T)


def two_bumps(lower):
    x = (np.arange(GRID[0]) + 0.5) * SPACING[0]
    y = (np.arange(GRID[1]) + 0.5) * SPACING[1]
    right = -((x[:, None] - 0.85) ** 2 + (y - 0.37) ** 2) / 0.4
    left = -((x[:, None] - 0.1) ** 2 + (y - 0.3) ** 2) / 0.4 - lower
    return Surface(heights=np.maximum(right, left), lengths=LENGTHS)


def test_some_cells_and_a_box_are_a_part_of_all():
    grids = Compliance(periodic=False, modulus=E_STAR, terms=[random_body()])
    alone = Compliance(periodic=False, modulus=E_STAR)
    box, shape = (slice(8, 40), slice(16, 48)), (32, 32)
    corner = 8 * SPACING[0], 16 * SPACING[1]
    dice = np.random.default_rng(2)
    p = np.zeros(GRID)
    p[box] = np.where(dice.random(shape) > 0.7, dice.random(shape), 0.0)
    added = [given.on_grid(GRID, SPACING).displacement(p) for given in (grids, alone)]
    body = added[0] - added[1]
    part = grids.on_grid(shape, SPACING, corner)
    inside = part.displacement(p[box]) - alone.on_grid(shape, SPACING, corner).displacement(p[box])
    assert inside == pytest.approx(body[box], abs=1e-12 * np.abs(body).max())
    cells = Cells.of(np.flatnonzero(p[box]), shape)
    rough = part.apply_compliance(cells, p[box].ravel()[cells.flat])
    fine = part.displacement(p[box]).ravel()[cells.flat]
    assert rough == pytest.approx(fine, abs=1e-5 * np.abs(fine).max())  # single precision
    assert grids.lifted(p, SPACING) == pytest.approx(body, abs=1e-11 * np.abs(body).max())


@pytest.mark.parametrize(
    ("control", "lower"),
    [
        (Control(approach=5e-3), 6e-3),
        (Control(force=0.1), 2e-3),
        (Control(approach=5e-3, tilt=(1e-3, 1e-3)), 6e-3),
    ],
    ids=["approach", "force", "tilted"],
)
def test_cells_lifted_into_contact_are_found(control, lower):
    """The lower bump lies outside of all that the plane overlaps; the body turns it up."""
    surface = two_bumps(lower)
    model = HalfSpaceModel(
        surface=surface, contact_modulus=E_STAR, body=seesaw(3e-3), tolerance=1e-9
    )
    state = model.press(control)
    overlap = model.interference(state.plane) > 0.0
    left = surface.x < 0.5
    assert not overlap[left].any()
    assert state.in_contact[left].any() and state.in_contact[~left].any()
    slack = 1.1e-9 * model.interference(state.plane).max()
    assert state.gap.min() >= -slack
    assert np.abs(state.gap[state.in_contact]).max() <= slack
    # the same on all cells at once, where no box can hide any
    interference = model.interference(state.plane)
    body = Compliance(periodic=False, modulus=E_STAR, terms=[seesaw(3e-3)])
    problem = replace(contact_problem(interference, SPACING, tolerance=1e-10), compliance=body)
    every = solve(problem, np.zeros(GRID))
    assert state.pressure == pytest.approx(every.pressure, abs=1e-6 * every.pressure.max())


@pytest.mark.long
@pytest.mark.parametrize("matrix_work", [0.0, 2e5], ids=["boxes", "few cells"])
@pytest.mark.parametrize("seed", [36, 71])
def test_cells_that_are_solved_on_only_grow(seed, matrix_work, monkeypatch):
    """What touched once may touch again: dropping it might go on for ever."""
    places, solve_on = [], solver._solve_on

    def recorded(problem, place, start):
        cells = np.zeros(problem.interference.shape, bool)
        cells[place] = True
        places.append(cells)
        return solve_on(problem, place, start)

    monkeypatch.setattr(solver, "_solve_on", recorded)
    monkeypatch.setattr(solver, "_MATRIX_WORK", matrix_work)
    dice, grown = np.random.default_rng(seed), 0
    for _ in range(12):
        cells = int(dice.integers(24, 64))
        spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.05, seed=int(dice.integers(10000)))
        surface = synthesise(spectrum, grid=(cells, cells), lengths=LENGTHS)
        matrix = np.diag([0, 1, 0, 1, 0, 0, 0, 0, 0]) * 10.0 ** dice.uniform(-4, -2, 9)
        body = BodyModes(LENGTHS, matrix)
        model = HalfSpaceModel(surface, contact_modulus=E_STAR, body=body)
        size = np.ptp(surface.heights)
        controls = (
            Control(approach=0.1 * size), Control(force=10.0 ** dice.uniform(-2, 0)),
            Control(approach=0.1 * size, tilt=(3e-3, -2e-3)),
        )  # fmt: skip
        for control in controls:
            places.clear()
            state = model.press(control)
            for before, after in pairwise(places):
                grown += 1
                assert np.all(after[before])
            assert state.gap.min() >= -1.1e-8 * model.interference(state.plane).max()
    assert grown > 2


def test_a_body_under_a_free_plane():
    surface = two_bumps(1e-3)
    model = HalfSpaceModel(
        surface=surface, contact_modulus=E_STAR, body=random_body(3, 1e-4), tolerance=1e-10
    )
    state = model.press(Control(force=2.0, tilt=None))
    area = np.prod(SPACING)
    for arm in (surface.x[:, None] - 0.5, surface.y - 0.375):
        assert abs(np.sum(state.pressure * arm) * area) < 1e-10 * 2.0
    assert state.gap.min() >= -1.1e-10 * model.interference(state.plane).max()
    fixed = model.press(Control(approach=state.approach, tilt=state.plane.tilt))
    assert fixed.force == pytest.approx(2.0, rel=1e-8)
