"""A half-space pressed through consistent laws against the whole rough surface."""

import numpy as np
import pytest
from helpers.along import respond
from scipy.optimize import root

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import influence_matrix, micro_model
from patchlaw.multiscale import PatchLaws, consistent_laws

MODULUS = 4000.0
TOLERANCE = 1e-3
END = 10e-3


def rough(seed, cells=64):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def table_of(surface, patches, name="half-space", end=END, tilt=(0.0, 0.0), **given):
    model = micro_model(name, surface, contact_modulus=MODULUS)
    means = patch_means(surface, patches)
    largest = Control(approach=end, tilt=tilt)
    given = {"largest": largest, "tolerance": TOLERANCE} | given
    return model, means, consistent_laws(model, patches, mean_heights=means, **given)


def macro_force(table, distance):
    """Solve c_i(s_i) + Σ Λ_ij p_j(s_j) / (π E*) = d_i by another solver than the project's."""
    laws, matrix = PatchLaws(table.laws), influence_matrix(table.patches) / (np.pi * MODULUS)

    def miss(s):
        point = laws.along(s)
        jacobian = np.diag(point.dclosure) + matrix * point.dpressure
        return (point.closure + matrix @ point.pressure - distance) / END, jacobian / END

    # away from the solution at first, so that there is something to find
    found = root(miss, distance - 0.1 * END, jac=True, tol=1e-12)
    assert np.abs(found.fun).max() < 1e-9
    return laws.along(found.x).pressure.sum() * table.patches.area


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "count"),
    [("half-space", count) for count in (1, 4, 16)] + [("elliptic", 1), ("elliptic", 8)],
)
def test_force_of_the_whole_surface(name, count):
    surface = rough(1)
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    model, means, table = table_of(surface, patches, name)
    law = max(table.laws, key=lambda law: len(law.rows))
    rows = law.rows.approach[[-1, len(law.rows) // 2]]
    between = np.random.default_rng(3).uniform(0.1 * END, END, 5)
    asked = np.sort(np.append(rows, between))
    forces = respond(model, asked, patches=patches, mean_heights=means).force
    for approach, force in zip(asked, forces, strict=True):
        # at rows the identity c_i = δ − Σ Λ p; between them what the table promises, up to kinks
        allowed = 2e-6 if approach in rows else 1.5 * table.force_error
        distance = np.full(patches.count, approach)
        assert macro_force(table, distance) == pytest.approx(force, rel=allowed)


@pytest.mark.slow
def test_stated_error_bounds_the_force_between_rows():
    """On fresh surfaces the stated error is what extra contact problems find, or a little more."""
    rng, ratios = np.random.default_rng(2026), []
    for _ in range(8):
        spectrum = Spectrum(
            hurst=rng.uniform(0.5, 0.95),
            waves=(2, int(rng.choice([8, 10, 20]))),
            rms_slope=rng.uniform(0.08, 0.25),
            seed=int(rng.integers(1e6)),
        )
        surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
        count, end = int(rng.choice([1, 4, 8])), rng.uniform(4e-3, 9e-3)
        patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
        model, means, table = table_of(surface, patches, end=end, tolerance=3e-3)
        approach = (
            end * np.sort(np.append(rng.uniform(0.1, 1.0, 30) ** 2, rng.uniform(size=20)))[::2]
        )
        forces = respond(model, [*approach, end], patches=patches, mean_heights=means).force
        made = [macro_force(table, np.full(patches.count, each)) for each in approach]
        # errors of smaller loads are relative to 3 % of the largest
        wrong = np.abs(made - forces[:-1]) / np.maximum(forces[:-1], 0.03 * forces[-1])
        ratios.append(wrong.max() / table.force_error)
    # kinks that no row has met may err more
    assert np.mean(np.array(ratios) <= 1.5) >= 0.95
    assert 0.2 < np.median(ratios) < 1.0


def test_no_more_rows_than_allowed():
    surface = rough(2)
    patches = PatchGrid(grid=(4, 4), lengths=surface.lengths)
    _, _, few = table_of(surface, patches, tolerance=1e-6, most_rows=40)
    _, _, more = table_of(surface, patches, tolerance=1e-6, most_rows=120)
    assert max(len(law.rows) for law in few.laws) <= 40
    assert max(len(law.rows) for law in more.laws) <= 120
    assert 1e-6 < more.force_error < 0.5 * few.force_error


@pytest.mark.parametrize(
    ("seed", "count", "allowed"), [pytest.param(1, 8, 0.03, marks=pytest.mark.long), (2, 16, 0.01)]
)
def test_tilted_plane(seed, count, allowed):
    """Laws of a level plane serve a plane tilted by 10 µm/mm: patches see little of the tilt."""
    # 8 × 8 cells to the smallest patch: with 4 × 4 the second seed misses by 1.1 % instead of 0.5 %
    surface, tilt = rough(seed, cells=128), (10e-3, 0.0)
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    model, means, table = table_of(surface, patches, end=14e-3, tolerance=1e-2)
    force = respond(model, [8e-3], patches=patches, mean_heights=means, tilt=tilt).force[0]
    distance = 8e-3 + tilt[0] * (patches.centres[:, 0] - 0.5)
    assert macro_force(table, distance) == pytest.approx(force, rel=allowed)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "count"), [("half-space", 1), ("half-space", 8), ("elliptic", 2), ("elliptic", 8)]
)
def test_laws_made_under_the_tilt(name, count):
    """They share the load as the tilted plane does: no patch is too large."""
    surface, tilt = rough(2), (10e-3, -4e-3)
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    model, means, table = table_of(surface, patches, name, tilt=tilt)
    for approach in (3e-3, 8e-3):
        force = respond(model, [approach], patches=patches, mean_heights=means, tilt=tilt).force[0]
        distance = approach + (patches.centres - 0.5) @ tilt
        # between rows: what the table promises half-way, and up to twice as much elsewhere
        assert macro_force(table, distance) == pytest.approx(force, rel=2 * TOLERANCE)
