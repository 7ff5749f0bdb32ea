"""No force drop along the approach where contacts merge; the benchmark studies 70 surfaces."""

import numpy as np
import pytest
from helpers.along import respond
from helpers.interaction_cases import E_STAR, PATCHES, set_1

from patchlaw.micro import MODELS, AsperityModel

APPROACHES = np.linspace(0.5e-3, 52e-3, 52)


@pytest.mark.parametrize("seed", [1, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", MODELS)
def test_force_never_falls(seed, kind):
    _, asperities, means = set_1(seed)
    model = AsperityModel(kind, asperities, contact_modulus=E_STAR)
    response = respond(model, APPROACHES, patches=PATCHES, mean_heights=means)
    assert np.all(np.diff(response.force) > 0.0)
    # Ellipses overlap long before: the kernel of merging contacts starts to act.
    assert response.contact_area_fraction[-1] > 0.1
