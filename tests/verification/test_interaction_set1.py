"""The four models on the paper's Set 1 surfaces: conditions, solvers, Fig. 7, separation."""

import numpy as np
import pytest
from helpers.along import respond
from helpers.asperity_states import displacement, pressed, surface_displacement
from helpers.interaction_cases import E_STAR, PATCHES, set_1
from helpers.truncated_newton import SOLVERS, solve_by

from patchlaw.micro import MODELS, AsperityModel

SEEDS = (1, 2, 3, 4)
APPROACHES = np.linspace(1e-3, 26e-3, 26)


@pytest.fixture(scope="module", params=SEEDS)
def rough(request):
    return set_1(request.param)


def curves(rough, names=MODELS):
    _, asperities, means = rough
    return {
        name: respond(
            AsperityModel(name, asperities, contact_modulus=E_STAR),
            APPROACHES,
            patches=PATCHES,
            mean_heights=means,
        )
        for name in names
    }


@pytest.mark.long
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", ["elliptic", "circular"])
def test_contact_conditions(rough, name, solver, monkeypatch):
    solve_by(solver, monkeypatch)
    _, asperities, _ = rough
    model = AsperityModel(name, asperities, contact_modulus=E_STAR)
    state = None
    for approach in APPROACHES:
        state = pressed(model, approach, start=state and state.guess)
        required = np.maximum(approach - (asperities.highest - asperities.z), 0.0)
        gap = displacement(model, state) - required
        assert np.all(gap >= -1e-10 * approach)
        assert np.all(state.ellipses.force >= 0.0)
        assert np.abs(gap[state.ellipses.force > 0.0]).max() <= 1e-10 * approach


@pytest.mark.long
def test_order_of_figure_7(rough):
    response = curves(rough)
    # (i) and (ii): neglecting the interaction overestimates pressure and area, more and more.
    for shape in ("elliptic", "circular"):
        alone, together = response[f"{shape}-independent"], response[shape]
        ratio = alone.force / together.force
        assert np.all(ratio >= 1.0 - 1e-10) and np.all(np.diff(ratio[5:]) > -1e-2)
        assert ratio[-1] > 1.5
        assert np.all(alone.contact_area >= together.contact_area * (1 - 1e-10))
        assert np.all(alone.contacts >= together.contacts)
    # Ellipses hardly matter on an isotropic surface: a few per cent in force and area.
    late = APPROACHES > 4e-3
    for suffix in ("", "-independent"):
        ellipse, circle = response[f"elliptic{suffix}"], response[f"circular{suffix}"]
        assert ellipse.force[late] == pytest.approx(circle.force[late], rel=0.05)
        assert ellipse.contact_area[late] == pytest.approx(circle.contact_area[late], rel=0.06)
        # "The circular assumption overestimates the area and underestimates the force."
        assert np.all(ellipse.force >= circle.force)
        assert np.all(ellipse.contact_area <= circle.contact_area)
    # (iii), (iv): area against pressure, and κ, is about the same for all four.
    kappa = {name: curve.kappa(0.215, E_STAR) for name, curve in response.items()}
    for name, values in kappa.items():
        enough = response[name].contact_area_fraction > 0.015
        assert np.all((values[enough] > 1.5) & (values[enough] < 3.5)), name


@pytest.mark.parametrize("name", MODELS)
def test_separation_is_the_average_gap(rough, name):
    surface, asperities, means = rough
    model = AsperityModel(name, asperities, contact_modulus=E_STAR)
    tilt = (2e-3, -1e-3)
    response = respond(model, [8e-3], patches=PATCHES, mean_heights=means, tilt=tilt)
    n = 200
    x = (np.arange(n) + 0.5) / n
    moved = surface_displacement(model, pressed(model, 8e-3, tilt=tilt), x[:, None], x)
    by_patch = moved.reshape(4, n // 4, 4, n // 4).mean(axis=(1, 3)).ravel()
    # Whole: midpoint rule on 5 µm cells against the cubature, 1e-4. Single patches: the cubature
    # misplaces up to 0.015 a/s, a/s ≤ 0.15, of what contacts across a border displace.
    assert response.patch_displacement[0].mean() == pytest.approx(moved.mean(), rel=1e-4)
    assert response.patch_displacement[0] == pytest.approx(by_patch, abs=2.3e-3 * by_patch.max())
    plane = asperities.highest - 8e-3  # the tilt averages out
    gap = plane - surface.mean_height + moved.mean()
    assert response.mean_separation[0] == pytest.approx(gap, rel=1e-5)
    assert gap > plane - surface.mean_height
