"""Quality of meshes whose top is the roughness, and what is refused."""

import numpy as np
import pytest
from mpi4py import MPI

from geometry import BlockShape, InputError, RefinedShape, Spectrum, Surface, synthesise
from macro import rough_block_mesh

CUBE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 6))
HIGH = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=6.0, seed=2), grid=(64, 64), lengths=(1.0, 1.0)
)
SHORT_WAVES = synthesise(
    Spectrum(hurst=0.5, waves=(8, 16), rms_slope=1.5, seed=5), grid=(64, 64), lengths=(1.0, 1.0)
)


def test_quality_is_that_of_the_cells():
    x = (np.arange(32) + 0.5) / 32
    ridge = Surface(heights=np.tile(0.05 * np.cos(2.0 * np.pi * x), (32, 1)), lengths=(1.0, 1.0))
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(4, 8, 10))
    _, quality = rough_block_mesh(shape, ridge, MPI.COMM_SELF)
    # the topmost edge, of 0.1, below the valley; the fall between neighbours half-way down
    assert quality.thinnest == pytest.approx(1.0 - 0.05 * (1.0 - 0.9**3) / 0.1, abs=2e-3)
    assert quality.steepest == pytest.approx(0.05 * np.cos(np.pi / 4) * 8, rel=0.01)


def test_tetrahedra_longer_than_the_waves_are_refused():
    places = np.array([[0.5, 0.5]])
    shape = RefinedShape(interface=(1.0, 1.0), height=1.0, places=places, fine=0.06, coarse=0.25)
    with pytest.raises(InputError, match="much longer than its waves"):
        rough_block_mesh(shape, SHORT_WAVES, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("surface", "text"),
    [
        (Surface(heights=np.zeros((8, 8)), lengths=(2.0, 1.0)), "must cover the block's top"),
        (HIGH, "turns cells inside out"),
    ],
)
def test_what_does_not_fit_is_refused(surface, text):
    with pytest.raises(InputError, match=text):
        rough_block_mesh(CUBE, surface, MPI.COMM_SELF)
