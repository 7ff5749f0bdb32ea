"""Asperities fitted at the scale of the contact: options, limits, states and curves."""

from dataclasses import replace

import numpy as np
import pytest

from geometry import (
    Control,
    InputError,
    PatchGrid,
    Spectrum,
    Surface,
    find_asperities,
    patch_means,
    synthesise,
)
from geometry.errors import NotConverged
from micro import (
    BORDERS,
    CURVATURES,
    MODELS,
    AsperityModel,
    IslandModel,
    ScaledModel,
    micro_model,
)

E_STAR = 4000.0
PATCHES = PatchGrid(grid=(3, 2), lengths=(1.0, 1.0))


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.8, waves=(2, 8), rms_slope=0.2, seed=4)
    return synthesise(spectrum, grid=(40, 40), lengths=(1.0, 1.0))


def scaled(surface, kind="elliptic", **options):
    return ScaledModel(kind=kind, surface=surface, contact_modulus=E_STAR, **options)


def islands(surface, **options):
    return IslandModel(surface=surface, contact_modulus=E_STAR, **options)


def respond(model, approaches, patches=PATCHES, **options):
    means = patch_means(model.surface, patches)
    return model.respond(approaches, patches=patches, mean_heights=means, **options)


def dome(cx, cy, major=0.3, minor=0.3, grid=96):
    x = (np.arange(grid) + 0.5) / grid
    heights = -((x[:, None] - cx) ** 2) / (2 * major) - (x - cy) ** 2 / (2 * minor)
    return Surface(heights=heights, lengths=(1.0, 1.0))


@pytest.mark.parametrize("kind", MODELS)
def test_without_options_it_is_the_paper_s_model(surface, kind):
    plain = AsperityModel(kind, find_asperities(surface, periodic=False), contact_modulus=E_STAR)
    same = scaled(surface, kind, curvature="summit", border="ignore")
    for approach in (1e-3, 8e-3):
        assert same.solve(approach).contacts.force == pytest.approx(
            plain.solve(approach).contacts.force, rel=1e-9
        )
    means = patch_means(surface, PATCHES)
    ours = respond(same, [1e-3, 8e-3])
    paper = plain.respond([1e-3, 8e-3], patches=PATCHES, mean_heights=means)
    assert ours.patch_force == pytest.approx(paper.patch_force, rel=1e-8, abs=1e-12)
    assert ours.mean_separation == pytest.approx(paper.mean_separation, rel=1e-9)


@pytest.mark.parametrize(("major", "minor"), [(0.3, 0.3), (0.9, 0.3)])
@pytest.mark.parametrize("approach", [1e-3, 5e-3])
def test_paraboloid_keeps_its_radii(major, minor, approach):
    surface = dome(0.5, 0.5, major, minor)
    fitted, plain = (
        scaled(surface, curvature=curvature).solve(approach) for curvature in CURVATURES[::-1]
    )
    # Sums over at least 1500 samples.
    assert fitted.contacts.force == pytest.approx(plain.contacts.force, rel=2e-3)
    assert fitted.contacts.semi_axes == pytest.approx(plain.contacts.semi_axes, rel=5e-3)


def test_curvature_is_that_of_the_contact():
    x = (np.arange(128) + 0.5) / 128 - 0.5
    squared = x[:, None] ** 2 + x**2
    # Sharp at the summit, 20 times as blunt beyond 30 µm.
    heights = -squared / 0.8 - 2e-4 * (1.0 - np.exp(-squared / 0.03**2))
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    model = scaled(surface)
    radius = [
        state.contacts.semi_axes[0].prod() / state.start.solution.indentation[0]
        for state in (model.solve(2e-6), model.solve(2e-2))
    ]
    assert radius[0] == pytest.approx(1.0 / (2.0 / 0.8 + 4e-4 / 0.03**2), rel=0.05)
    assert radius[1] == pytest.approx(0.4, rel=0.05)  # 1 % is still the sharp tip's depth
    assert (
        scaled(surface, curvature="summit").solve(2e-2).contacts.force
        < 0.95 * model.solve(2e-2).contacts.force
    )


