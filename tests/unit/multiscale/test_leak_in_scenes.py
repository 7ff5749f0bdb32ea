"""Scenes that ask what leaks through their gaps: columns, errors, notes, files, refusals."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.resumed_runs import gone_on, ran_past
from scipy.ndimage import maximum_filter

from patchlaw.micro import transport
from patchlaw.micro.transport import gap_flow
from patchlaw.multiscale import History, Run, Scene, make_setup, read_history, run
from patchlaw.multiscale.observers import leak as observer
from patchlaw.multiscale.observers.leak import leak_text
from patchlaw.multiscale.results.figures.observed import leak_figure
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.support import InputError

WATER = {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"]}
NAMES = [
    f"{name}_{direction}{unit}"
    for direction in "xy"
    for name, unit in [
        ("leak", "_mm3_per_s"), ("leak_error", "_mm3_per_s"), ("transmissivity", "_mm3"),
        ("hydraulic_gap", "_mm"), ("flow_factor", ""), ("constriction", "_fraction"),
        ("percolates", ""),
    ]
]  # fmt: skip


def scene(leak=WATER, kind="analytic", **sections):
    spectrum = {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.1, "seed": 1}
    surface = {"spectrum": spectrum, "grid": [32, 48], "lengths": [1.0, 1.5]}
    data = {
        "surface": surface | {"periodic": kind == "analytic"},
        "block": {"young_modulus": 1000.0, "poisson_ratio": 0.3},
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": kind},
        "load": {"force": 36.0, "steps": 4},
        "output": {"check": "all", "figures": False, "report": False, "contact": "all"},
    }
    merged = {name: data.get(name, {}) | section for name, section in sections.items()}
    return Scene.from_dict(data | ({} if leak is None else {"leak": leak}) | merged)


@cache
def ran():
    return run(scene())


def test_every_load_step_has_the_flow_through_its_gaps():
    history = ran()
    for step, record in zip(history, history.contact_records, strict=True):
        gap = np.where(record.pressure_MPa > 0.0, 0.0, np.maximum(record.gap_mm, 0.0))
        for axis, direction in enumerate("xy"):
            flow = gap_flow(gap, (1.0, 1.5), axis=axis, periodic=True)
            along, across = (1.0, 1.5) if axis == 0 else (1.5, 1.0)
            leak = step.leak(direction)
            cubed = leak.transmissivity
            assert cubed == pytest.approx(flow.transmissivity, rel=1e-9)
            # 1 bar is 0.1 MPa, 1 mPa s is 1e-9 MPa s
            rate = leak.rate
            assert rate == pytest.approx(cubed * across / along * 0.1 / 12e-9, rel=1e-12)
            assert leak.hydraulic_gap**3 == pytest.approx(cubed, rel=1e-12)
            assert leak.flow_factor == pytest.approx(flow.flow_factor, rel=1e-6)
            assert leak.percolates == flow.percolates == (rate > 0.0)
            share = leak.constriction
            if flow.percolates:
                assert share == pytest.approx(flow.constriction.share, rel=1e-6)
            else:
                assert share is None
    assert (np.diff(history.leak_x_mm3_per_s) <= 0.0).all()


def test_the_error_is_that_of_coarser_grids_and_next_to_closing_of_wider_gaps():
    """Scenes of the surface on fewer cells find their own contacts, under the same forces."""
    made = scene(micro={"finite_slopes": False})  # which coarser grids take over from the step
    history, coarser = run(made), []
    beside = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], bool)
    for grid in ((16, 24), (8, 12)):
        surface = make_setup(made).parts.surface.on_grid(grid)
        heights = {"heights": surface.heights, "lengths": [1.0, 1.5], "periodic": True}
        coarser.append(run(Scene.from_dict(made.written | {"surface": heights})))
    kinds = set()
    for step, record, *fewer in zip(history, history.contact_records, *coarser, strict=True):
        gap = np.where(record.pressure_MPa > 0.0, 0.0, np.maximum(record.gap_mm, 0.0))
        around = maximum_filter(gap, footprint=beside, mode="wrap")
        beside_contact = (gap == 0.0) | maximum_filter(gap == 0.0, footprint=beside, mode="wrap")
        wide = np.where(beside_contact, 0.5 * (gap + np.maximum(gap, around)), gap)
        for axis, way in enumerate("xy"):
            leak = step.leak(way)
            own, half, quarter = (abs(one.leak(way).rate) for one in (step, *fewer))
            closing = min(own, half, quarter) == 0.0 or not 1 / 3 < own / half < 3.0
            own_gap, half_gap, quarter_gap = np.cbrt([own, half, quarter])
            change = abs(own_gap - half_gap)
            if closing:  # coarser grids tell less than wider gaps
                wider = gap_flow(wide, (1.0, 1.5), axis=axis, periodic=True)
                grown = np.cbrt(abs(wider.rate(0.1, 1e-9))) - own_gap
                off = max(0.4 * change, 0.6 * grown, 0.05 * max(own_gap, half_gap))
            else:
                off = max(1.2 * change, 0.25 * abs(half_gap - quarter_gap), 0.01 * own_gap)
            expected = (own_gap + off) ** 3 - own
            assert leak.error == pytest.approx(expected, rel=1e-4)
            kinds.add((closing, own > 0.0))
    assert kinds >= {(False, True), (True, True)}


def test_errors_are_measured_at_the_load_steps_that_are_checked_whatever_the_way_of_the_flow():
    turned = WATER | {"pressures": ["1 bar", "2 bar"]}
    history = run(scene(turned, output={"check": "last"}))
    np.testing.assert_array_equal(
        np.isfinite(history.leak_error_y_mm3_per_s), [False, False, False, True]
    )
    assert history.leak_y_mm3_per_s[-1] < 0.0
    error = history.leak_error_y_mm3_per_s[-1]
    assert error == pytest.approx(ran().leak_error_y_mm3_per_s[-1], rel=1e-9)


def test_closed_gaps_leak_nothing_and_are_called_closed():
    history = run(scene(load={"force": 90.0, "steps": 6}))
    assert history.percolates_x[0] == 1 and history.percolates_x[-1] == 0
    assert history.leak_x_mm3_per_s[-1] == 0.0 == history.hydraulic_gap_x_mm[-1]
    assert np.isnan(history.constriction_x_fraction[-1])
    notes = " ".join(history.notes)
    assert "leak along x at load step 6: closed, nothing leaks: the surfaces touch" in notes
    assert "the gap is closed along x at" in notes
    rates, factors = leak_figure(history, None, scene().leak, periodic=True).axes
    assert rates.get_xlim() == factors.get_xlim()  # which has no points where it is closed
    leak = history.steps[0].leak("x")
    assert leak_text(replace(leak, error=None)).endswith("mm³/s")
    unsure = replace(leak, rate=0.0, error=2.0)
    assert leak_text(unsure) == "closed, nothing leaks (or up to 2 mm³/s)"
    unsure = replace(leak, rate=-0.5, error=2.0)  # ± would say that the way of the flow is unknown
    assert leak_text(unsure) == "-0.5 (or up to -2.5) mm³/s"


def test_errors_far_above_leaks_hide_neither_the_leak_nor_its_bound():
    """In tables, where ± would round leaks to 0, and in the figure, where closed is not certain."""
    rates, errors = (0.0429, -0.0429, -0.0, 0.3), (1.4, 1.4, 2.3e-7, 0.2)
    steps = tuple(
        replace(step, leaks=(replace(step.leak("x"), rate=rate, error=error),))
        for step, rate, error in zip(ran().steps, rates, errors, strict=True)
    )
    _, shown = History.leak_x_mm3_per_s.shown(steps)
    most = "0.043 (or up to 1.4)", "-0.043 (or up to -1.4)", "0 (or up to -2.3·10⁻⁷)", "0.30 ± 0.20"
    assert tuple(shown) == most
    section = replace(scene().leak, direction="x")
    axes = leak_figure(replace(ran(), steps=steps), None, section, periodic=True).axes[0]
    ends = [line[:, 1] for bars in axes.collections for line in bars.get_segments()]
    assert any(np.allclose(one, [0.0, 2.3e-7]) for one in ends)


def test_coarse_grids_are_warned_of():
    assert any("the leak along y is uncertain: on finer cells" in note for note in ran().notes)
    closed = run(scene(load={"force": 50.0}, output={"check": "last"}))
    assert closed[-1].leak("x").rate == 0.0 < closed[-1].leak("x").error
    assert any("the leak along x is uncertain: on finer cells" in note for note in closed.notes)


def test_flow_is_solved_along_one_axis_where_one_is_asked_for(monkeypatch):
    asked = []
    solved = observer.gap_flows

    def counted(gap, lengths, *, axes, **options):
        asked.append(axes)
        return solved(gap, lengths, axes=axes, **options)

    monkeypatch.setattr(observer, "gap_flows", counted)
    history = run(scene(WATER | {"direction": "y"}, output={"check": "none"}))
    assert asked == [[1]] * 4
    assert (
        np.isnan(history.leak_x_mm3_per_s).all() and np.isnan(history.leak_error_y_mm3_per_s).all()
    )
    np.testing.assert_array_equal(history.leak_y_mm3_per_s, ran().leak_y_mm3_per_s)


def test_multigrid_solves_large_maps(monkeypatch):
    """Shares of channels err as pressures do, flows by the square of it."""
    factorised = ran()  # before the limit is another one
    monkeypatch.setattr(transport, "_MOST_FACTORISED", 100)
    history = run(scene(output={"check": "none"}))
    allowed = {"leak_x_mm3_per_s": 1e-7, "leak_y_mm3_per_s": 1e-7, "constriction_x_fraction": 1e-5}
    for name, most in allowed.items():
        np.testing.assert_allclose(getattr(history, name), getattr(factorised, name), rtol=most)


def test_flow_turns_with_the_pressures_and_is_slower_in_oil():
    oil = {"viscosity": "0.1 Pa s", "pressures": ["0 bar", "4 bar"]}
    history = run(scene(oil, output={"check": "none"}))
    np.testing.assert_allclose(history.leak_x_mm3_per_s, -0.04 * ran().leak_x_mm3_per_s, rtol=1e-12)


@pytest.mark.long
def test_a_block_has_walls_and_gaps_of_its_own():
    """On its body the contact is another, and no flow passes the sides along it."""
    done = Run(scene(kind="concurrent", micro={"finite_slopes": False}))
    for step in done.load_steps():
        gap = done.coupling.model.gaps
        flow = gap_flow(gap, (1.0, 1.5), periodic=False)
        leak = step.leak("x")
        assert leak.transmissivity == pytest.approx(flow.transmissivity, rel=1e-12)
        assert leak.error > 0.0
    done.close()


def test_after_unloading_cells_that_yielded_leak_more_and_have_no_error():
    load = {"force": [36.0, 9.0], "steps": 2}
    history = run(scene(micro={"hardness": 60.0}, load=load))
    assert list(np.isnan(history.leak_error_x_mm3_per_s)) == [False, False, True, True]
    assert any("error of the leak after unloading is not measured" in one for one in history.notes)


@pytest.mark.long
def test_one_patch_leaks_as_the_cells_and_more_of_them_roughly():
    """One patch is the whole surface, whose laws reproduce it; sixteen are walls and means."""
    cells = run(scene(kind="concurrent", micro={"finite_slopes": False}))
    # a leak of 1 in 450 of the open gap's is interpolated between rows that fall by a factor of 20
    for grid, within in (([1, 1], 0.02), ([2, 2], 0.7)):
        laws = run(scene(kind="consistent", patches={"grid": grid}, micro={"finite_slopes": False}))
        for step, of_cells in zip(laws.steps[:3], cells.steps[:3], strict=True):
            for way in "xy":
                found, known = step.leak(way), of_cells.leak(way)
                assert list(dict(found.causes)) == ["grid", "rows"]
                assert found.rate == pytest.approx(known.rate, rel=within), (grid, step.step, way)
                assert found.constriction is None
    assert any("through 4 patches of one transmissivity each" in note for note in laws.notes)


@pytest.mark.long
def test_grids_err_in_laws_of_one_patch_as_in_cells():
    """Two coarser grids and a floor tell it, at the same approach; the rows' flow is within 1 %."""

    def on(kind, **sections):
        asked = scene(
            kind=kind, micro={"finite_slopes": False}, output={"check": "all"}, **sections
        )
        load = {"approach": [5e-3, 7e-3], "steps": 1}
        return run(Scene.from_dict({**asked.written, "load": load}))

    cells, laws = on("concurrent"), on("consistent", patches={"grid": [1, 1]})
    for step, of_cells in zip(laws.steps, cells.steps, strict=True):
        for found, known in zip(step.leaks, of_cells.leaks, strict=True):
            assert dict(found.causes)["grid"] == pytest.approx(known.error, rel=0.05)


