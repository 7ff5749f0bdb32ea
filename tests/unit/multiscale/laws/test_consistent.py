"""Consistent laws on the half-space give back the solution that they were made from."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.along import respond

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import influence_matrix, micro_model
from patchlaw.multiscale import PatchContact, consistent_laws
from patchlaw.multiscale.laws.of_patches import WholeSurface
from patchlaw.multiscale.models.patch_contact import PathContact

MODULUS = 4000.0
END = 9e-3
LARGEST = Control(approach=END, tilt=(0.0, 0.0))


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    return synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))


def parts(surface, grid, name="circular", tolerance=1e-4):
    model = micro_model(name, surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=grid, lengths=surface.lengths)
    means = patch_means(surface, patches)
    table = consistent_laws(
        model, patches, mean_heights=means, largest=LARGEST, tolerance=tolerance, most_rows=400
    )
    half_space = influence_matrix(patches) / (np.pi * MODULUS)
    return model, patches, means, table, PatchContact(table, half_space)


@pytest.mark.parametrize(("grid", "name"), [
    ((1, 1), "circular"), pytest.param((3, 2), "half-space", marks=pytest.mark.long),
    ((3, 2), "circular"), ((8, 8), "circular"),
])  # fmt: skip
def test_whole_surface_comes_back(surface, grid, name):
    model, patches, means, table, coupling = parts(surface, grid, name, 1e-3)
    law = max(table.laws, key=lambda one: len(one.rows))
    rows = law.rows.approach[[len(law.rows) // 2, -1]]
    for approach in (*rows, 0.537 * END):
        step = coupling.press(Control(approach=approach))
        whole = respond(model, [approach], patches=patches, mean_heights=means)
        # at rows the micro model's own tolerance; between them that of the tables
        allowed = 1e-6 if approach in rows else 1e-3
        assert step.force_N == pytest.approx(whole.force[0], rel=allowed)
        assert step.mean_separation_mm == pytest.approx(whole.mean_separation[0], rel=allowed)
        np.testing.assert_allclose(
            step.patches.pressure_MPa,
            whole.patch_pressure[0],
            atol=allowed * whole.patch_pressure.max(),
        )


def test_tables_keep_their_tolerance_and_say_so(surface):
    model, patches, means, table, _ = parts(surface, (3, 2))
    approach = np.random.default_rng(4).uniform(1e-3, END, 100)
    pressure = respond(model, approach, patches=patches, mean_heights=means).patch_pressure
    load = np.maximum(pressure.mean(axis=1), 0.01 * pressure.mean(axis=1).max())
    made = np.column_stack([law.along(approach).pressure for law in table.laws])
    # what the tables say is measured half-way between rows; elsewhere it may be a little more
    assert np.max(np.abs((made - pressure).mean(axis=1)) / load) < 3e-4
    assert table.force_error <= 1e-4
    for law, wrong, found in zip(table.laws, (made - pressure).T, pressure.T, strict=True):
        assert np.max(np.abs(wrong) / np.maximum(found, load)) < 3e-3
        assert law.interpolation_error <= 1e-3  # ten times as large as the force's
        assert law.is_open or 0.0 < law.stiffness_error < 0.1
    assert (table.made_by["coupling"], table.made_by["tilt"]) == ("consistent", "0, 0")


@pytest.mark.parametrize(("macro", "tilt"), [
    *(("half-space", tilt) for tilt in ((0.0, 0.0), (5e-3, -2e-3))),
    pytest.param("half-space", None, marks=pytest.mark.long), ("too stiff", (5e-3, -2e-3)),
    ("made up", None),
])  # fmt: skip
def test_any_macro_model_finds_the_rows_again(surface, macro, tilt):
    """Closures count in the compliance of the model that the laws are for, right or wrong."""
    model = micro_model("circular", surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=(3, 2), lengths=surface.lengths)
    means = patch_means(surface, patches)
    compliance = influence_matrix(patches) / (np.pi * MODULUS)
    if macro == "too stiff":  # as a coarse mesh is
        compliance = 0.8 * compliance
    elif macro == "made up":
        random = np.random.default_rng(2).normal(size=compliance.shape)
        compliance = compliance + 0.02 * compliance.max() * random @ random.T
    table = consistent_laws(
        model, patches, mean_heights=means, largest=Control(force=2.0, tilt=tilt),
        displacements=lambda pressures: pressures @ compliance.T, tolerance=1e-3,
    )  # fmt: skip
    coupling, start = PatchContact(table, compliance), None
    if tilt is None:
        coupling = PathContact(table, lambda pressures: pressures @ compliance.T)
    assert table.made_by["tilt"] == ("free" if tilt is None else f"{tilt[0]:g}, {tilt[1]:g}")
    for force in (0.2, 0.7, 1.3, 2.0):
        control = Control(force=force, tilt=tilt)
        whole = model.press(control, patches=patches, mean_heights=means, start=start)
        plane, start = whole.plane, whole.start
        step = coupling.press(control)
        assert step.force_N == pytest.approx(force, rel=1e-9)
        # the tables' tolerance of the force, of which the approach takes two thirds (Hertz)
        touch = table_touch(table)
        assert step.approach_mm - touch == pytest.approx(plane.approach - touch, rel=1e-3)
        np.testing.assert_allclose(
            step.patches.pressure_MPa, whole.patch_pressure, atol=3e-3 * whole.patch_pressure.max()
        )
        # untouched patches sink, and under a plane that turns they open (macro model or not)
        assert step.mean_separation_mm == pytest.approx(whole.mean_separation, rel=1e-3)
        if tilt is None:
            largest_turn = max(map(abs, plane.tilt))
            np.testing.assert_allclose(step.tilt, plane.tilt, atol=3e-3 * largest_turn)


def table_touch(table):
    """Return an approach below which nothing is in contact."""
    return min(law.rows.approach[0] for law in table.laws if not law.is_open)


def test_rows_where_a_patch_falls_behind_are_left_out(surface):
    """A plane that turns may leave a patch while it comes nearer."""
    model = micro_model("circular", surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=(2, 1), lengths=surface.lengths)
    whole = WholeSurface(
        model=model, patches=patches, mean_heights=patch_means(surface, patches),
        displacements=lambda pressures: 0.0 * pressures, tilt=None,
    )  # fmt: skip
    approaches = np.linspace(0.1, 0.9, 6) * END
    rows = whole.rows(approaches)
    approach, closure = rows.approach.copy(), rows.closure.copy()
    approach[3, 1], closure[3, 1] = approach[1, 1], closure[1, 1]
    used, counts = replace(rows, approach=approach, closure=closure).from_first_touch()
    assert counts[1] == counts[0] - 1
    assert np.all(np.diff(used.approach[counts[0] :]) > 0.0)
