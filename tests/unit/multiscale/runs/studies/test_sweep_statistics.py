"""Statistics of a sweep against numpy on the table of all cases."""

import numpy as np
import pytest

from patchlaw.multiscale.runs.sweep import BINS, NUMBERS, column_statistics


@pytest.fixture
def table():
    """Columns of 40 cases of 3 load steps; one is not measured at the first of them."""
    values = np.random.default_rng(5).lognormal(size=(40, 3, len(NUMBERS)))
    values[:, 0, NUMBERS.index("approach_stiffness_N_per_mm")] = np.nan
    return values


def test_every_number_is_that_of_numpy(table):
    found = column_statistics(table)
    for name in ("force_N", "contact_area_fraction"):
        for step in range(3):
            values = table[:, step, NUMBERS.index(name)]
            expected = {
                "cases": 40, "mean": values.mean(), "deviation": values.std(ddof=1),
                "smallest": values.min(), "low": np.quantile(values, 0.05),
                "median": np.median(values), "high": np.quantile(values, 0.95),
                "largest": values.max(),
            }  # fmt: skip
            for field, value in expected.items():  # sums of 40 numbers in another order
                assert found.of(name, field)[step] == pytest.approx(value, rel=1e-14), field


def test_histograms_are_those_of_numpy(table):
    counts = column_statistics(table).histograms[1, NUMBERS.index("force_N")]
    expected, _ = np.histogram(table[:, 1, NUMBERS.index("force_N")], bins=BINS)
    np.testing.assert_array_equal(counts, expected)


def test_what_was_not_measured_does_not_count(table):
    found = column_statistics(table)
    assert found.of("approach_stiffness_N_per_mm", "cases").tolist() == [0, 40, 40]
    assert np.isnan(found.of("approach_stiffness_N_per_mm", "mean")).tolist() == [
        True,
        False,
        False,
    ]


def test_one_case_has_no_deviation_and_none_has_no_step(table):
    alone = column_statistics(table[:1])
    assert alone.of("force_N", "mean").tolist() == table[0, :, NUMBERS.index("force_N")].tolist()
    assert np.isnan(alone.of("force_N", "deviation")).all()
    assert column_statistics(np.empty((0, 0, len(NUMBERS)))).values.shape[0] == 0
