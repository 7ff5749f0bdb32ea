"""No force below first touch, and forces that rise from nothing: all models in all couplings.

No contact at an approach δ carries more than a punch over a circle around the whole face, which
is 2 E* r δ on a half-space; a block as high as it is wide does not change that by half.
"""

import numpy as np
import pytest
from helpers.along import respond
from helpers.hard_cases import KINDS, history, scene

from patchlaw.geometry import Material, MaterialPair, PatchGrid, patch_means
from patchlaw.micro import MODEL_NAMES, micro_model
from patchlaw.multiscale.scene.surfaces import make_surface

MATERIALS = MaterialPair(first=Material(young_modulus=4000.0, poisson_ratio=0.15))
MODULUS = 4000.0 / (1.0 - 0.15**2)
PUNCH = 1.5 * 2.0 * MODULUS * np.sqrt(0.5)  # N/mm
COARSE = {
    "surface__grid": [24, 24],
    "surface__spectrum": {"hurst": 0.95, "waves": [2, 10], "rms_slope": 0.215, "seed": 2},
}


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", MODEL_NAMES)
def test_forces_rise_from_nothing(kind, model):
    """Twenty-four heights across ten waves: a spline of a part differs from the whole's by 3 µm."""
    force = history(
        coupling__kind=kind,
        load__steps=1,
        load__approach=["1 pm", "1 nm"],
        micro__model=model,
        **COARSE,
    ).force_N
    assert np.all((force >= 0.0) & (force <= PUNCH * np.array([1e-9, 1e-6])))


@pytest.mark.long
@pytest.mark.parametrize("model", MODEL_NAMES)
@pytest.mark.parametrize("patches", [(1, 1), pytest.param((4, 4), marks=pytest.mark.slow), (3, 5)])
def test_nothing_touches_before_first_touch(model, patches):
    """Neither the whole surface nor a patch of it alone, which rises no higher than the whole."""
    for seed in range(3):
        spectrum = COARSE["surface__spectrum"] | {"seed": seed}
        given = scene(**COARSE | {"surface__spectrum": spectrum}, micro__model=model)
        surface = make_surface(given)
        grid = PatchGrid(grid=patches, lengths=surface.lengths)
        means = patch_means(surface, grid)
        whole = micro_model(model, surface, contact_modulus=MATERIALS.contact_modulus)
        parts = [(whole, grid, means)]
        for index in range(grid.count):
            parts.append((*whole.of_patch(grid, index), means[index : index + 1]))
        for part, patch, heights in parts:
            touch = part.first_touch
            if not np.isfinite(touch):
                continue
            assert touch > -1e-12  # mm: rounding of the highest point
            near = touch + np.array([-1e-2, -1e-6, -1e-12, 1e-6])
            force = respond(part, near, patches=patch, mean_heights=heights).force
            assert np.all(force[:3] == 0.0)
            assert 0.0 < force[3] <= PUNCH * 1e-6
