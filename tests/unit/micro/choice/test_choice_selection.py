"""The choice among micro models: promises kept, checks made, reasons told."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import PatchGrid, Spectrum, Surface, synthesise
from geometry.errors import InputError, NotConverged
from micro import AsperityModel, HalfSpaceModel, choose

WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def rough(seed: int, grid: int = 64, top: int = 6) -> Surface:
    spectrum = Spectrum(hurst=0.8, waves=(2, top), rms_slope=0.2, seed=seed)
    made = synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0))
    return Surface(heights=made.heights, lengths=made.lengths)


def force(model, approaches):
    return model.respond(approaches, patches=WHOLE, mean_heights=[0.0]).force


def fine(surface, cells):
    return HalfSpaceModel(surface, contact_modulus=1.0).resampled((cells, cells))


@pytest.mark.parametrize(
    ("grid", "hurst", "band"),
    [
        (64, 0.8, {"waves": (2, 6)}),
        (64, 0.4, {"waves": (1, 8)}),
        (48, 0.95, {"waves_x": (2, 3), "waves_y": (2, 6)}),
        (96, 0.6, {"waves": (4, 12)}),
    ],
)
def test_promised_tolerances_are_kept(grid, hurst, band):
    spectrum = Spectrum(hurst=hurst, rms_slope=0.1, seed=901, **band)
    made = synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0))
    surface = Surface(heights=made.heights, lengths=made.lengths)
    approach = 1.5 * surface.heights.std()
    loads = [0.5 * approach, approach]
    truth = force(fine(surface, 4 * grid), loads)  # within 0.08 % of what grids tend to
    for tolerance in (0.03, 0.05, 0.1):
        choice = choose(surface, contact_modulus=1.0, approach=approach, tolerance=tolerance)
        assert choice.taken.expected_error <= tolerance
        assert choice.model.reference_height == surface.highest
        np.testing.assert_allclose(force(choice.model, loads), truth, rtol=tolerance)


def test_a_looser_tolerance_costs_no_more():
    costs = [
        choose(rough(3), contact_modulus=1.0, approach=0.02, tolerance=t).taken.cost
        for t in (0.02, 0.05, 0.1, 0.4)
    ]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] > costs[-1]


def test_the_cheapest_that_promises_is_taken():
    choice = choose(rough(5), contact_modulus=1.0, approach=0.02, tolerance=0.1)
    good = [c for c in choice.candidates if c.expected_error <= 0.1]
    assert choice.taken.cost == min(c.cost for c in good)
    assert "the cheapest that promises the tolerance of 10 %;" in choice.sentence


def test_the_check_is_the_difference_from_the_surfaces_own_grid():
    surface = rough(5, grid=96)
    choice = choose(surface, contact_modulus=1.0, approach=0.02, tolerance=0.2)
    own = HalfSpaceModel(surface=surface, contact_modulus=1.0)
    expected = abs(force(choice.model, [0.01])[0] / force(own, [0.01])[0] - 1.0)
    assert choice.taken.checked_error == pytest.approx(expected, abs=1e-12)
    assert (
        f"{100 * expected:.2g} % from the half-space solution on 96 × 96 cells" in choice.sentence
    )


def test_the_surfaces_own_grid_is_checked_against_a_finer_one():
    surface, own = rough(5), "half-space on 64 × 64 cells"
    choice = choose(surface, contact_modulus=1.0, approach=0.02, tolerance=0.2, label=own)
    expected = abs(force(choice.model, [0.01])[0] / force(fine(surface, 96), [0.01])[0] - 1.0)
    assert choice.taken.label == own
    assert 0.0 < choice.taken.checked_error == pytest.approx(expected, abs=1e-12)


def test_a_failed_check_gives_way_to_the_next_and_says_so(monkeypatch):
    # A bound far too good promises everything; the check refuses what asperities give.
    monkeypatch.setattr("micro.choice.models.contact_error", lambda kind, at: 1e-5)
    choice = choose(rough(5), contact_modulus=1.0, approach=0.02, tolerance=0.005)
    assert "circular-independent differs by" in choice.sentence
    assert "none that was checked keeps" in choice.sentence
    assert choice.taken.label.startswith("half-space")  # of those that did not fail
    rest = [c.expected_error for c in choice.candidates if c.expected_error > 1e-5]
    assert choice.taken.expected_error == min(rest)


def test_a_model_without_a_solution_gives_way(monkeypatch):
    def stuck(*_, **__):
        raise NotConverged("nothing", reason="STUCK", iterations=1, remedy="none")

    monkeypatch.setattr("micro.choice.models.contact_error", lambda kind, at: 1e-5)
    monkeypatch.setattr(AsperityModel, "respond", stuck)
    choice = choose(rough(5), contact_modulus=1.0, approach=0.02, tolerance=0.1)
    assert "circular-independent has no solution when checked" in choice.sentence


def test_says_when_nothing_promises_the_tolerance():
    choice = choose(rough(5), contact_modulus=1.0, approach=0.002, tolerance=1e-5)
    assert (
        "the least expected error, for none promises the tolerance of 0.001 %;" in choice.sentence
    )
    assert choice.taken.expected_error == min(c.expected_error for c in choice.candidates)


def test_coarse_grids_must_resolve_the_patches():
    patches = PatchGrid(grid=(8, 8), lengths=(1.0, 1.0))
    choice = choose(rough(5), contact_modulus=1.0, approach=0.02, tolerance=0.4, patches=patches)
    assert "half-space on 48 × 48 cells" not in [c.label for c in choice.candidates]
    assert "half-space on 64 × 64 cells" in [c.label for c in choice.candidates]


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"approach": 0.0}, "largest approach is out of range"),
        ({"tolerance": 0.0}, "tolerance is out of range"),
        ({"tolerance": 0.5}, "tolerance is out of range"),
        ({"solutions": 0}, "number of solutions is out of range"),
    ],
)
def test_refuses(options, problem):
    with pytest.raises(InputError, match=problem):
        choose(rough(5), contact_modulus=1.0, **{"approach": 0.01} | options)


def test_an_earlier_choice_is_taken_again():
    surface = rough(1)
    first = choose(surface, contact_modulus=1.0, approach=0.01)
    other = next(c.label for c in first.candidates if c.label != first.taken.label)
    again = choose(surface, contact_modulus=1.0, approach=0.01, label=other)
    assert again.taken.label == other
    with pytest.raises(InputError, match="'a better one': is no micro model here"):
        choose(surface, contact_modulus=1.0, approach=0.01, label="a better one")


def test_interacting_asperities_are_left_out_where_their_pairs_do_not_fit(monkeypatch):
    monkeypatch.setattr("micro.interaction.contact_problem.process_memory", lambda: 1e3)
    choice = choose(rough(5, top=20), contact_modulus=1.0, approach=0.02, tolerance=0.3)
    labels = {candidate.label for candidate in choice.candidates}
    assert "circular-independent" in labels and "half-space on 64 × 64 cells" in labels
    assert not labels & {"circular", "elliptic"} and not any("scale" in name for name in labels)
