"""Transmissivities of the patches of one surface."""

from dataclasses import replace

import numpy as np

from patchlaw import Spectrum, synthesise
from patchlaw.geometry import PatchGrid
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.laws.transmissivity import patch_transmissivities


def test_patches_whose_borders_cut_cells_leak_as_their_mirror_image():
    spectrum = Spectrum(hurst=0.8, waves=(1, 3), rms_slope=0.1, seed=2)
    surface = synthesise(spectrum, grid=(17, 11), lengths=(1.0, 0.7))
    patches = PatchGrid(grid=(2, 2), lengths=surface.lengths)
    depth = 0.2 * float(np.ptp(surface.heights))

    def columns(heights):
        model = HalfSpaceModel(replace(surface, heights=heights), contact_modulus=1.0)
        models = [model, model.resampled((8, 5))]
        found = patch_transmissivities(models, patches, (0.0, depth), (0.0, 0.0))
        return [np.column_stack([one.separation, one.hydraulic_gap]) for one in found]

    own, turned = columns(surface.heights), columns(surface.heights[::-1, ::-1])
    for one, other in zip(own, turned[::-1], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6)  # residuals of 1e-8 on gaps
