"""Free sides beside the half-space: on cells, on rectangles, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.free_side_points import side_displacements
from helpers.uneven_grid import uneven_grid

from patchlaw.geometry import Surface
from patchlaw.micro import FreeSides, HalfSpaceModel, side_modes, side_stress_modes, side_stresses
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.boundary_elements.side_cells import SideTerm, side_cells
from patchlaw.support import InputError

SIDES = FreeSides(lengths=(1.0, 1.5), poisson_ratio=0.2, decay_length=0.25)
GRID = (20, 30)
SPACING = (0.05, 0.05)


@pytest.fixture(scope="module")
def cells():
    return side_cells(SIDES, SPACING)


def whole(cells, pressure):
    return cells.among(*(np.arange(n) for n in GRID)).displacement(pressure)


def random(seed, shape=GRID):
    return np.random.default_rng(seed).normal(size=shape)


def test_compliance_of_cells_is_symmetric_and_positive(cells):
    p, q = random(1), random(2)
    # rounding
    assert np.vdot(p, whole(cells, q)) == pytest.approx(np.vdot(q, whole(cells, p)), rel=1e-11)
    assert np.vdot(p, whole(cells, p)) > 0.0


def test_opposite_sides_are_alike(cells):
    p = random(3)
    for axis in (0, 1):
        turned = np.flip(whole(cells, np.flip(p, axis)), axis)
        np.testing.assert_allclose(turned, whole(cells, p), rtol=1e-10, atol=1e-13)


def test_some_cells_are_a_part_of_all(cells):
    rows, columns = np.array([0, 1, 5, 19]), np.array([2, 3, 4, 29])
    p = np.zeros(GRID)
    p[np.ix_(rows, columns)] = random(4, (4, 4))
    part = cells.among(rows, columns).displacement(p[np.ix_(rows, columns)])
    np.testing.assert_allclose(part, whole(cells, p)[np.ix_(rows, columns)], rtol=1e-10, atol=1e-14)


def test_cells_and_rectangles_tell_the_same(cells):
    """A square of cells at a side, seen by points of cells and by points of a surface."""
    p = np.zeros(GRID)
    p[:4, 12:16] = 1.0
    x, y = (np.arange(n) * 0.05 + 0.025 for n in GRID)
    ticks = (0.0, 0.2, 1.0), (0.0, 0.6, 0.8, 1.5)
    loads = uneven_grid(ticks_x=ticks[0], ticks_y=ticks[1])
    found, points = whole(cells, p), side_displacements(SIDES, x, y, loads)[:, :, 1]
    # means over cells against their middles: 2.2 % of the largest next to the side, then 0.3 %
    assert np.abs(found - points).max() < 0.03 * points.max()
    assert np.abs(found - points)[2:].max() < 4e-3 * points.max()


def test_grids_know_their_sides_where_they_lie():
    grids, alone = (Compliance(periodic=False, terms=terms) for terms in ([SideTerm(SIDES)], []))
    box, corner = (slice(0, 8), slice(20, 30)), (0.0, 20 * SPACING[1])
    p = np.abs(random(5, (8, 10)))
    beside = grids.on_grid(p.shape, SPACING, corner).displacement(p)
    inside = alone.on_grid(p.shape, SPACING, corner).displacement(p)
    every = np.zeros(GRID)
    every[box] = p
    added = whole(side_cells(SIDES, SPACING), every)[box]
    np.testing.assert_allclose(beside, inside + added, rtol=1e-12)
    where = Cells.of(np.flatnonzero(p > 1.0), p.shape)
    few = np.where(p > 1.0, p, 0.0)
    rough = grids.on_grid(p.shape, SPACING, corner).apply_compliance(where, few.ravel()[where.flat])
    fine = grids.on_grid(p.shape, SPACING, corner).displacement(few).ravel()[where.flat]
    np.testing.assert_allclose(rough, fine, rtol=1e-5)  # products in single precision


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lengths": (1.0, 0.0)}, "lengths and decay length must be positive \\(allowed"),
        ({"decay_length": np.inf}, "lengths and decay length must be positive \\(allowed"),
        ({"poisson_ratio": 0.5}, "Poisson's ratio is out of range \\(allowed"),
    ],
)
def test_sides_out_of_range_are_refused(change, message):
    given = {"lengths": (1.0, 1.0), "poisson_ratio": 0.3, "decay_length": 0.2}
    with pytest.raises(InputError, match=message):
        FreeSides(**given | change)


def test_sides_of_another_surface_are_refused():
    surface = Surface(heights=np.zeros((4, 4)), lengths=(1.0, 1.0))
    with pytest.raises(InputError, match="the free sides are not those of the surface"):
        HalfSpaceModel(surface=surface, contact_modulus=1.0, sides=SIDES)
    periodic = replace(surface, periodic=True)
    with pytest.raises(InputError, match="a periodic half-space has no free sides"):
        HalfSpaceModel(surface=periodic, contact_modulus=1.0, periodic=True, sides=SIDES)


def test_sides_add_up():
    """Each of the four alone, and all: displacements of cells, of patches, in modes; stresses."""
    patches = uneven_grid(ticks_x=(0.0, 0.3, 1.0), ticks_y=(0.0, 0.5, 1.5))
    single = [replace(SIDES, present=tuple((np.arange(4) == k).tolist())) for k in range(4)]
    pressure = random(8)
    for evaluate in (
        lambda sides: whole(side_cells(sides, SPACING), pressure),
        lambda sides: side_stresses(sides, SPACING).stresses(pressure),
        lambda sides: sides.patch_compliance(patches),
        lambda sides: side_modes(sides, 3),
        lambda sides: side_stress_modes(sides, 3),
    ):
        found = evaluate(SIDES)
        scale = np.abs(found).max()
        np.testing.assert_allclose(sum(map(evaluate, single)), found, atol=1e-11 * scale)