@pytest.mark.parametrize(("place", "count"), [((0.0, 0.5), 1), ((1.0, 0.0), 1), ((0.5, 0.5), 1)])
def test_border_asperities(place, count):
    surface = dome(*place)
    both = scaled(surface, border="include")
    inside = place == (0.5, 0.5)
    assert (both.solve(1e-3).contacts.force > 0.0).sum() == count
    alone = scaled(surface, border="ignore").solve(1e-3)
    assert (alone.contacts.force.sum() > 0.0) == inside
    if not inside:  # a corner of the dome at most has the R of a half or a quarter
        state = both.solve(1e-3)
        share = 0.5 if 0.5 in place else 0.25
        k = state.contacts.force > 0.0
        radius = state.contacts.semi_axes[k].prod() / state.start.solution.indentation[k]
        assert 0.8 * share < radius[0] / 0.3 < share  # π a b = π R A1 w with A1 ≤ 1


@pytest.mark.parametrize("kind", ["elliptic", "circular-independent"])
def test_curve_is_made_of_states(surface, kind):
    model = scaled(surface, kind)
    approaches = np.array([8e-3, -1e-3, 0.0, 3e-3, 8e-3])
    response = respond(model, approaches)
    assert response.approach.tolist() == approaches.tolist()
    for row, approach in enumerate(approaches):
        state = model.solve(approach)
        # Contacts and curvatures agree to 1e-6 of the approach on either path.
        assert response.force[row] == pytest.approx(state.contacts.force.sum(), rel=2e-5, abs=1e-12)
        assert response.contacts[row] == np.count_nonzero(state.contacts.force)
    assert response.patch_force.sum(axis=1) == pytest.approx(response.force, rel=1e-12)
    assert response.force[1] == response.force[2] == 0.0
    assert response.model == f"{kind}, curvature contact, border include"
    warm = model.solve(8e-3, start=model.solve(7.9e-3).start)
    assert warm.contacts.force.sum() == pytest.approx(response.force[0], rel=2e-5)


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("curvature", CURVATURES)
def test_force_grows_with_the_approach(surface, curvature, border):
    response = respond(
        scaled(surface, curvature=curvature, border=border), np.linspace(0.0, 0.02, 81)
    )
    assert np.all(np.diff(response.force) > 0.0)
    assert np.all(np.diff(response.contact_area) > -1e-3 * response.contact_area[1:])


@pytest.mark.parametrize("make", [scaled, islands])
def test_patches_and_mean_heights_follow_from_the_surface(surface, make):
    model, whole = make(surface), PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    for patches, wanted in ((None, whole), (PATCHES, PATCHES)):
        short, given = model.respond([5e-3], patches=patches), respond(model, [5e-3], wanted)
        np.testing.assert_array_equal(short.patch_separation, given.patch_separation)
        step = model.press(Control(approach=5e-3), patches=patches).response
        assert step.patch_separation.shape == given.patch_separation.shape
        assert step.mean_separation == pytest.approx(given.mean_separation, rel=1e-9)


def test_tilt_turns_the_load(surface):
    model = scaled(surface)
    left, right = (respond(model, [8e-3], tilt=(t, 0.0)).patch_force[0] for t in (-2e-2, 2e-2))
    assert left[:2].sum() > right[:2].sum() and left[4:].sum() < right[4:].sum()


def test_homogeneous_in_the_modulus(surface):
    soft = ScaledModel(kind="elliptic", surface=surface, contact_modulus=1.0).solve(8e-3)
    hard = scaled(surface).solve(8e-3)
    assert hard.contacts.force == pytest.approx(4000.0 * soft.contacts.force, rel=1e-9)


def test_models_by_name(surface):
    plain = micro_model("circular", surface, contact_modulus=1.0)
    assert plain.name == "circular"
    model = micro_model("circular", surface, contact_modulus=1.0, border="include")
    assert model.name == "circular, curvature summit, border include"
    assert model.reference_height == surface.highest


def test_patches_alone_hold_all_asperities(surface):
    model = scaled(surface)
    count, alone_force = 0, np.zeros(2)
    together = model.respond([2e-3, 1e-2], patches=PATCHES, mean_heights=np.zeros(6))
    for index in range(PATCHES.count):
        alone, patch = model.of_patch(PATCHES, index)
        count += len(alone.asperities)
        assert alone.first_touch >= model.first_touch - 1e-12
        curve = alone.respond([2e-3, 1e-2], patches=patch, mean_heights=[0.0])
        alone_force += curve.force
    # Without neighbours that press its summits down a patch carries more.
    assert np.all(alone_force >= together.force)
    assert count == len(model.asperities)


def test_flat_surface():
    flat = Surface(heights=np.zeros((16, 16)), lengths=(1.0, 1.0))
    model = scaled(flat, border="ignore")
    assert len(model.asperities) == 0 and len(model.solve(1e-3).contacts.force) == 0
    # The border's highest cell stands for the plateau; its fit has the area of the surface.
    assert np.isfinite(scaled(flat).solve(1e-3).contacts.force).all()


