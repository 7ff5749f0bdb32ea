"""Slopes of heights from every source: refused where no surface is so steep."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import (
    Material,
    Preparation,
    Spectrum,
    Surface,
    facing,
    read_surface,
    synthesise,
)
from patchlaw.geometry.files.reading import surface_of
from patchlaw.geometry.preparation import prepared
from patchlaw.geometry.statistics import check_finite_slopes, check_slopes, rms_gradient
from patchlaw.micro import FiniteSlopes, HalfSpaceModel

LENGTHS = (0.7, 1.1)


def rough(rms_slope, seed=5):
    spectrum = Spectrum(hurst=0.77, waves=(2, 5), rms_slope=rms_slope, seed=seed)
    return synthesise(spectrum, grid=(40, 64), lengths=LENGTHS)


def pressed(surface):
    return HalfSpaceModel(surface, contact_modulus=4321.0)


def in_memory(surface):
    return surface_of(surface.heights, lengths=LENGTHS, periodic=True)


SOURCES = {
    "synthesised": lambda surface, _: prepared(surface, Preparation()),
    "array": lambda surface, _: in_memory(surface),
    "model": lambda surface, _: pressed(surface).surface,
    "both sides": lambda surface, _: facing(surface.scaled(0.5), surface.scaled(0.5)),
}


def file(surface, folder):
    np.save(folder / "map.npy", surface.heights)
    return read_surface(folder / "map.npy", lengths=LENGTHS, periodic=True)


@pytest.mark.parametrize("make", [*SOURCES.values(), file], ids=[*SOURCES, "file"])
def test_every_source_has_one_guard(make, tmp_path):
    # on the spline, by less than 2e-4, as there are 8 heights on the shortest waves
    assert rms_gradient(make(rough(1.97), tmp_path)) == pytest.approx(1.97, rel=2e-4)
    with pytest.raises(
        InputError, match=r"heights is 2\.03,.*(in µm|both sides).*gradients up to 2\)"
    ):
        make(rough(2.03), tmp_path)


def test_parts_and_resamplings_of_a_surface_are_its_own():
    """A part may be steeper than the whole, which was looked at."""
    step = np.zeros((64, 64))
    step[30:34] = np.array([0.1, 0.9, 0.9, 0.1])[:, None] * 0.12
    model = pressed(Surface(heights=step, lengths=(1.0, 1.0)))
    steep = model.surface.piece((0.45, 0.55), (0.0, 1.0))
    assert rms_gradient(steep) > 2.0 > rms_gradient(model.surface)
    assert model.resampled((96, 96)).surface.grid == (96, 96)
    with pytest.raises(InputError, match="no rough surface is so steep"):
        check_slopes(steep)


def test_finite_slopes_end_where_two_orders_do():
    material = Material(young_modulus=4000.0, poisson_ratio=0.21)
    check_finite_slopes(rough(0.8))
    assert FiniteSlopes(rough(0.8), material).grid == (40, 64)
    with pytest.raises(
        InputError, match=r"surface, 0\.81; .*finite_slopes = false.*'reference'.*0\.8"
    ):
        FiniteSlopes(rough(0.81), material)


@pytest.mark.parametrize(
    ("unit", "factor", "advice"),
    [
        ("mm", 1.0, "are they in µm? Then say height_unit = 'um'"),
        ("mm", 1e3, "are they in nm? Then say height_unit = 'nm'"),
        ("um", 1e3, "heights are given in um; is that right, and are its lengths"),
    ],
)
def test_advice_is_of_a_unit_that_was_not_given(tmp_path, unit, factor, advice):
    heights = 1e3 * factor * rough(0.1).heights
    np.save(tmp_path / "map.npy", heights)
    for read in (lambda **how: read_surface(tmp_path / "map.npy", **how),
                 lambda **how: surface_of(heights, **how)):  # fmt: skip
        with pytest.raises(InputError, match=advice.replace("?", r"\?")):
            read(lengths=LENGTHS, height_unit=unit)
