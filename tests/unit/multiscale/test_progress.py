"""What a run is at is shown: by lines in logs and under mpirun, by a text, in a notebook."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import micro_model
from patchlaw.multiscale import LoadHistory, consistent_laws, console, isolated_laws
from patchlaw.support import shared
from patchlaw.support.readable import WHOLE

LOADS = LoadHistory(approach=(8e-3,), steps=4, tilt=(0.0, 0.0))
STEP = SimpleNamespace(step=1, approach_mm=0.008, force_N=1234.5)


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """A clock that stands still unless it is set, and a time of day."""
    now = SimpleNamespace(value=0.0)
    monkeypatch.setattr(console.time, "monotonic", lambda: now.value)
    monkeypatch.setattr(console.time, "strftime", lambda form: "12:00:00")
    return now


def shown_to(comm, clock, capsys, done=0):
    with console.run_progress(comm, LOADS, done) as (advance, observe):
        observe("block")
        for row in range(1, 98):
            observe("rows of laws", row, 97)
        observe("load steps")
        observe("contact")
        observe("load steps")  # after what happened within
        clock.value += 7.0
        advance(SimpleNamespace(**vars(STEP) | {"step": 1 + done}))
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("comm", [None, SimpleNamespace(rank=0, size=2)])
def test_lines_where_no_terminal_is(comm, clock, capsys):
    first, *tenths, begun, step = shown_to(comm, clock, capsys)
    assert first == "12:00:00 block"
    assert [line.split()[4] for line in tenths] == [
        "10", "20", "30", "39", "49", "59", "68", "78", "88", "97",
    ]  # fmt: skip
    assert tenths[0] == "12:00:00 rows of laws: 10 of at most 97; about 0 s left"
    assert begun == "12:00:00 load steps"
    assert step == "12:00:00 load step 1/4: 8 µm, 1.234 kN; about 21 s left"


def test_a_resumed_run_counts_its_own_load_steps(clock, capsys):
    assert shown_to(None, clock, capsys, done=1)[-1].endswith(
        "step 2/4: 8 µm, 1.234 kN; about 14 s left"
    )


def test_other_ranks_are_silent(clock, capsys):
    assert shown_to(SimpleNamespace(rank=1, size=2), clock, capsys) == []


def test_progress_as_it_is_asked_for(clock, capsys):
    with console.printing(quiet=False, progress="none"):
        assert shown_to(None, clock, capsys) == []
    with console.printing(quiet=True, progress="lines"):
        assert shown_to(None, clock, capsys) == []
    with console.printing(quiet=False, progress="bar"):  # by escape codes, in one line
        with console.following(None) as (at, ended):
            at("block")
            ended("one is done")
    shown = capsys.readouterr().out
    assert "one is done" in shown and "\x1b[" in shown and "12:00:00" not in shown


def test_the_pace_tells_what_is_left(clock):
    said = console.Progress(lambda text: None)
    left = []
    for done, clock.value in enumerate((100.0, 130.0, 140.0, 145.0, 146.0)):
        left.append(said.left("steps", done, 4))
    assert left == [
        "", "; about 1 min 30 s left", "; about 40 s left", "; about 15 s left", "",
    ]  # fmt: skip
    clock.value = 1000.0
    assert said.left("steps", 0, 2) == ""  # begins again
    clock.value = 1003.0
    assert said.left("steps", 1, 2) == "; about 3 s left"
    assert said.left("unknown", 3, 0) == ""
    for done, clock.value, after in ((1, 2000.0, ""), (2, 2001.0, "; about 2 s left")):
        assert said.left("rows", done, 4) == after
    for done, clock.value, after in ((1, 3000.0, ""), (2, 3001.0, "; about 2 s left")):
        assert said.left("rows", done, 4) == after  # those of other laws


def test_what_is_measured_beside_a_load_step_is_told_where_it_takes_long(clock):
    """In logs, which a short check at every load step would fill."""
    texts = []
    observe = console.Progress(texts.append, seldom=True)
    for done, clock.value in ((0, 0.0), (20, 1.0), (30, 1.2), (0, 10.0), (20, 15.0), (65, 30.0)):
        observe("check", done, WHOLE)
    assert texts == ["check: 20 %; about 20 s left", "check: 65 %; about 10.8 s left"]


def test_a_hundred_parts_are_a_count():
    """They are told of however soon they are done, and not in percent."""
    texts = []
    observe = console.Progress(texts.append, seldom=True)
    observe("rows of laws", 0, 100)
    observe("rows of laws", 50, 100)
    assert texts == ["rows of laws: 50 of at most 100; about 0 s left"]


def test_a_text_for_all_that_is_counted():
    texts = []
    observe = console.Progress(texts.append)
    for what in (("block",), ("laws of patches", 3, 16), ("contact",), ("block",)):
        observe(*what)
    assert texts == ["block", "laws of patches: 3 of at most 16"]


def test_a_notebook_shows_one_line_that_changes(monkeypatch, clock, capsys):
    shown = []
    line = SimpleNamespace(update=lambda content, raw: shown.append(content))
    display = SimpleNamespace(display=lambda content, raw, display_id: line)
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=None), display=display)
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    with console.run_progress(None, LOADS) as (advance, observe):
        observe("set-up & body")
        observe("load steps")
        clock.value = 7.0
        advance(STEP)
    assert [one["text/plain"] for one in shown] == [
        "set-up & body",
        "load steps",
        "load step 1/4: 8 µm, 1.234 kN; about 21 s left",
    ]
    assert shown[0]["text/html"] == "<div>set-up &amp; body</div>"
    with console.following(SimpleNamespace(rank=1, size=2)) as (at, _):
        at("other ranks are silent")
    assert len(shown) == 3 and not capsys.readouterr().out


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


def test_names_of_files_are_shown_as_they_are(capsys):
    console.say(None, "a:fire:b[red]c.toml")
    console.show_pairs(None, [("file", "d:fire:e[red]f")])
    console.show_notes(None, ["g:fire:h[red]i"])
    shown = capsys.readouterr().out
    assert all(
        text in shown for text in ("a:fire:b[red]c.toml", "d:fire:e[red]f", "g:fire:h[red]i")
    )
