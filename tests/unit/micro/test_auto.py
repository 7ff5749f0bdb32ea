from __future__ import annotations

import numpy as np
import pytest

from geometry import PatchGrid, Spectrum, Surface, synthesise
from geometry.errors import InputError
from micro import HalfSpaceModel, choose
from micro.auto import cells_per_radius, resampled

WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def rough(seed: int, grid: int = 64) -> Surface:
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.2, seed=seed)
    made = synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0))
    return Surface(heights=made.heights, lengths=made.lengths)


def force(model, approaches):
    return model.respond(approaches, patches=WHOLE, mean_heights=[0.0]).force


@pytest.mark.parametrize("tolerance", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("seed", range(901, 905))
def test_a_promised_tolerance_is_kept(seed, tolerance):
    surface = rough(seed)
    approach = 1.5 * surface.heights.std()
    loads = [0.5 * approach, approach]
    fine = HalfSpaceModel(surface=resampled(surface, (192, 192)), contact_modulus=1.0)
    choice = choose(surface, contact_modulus=1.0, approach=approach, tolerance=tolerance)
    assert choice.taken.expected_error <= tolerance
    # 192² cells are themselves within 0.7 % (largest of auto_study.py), less on these bands.
    np.testing.assert_allclose(force(choice.model, loads), force(fine, loads), rtol=tolerance)


def test_a_looser_tolerance_costs_no_more():
    costs = [
        choose(rough(3), contact_modulus=1.0, approach=0.02, tolerance=t).taken.cost
        for t in (0.01, 0.02, 0.05, 0.1)
    ]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] > costs[-1]


def test_the_check_is_the_error_against_the_surfaces_own_grid():
    surface = rough(5)
    choice = choose(surface, contact_modulus=1.0, approach=0.02, tolerance=0.1)
    own = HalfSpaceModel(surface=surface, contact_modulus=1.0)
    expected = abs(force(choice.model, [0.01])[0] / force(own, [0.01])[0] - 1.0)
    assert choice.checked_error == pytest.approx(expected, abs=1e-12)
    assert f"{expected:.2%}" in choice.sentence


def test_a_failed_check_gives_way_to_the_next_and_says_so(monkeypatch):
    # A bound a hundred times too good promises the coarsest grid, which the check refuses.
    monkeypatch.setattr("micro.auto._GRID_ERROR", 1.5e-3)
    choice = choose(rough(5), contact_modulus=1.0, approach=0.005, tolerance=0.005)
    assert "missed it by its check" in choice.sentence
    assert choice.taken.label != choice.candidates[0].label


def test_says_when_nothing_promises_the_tolerance():
    choice = choose(rough(5), contact_modulus=1.0, approach=0.002, tolerance=1e-4)
    assert "the least there is, above the tolerance" in choice.sentence
    assert choice.taken.expected_error == min(c.expected_error for c in choice.candidates)


def test_coarse_grids_must_resolve_the_patches():
    patches = PatchGrid(grid=(8, 8), lengths=(1.0, 1.0))
    choice = choose(rough(5), contact_modulus=1.0, approach=0.02, tolerance=0.4, patches=patches)
    assert "half-space on 48 × 48 cells" not in [c.label for c in choice.candidates]
    assert "half-space on 64 × 64 cells" in [c.label for c in choice.candidates]


def test_cells_per_radius_of_one_cap():
    x = (np.arange(80) + 0.5) / 80 - 0.5
    cap = Surface(heights=-(x[:, None] ** 2 + x**2), lengths=(1.0, 1.0))
    # The cap of depth h above -r² has the radius sqrt(h): 0.2 mm, 16 cells; pixels count to 2 %.
    assert cells_per_radius(cap, 0.04) == pytest.approx(16.0, rel=0.02)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"approach": 0.0}, "largest approach must be positive"),
        ({"approach": 0.01, "tolerance": 0.0}, "tolerance is out of range"),
        ({"approach": 0.01, "tolerance": 0.5}, "tolerance is out of range"),
    ],
)
def test_refuses(options, problem):
    with pytest.raises(InputError, match=problem):
        choose(rough(5), contact_modulus=1.0, **options)
