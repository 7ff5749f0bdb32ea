"""Files appear whole or not at all."""

import csv
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.histories import load_step

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale import History
from patchlaw.multiscale.console import show_history
from patchlaw.multiscale.loading.load_step import PatchState
from patchlaw.multiscale.results.files import history_files
from patchlaw.multiscale.results.history import PATCH_COLUMNS
from patchlaw.support import NotWritten
from patchlaw.support.files import csv_text, write_text


@pytest.fixture
def history():
    sixths = PatchState(np.arange(6.0) / 3, np.arange(6.0) / 9, np.arange(6.0) / 11)
    steps = (load_step(number, force_N=number / 7, patches=sixths) for number in (1, 2))
    return History(steps=tuple(steps), patches=PatchGrid(grid=(2, 3), lengths=(1.0, 1.0)))


def test_patch_rows_follow_the_flat_index(history):
    rows = list(csv.DictReader(dict(history_files(history))["patches.csv"].splitlines()))
    assert list(rows[0]) == list(PATCH_COLUMNS)
    assert [row["ix"] + row["iy"] for row in rows[:4]] == ["00", "01", "02", "10"]
    assert [float(row["closure_mm"]) for row in rows[:6]] == [i / 3 for i in range(6)]


def test_what_is_not_known_is_empty(tmp_path):
    rows = [(1, None, float("nan"), np.float64("nan")), (2, 0.5, np.float64(0.25), np.int64(3))]
    path = write_text(tmp_path / "a.csv", csv_text(list("abcd"), rows))
    assert path.read_text(encoding="utf-8").split() == ["a,b,c,d", "1,,,", "2,0.5,0.25,3"]
    found = np.genfromtxt(path, delimiter=",", names=True)  # what readers make of it
    assert np.isnan([found[name][0] for name in "bcd"]).all()


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = write_text(tmp_path / "report.html", "old")

    def fail(partial, content):
        partial.write_text("half", encoding="utf-8")
        raise OSError("disk full")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", fail)
        with pytest.raises(NotWritten, match=r"report.html: cannot be written: disk full"):
            write_text(path, "new")
    assert path.read_text(encoding="utf-8") == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_long_history_is_printed_in_part(history, capsys):
    """Ten thousand rows would take the terminal longer than the solution; files have them all."""
    steps = tuple(replace(history.steps[0], step=number) for number in range(1, 1001))
    show_history(None, replace(history, steps=steps))
    told = capsys.readouterr().out.splitlines()
    first = [line.split()[0] for line in told if line.strip()]
    assert "940 more" in " ".join(told)
    rows = [int(word) for word in first if word.isdigit()]
    assert (len(rows), rows[0], rows[-1]) == (60, 1, 1000)
    assert {later - one for one, later in itertools.pairwise(rows)} == {16, 17}
    show_history(None, history)
    assert "more" not in capsys.readouterr().out
