"""The dense sum over the pairs of many interacting asperities, against a slow oracle for a few."""

import numpy as np
import pytest
from helpers.asperity_states import displacement, interference, pressed
from helpers.interaction_cases import E_STAR

from patchlaw.geometry import Asperities
from patchlaw.micro import AsperityModel, HertzContact


def scattered(count, seed=0, depth=2e-3):
    """Asperities at random places, some of them close together; radii of a wide spread."""
    rng = np.random.default_rng(seed)
    minor = 0.3 / count**0.5 * np.exp(rng.normal(0.0, 0.6, count))
    x, y = rng.random((2, count))
    return Asperities(
        x=x,
        y=y,
        z=-rng.exponential(depth, count),
        radius_major=minor * (1.0 + rng.exponential(1.0, count)),
        radius_minor=minor,
        angle=np.pi * rng.random(count),
        lengths=(1.0, 1.0),
        highest=0.0,
        mean_height=-0.02,
    )


@pytest.mark.slow
def test_contact_conditions_of_2500_asperities_above_the_plane():
    many = scattered(2500)
    approach = 2e-3 + float(-many.z.min())  # the undisplaced plane lies below every summit
    model = AsperityModel("elliptic", many, contact_modulus=E_STAR)
    state = pressed(model, approach)
    required, found = interference(many, state), displacement(model, state)
    assert required.min() > 0.0
    on = np.flatnonzero(state.ellipses.force)
    assert 300 < len(on) < 2500
    fields = HertzContact(
        contact_modulus=E_STAR,
        radius_major=many.radius_major[on],
        radius_minor=many.radius_minor[on],
        indentation=state.indentation[on],
    )
    assert state.ellipses.force[on] == pytest.approx(fields.force, rel=1e-12)
    # Far from all contacts that merge with it, a summit is displaced by Hertz's exact fields.
    for k in np.random.default_rng(1).choice(2500, 40, replace=False):
        dx, dy = many.x[k] - many.x[on], many.y[k] - many.y[on]
        cos, sin = np.cos(many.angle[on]), np.sin(many.angle[on])
        moved = fields.displacement(cos * dx + sin * dy, cos * dy - sin * dx)
        if np.any((np.hypot(dx, dy) < 1.3 * fields.semi_major) & (on != k)):
            continue
        assert found[k] == pytest.approx(moved.sum(), rel=1e-11)
        gap = moved.sum() - required[k]
        assert gap >= -1e-9 * approach  # solved to 1e-10
        assert (gap <= 1e-9 * approach) or state.ellipses.force[k] == 0.0
