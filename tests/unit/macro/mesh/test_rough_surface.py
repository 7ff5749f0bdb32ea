"""Meshes whose top is the roughness: quality, what fades below and beside it, what is refused."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from benchmarks.stepped import SteppedShape, stepped_mesh
from patchlaw import InputError
from patchlaw.geometry import BlockShape, RefinedShape, Spectrum, Surface, synthesise
from patchlaw.macro import Block, Material, UnilateralContactProblem, rough_block_mesh
from patchlaw.macro.mesh.block import move_onto

COMM = MPI.COMM_SELF
CUBE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 6))
HIGH = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=6.0, seed=2), grid=(64, 64), lengths=(1.0, 1.0)
)
SHORT_WAVES = synthesise(
    Spectrum(hurst=0.5, waves=(8, 16), rms_slope=1.5, seed=5), grid=(64, 64), lengths=(1.0, 1.0)
)


def refined(element, fine=0.06, coarse=0.25):
    places = np.array([[0.5, 0.5]])
    return RefinedShape(
        interface=(1.0, 1.0), height=1.0, places=places, fine=fine, coarse=coarse, element=element
    )


def wave(depth, waves=1):
    """Return a ridge of some wavelengths, whose top is at the middle."""
    x = (np.arange(64) + 0.5) / 64
    ridge = -depth * np.cos(2.0 * np.pi * waves * x)
    return Surface(heights=np.tile(ridge[:, None], 64), lengths=(1.0, 1.0), periodic=True)


def test_quality_is_that_of_the_cells():
    x = (np.arange(32) + 0.5) / 32
    ridge = Surface(heights=np.tile(0.05 * np.cos(2.0 * np.pi * x), (32, 1)), lengths=(1.0, 1.0))
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(4, 8, 10))
    _, quality = rough_block_mesh(shape, ridge, COMM)
    # the topmost edge, of 0.1, below the valley; the fall between neighbours half-way down
    assert quality.thinnest == pytest.approx(1.0 - 0.05 * (1.0 - 0.9**3) / 0.1, abs=2e-3)
    assert quality.steepest == pytest.approx(0.05 * np.cos(np.pi / 4) * 8, rel=0.01)


@pytest.mark.parametrize(("element", "slack"), [("P1", 0.1), ("P2", 0.02)])
def test_quality_of_tetrahedra_is_the_jacobian(element, slack):
    """Below the valley a depth dz becomes 1 − 3 · 0.1 (1 + z)² of it."""
    _, quality = rough_block_mesh(refined(element, coarse=0.04, fine=0.04), wave(0.1), COMM)
    # gradients across a linear cell are averages, those of a quadratic one nearly exact
    assert quality.thinnest == pytest.approx(0.7, abs=slack)
    assert quality.steepest == pytest.approx(0.1 * 2.0 * np.pi, rel=0.03)  # means over edges


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_all_nodes_of_the_top_lie_on_the_surface(element):
    surface = wave(0.02, waves=2)
    mesh, _ = rough_block_mesh(refined(element, coarse=0.1), surface, COMM)
    block = UnilateralContactProblem(
        Block(mesh, Material(young_modulus=1.0, poisson_ratio=0.3)), 0.02
    )
    # the nodes of the displacements: those in the middle of edges are no means of the ends
    top = block.top
    np.testing.assert_allclose(top.height, surface.height_at(top.x, top.y), atol=1e-12)


def test_cells_that_span_waves_stay_straight():
    """Bent edges would turn cells inside out that straight ones leave alone."""
    rough = synthesise(
        Spectrum(hurst=0.9, waves=(4, 10), rms_slope=0.35, seed=1),
        grid=(64, 64),
        lengths=(1.0, 1.0),
    )
    straight, curved = (
        rough_block_mesh(refined(element, coarse=0.2), rough, COMM)[1] for element in ("P1", "P2")
    )
    assert straight.thinnest > 0.3
    assert curved.thinnest >= 0.3  # −0.15 with all edges bent


def test_a_curved_top_has_the_volume_of_the_surface():
    """Between nodes the top is a quadratic: its volume errs less than a faceted top's."""
    surface, errors = wave(0.02, waves=2), []
    for element in ("P1", "P2"):
        mesh, _ = rough_block_mesh(refined(element, coarse=0.1), surface, COMM)
        length = fem.Constant(mesh.mesh, 1.0) * ufl.dx(domain=mesh.mesh)
        errors.append(abs(fem.assemble_scalar(fem.form(length)) - 1.0))
    assert errors[1] < 0.2 * errors[0]  # the mean of the waves is 0


def test_tetrahedra_longer_than_the_waves_are_refused():
    with pytest.raises(InputError, match="much longer than its waves"):
        rough_block_mesh(refined("P1"), SHORT_WAVES, COMM)


@pytest.mark.parametrize(
    ("surface", "text"),
    [
        (Surface(heights=np.zeros((8, 8)), lengths=(2.0, 1.0)), "must cover the block's top"),
        (Surface(heights=np.zeros((8, 8)), lengths=(1.0, 0.9)), "must cover the block's top"),
        (HIGH, "valley of the roughness is too deep for the body"),
        (wave(0.28, waves=2), "the roughness is too steep for a mesh"),
    ],
)
def test_what_does_not_fit_is_refused(surface, text):
    with pytest.raises(InputError, match=text):
        rough_block_mesh(CUBE, surface, COMM)


SHAPE = SteppedShape(
    block=RefinedShape(
        interface=(1.0, 1.0),
        height=0.75,
        places=np.array([[0.5, 0.5]]),
        fine=0.1,
        coarse=0.3,
        element="P2",
    ),
    boxes=[[[0.0, 0.0, -1.5], [1.5, 1.0, -0.75]]],
)
PLANES = {"held": (0, 1.5), "below": (2, -1.5)}
ROUGH = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=2), grid=(64, 64), lengths=(1.0, 1.0)
)


def test_roughness_fades_beside_its_rectangle():
    flat = stepped_mesh(SHAPE, PLANES, COMM).mesh
    before = flat.geometry.x.copy()
    narrow = Surface(heights=ROUGH.heights[:, :32], lengths=(1.0, 0.5))
    move_onto(flat, narrow, 0.75)
    rise = flat.geometry.x[:, 2] - before[:, 2]
    inside, far = before[:, 1] <= 0.5, before[:, 1] >= 0.75
    top = np.abs(before[:, 2]) < 1e-12
    places = np.clip(before[top & inside, :2], 0.0, narrow.lengths)
    heights = narrow.height_at(*places.T) - narrow.mean_height
    np.testing.assert_allclose(rise[top & inside], heights, atol=1e-12)
    np.testing.assert_array_equal(rise[far], 0.0)
    assert np.abs(rise[top & ~inside & ~far]).max() > 1e-3


def test_roughness_needs_a_body_that_is_thick_enough():
    mesh = stepped_mesh(SHAPE, PLANES, COMM).mesh
    with pytest.raises(InputError, match=r"too deep for the body .*below the mean, where"):
        move_onto(mesh, ROUGH, 0.05)
