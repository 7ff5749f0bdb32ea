"""A history read back from its folder is the one that was written."""

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Scene, read_contact, read_history, run
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.results.files import csv_rows
from patchlaw.support import InputError
from patchlaw.support.files import csv_text

TILTED = ["load.tilt=[1e-3, 0.0]", "output.check=last"]


@pytest.fixture
def folder(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(SMALL_SCENE)
    assert main(["run", str(file), "--out", str(tmp_path / "out"), "--set", *TILTED]) == 0
    return tmp_path / "out"


def test_history_is_the_one_that_was_written(folder, tmp_path):
    found, made = read_history(folder), run(Scene.load(tmp_path / "scene.toml", TILTED))
    for column in COLUMNS:
        if column.name != "wall_s":
            np.testing.assert_array_equal(getattr(found, column.name), getattr(made, column.name))
    np.testing.assert_array_equal(found.patch_pressure_MPa, made.patch_pressure_MPa)
    np.testing.assert_array_equal(found.closure_mm, made.closure_mm)
    assert found.patches == made.patches
    assert found.notes == made.notes
    assert read_history(str(folder)).seconds.keys() == found.seconds.keys()


@pytest.mark.parametrize("name", ["history.csv", "patches.csv", "provenance.json"])
def test_a_missing_file_is_named(folder, name):
    (folder / name).unlink()
    with pytest.raises(InputError, match=name):
        read_history(folder)


def test_tables_that_do_not_fit_are_no_result(folder):
    lines = (folder / "patches.csv").read_text().splitlines()
    (folder / "patches.csv").write_text("\n".join([*lines[:-1], ""]))
    with pytest.raises(InputError, match=r"patches.csv: has .* of the .* rows"):
        read_history(folder)


@pytest.mark.long
@pytest.mark.parametrize("name", ["history.csv", "patches.csv", "contacts.csv"])
def test_a_table_that_is_cut_anywhere_is_refused(folder, name):
    """A cut within a number leaves another number, and one within a row other columns."""
    content = (folder / name).read_bytes()
    last = content.rstrip().rfind(b"\n")  # every byte of the last two lines, and some before
    before = content[:last].rfind(b"\n")
    for length in [*range(0, before, max(before // 50, 1)), *range(before, len(content))]:
        (folder / name).write_bytes(content[:length])
        if content[length:].strip():
            with pytest.raises(InputError, match=name):
                read_contact(folder)
    (folder / name).write_bytes(content)
    assert read_contact(folder).step.tolist() == [read_history(folder).step[-1]]


def test_what_cells_that_yield_scatter_is_read_from_older_runs(folder):
    """Their only error of the stiffness against the approach was that by scatter."""
    path, name = folder / "history.csv", "approach_stiffness_error_N_per_mm"
    rows, stiffness = csv_rows(path), read_history(folder).approach_stiffness_N_per_mm
    for row, error in zip(rows, 0.03 * stiffness, strict=True):
        del row["stiffness_scatter"]
        row[name] = repr(float(error))
    path.write_text(csv_text(list(rows[0]), [list(row.values()) for row in rows]))
    np.testing.assert_allclose(read_history(folder).stiffness_scatter, 0.03, rtol=1e-12)


def test_curves_are_drawn_with_their_label(folder):
    figure = read_history(folder).plot("mine")
    force, area, gap = figure.axes
    assert force.get_legend_handles_labels()[1] == ["mine"]
    found = read_history(folder)
    np.testing.assert_allclose(force.lines[0].get_ydata(), found.mean_pressure_MPa)
    np.testing.assert_allclose(area.lines[0].get_ydata(), 100 * found.contact_area_fraction)
    np.testing.assert_allclose(gap.lines[0].get_xdata(), 1e3 * found.mean_separation_mm)
