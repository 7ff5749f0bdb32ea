"""Roughness on a body that is no block below the depth that it decays in."""

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.stepped import SteppedShape, stepped_mesh
from patchlaw import InputError
from patchlaw.geometry import RefinedShape, Spectrum, Surface, synthesise
from patchlaw.macro.mesh.block import move_onto

COMM = MPI.COMM_SELF
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
