"""Tables of isolated laws against the micro model that they stand for."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.along import respond

from patchlaw.geometry import PatchGrid, Spectrum, find_asperities, patch_means, synthesise
from patchlaw.micro import AsperityModel, micro_model
from patchlaw.micro.closed_forms import love_centre, love_mean
from patchlaw.multiscale import isolated_laws
from patchlaw.multiscale.laws.of_patches import IsolatedPatch
from patchlaw.support import InputError

MODULUS = 4000.0
TOLERANCE = 1e-4
ROWS = 400  # enough of them


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    return synthesise(spectrum, grid=(128, 128), lengths=(1.0, 1.0))


@pytest.fixture(scope="module")
def model(surface):
    asperities = find_asperities(surface)
    return AsperityModel("circular", asperities, contact_modulus=MODULUS)


@pytest.fixture(scope="module")
def whole(surface, model):
    grid = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return IsolatedPatch(model=model, patch=grid, mean_height=surface.mean_height)


@pytest.mark.long
@pytest.mark.parametrize(("love", "factor"), [("mean", love_mean), ("centre", love_centre)])
def test_rows_are_the_micro_model_and_love(surface, model, whole, love, factor):
    patch = IsolatedPatch(model=model, patch=whole.patch, mean_height=whole.mean_height, love=love)
    law = patch.law(10e-3, TOLERANCE, ROWS)
    response = respond(
        model, law.rows.approach, patches=whole.patch, mean_heights=np.array([whole.mean_height])
    )
    # the same solver from another start: its tolerance of 1e-10
    np.testing.assert_allclose(law.rows.pressure, response.mean_pressure, rtol=1e-8, atol=1e-12)
    correction = factor(0.5, 0.5) * law.rows.pressure / (np.pi * MODULUS)  # eq. 31
    np.testing.assert_allclose(law.rows.closure, law.rows.approach - correction, rtol=1e-12)
    np.testing.assert_array_equal(law.rows.contacts[1:], response.contacts[1:])
    if love == "mean":  # the law's closure is the block's: the mean gap is the micro model's
        gap = law.at(law.rows.closure).separation
        np.testing.assert_allclose(gap[1:], response.mean_separation[1:], rtol=1e-9)


def test_interpolation_error_is_what_the_law_says(whole, model):
    law = whole.law(10e-3, TOLERANCE, ROWS)
    approach = np.random.default_rng(1).uniform(law.rows.approach[0], law.rows.approach[-1], 300)
    rows = whole.rows(np.sort(approach))
    scale = np.maximum(rows.pressure, 0.01 * law.rows.pressure[-1])
    error = (np.abs(law.at(rows.closure).pressure - rows.pressure) / scale).max()
    assert law.interpolation_error <= TOLERANCE
    # the law's own figure is measured half-way between rows; elsewhere it may be a little more
    assert error <= 3 * TOLERANCE


def test_table_reaches_the_closure_asked_for(whole):
    for end in (1e-3, 5e-3, 12e-3):
        assert end <= whole.law(end, 1e-2, ROWS).range[1] < 1.3 * end


def test_patch_is_open_when_out_of_reach(surface, model, whole):
    low = model.asperities.z < model.asperities.highest - 5e-3
    assert low.any()
    model = AsperityModel("circular", model.asperities.subset(low), contact_modulus=MODULUS)
    patch = IsolatedPatch(model=model, patch=whole.patch, mean_height=0.0)
    law = patch.law(4e-3, 1e-2, ROWS)
    assert law.is_open
    assert law.first_touch == pytest.approx(patch.first_touch, rel=1e-15)  # the same number
    assert not patch.law(1.5 * patch.first_touch, 1e-2, ROWS).is_open


@pytest.mark.long
def test_stiff_patch_goes_on_where_closure_falls(surface, model):
    """Many asperities in a patch without interaction: dp/dδ outgrows the patch's own stiffness."""
    model = AsperityModel("circular-independent", model.asperities, contact_modulus=MODULUS)
    patch = IsolatedPatch(
        model=model,
        patch=PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)),
        mean_height=surface.mean_height,
    )
    law = patch.law(60e-3, TOLERANCE, ROWS)
    assert not law.is_function
    assert law.range[1] == law.rows.closure.max() < 60e-3
    assert law.rows.approach[-1] >= 60e-3
    local = np.linspace(1e-3, 60e-3, 50)
    response = respond(model, local, patches=patch.patch, mean_heights=[surface.mean_height])
    # the tolerance, of the pressure or a hundredth of the last, is measured half-way between rows
    scale = np.maximum(response.mean_pressure, 0.01 * law.rows.pressure[-1])
    assert np.all(np.abs(law.along(local).pressure - response.mean_pressure) < 3e-4 * scale)
    assert law.along(local).dclosure.min() < -0.5


@pytest.mark.long
def test_surface_models_make_laws_too(surface):
    """Laws of a model that knows no summits: the whole patch is the surface itself."""
    model = micro_model("half-space", surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    alone, patch = model.of_patch(patches, 0)
    law = IsolatedPatch(model=alone, patch=patch, mean_height=surface.mean_height).law(8e-3, 1e-3)
    response = respond(
        model, law.rows.approach[1:], patches=patches, mean_heights=np.array([surface.mean_height])
    )
    # the same solver from other starts, to its tolerance of 1e-8 of the largest pressure
    np.testing.assert_allclose(law.rows.pressure[1:], response.mean_pressure, rtol=1e-7)


def test_law_that_is_nowhere_a_function_goes_on_over_the_approach(surface):
    """A flat surface is in full contact at once: pressure grows, closure does not."""
    flat = replace(surface, heights=np.zeros((16, 16)))
    model = micro_model("half-space", flat, contact_modulus=MODULUS)
    patch = PatchGrid(grid=(1, 1), lengths=flat.lengths)
    law = IsolatedPatch(model=model, patch=patch, mean_height=0.0).law(1e-3, 1e-3)
    assert not law.is_function
    # linear: twice the approach, twice the pressure; the solver's tolerance of 1e-8, and of a
    # power of 3/2 that follows a straight line between 33 rows
    assert law.along(1e-3).pressure == pytest.approx(2 * law.along(0.5e-3).pressure, rel=1e-4)
    with pytest.raises(InputError, match="stops being a function of closure"):
        law.at(0.5e-3)


def test_all_laws_of_a_grid(surface, model):
    patches = PatchGrid(grid=(3, 2), lengths=surface.lengths)
    table = isolated_laws(
        model, patches, mean_heights=patch_means(surface, patches), closure_ends=np.full(6, 10e-3),
        love="centre",
    )  # fmt: skip
    assert table.made_by["love"] == "centre"
    owner = patches.index_of(model.asperities.x, model.asperities.y)
    for index, law in enumerate(table.laws):
        own = model.asperities.z[owner == index]
        touch = model.asperities.highest - own.max() if own.size else np.inf
        assert law.first_touch == pytest.approx(touch, rel=1e-12, abs=1e-15)  # the same subtraction
        assert law.is_open == (touch >= 10e-3)