def test_a_fit_that_does_not_converge_is_an_error(surface):
    message = r"the fit of curvatures to contacts at approach 0\.008 mm did not converge"
    with pytest.raises(NotConverged, match=message):
        scaled(surface, curvature="contact", most_iterations=1).solve(8e-3)


def test_refuses(surface):
    with pytest.raises(InputError, match=r"'tip': this scale of the curvature is unknown.*contact"):
        scaled(surface, curvature="tip")
    with pytest.raises(InputError, match=r"'mirror': this treatment of the border.*ignore"):
        scaled(surface, border="mirror")
    with pytest.raises(InputError, match=r"'flat': this micro model is unknown"):
        scaled(surface, "flat")
    with pytest.raises(InputError, match=r"'lemke': this solver is unknown"):
        scaled(surface, solver="lemke")
    with pytest.raises(InputError, match=r"-1\.0: the contact modulus must be positive"):
        ScaledModel(kind="circular", surface=surface, contact_modulus=-1.0)
    with pytest.raises(InputError, match="inf: the approach must be finite"):
        scaled(surface).solve(np.inf)
    with pytest.raises(InputError, match="a response needs at least one approach"):
        respond(scaled(surface), [])


@pytest.mark.parametrize("make", [scaled, islands])
def test_large_surfaces_keep_less_but_find_the_same(surface, make):
    """Beyond so many cells only samples above a plane are sorted, anew for every plane."""
    steps = [
        Control(approach=1e-4, tilt=(1e-3, 0.0)),
        Control(force=0.5),
        Control(force=0.5, tilt=(1e-3, 0.0)),
        Control(force=0.5, tilt=None),
    ]
    means = patch_means(surface, PATCHES)

    def found(**options):
        model = make(surface, **options)
        forces = [respond(model, [d]).force[0] for d in (-1e-3, 0.0, 1e-7, 1e-4, 4e-3)]
        for control in steps:
            pressed = model.press(control, patches=PATCHES, mean_heights=means)
            forces += [pressed.response.force[0], pressed.plane.approach]
        return model.first_touch, forces

    touch, all_kept = found()
    least_touch, least_kept = found(most_whole=0)
    assert least_touch == touch
    # Curvatures and displacements converge to 1e-6; caps of 33 samples are differences of longer
    # sums.
    np.testing.assert_allclose(least_kept, all_kept, rtol=1e-6)


def test_radii_of_small_watersheds_scale_with_the_surface():
    """Heights in steps have peaks of a few samples, below which a small cap has no volume."""
    spectrum = Spectrum(hurst=0.5, waves=(1, 5), rms_slope=0.2, seed=3)
    heights = synthesise(spectrum, grid=(31, 16), lengths=(1.0, 0.5)).heights
    step = np.ptp(heights) / 47
    heights = np.round(heights / step) * step
    forces, radii = [], []
    for scale in (1.0, 1e3, 1e-3):
        surface = Surface(heights=heights * scale, lengths=(scale, 0.5 * scale))
        model = scaled(surface)
        state = model.solve(3e-3 * scale, tilt=(6e-3, -7e-3))
        forces.append(state.contacts.force.sum() / scale**2)
        radii.append(np.sort(model.asperities.radius) / scale)
        assert radii[-1].max() < 1.0  # of the side
    # contacts and curvatures agree to 1e-6 of the displacement
    np.testing.assert_allclose(forces, forces[0], rtol=1e-6)
    np.testing.assert_allclose(radii, [radii[0]] * 3, rtol=1e-6)


@pytest.mark.parametrize("border", BORDERS)
def test_mirrored_surfaces_carry_the_same(border):
    """A ridge on which several samples are peaks must not be divided among them by chance."""
    spectrum = Spectrum(hurst=0.8, waves=(1, 4), rms_slope=0.1, seed=12)
    surface = synthesise(spectrum, grid=(43, 32), lengths=(1.0, 2.3))
    approach = 1.5 * surface.heights.std()
    forces = []
    for heights in (surface.heights, surface.heights[::-1], surface.heights[:, ::-1]):
        model = scaled(replace(surface, heights=heights), border=border)
        forces.append(model.solve(approach).contacts.force.sum())
    np.testing.assert_allclose(forces, forces[0], rtol=1e-6)  # curvatures are settled to that
