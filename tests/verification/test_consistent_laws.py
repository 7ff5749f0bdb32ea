"""A half-space pressed through consistent laws against the whole rough surface."""

import numpy as np
import pytest
from scipy.optimize import root

from geometry import PatchGrid, Spectrum, patch_means, synthesise
from micro import micro_model
from micro.influence import influence_matrix
from multiscale.consistent import consistent_laws
from multiscale.laws import PatchLaws

MODULUS = 4000.0
TOLERANCE = 1e-3
END = 10e-3


def rough(seed, cells=64):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def table_of(surface, patches, end=END, tolerance=TOLERANCE):
    model = micro_model("half-space", surface, contact_modulus=MODULUS)
    means = patch_means(surface, patches)
    table = consistent_laws(
        model, patches, mean_heights=means, approach_end=end, tolerance=tolerance
    )
    return model, means, table


def macro_force(table, distance):
    """Solve c_i(s_i) + Σ Λ_ij p_j(s_j) / (π E*) = d_i densely for s."""
    laws, matrix = PatchLaws(table.laws), influence_matrix(table.patches) / (np.pi * MODULUS)

    def miss(s):
        point = laws.along(s)
        jacobian = np.diag(point.dclosure) + matrix * point.dpressure
        return (point.closure + matrix @ point.pressure - distance) / END, jacobian / END

    # away from the solution at first, so that the oracle has something to find
    found = root(miss, distance - 0.1 * END, jac=True, tol=1e-12)
    assert np.abs(found.fun).max() < 1e-9
    return laws.along(found.x).pressure.sum() * table.patches.area


@pytest.mark.parametrize("count", [1, 2, 4, 8, 16])
def test_force_of_the_whole_surface(count):
    surface = rough(1)
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    model, means, table = table_of(surface, patches)
    law = max(table.laws, key=lambda law: law.approach.size)
    rows = law.approach[[-1, len(law.approach) // 2]]
    between = 0.5 * (law.approach[-1] + law.approach[-2])
    asked = np.sort(np.append(rows, between))
    forces = model.respond(asked, patches=patches, mean_heights=means).force
    for approach, force in zip(asked, forces, strict=True):
        # at rows the identity c_i = δ − Σ Λ p; between them what the table promises
        allowed = 1e-6 if approach in rows else TOLERANCE
        distance = np.full(patches.count, approach)
        assert macro_force(table, distance) == pytest.approx(force, rel=allowed)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("count", "allowed"), [(8, 0.03), (16, 0.01)])
def test_tilted_plane(seed, count, allowed):
    """Laws of a level plane serve a plane tilted by 10 µm/mm: patches see little of the tilt."""
    # 8 × 8 cells to the smallest patch: with 4 × 4 the second seed misses by 1.1 % instead of 0.5 %
    surface, tilt = rough(seed, cells=128), (10e-3, 0.0)
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    model, means, table = table_of(surface, patches, end=14e-3, tolerance=1e-2)
    force = model.respond([8e-3], patches=patches, mean_heights=means, tilt=tilt).force[0]
    distance = 8e-3 + tilt[0] * (patches.centres[:, 0] - 0.5)
    assert macro_force(table, distance) == pytest.approx(force, rel=allowed)
