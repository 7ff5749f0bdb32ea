"""Representative laws against closed forms of waves, resolved roughness, and a column."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.along import respond
from helpers.block_cases import block_of, interface_of
from helpers.half_space_cases import wave
from scipy.integrate import quad
from scipy.optimize import brentq

from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, mirrored, synthesise
from patchlaw.macro import LawContactProblem
from patchlaw.micro import HalfSpaceModel, influence_matrix
from patchlaw.multiscale import LawTable, PatchContact, representative_law

AMPLITUDE = 0.01
FULL = np.pi * AMPLITUDE  # mean pressure / E* that closes a wave of length 1 (Johnson 1985, 13.2)


@pytest.fixture(scope="module")
def wavy():
    surface = wave((256, 4), (1.0, 1 / 64), AMPLITUDE)
    return representative_law([surface], 1.0, largest_pressure=2.0 * FULL, tolerance=1e-4)


@pytest.mark.parametrize(
    ("share", "allowed"), [(0.05, 5e-4), (0.3, 5e-4), (0.7, 5e-4), (0.9, 1e-3)]
)
def test_westergaards_wave(wavy, share, allowed):
    """Load increments press on the contact strips as on a row of punches.

    A row of cracks of half-length b, period λ, adds −2λ/(π E*) ln cos(π b/λ) to the compliance of
    one half of the body (Tada, Paris & Irwin, The stress analysis of cracks handbook). Between the
    strips of Westergaard, sin²(π a/λ) = p/p*, that is dc/dp = −λ/(π E*) ln(p/p*), and the closure
    of a wave of amplitude A is c = A (p/p*) (1 − ln p/p*).
    """
    closure = AMPLITUDE * share * (1.0 - np.log(share))
    point = wavy.at(closure)
    assert point.pressure == pytest.approx(share * FULL, rel=allowed)  # of 256 cells, and of rows
    assert point.stiffness == pytest.approx(-np.pi / np.log(share), rel=0.01)
    assert point.contact_area_fraction == pytest.approx(
        2.0 / np.pi * np.arcsin(np.sqrt(share)), abs=2.0 / 256
    )
    assert point.separation == pytest.approx(AMPLITUDE - closure, abs=1e-6 * AMPLITUDE)


def test_a_wave_closes_at_the_closed_forms_pressure(wavy):
    assert wavy.initial_separation == pytest.approx(AMPLITUDE, rel=1e-6)  # a spline's maximum
    (closed,) = np.flatnonzero(wavy.rows.closure == wavy.initial_separation)
    # the deepest cell's centre is half a cell off the trough: (π/256)²/2 too little
    assert wavy.rows.pressure[closed] == pytest.approx(FULL, rel=1e-4)


def test_a_bisinusoidal_wave():
    """Full contact and work of A cos 2πx cos 2πy (Johnson, Greenwood & Higginson 1985)."""
    x = (np.arange(64) + 0.5) / 64
    heights = AMPLITUDE * np.outer(np.cos(2.0 * np.pi * x), np.cos(2.0 * np.pi * x))
    surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=True)
    law = representative_law([surface], 1.0, largest_closure=1.5 * AMPLITUDE)
    full = np.sqrt(2.0) * np.pi * AMPLITUDE
    (closed,) = np.flatnonzero(law.rows.closure == law.initial_separation)
    # centres of cells half a cell off the trough in both directions: (π/64)² too little
    assert law.rows.pressure[closed] == pytest.approx(full * (1 - (np.pi / 64) ** 2), rel=1e-5)
    assert law.rows.contacts[1] == 2
    # the work to full contact is stored in the flattened wave: half of p · displacement
    work, _ = quad(law.pressure, 0.0, AMPLITUDE, limit=200)
    assert work == pytest.approx(full * AMPLITUDE / 8.0, rel=2e-3)


@pytest.mark.long
def test_the_middle_of_a_finite_array():
    """Samples side by side on a half-space that is not periodic, under one rigid plane.

    Closure of a sample there: the approach less its own mean displacement.
    """
    spectrum, many = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.1, seed=5), 12
    sample = synthesise(spectrum, grid=(24, 24), lengths=(1.0, 1.0))
    law = representative_law([sample], 1.0, largest_pressure=0.05, tolerance=1e-4)
    heights = np.tile(sample.heights, (many, many))
    array = Surface(heights=heights, lengths=(float(many), float(many)))
    model = HalfSpaceModel(array, contact_modulus=1.0, highest=sample.highest)
    found = respond(model, [0.06], patches=PatchGrid(grid=(many, many), lengths=array.lengths))
    middle = many // 2 * (many + 1)
    pressure, displacement = found.patch_pressure[0], found.patch_displacement[0]
    expected = law.at(0.06 - displacement[middle])
    # what is not periodic beyond the array: 1/many of the closure's part; Love's rectangles on one
    # side, waves on the other: 1/24
    assert expected.pressure == pytest.approx(pressure[middle], rel=0.02)
    assert displacement[middle] > 0.7 * 0.06  # long waves take most of the approach
    # the edges of the array carry more, and the law knows it by their displacement alone
    inner = np.arange(many**2).reshape(many, many)[1:-1, 1:-1]
    made = law.at(0.06 - displacement[inner]).pressure
    assert np.ptp(pressure[inner]) > 0.3 * pressure[middle]
    assert np.abs(made / pressure[inner] - 1.0).max() < 0.05


@pytest.mark.long
def test_a_crowned_face_with_its_roughness_resolved():
    """Every asperity of a rough sphere on a half-space, against the law of its roughness.

    Twelve samples lie side by side on the sphere. The law sees the sphere in its mean depths below
    squares of half a sample, on the half-space's compliance.
    """
    many, cells, alpha = 12, 24, 0.5
    spectrum = Spectrum(hurst=0.8, waves=(2, 4), rms_slope=0.1, seed=5)
    sample = synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))
    law = representative_law([sample], 1.0, largest_pressure=0.1)
    hertz = many / 4.0  # radius of contact of the smooth sphere
    radius = alpha * hertz**2 / float(sample.heights.std())
    force = 4.0 * hertz**3 / (3.0 * radius)

    x = (np.arange(many * cells) + 0.5) / cells - 0.5 * many
    heights = np.tile(sample.heights, (many, many)) - (x[:, None] ** 2 + x**2) / (2.0 * radius)
    sides = (float(many), float(many))
    model = HalfSpaceModel(Surface(heights=heights, lengths=sides), contact_modulus=1.0)
    by_sample = PatchGrid(grid=(many, many), lengths=sides)
    resolved = model.press(Control(force=force), patches=by_sample)

    halves = PatchGrid(grid=(2 * many, 2 * many), lengths=sides)
    depth = ((halves.centres - 0.5 * many) ** 2).sum(axis=1) / (2.0 * radius)
    table = LawTable(
        patches=halves, laws=tuple(map(law.shifted, depth)), made_by={"coupling": "representative"}
    )
    compliance = influence_matrix(halves) / np.pi
    step = PatchContact(table, compliance).press(Control(force=force))
    found = np.reshape(step.patches.pressure_MPa, (many, 2, many, 2)).mean(axis=(1, 3)).ravel()
    exact = resolved.patch_pressure
    assert exact.max() < 0.8 * 1.5 * force / (np.pi * hertz**2)  # roughness spreads the pressure
    assert found.max() == pytest.approx(exact.max(), rel=0.02)
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.04 * exact.max()  # a sample is no point
    # the highest point of the sphere lies on its flank: the approach of both counts from there
    lower = law.initial_separation - (model.reference_height - sample.mean_height)
    assert step.approach_mm == pytest.approx(resolved.plane.approach + lower, rel=0.005)


@pytest.mark.long
def test_measured_parts_are_mirrored():
    """Quarters of a surface, as maps that do not continue periodically, against the whole.

    Near full contact the law knows little of what sample it came from, and all of its steps.
    """
    spectrum = Spectrum(hurst=0.8, waves=(4, 12), rms_slope=0.1, seed=1)
    whole = synthesise(spectrum, grid=(48, 48), lengths=(2.0, 2.0))
    quarters = [
        Surface(heights=part, lengths=(1.0, 1.0))
        for half in np.split(whole.heights, 2)
        for part in np.split(half, 2, axis=1)
    ]

    def separation(samples):
        law = representative_law(samples, 1.0, largest_pressure=0.05, tolerance=0.01)
        closure = np.interp(0.05, law.rows.pressure, law.rows.closure)
        return law.initial_separation - closure

    exact = separation([whole])
    continued = [replace(quarter, periodic=True) for quarter in quarters]
    assert separation([mirrored(each) for each in quarters]) == pytest.approx(exact, rel=0.1)
    assert separation(continued) > 1.2 * exact  # the ridges around them keep the faces apart


@pytest.mark.long
@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
def test_a_column_in_series_with_the_law(mode):
    spectrum = Spectrum(hurst=0.8, waves=(2, 5), rms_slope=0.1, seed=1)
    sample = synthesise(spectrum, grid=(16, 16), lengths=(1.0, 1.0))
    block = block_of("roller", height=0.6, cells=(3, 4, 3))
    law = representative_law([sample], block.material.contact_modulus, largest_pressure=200.0)
    pressed = LawContactProblem(interface_of(block, (1, 1)), [law], mode)
    column = block.material.confined_modulus / 0.6  # u = p H / M
    for approach in (6e-3, 18e-3):
        state = pressed.solve(Control(approach=approach))

        def lacking(c, approach=approach):
            return c + law.pressure(c) / column - approach

        closure = brentq(lacking, 0.0, min(approach, law.range[1]), xtol=1e-18)
        assert law.pressure(closure) / column > 0.02 * approach  # both give way
        np.testing.assert_allclose(state.patch_closure, closure, rtol=1e-10)
        np.testing.assert_allclose(state.patch_pressure, law.pressure(closure), rtol=1e-10)
