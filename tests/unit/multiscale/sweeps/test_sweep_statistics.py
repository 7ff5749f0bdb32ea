"""Statistics of a sweep against numpy on the table of all cases."""

import numpy as np
import pytest

from multiscale.results.history import COLUMNS
from multiscale.sweeps.statistics import BINS, NUMBERS, column_statistics

NAMES = [column.name for column in COLUMNS]


@pytest.fixture
def cases():
    """Rows of 40 cases of 3 load steps; one column is not measured at the first of them."""
    draw = np.random.default_rng(5).lognormal(size=(40, 3, len(NAMES)))
    found = {}
    for number, steps in enumerate(draw):
        rows = [dict(zip(NAMES, row.tolist(), strict=True)) for row in steps]
        for step, row in enumerate(rows, start=1):
            row |= {"step": step, "reason": "CONVERGED"}
        rows[0]["stiffness_N_per_mm"] = None
        found[number] = [list(row.values()) for row in rows]
    return found


def table(cases, name, step):
    return np.array([rows[step - 1][NAMES.index(name)] for rows in cases.values()])


def test_every_number_is_that_of_numpy(cases):
    (found,) = column_statistics(None, cases, [range(40)])
    for name in ("force_N", "contact_area_fraction"):
        for step in (1, 2, 3):
            values = table(cases, name, step)
            expected = {
                "cases": 40, "mean": values.mean(), "deviation": values.std(ddof=1),
                "smallest": values.min(), "low": np.quantile(values, 0.05),
                "median": np.median(values), "high": np.quantile(values, 0.95),
                "largest": values.max(),
            }  # fmt: skip
            for field, value in expected.items():  # the same sums in the same order
                assert found.of(name, field)[step - 1] == pytest.approx(value, rel=1e-15), field


def test_histograms_are_those_of_numpy(cases):
    (found,) = column_statistics(None, cases, [range(40)])
    counts, borders = found.histogram("force_N", 2)
    expected, edges = np.histogram(table(cases, "force_N", 2), bins=BINS)
    np.testing.assert_array_equal(counts, expected)
    np.testing.assert_allclose(borders, edges, rtol=1e-15)


def test_what_was_not_measured_does_not_count(cases):
    (found,) = column_statistics(None, cases, [range(40)])
    assert found.of("stiffness_N_per_mm", "cases").tolist() == [0, 40, 40]
    assert np.isnan(found.of("stiffness_N_per_mm", "mean")).tolist() == [True, False, False]


def test_ensembles_are_apart_and_the_order_of_cases_does_not_matter(cases):
    turned = dict(reversed(cases.items()))
    few, rest = column_statistics(None, turned, [range(5), range(5, 40)])
    (again,) = column_statistics(None, {n: cases[n] for n in range(5)}, [range(5)])
    np.testing.assert_array_equal(few.values, again.values)
    assert rest.of("force_N", "cases").tolist() == [35, 35, 35]
    assert few.values.shape == (3, len(NUMBERS), 8)


def test_nothing_done_has_no_statistics():
    (found,) = column_statistics(None, {}, [range(3)])
    assert found.values.shape[0] == 0
