"""The columns of a history are attributes, a data frame and a table that notebooks show."""

import sys
from types import ModuleType

import numpy as np
import pytest

from geometry.patches import PatchGrid
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.results.history import COLUMNS, History

FIRST_COLUMNS = (
    "step", "approach_mm", "force_N", "mean_pressure_MPa", "contact_area_fraction",
    "mean_separation_mm", "contacts", "newton_iterations", "linear_iterations", "wall_s", "reason",
)  # fmt: skip


@pytest.fixture
def history():
    ones = np.ones(1)
    state = PatchState(closure_mm=ones, pressure_MPa=ones, contact_area_fraction=ones)
    steps = [
        LoadStep(
            step=number, approach_mm=4e-3 * number, force_N=0.5 * number, mean_pressure_MPa=0.5,
            contact_area_fraction=0.01, mean_separation_mm=0.02, contacts=3, newton_iterations=4,
            linear_iterations=5, wall_s=0.25, reason="<CONVERGED>", patches=state,
            tilt=(1e-3, 2e-3), moment_N_mm=(0.1, 0.2), force_error_N=error,
        )
        for number, error in ((1, None), (2, 0.03))
    ]  # fmt: skip
    return History(steps=tuple(steps), patches=PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))


def test_columns_of_the_file_stay_in_their_order():
    assert tuple(column.name for column in COLUMNS)[: len(FIRST_COLUMNS)] == FIRST_COLUMNS


def test_every_column_is_an_attribute_with_documentation(history):
    for column in COLUMNS:
        assert column.name in dir(history)
        assert len(getattr(history, column.name)) == 2
        assert getattr(History, column.name).__doc__.endswith(".")
    assert history.tilt_y.tolist() == [2e-3, 2e-3]
    assert history.moment_x_N_mm.tolist() == [0.1, 0.1]
    assert np.isnan(history.force_error_N[0]) and history.force_error_N[1] == 0.03
    assert History.force_N.__doc__ == "Normal force on the plane [N]."


def test_table_shows_values_with_their_errors(history):
    header, rows = history.table()
    assert header[:3] == ["step", "approach [µm]", "force [N]"]
    assert rows[0][:3] == ("1", "4", "0.5")
    assert rows[1][2] == "1.000 ± 0.030"


def test_notebooks_show_the_table(history):
    shown = history._repr_html_()
    assert shown.startswith("<table>") and shown.endswith("</table>")
    assert shown.count("<tr>") == 3
    assert "<td>1.000 ± 0.030</td>" in shown


def test_data_frame_has_the_columns_of_the_file(history, monkeypatch):
    pandas = ModuleType("pandas")
    pandas.DataFrame = lambda records: records
    monkeypatch.setitem(sys.modules, "pandas", pandas)
    records = history.to_dataframe()
    assert all(list(record) == [column.name for column in COLUMNS] for record in records)
    assert [record["force_N"] for record in records] == [0.5, 1.0]


def test_data_frame_without_pandas_says_what_to_install(history, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"needs pandas .*`records` gives the same rows"):
        history.to_dataframe()
