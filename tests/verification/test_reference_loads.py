"""The meshed block under loads that are known otherwise: two bodies, a flat top, patches."""

import numpy as np
import pytest
from helpers.block_cases import rough_contact
from helpers.reference_cases import MATERIAL, MODULUS, body, give, on_block, pressed

from patchlaw.geometry import BlockShape, Control, PatchGrid, RefinedShape, Surface
from patchlaw.micro import HertzContact

RADIUS, SIZE, APART = 100.0, 0.06, 0.16
APPROACH = SIZE**2 / RADIUS
HALVES = PatchGrid(grid=(2, 1), lengths=(1.0, 1.0))
METHODS = ("active-set", "augmented-lagrangian")


@pytest.fixture(scope="module")
def balls():
    """Two equal spheres beside each other."""

    def profile(x, y):
        return (np.minimum((x - 0.5 * APART) ** 2, (x + 0.5 * APART) ** 2) + y**2) / (2.0 * RADIUS)

    return body(profile, points=257)


def two_spheres():
    """Return the force of two equal Hertz contacts that displace each other and the block."""
    depth = APPROACH
    for _ in range(60):  # halfway each time: neighbours take a quarter of the approach
        one = HertzContact(
            contact_modulus=MODULUS, radius_major=RADIUS, radius_minor=RADIUS, indentation=depth
        )
        given = float(one.displacement(APART, 0.0)) + 2.0 * give() * float(one.force)
        depth = 0.5 * (depth + APPROACH - given)
    return 2.0 * float(one.force)


@pytest.mark.slow
def test_two_spheres_feel_each_other(balls):
    expected = on_block(balls).press(Control(approach=APPROACH)).force
    _, state = pressed(balls, APPROACH, fine=SIZE / 3.0, patches=HALVES)
    alone = 8.0 / 3.0 * MODULUS * np.sqrt(RADIUS) * APPROACH**1.5
    assert expected / alone < 0.9  # measured 0.83: each sinks in the other's pit
    assert state.force == pytest.approx(expected, rel=5e-3)
    # of Hertz' field at the other's summit alone, not over its contact: 0.2 % more
    assert state.force == pytest.approx(two_spheres(), rel=6e-3)
    assert state.contacts == 2
    # no symmetry in the mesh; measured 0.05 %
    assert state.patch_force == pytest.approx(np.full(2, 0.5 * state.force), rel=3e-3)
    assert state.patch_force.sum() == pytest.approx(state.force, rel=1e-12)


FLAT = Surface(heights=np.zeros((8, 8)), lengths=(1.0, 1.0))
CUBES = BlockShape(interface=(1.0, 1.0), height=0.5, cells=(8, 8, 4), grading=2.0)
TETRAHEDRA = RefinedShape(
    interface=(1.0, 1.0),
    height=0.5,
    places=np.array([[0.5, 0.5]]),
    fine=0.1,
    coarse=0.25,
    element="P2",
)


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [CUBES, TETRAHEDRA], ids=["Q1", "P2"])
def test_a_flat_top_between_rollers_is_compressed_evenly(shape, method):
    """All of it in contact from the first touch: confined compression, exact on every mesh."""
    patches = PatchGrid(grid=(4, 2), lengths=(1.0, 1.0))
    block = rough_contact(shape, FLAT, MATERIAL, "roller", method=method, patches=patches)
    state = block.solve(Control(approach=1e-3))
    first, shear = MATERIAL.lame
    force = (first + 2.0 * shear) * 1e-3 / 0.5
    # nodes do not penetrate at all, points by 1e-8 or 1e-5 of the displacement
    rel = 1e-8 if method == "active-set" or shape is CUBES else 2e-5
    assert state.force == pytest.approx(force, rel=rel)
    assert state.reaction == pytest.approx(force, rel=rel)
    assert state.nodal_area == pytest.approx(1.0, rel=1e-12)
    assert state.contact_area == pytest.approx(1.0, rel=1e-12)
    assert state.contacts == 1
    if shape is CUBES:  # whose nodes on borders share their area as the patches do
        assert state.patch_force == pytest.approx(np.full(8, force / 8.0), rel=rel)
        assert state.patch_closure == pytest.approx(np.zeros(8), abs=1e-11)


def test_a_flat_top_holds_a_free_plane_level():
    """By symmetry; its sides bulge, and the corners press hardest."""
    state = rough_contact(CUBES, FLAT, MATERIAL).solve(Control(force=2.0, tilt=None))
    assert state.force == pytest.approx(2.0, rel=1e-9)
    assert np.abs(state.moment).max() < 2e-9  # of force times half a side
    assert np.abs(state.tilt).max() < 1e-9 * state.approach
