"""A constant added to all heights changes nothing, in any micro model and any column."""

import numpy as np
import pytest

from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, patch_means, synthesise
from patchlaw.micro import MODEL_NAMES, micro_model

PATCHES = PatchGrid(grid=(2, 3), lengths=(1.0, 0.9))
X, Y = (np.arange(40) + 0.5) / 40, 0.9 * (np.arange(36) + 0.5) / 36
SURFACES = {
    "rough": synthesise(
        Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.2, seed=4), grid=(40, 36), lengths=(1.0, 0.9)
    ).heights,
    # contacts that are circles, whose axes only rounding would tell, and reach over borders
    "cap beside a corner": -((X[:, None] - 0.11) ** 2 + (Y - 0.15) ** 2) / 4.0,
    "cap on a border": -((X[:, None] - 0.52) ** 2 + (Y - 0.31) ** 2) / 4.0,
}
SAME = (
    *("force", "moment", "contact_area", "contacts", "mean_separation"),
    *("patch_force", "patch_area", "patch_contacts"),
    *("patch_displacement", "patch_separation"),
)


@pytest.mark.long
@pytest.mark.parametrize("name", MODEL_NAMES)
@pytest.mark.parametrize("surface", SURFACES)
def test_a_constant_changes_no_column(name, surface):
    dice, heights = np.random.default_rng(len(surface)), SURFACES[surface]
    size, plain = np.ptp(heights), None
    tilt = (0.2 * size, -0.1 * size)
    for constant in (0.0, *(dice.uniform(-1.0, 1.0, 4) * 10.0 ** dice.uniform(-4.0, 0.0, 4))):
        moved = Surface(heights=heights + constant, lengths=PATCHES.lengths)
        model = micro_model(name, moved, contact_modulus=4000.0)
        means = patch_means(moved, PATCHES)
        controls = [Control(approach=0.3 * size), Control(approach=0.2 * size, tilt=tilt)]
        controls.append(Control(force=1.0))
        if surface == "rough":  # a single cap holds no plane that may turn
            controls.append(Control(force=2.0, tilt=None))
        found = [model.press(control, patches=PATCHES, mean_heights=means) for control in controls]
        plain = plain or found
        for now, before in zip(found, plain, strict=True):
            for column in SAME:
                one, other = getattr(now, column), getattr(before, column)
                # residuals of 1e-8, and heights rounded to 1e-16 of the constant; moments vanish
                scale = np.abs(other).max() if column != "moment" else before.force
                np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * scale, err_msg=column)
