"""The model islands: responses, order, tilt, degenerate surfaces, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from geometry import (
    Control,
    InputError,
    NotConverged,
    PatchGrid,
    Spectrum,
    Surface,
    patch_means,
    synthesise,
)
from geometry.rigid_plane import PlaneLevers
from micro import IslandModel
from micro.interaction.plane_on_peaks import Peaks
from micro.islands.equilibrium import IslandContact
from micro.islands.watersheds import Watersheds

PATCHES = PatchGrid(grid=(2, 3), lengths=(1.0, 1.0))


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.8, waves=(2, 9), rms_slope=0.2, seed=5)
    return synthesise(spectrum, grid=(40, 40), lengths=(1.0, 1.0))


@pytest.fixture(scope="module")
def model(surface):
    return IslandModel(surface=surface, contact_modulus=4000.0)


def respond(model, approaches, patches=PATCHES, **options):
    means = patch_means(model.surface, patches)
    return model.respond(approaches, patches=patches, mean_heights=means, **options)


def test_curve_is_made_of_states(model):
    approaches = np.array([9e-3, 0.0, 3e-3, -1e-3, 9e-3])
    response = respond(model, approaches)
    assert response.model == "islands" and response.approach.tolist() == approaches.tolist()
    for row, approach in enumerate(approaches):
        state = model.solve(approach)
        assert response.force[row] == state.contacts.force.sum()  # no result depends on another
        assert response.contact_area[row] == state.contacts.area.sum()
        assert (
            response.contacts[row]
            == len(state.contacts.force)
            == response.patch_contacts[row].sum()
        )
    # Shares of an island add up to one, to rounding.
    assert response.patch_force.sum(axis=1) == pytest.approx(response.force, rel=1e-13)
    assert response.patch_contact_area.sum(axis=1) == pytest.approx(response.contact_area)
    assert response.residual.max() <= 1e-6 and response.iterations.max() < 30


def test_before_touch(model):
    response = respond(model, [0.0, -1e-3])
    assert response.force.tolist() == [0.0, 0.0] and response.contacts.tolist() == [0, 0]
    gap = model.surface.highest - model.surface.mean_height
    assert response.mean_separation == pytest.approx([gap, gap + 1e-3])


def test_is_homogeneous_in_the_modulus(surface, model):
    soft = IslandModel(surface=surface, contact_modulus=1.0).solve(8e-3)
    hard = model.solve(8e-3)
    assert hard.contacts.force == pytest.approx(4000.0 * soft.contacts.force, rel=1e-13)
    assert hard.contacts.semi_axes == pytest.approx(soft.contacts.semi_axes, rel=1e-13)


def test_tilt_is_a_tilted_surface(surface):
    surface = replace(surface, periodic=False)  # a tilted one is not, its border differs
    model = IslandModel(surface=surface, contact_modulus=4000.0)
    tilt = (4e-3, -2e-3)
    offset = tilt[0] * (surface.x[:, None] - 0.5) + tilt[1] * (surface.y - 0.5)
    turned = Surface(heights=surface.heights + offset, lengths=(1.0, 1.0))
    approach = 8e-3 + turned.highest - surface.highest
    level = IslandModel(surface=turned, contact_modulus=4000.0).solve(approach)
    tilted = model.solve(8e-3, tilt=tilt)
    assert tilted.contacts.force.sum() == pytest.approx(level.contacts.force.sum(), rel=1e-9)
    response = respond(model, [8e-3], tilt=tilt)
    assert response.force[0] == pytest.approx(tilted.contacts.force.sum(), rel=1e-9)


def test_border_cuts_a_summit_in_half():
    x = (np.arange(64) + 0.5) / 64
    whole, half = (
        IslandModel(
            surface=Surface(
                heights=-((x[:, None] - centre) ** 2 + (x - 0.5) ** 2) / 0.6, lengths=(1.0, 1.0)
            ),
            contact_modulus=1.0,
        ).solve(2e-3)
        for centre in (0.5, 0.0)
    )
    assert half.contacts.depth == pytest.approx(
        whole.contacts.depth, rel=1e-9
    )  # the spline is exact
    # Half the volume: R is halved, so the force is 1/√2 of the whole but for the shape's factor.
    assert half.contacts.force[0] / whole.contacts.force[0] == pytest.approx(np.sqrt(0.5), rel=0.06)
    assert half.contacts.x[0] > 0.0


def test_patches_share_an_island_by_area():
    x = (np.arange(64) + 0.5) / 64
    surface = Surface(
        heights=-((x[:, None] - 0.5) ** 2 + (x - 0.25) ** 2) / 0.2, lengths=(1.0, 1.0)
    )
    model = IslandModel(surface=surface, contact_modulus=1.0)
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    response = respond(model, [1e-3], patches)
    # Half on either side of the border at x = 0.5, by symmetry of the samples.
    assert response.patch_force[0] / response.force[0] == pytest.approx([0.5, 0, 0.5, 0], abs=0.01)
    assert response.patch_contacts[0].sum() == 1


def test_flat_surface_is_reported():
    flat = IslandModel(
        surface=Surface(heights=np.zeros((16, 16)), lengths=(1.0, 1.0)), contact_modulus=1.0
    )
    state = flat.solve(1e-3)
    assert state.contacts.area == pytest.approx([1.0])  # half a cap's base would be; it is flagged
    (warning,) = respond(flat, [-1e-3, 1e-3]).warnings
    assert "the islands cover 100.0% of the surface, the largest 100% of it" in warning


def test_plateau_is_one_contact():
    x = (np.arange(64) + 0.5) / 64
    dome = -((x[:, None] - 0.5) ** 2 + (x - 0.5) ** 2) / 0.4
    surface = Surface(heights=np.minimum(dome, -5e-3), lengths=(1.0, 1.0))
    state = IslandModel(surface=surface, contact_modulus=1.0).solve(2e-3)
    assert (
        len(state.contacts.force) == 1 and state.overlapping_contacts > 0
    )  # ties and the spline's ripples on the edge
    # More than the plateau's own area touches, and less than the base of what lies above.
    flat, base = np.pi * 0.4 * 5e-3, np.pi * 0.4 * 7e-3
    assert 0.5 * flat < state.contacts.area[0] < base


def test_approach_beyond_the_range_of_heights(model):
    depth = 3.0 * np.ptp(model.surface.heights)
    state = model.solve(depth)
    assert len(state.contacts.force) == 1 and np.isfinite(state.contacts.force[0])
    assert respond(model, [depth]).warnings


def test_refuses(surface, model):
    with pytest.raises(InputError, match=r"0\.0: the contact modulus must be positive"):
        IslandModel(surface=surface, contact_modulus=0.0)
    with pytest.raises(InputError, match="nan: the approach must be finite"):
        model.solve(np.nan)
    with pytest.raises(InputError, match="a response needs at least one approach"):
        respond(model, [])
    with pytest.raises(InputError, match=r"\(3,\): every patch needs one mean height"):
        model.respond([1e-3], patches=PATCHES, mean_heights=np.zeros(3))
    corner = PatchGrid(grid=(1, 1), lengths=(0.1, 0.1))
    with pytest.raises(InputError, match="points lie outside the patches"):
        model.respond([1e-2], patches=corner, mean_heights=[0.0])


def test_islands_that_do_not_converge_are_an_error(surface):
    sheds = Watersheds.of(surface)
    below, count = surface.highest - sheds.z, len(sheds)
    levers = PlaneLevers.at(sheds.x, sheds.y, surface.lengths)
    contact = IslandContact(
        watersheds=sheds,
        peaks=Peaks(levers=levers, depth=below, force=lambda over: 0.0),
        control=Control(approach=8e-3, tilt=(0.0, 0.0)),
        level=np.full(count, surface.highest - 8e-3),
        motion=np.array([8e-3, 0.0, 0.0]),
        contact_modulus=4000.0,
        body=None,
    )
    message = (
        r"^the iteration between islands and their displacements at an approach of 0\.008 mm did "
        r'not converge: MAX_ITERATIONS after 2 iterations; .*micro\.model = "half-space"'
    )
    with pytest.raises(NotConverged, match=message):
        contact.equilibrium(most_iterations=2)
