"""Asperities on cube, pancake and column, against the half-space model on the same.

The half-space model adds free sides by images and the body's smooth rest; the small models take
both from the body's modes.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.macro import Material, face_compliance
from patchlaw.micro import (
    BodyModes,
    FreeSides,
    HalfSpaceModel,
    half_space_modes,
    micro_model,
    side_modes,
)

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
MODULUS = 4000.0 / (1.0 - 0.15**2)
FACE = (1.0, 1.0)
SURFACE = synthesise(
    Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=5), grid=(128, 128), lengths=FACE
)
PATCHES = PatchGrid(grid=(2, 2), lengths=FACE)
MEANS = patch_means(SURFACE, PATCHES)
APPROACH = 8e-3

BLOCKS = {"cube": (1.0, 6), "pancake": (0.1, 12), "column": (10.0, 6)}
"""Heights [mm] and modes along a side."""


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.long] * (name == "column")) for name in BLOCKS],
)
def bodies(request):
    """The body of the small models, and the half-space model on the same block."""
    height, modes = BLOCKS[request.param]
    face = face_compliance(FACE, height, MATERIAL, "free", modes, MPI.COMM_SELF)
    whole = face.normal - half_space_modes(FACE, modes) / MODULUS
    sides = FreeSides(lengths=FACE, poisson_ratio=0.15, decay_length=0.1)
    rest = whole - side_modes(sides, modes) / MODULUS
    reference = HalfSpaceModel(
        surface=SURFACE, contact_modulus=MODULUS, sides=sides, body=BodyModes(FACE, rest)
    )
    return BodyModes(FACE, whole), reference


def press(model, **given):
    return model.press(Control(**given), patches=PATCHES, mean_heights=MEANS)


def test_keeps_the_error_it_has_on_a_half_space(bodies):
    """Contacts at a tenth of the face are not points to a body 0.1 mm high: 5 % for them."""
    body, reference = bodies
    alone = micro_model("elliptic", SURFACE, contact_modulus=MODULUS)
    model = replace(alone, body=body)
    endless = replace(reference, sides=None, body=None)
    known = press(alone, approach=APPROACH).force
    known /= press(endless, approach=APPROACH).force
    for given in ({"approach": 4e-3}, {"approach": APPROACH}):
        force = press(model, **given).force
        expected = press(reference, **given).force
        # beyond that, measured: 1.2 % on the cube, 4.5 % on the pancake, nothing on the column
        assert force / expected == pytest.approx(1.0, abs=abs(known - 1.0) + 0.05)


def test_free_plane_stands_as_on_the_half_space_model(bodies):
    body, reference = bodies
    model = replace(micro_model("elliptic", SURFACE, contact_modulus=MODULUS), body=body)
    found, expected = press(model, force=1.0, tilt=None), press(reference, force=1.0, tilt=None)
    assert found.force == pytest.approx(1.0, rel=1e-8)
    assert np.abs(found.moment).max() < 1e-8
    # a tenth of a slope of 1e-2: the surface's own rms gradient is 0.2
    assert found.plane.tilt == pytest.approx(expected.plane.tilt, abs=1e-3)
    assert found.plane.approach == pytest.approx(expected.plane.approach, rel=0.03)
    separation = expected.mean_separation
    assert found.mean_separation == pytest.approx(separation, rel=0.01)
    displacement = expected.patch_displacement
    assert found.patch_displacement == pytest.approx(displacement, rel=0.1, abs=5e-5)
