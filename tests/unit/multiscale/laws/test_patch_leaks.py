"""Transmissivities of the patches of one surface, and the table of a sample."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from patchlaw import Spectrum, synthesise
from patchlaw.geometry import PatchGrid
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flows
from patchlaw.multiscale.laws import transmissivity
from patchlaw.multiscale.laws.rows import Transmissivity
from patchlaw.multiscale.laws.transmissivity import (
    flow_memory,
    patch_transmissivities,
    sample_transmissivity,
)


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


def test_no_contact_of_a_table_is_solved_twice(monkeypatch):
    """Wider gaps next to closing are those of the rows that are there."""
    pressed, press = [], HalfSpaceModel.press
    spectrum = Spectrum(hurst=0.8, waves=(1, 3), rms_slope=0.1, seed=2)
    surface = synthesise(spectrum, grid=(16, 16), lengths=(1.0, 1.0))

    def counted(model, control, **options):
        pressed.append((model.surface.grid, control.approach))
        return press(model, control, **options)

    monkeypatch.setattr(HalfSpaceModel, "press", counted)
    model = HalfSpaceModel(surface, contact_modulus=1.0, periodic=True)
    table = sample_transmissivity([model], np.zeros_like)
    assert not table.hydraulic_gap[0].any()  # it closes
    assert len(set(pressed)) == len(pressed)


def test_a_table_is_closed_where_cells_are():
    """Beside a closed row the interpolant falls to 1e-21 of the flow and less; cells say 0."""
    gap = np.array([[0.0, 0.0], [0.0, 3.1e-4], [8.3e-4, 9.7e-4]])
    none = np.zeros_like(gap)
    rows = np.array([2.3e-4, 5.9e-4, 1.1e-3])
    table = Transmissivity(separation=rows, hydraulic_gap=gap, on_half=gap, scatter=none)
    found = table.at(rows[1] + np.array([0.0, 1e-8, 1e-5]))
    assert found[:, 0].tolist()[:2] == [0.0, 0.0] and 0.0 < found[2, 0] < found[2, 1]
    np.testing.assert_allclose(np.cbrt(table.at(rows)), gap, rtol=1e-12)


@pytest.mark.long
def test_a_table_keeps_no_more_memory_than_plan_says(monkeypatch):
    """Of 30 rows, the most that ten samples had."""
    samples, make = [], transmissivity._Sample

    def kept(*given):
        samples.append(make(*given))
        return samples[-1]

    spectrum = Spectrum(hurst=0.8, waves=(2, 10), rms_slope=0.1, seed=0)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=1000.0, periodic=True, tolerance=1e-6)
    monkeypatch.setattr(transmissivity, "_Sample", kept)
    tracemalloc.start()
    try:
        sample_transmissivity([model], np.zeros_like)
        whole = tracemalloc.get_traced_memory()[0]
        samples.clear()
        taken = whole - tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    stated = flow_memory(0, surface.heights.size)
    assert 0.7 * stated < taken <= stated


@pytest.mark.parametrize("cells", [180, 288])
def test_flows_take_the_memory_that_is_stated(cells):
    heights = ndimage.gaussian_filter(
        np.random.default_rng(cells).normal(size=(cells, cells)), 3.0, mode="wrap"
    )
    gap = np.maximum(heights + 0.8 * heights.std(), 0.0)
    tracemalloc.start()
    try:
        for flow in gap_flows(gap, (1.0, 1.0), periodic=True):
            assert flow.constriction.share > 0.0
        taken = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    stated = flow_memory(cells**2)
    assert 0.7 * stated < taken <= stated
