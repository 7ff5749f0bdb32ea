"""The columns of a history are attributes, a data frame and a table that notebooks show."""

import re
import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from helpers.histories import history_of, load_step

from patchlaw import Scene, run
from patchlaw.geometry import PatchGrid, Regions
from patchlaw.multiscale import History
from patchlaw.multiscale.loading.load_step import COLUMNS, PatchState
from patchlaw.support import InputError

FIRST_COLUMNS = (
    "step", "approach_mm", "force_N", "mean_pressure_MPa", "contact_area_fraction",
    "mean_separation_mm", "contacts", "newton_iterations", "linear_iterations", "wall_s", "reason",
)  # fmt: skip


@pytest.fixture
def history():
    return history_of(
        load_step(
            number, approach_mm=4e-3 * number, force_N=0.5 * number, reason="<CONVERGED>",
            tilt=(1e-3, 2e-3), moment_N_mm=(0.1, 0.2), force_error_N=error,
        )
        for number, error in ((1, None), (2, 0.03))
    )  # fmt: skip


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
    assert shown.startswith("<p>History of 2 load steps: 4 to 8 µm, 0.5 to 1 N</p><table>")
    assert shown.endswith("</table>")
    assert shown.count("<tr>") == 3
    assert "<td>1.000 ± 0.030</td>" in shown


def test_a_history_is_printed_as_the_table(history):
    assert repr(history) == "<History of 2 load steps: 4 to 8 µm, 0.5 to 1 N>"
    line, heading, first, second = str(history).splitlines()
    assert line in repr(history)
    assert heading.startswith("step  approach [µm]      force [N]")
    assert first.split()[:3] == ["1", "4", "0.5"] and "1.000 ± 0.030" in second
    assert str(History(steps=(), patches=history.patches)).strip() == "History without a load step"


def test_an_index_gives_a_load_step_and_a_slice_a_history(history):
    assert history[-1] is history.steps[1]
    falling = replace(history, steps=history.steps[::-1])
    assert falling.unloading.tolist() == [False, True]
    assert falling[1:].unloading.tolist() == [True]  # its first step was fallen to all the same
    assert falling[1:][:].unloading.tolist() == [True]
    assert falling[:1].force_N.tolist() == [1.0] and len(falling[2:]) == 0
    assert history[::2].step.tolist() == [1]
    with pytest.raises(InputError, match=r"-1\): a history goes forward .*a step of 1 or more"):
        history[::-1]
    with pytest.raises(IndexError):
        history[2]


def test_a_load_step_is_printed_with_what_is_known(history):
    step = history[1]
    assert repr(step) == "<LoadStep 2: 8 µm, 1.000 ± 0.030 N>"
    assert re.search(r"^force_error_N +0\.03$", str(step), re.MULTILINE)
    assert "leak" not in str(step)


def test_a_dataset_has_columns_and_patches(history, monkeypatch):
    made = []
    xarray = ModuleType("xarray")
    xarray.Dataset = lambda values, coords, attrs: made.append((values, coords, attrs))
    monkeypatch.setitem(sys.modules, "xarray", xarray)
    rising = np.arange(6.0)
    state = PatchState(closure_mm=rising, pressure_MPa=rising, contact_area_fraction=rising)
    steps = tuple(replace(step, patches=state) for step in history)
    grid = PatchGrid(grid=(3, 2), lengths=(1.0, 1.0))
    replace(history, steps=steps, patches=grid).to_xarray()
    replace(history, steps=steps, patches=Regions(names=tuple("abcdef"))).to_xarray()
    (values, coordinates, _), (of_regions, regions, _) = made
    dimensions, pressure = values["patch_pressure_MPa"]
    assert dimensions == ("step", "ix", "iy") and pressure.shape == (2, 3, 2)
    for index in range(grid.count):
        assert pressure[(1, *grid.unravel(index))] == rising[index]
    assert values["force_N"][0] == ("step",) and values["force_N"][1].tolist() == [0.5, 1.0]
    assert values["force_N"][2] == {"long_name": "Normal force on the plane", "units": "N"}
    assert "leak_mm3_per_s" not in values and coordinates["step"][1].tolist() == [1, 2]
    assert of_regions["patch_closure_mm"][0] == ("step", "region")
    assert regions["region"] == list("abcdef")


def test_datasets_are_those_of_xarray(history):
    pytest.importorskip("xarray")
    made = history.to_xarray()
    assert made.force_N.sel(step=2) == 1.0 and made.force_N.attrs["units"] == "N"


def test_a_dataset_without_xarray_says_what_to_install(history, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"needs xarray"):
        history.to_xarray()


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


def test_a_column_of_before_says_what_it_is_called_now():
    history = history_of(())
    with pytest.raises(AttributeError, match="called 'approach_stiffness_N_per_mm', and contains"):
        _ = history.stiffness_N_per_mm
    with pytest.raises(AttributeError, match=r"no attribute 'stifness'$"):
        _ = history.stifness


def notes_on_bumps(folder, places, load, **sections):
    """Press single heights above a flat face by a plane that is free to tilt; return the notes."""
    heights = np.full((24, 24), -1e-2)
    for place in places:
        heights[place] = 0.0
    np.save(folder / "bumps.npy", heights)
    given = {
        "surface": {"file": str(folder / "bumps.npy"), "lengths": [1.0, 1.0]},
        "load": load | {"steps": 1, "tilt": "free"},
        "block": {"young_modulus": 2e5, "poisson_ratio": 0.3},
        "coupling": {"kind": "analytic"},
        "output": {"check": "none"},
    }
    history = run(Scene.from_dict(given | sections))
    assert history.contacts[0] == len(places)
    return [note for note in history.notes if "rests on cells or patches in one line" in note]


OPPOSITE, AROUND = [(6, 12), (17, 11)], [(4, 4), (19, 5), (11, 20)]
PATCHES = {
    "patches": {"grid": [3, 3]},
    "micro": {"finite_slopes": False},
    "coupling": {"kind": "isolated"},
}


@pytest.mark.long
@pytest.mark.parametrize(("places", "loose"), [(OPPOSITE, 1), (AROUND, 0)])
@pytest.mark.parametrize("sections", [{}, PATCHES], ids=["cells", "patches"])
def test_a_plane_that_nothing_holds_about_a_line_is_said(tmp_path, sections, places, loose):
    """Two bumps opposite each other through the middle, or three around it."""
    assert len(notes_on_bumps(tmp_path, places, {"force": 1e-3}, **sections)) == loose


@pytest.mark.parametrize(("micro", "loose"), [({}, 0), ({"hardness": 50.0}, 1)], ids=str)
def test_cells_that_yield_hold_no_plane(tmp_path, micro, loose):
    """Three bumps bear the hardness under a plane of many tilts; as elastic ones under one."""
    assert len(notes_on_bumps(tmp_path, AROUND, {"approach": 1e-4}, micro=micro)) == loose