@pytest.mark.parametrize(("patches", "micro"), [([9, 2], {}), ([8, 8], {"cells": [16, 16]})])
def test_patches_with_too_few_cells_are_refused(patches, micro):
    match = rf"patches.grid = \[{patches[0]}, {patches[1]}\]: leaves patches fewer than 4 ce"
    with pytest.raises(InputError, match=match):
        Run(scene(kind="consistent", patches={"grid": patches}, micro=micro))


@pytest.mark.slow
def test_columns_are_written_read_drawn_and_kept_over_a_resume(tmp_path):
    asked = scene(output={"figures": True, "report": True})
    done = ran_past(asked, 2, tmp_path / "checkpoint.state")
    resumed, rest = gone_on(asked, tmp_path / "checkpoint.state")
    assert len(rest) == 2
    write_results(tmp_path, done, options=[])
    assert (tmp_path / "leak.png").stat().st_size > 10_000
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "leak along x" in report and "a ring marks the narrowest place" in report
    again, before = read_history(tmp_path), done.history()
    for name in NAMES:
        np.testing.assert_array_equal(getattr(again, name), getattr(before, name))
        np.testing.assert_allclose(
            getattr(resumed.history(), name), getattr(before, name), rtol=1e-6
        )


def test_scenes_that_do_not_ask_have_no_leak():
    history = run(scene(None))
    assert all(np.isnan(getattr(history, name)).all() for name in NAMES)
    assert not any("leak" in note for note in history.notes)
