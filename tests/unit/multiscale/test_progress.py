"""What a run is at is shown: by a line for each tenth under mpirun, by a text, in a notebook."""

import sys
from types import SimpleNamespace

import numpy as np

from patchlaw.geometry import PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.geometry.rigid_plane import Control
from patchlaw.micro import micro_model
from patchlaw.multiscale import console
from patchlaw.multiscale.laws.of_patches import consistent_laws, isolated_laws
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.support.parallel import shared

LOADS = LoadHistory(approach=(8e-3,), steps=4, tilt=(0.0, 0.0))
STEP = SimpleNamespace(step=1, approach_mm=0.008, force_N=1234.5, wall_s=7.0)


def shown_on(rank, capsys):
    with console.run_progress(SimpleNamespace(rank=rank, size=2), LOADS) as (advance, observe):
        observe("block", 0, 0)
        for done in range(1, 98):
            observe("rows of laws", done, 97)
        advance(STEP)
    return capsys.readouterr().out.splitlines()


def test_a_line_for_each_tenth_under_mpirun(capsys):
    *tenths, step = shown_on(0, capsys)
    assert [line.split()[3] for line in tenths] == [
        "10", "20", "30", "39", "49", "59", "68", "78", "88", "97",
    ]  # fmt: skip
    assert tenths[0] == "rows of laws: 10 of at most 97"
    assert step == "load step 1/4: 8 µm, 1.234 kN; about 21 s left"


def test_other_ranks_are_silent(capsys):
    assert shown_on(1, capsys) == []


def test_a_text_for_all_that_is_counted():
    texts = []
    observe = console.counting(texts.append)
    observe("block", 0, 0)
    observe("laws of patches", 3, 16)
    assert texts == ["block", "laws of patches: 3 of at most 16"]


def test_a_notebook_shows_one_line_that_changes(monkeypatch, capsys):
    shown = []
    line = SimpleNamespace(update=lambda content, raw: shown.append(content))
    display = SimpleNamespace(display=lambda content, raw, display_id: line)
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=None), display=display)
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    with console.run_progress(None, LOADS) as (advance, observe):
        observe("set-up & body", 0, 0)
        advance(STEP)
    assert [one["text/plain"] for one in shown] == [
        "set-up & body",
        "load step 1/4: 8 µm, 1.234 kN; about 21 s left",
    ]
    assert shown[0]["text/html"] == "<div>set-up &amp; body</div>"
    with console.following(SimpleNamespace(rank=1, size=2)) as (begun, _):
        begun("other ranks are silent")
    assert len(shown) == 2 and not capsys.readouterr().out


def test_shared_tasks_are_counted_over_all_ranks():
    told = []
    shared(None, 4, lambda index: index, observe=told.append)
    assert told == [1, 2, 3, 4]
    del told[:]
    # of three ranks this one does the tasks 0, 3, 6

    def allgather(mine):
        assert mine == ([0, 3, 6], None)
        return [mine, ([1, 4], None), ([2, 5], None)]

    done = SimpleNamespace(Test=lambda: True)
    ranks = SimpleNamespace(rank=0, size=3, allgather=allgather, Ibarrier=lambda: done)
    assert shared(ranks, 7, lambda index: index, observe=told.append) == list(range(7))
    assert told == [3, 6, 7]


def test_laws_say_how_many_rows_and_patches_are_done():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    surface = synthesise(spectrum, grid=(32, 32), lengths=(1.0, 1.0))
    model = micro_model("circular-independent", surface, contact_modulus=4000.0)
    patches = PatchGrid(grid=(2, 2), lengths=surface.lengths)
    means, told = patch_means(surface, patches), []

    def observe(*what):
        told.append(what)

    largest = Control(approach=9e-3, tilt=(0.0, 0.0))
    consistent_laws(
        model, patches, mean_heights=means, largest=largest, most_rows=97, observe=observe
    )
    rows = [done for _, done, _ in told]
    assert {(what, most) for what, _, most in told} == {("rows of laws", 97)}
    assert rows == sorted(set(rows)) and rows[0] <= 2 and 17 <= rows[-1] <= 97
    del told[:]
    ends = np.full(4, 9e-3)
    isolated_laws(model, patches, mean_heights=means, closure_ends=ends, observe=observe)
    assert told == [("laws of patches", done, 4) for done in (1, 2, 3, 4)]
