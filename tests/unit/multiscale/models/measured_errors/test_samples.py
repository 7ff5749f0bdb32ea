"""Errors of load steps under laws of samples: by cause, in scenes, against finer solutions."""

import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.box_msh import write_box
from helpers.resumed_runs import gone_on, ran_past
from scipy.stats import norm

from patchlaw.geometry import BlockShape, Control
from patchlaw.macro import elastic_body
from patchlaw.macro.contact import other_elements
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.models.measured_errors import faces as law_errors
from patchlaw.multiscale.models.measured_errors.errors import response_of
from patchlaw.multiscale.models.measured_errors.faces import (
    LawErrorProbe,
    check_requests,
    omission_notes,
)
from patchlaw.multiscale.models.measured_errors.samples import (
    SampleProbe,
    interpolation_errors,
    mean_error,
)
from patchlaw.support import InputError, NotConverged
from patchlaw.support.readable import quantity

CELLS = (4, 3, 2)
TICKS = BlockShape(interface=(1.1, 0.9), height=0.8, cells=CELLS).ticks
CONSTANTS = {"young_modulus": 4100.0, "poisson_ratio": 0.17}
SPECTRUM = {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.1, "seed": 3}
SURFACE = {"spectrum": SPECTRUM, "grid": [18, 18], "lengths": [0.083, 0.083]}
ONE = {"kind": "representative"}
TWO = {**ONE, "seeds": [1, 2]}
QUIET = {"figures": False, "report": False, "contact": "none"}


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A box as a file."""
    return write_box(tmp_path_factory.mktemp("mesh") / "box.msh", TICKS)


def body(mesh, element="linear"):
    held = [{"surface": "bottom"}]
    return {"mesh": str(mesh), "contact": "top", "supports": held, "element": element, **CONSTANTS}


def scene(mesh, *, law=None, load=None, output=None, element="linear", **sections):
    data = {
        "surface": SURFACE,
        "law": law or ONE,
        "load": load or {"approach": "2.3 um", "steps": 2},
        "output": QUIET | (output or {}),
    }
    if "block" not in sections:
        data["body"] = body(mesh, element)
    return Scene.from_dict(data | sections)


@pytest.fixture(scope="module")
def all_measured(mesh):
    """The scene as it is, with errors at every load step."""
    return run(scene(mesh, output={"check": "all"}))


@pytest.mark.long
def test_samples_whose_fewer_cells_have_no_gap_left_leave_the_errors_by_others(mesh, monkeypatch):
    def closed(*_, **__):
        raise InputError("a periodic surface has no gap left at this approach")

    monkeypatch.setattr("patchlaw.micro.half_space.error_probe.ErrorProbe.measure", closed)
    last = run(scene(mesh)).steps[-1]
    unknown = {cause for cause, error in last.errors if error == math.inf}
    assert unknown == {"grid", "slopes"} and np.isnan(last.force_error_N or math.nan)


@pytest.mark.slow
@pytest.mark.parametrize("element", ["linear", pytest.param("quadratic", marks=pytest.mark.long)])
def test_the_last_load_step_has_its_errors_by_cause(mesh, element):
    history = run(scene(mesh, law=TWO, element=element))
    first, last = history.steps
    assert first.errors == () and np.isnan(history.force_error_N[0])
    causes = dict(last.errors)
    assert list(causes) == [
        "mesh", "quadrature", "laws", "samples", "grid", "slopes", "edges", "zero",
    ]  # fmt: skip
    assert all(error > 0.0 for error in causes.values())
    assert last.force_error_N == pytest.approx(sum(causes.values()), rel=1e-12)
    assert last.approach_error_mm == 0.0
    within = f"the force is within {quantity(last.force_error_N, 'N', 2)}"
    assert any(within in note for note in history.notes)
    assert "check" in history.seconds


@pytest.mark.slow
def test_what_is_read_off_at_an_approach_errs_with_the_force_besides(mesh, all_measured):
    """By all causes: what errs in the pressures errs in the area."""
    last = all_measured.steps[-1]
    under = run(scene(mesh, load={"force": f"{last.force_N!r} N", "steps": 1})).steps[-1]
    share = last.force_error_N / last.force_N
    at, beneath = (
        one.contact_area_fraction_error / one.contact_area_fraction for one in (last, under)
    )
    assert at == pytest.approx(beneath + share, rel=0.2)  # by elements, on other ones


@pytest.mark.long
def test_a_prescribed_force_has_an_error_of_the_approach(mesh):
    load = {"force": "5.3 N", "steps": 1, "tilt": "free"}
    whole = Run(scene(mesh, load=load))
    (step,) = whole.load_steps()
    assert step.force_error_N == 0.0
    press, d = whole.coupling.model.press, 1e-6
    near = [press(Control(approach=step.approach_mm + s * d, tilt=None)).force_N for s in (-1, 1)]
    expected = sum(dict(step.errors).values()) * 2 * d / (near[1] - near[0])
    assert step.approach_error_mm == pytest.approx(expected, rel=1e-4)  # a difference's
    whole.close()


def test_all_load_steps_are_measured_where_that_is_asked_for(all_measured):
    """A single sample tells no scatter."""
    assert np.isfinite(all_measured.force_error_N).sum() == 2
    assert "samples" not in dict(all_measured.steps[-1].errors)
    told = "top: the error is that for this one sample"
    assert any(told in note for note in all_measured.notes)


@pytest.mark.long
def test_linear_elements_without_affordable_quadratic_ones_leave_no_stated_error(mesh, monkeypatch):
    monkeypatch.setattr(law_errors, "MOST_CHECKED_UNKNOWNS", 500)
    history = run(scene(mesh))
    step = history.steps[-1]
    assert dict(step.errors)["mesh"] == math.inf
    assert step.force_error_N is None
    assert any("has no stated error, as that by mesh" in note for note in history.notes)
    assert any("quadratic elements, which would tell" in note for note in history.notes)


@pytest.mark.long
def test_blocks_of_many_linear_cells_are_compared_with_fewer(mesh, monkeypatch):
    monkeypatch.setattr(law_errors, "MOST_CHECKED_UNKNOWNS", 500)
    block = {**CONSTANTS, "lengths": [1.1, 0.9], "height": 0.8}

    def force(cells, check):
        step = run(scene(mesh, block={**block, "cells": cells}, output={"check": check})).steps[-1]
        return step.force_N, dict(step.errors).get("mesh")

    (found, stated), (true, _) = force([6, 5, 4], "last"), force([24, 20, 16], "none")
    # the laws of runs end at different pressures, and so have different rows
    assert stated == pytest.approx(abs(found - force([3, 2, 2], "none")[0]), rel=0.02)
    assert stated / 4 < abs(found - true) < 1.5 * stated


@pytest.mark.long
def test_a_plane_that_does_not_touch_has_no_error(mesh):
    heat = {"conductance": {"conductivity": "50 W/m/K"}, "friction": {"coefficient": 0.3}}
    load = {"approach": "1e-9 mm", "steps": 1, "shear": [["10 nm", "0 nm"]], "shear_steps": 1}
    history = run(scene(mesh, load=load, **heat))
    step = history.steps[-1]
    assert step.force_N == step.thermal_conductance_W_per_K == 0.0
    names = "force_error_N", "contact_area_fraction_error", "mean_separation_error_mm"
    for name in (*names, "thermal_conductance_error_W_per_K", "shear_force_error_N"):
        assert getattr(step, name) == 0.0
    assert any("the shear force is within 0 N: " in note for note in history.notes)


@pytest.mark.long
def test_a_box_from_a_file_has_the_errors_of_the_block(mesh, all_measured):
    block = {**CONSTANTS, "cells": CELLS, "lengths": [1.1, 0.9], "height": 0.8}
    step = run(scene(mesh, block=block)).steps[-1]
    found, own = dict(all_measured.steps[-1].errors), dict(step.errors)
    # in proportion from the first load step, at 0.4 of the force
    assert found.pop("mesh") == pytest.approx(own.pop("mesh"), rel=0.05)
    # differences of two forces, each solved for to 1e-8
    assert found == pytest.approx(own, rel=1e-6, abs=2e-8 * step.force_N)


def test_the_error_of_a_mean_holds_in_19_of_20_sets():
    class Sample:
        area = 0.7

    rng = np.random.default_rng(5)
    for count in (2, 3, 8):
        drawn = norm.rvs(size=(20000, count), random_state=rng)
        stated = mean_error([Sample()] * count) * drawn.std(axis=1, ddof=1)
        kept = np.mean(np.abs(drawn.mean(axis=1)) <= stated)
        assert kept == pytest.approx(0.95, abs=0.005)  # three standard deviations of 20000
    assert mean_error([Sample()]) == 0.0


def test_laws_err_by_a_share_of_their_pressure_or_of_their_largest(mesh):
    whole = Run(scene(mesh))
    (law,) = whole.make_laws().laws
    known = replace(law, interpolation_error=0.01)
    end = float(law.rows.pressure[-1])
    closure = law.rows.closure[[1, -1]]
    found = interpolation_errors(known, closure)
    assert found == pytest.approx([0.01 * max(law.rows.pressure[1], 0.03 * end), 0.01 * end])


@pytest.mark.long
def test_errors_of_samples_do_not_depend_on_the_unit_of_pressures():
    def errors(unit):
        block = {"young_modulus": 4100.0 * unit, "poisson_ratio": 0.17}
        block |= {"height": 0.8, "lengths": [1.1, 0.9], "cells": [1, 1, 1]}
        load = {"pressure": 2.3 * unit, "steps": 1}
        step = run(scene(None, block=block, load=load)).steps[-1]
        return step.contact_area_fraction_error, step.mean_separation_error_mm

    assert errors(math.pi) == pytest.approx(errors(1.0), rel=1e-5)


class ReadOff:
    """A law that closures under pressures are read off."""

    range = -0.3, 1.1
    closure_under, _places = PatchLaw.closure_under, PatchLaw._places

    def pressure(self, closure):
        return 7.0 * (closure + 0.3) ** 1.5


def test_closures_under_pressures_near_first_touch_are_those_of_the_law():
    """Read off between even places, 1e-9 of the largest pressure led to 3e-12 of it."""
    law = ReadOff()
    pressure = np.geomspace(1e-12, 1.0, 37) * law.pressure(1.1)
    assert law.pressure(law.closure_under(pressure)) == pytest.approx(pressure, rel=2e-3)
    assert law.closure_under(np.array([0.0, 1e9])) == pytest.approx([-0.3, 1.1])


class NearlyClosed(ReadOff):
    """A law whose gap closes as the inverse of the pressure: p = 1 / gap − 1 / 1.2 mm."""

    range = 0.0, 1.2 - 1.0 / 25.0

    def at(self, _, closure, extend):
        gap = 1.2 - np.asarray(closure)
        pressure, area = 1.0 / gap - 1.0 / 1.2, np.full_like(gap, 0.999)
        return SimpleNamespace(
            pressure=pressure, separation=gap, stiffness=gap**-2.0, contact_area_fraction=area
        )

    def pressure(self, closure):
        return self.at(0, closure, True).pressure


def test_gap_and_stiffness_near_full_contact_err_as_the_law_says_at_every_point():
    """Half of the face is nearly closed, and stiff, the other bears little and has the gap."""
    pressure, weight, share = np.array([20.0, 1.0]), np.array([0.3, 0.3]), 0.1
    sampling = SimpleNamespace(
        patch=np.zeros(2, np.intp), patch_sums=lambda values: np.array([weight @ values])
    )
    gaps, force = (lambda p: 1.0 / (p + 1.0 / 1.2)), float(weight @ pressure)
    stiffness = float(weight @ gaps(pressure) ** -2.0)
    probe = LawErrorProbe(
        **dict.fromkeys(("face", "problem_with", "cells")),
        problem=SimpleNamespace(sampling=sampling),
        state=SimpleNamespace(sample_pressure=pressure, force=force),
        table=SimpleNamespace(laws=[law := NearlyClosed()], together=lambda: law),
        samples=(),
        new_laws=(),
        step=SimpleNamespace(interface_stiffness_N_per_mm=stiffness),
    )
    known, *moved = (gaps(pressure * (1.0 + by)) for by in (0.0, share, -share))
    gap = max(abs((one - known).mean()) for one in moved)
    stiffer = max(abs((one**-2.0).mean() / (known**-2.0).mean() - 1.0) for one in moved)
    area_error, *others = probe._going_with(share)
    assert area_error == pytest.approx(0.0, abs=1e-12)
    # the law is read off between 401 places
    assert others == pytest.approx([gap, stiffer], rel=0.02)
    assert gap > 2.5 * share * force / stiffness  # as if the whole face closed alike
    assert stiffer > 1.8 * share


@pytest.mark.long
@pytest.mark.parametrize("load", [
    {"force": "0.3 N"}, {"approach": "-0.15 um"},
    pytest.param({"force": "0.3 N", "shear": [[1e-5, 0.0]]}, marks=pytest.mark.slow),
])  # fmt: skip
def test_what_is_read_off_errs_as_on_other_elements(mesh, monkeypatch, load):
    """What all pressures alike would change is no part of it."""
    found, measure = [], LawErrorProbe.of_force
    monkeypatch.setattr(LawErrorProbe, "_going_with", lambda probe, share: np.zeros(3))
    monkeypatch.setattr(
        LawErrorProbe, "of_force", lambda *given: found.append(measure(*given)) or found[-1]
    )
    smooth = {**SURFACE, "spectrum": {**SPECTRUM, "rms_slope": 0.02}}
    load = load | {"steps": 1, "zero": "mean plane", "tilt": [0.0, 0.0]}
    rubs = {"friction": {"coefficient": 0.4}} if "shear" in load else {}
    read = []
    for element in ("linear", "quadratic"):
        held = {**body(mesh, element), "supports": [{"surface": "left"}]}
        whole = Run(scene(mesh, load=load, surface=smooth, body=held, **rubs))
        *_, step = whole.load_steps()
        stiffness = whole.coupling.model.stiffness().interface
        read.append([step.contact_area_fraction, step.mean_separation_mm, stiffness])
        whole.coupling.measured_errors(step)
        whole.close()
    own, true = np.array(read)
    area, gap, stiffness = found[0].by_cause["mesh"][1:] * [1.0, 1.0, own[2]] / abs(true - own)
    assert 0.7 < area < 4.0
    assert 0.7 < gap < 4.0
    assert rubs or 0.7 < stiffness < 4.0  # as closures change with the approach on linear elements


@pytest.mark.long
def test_every_stage_is_measured_with_the_loads_of_its_bodies(mesh):
    stages = [
        {"force": "5 N", "steps": 2, "body": {"pretension": [{"surface": "right", "pull": "2 N"}]}},
        {"hold": "approach", "steps": 1, "body": {"temperature": "7 K"}},
    ]
    warm = {**body(mesh), "thermal_expansion": "20 ppm/K"}
    load, output = {"stage": stages, "tilt": "free"}, {"check": "all"}
    steps = run(scene(mesh, body=warm, load=load, output=output)).steps
    assert len(steps) == 3
    for step in steps:
        errors = dict(step.errors)
        # under other loads of the body the force would be another altogether
        assert errors["quadrature"] < 1e-4 * step.force_N
        assert 0.0 < errors["mesh"] < 0.1 * step.force_N
    assert [step.force_error_N == 0.0 for step in steps] == [True, True, False]


@pytest.mark.long
def test_other_elements_are_kept_between_load_steps_and_tell_the_same(mesh, monkeypatch, tmp_path):
    made, own = [], other_elements.face_on

    def face_on(*given, **options):
        made.append(given)
        return own(*given, **options)

    monkeypatch.setattr(other_elements, "face_on", face_on)
    known = scene(mesh, output={"check": "all"})
    path = tmp_path / "checkpoint.state"
    whole = ran_past(known, 1, path)
    kept = whole.steps
    assert len(made) == 2  # with quadratic elements, and with more points
    assert set(whole.coupling._elsewhere) == {"finer", "nearer", "quadratic"}
    whole.close()
    assert not whole.coupling._elsewhere
    again, (last,) = gone_on(known, path)
    again.close()  # what the first load step told is in the checkpoint
    assert dict(last.errors) == pytest.approx(dict(kept[-1].errors), rel=1e-6)
    made.clear()
    monkeypatch.setattr(law_errors, "_MOST_KEPT_UNKNOWNS", 0)
    fresh = run(known).steps
    assert len(made) == len(fresh) + 1  # quadratic elements tell those of both load steps
    for one, other in zip(kept, fresh, strict=True):
        abs_ = 1e-7 * one.force_N  # load steps converge to 1e-9
        assert dict(one.errors) == pytest.approx(dict(other.errors), rel=1e-4, abs=abs_)


def test_errors_are_recalled_of_the_nearest_load_and_only_where_they_are_known():
    probe = SimpleNamespace(told=[])
    for of, load, error in (("cells", 1.0, 3.0), ("cells", 3.0, 2.0), ("steps", 2.0, 9.0)):
        SampleProbe.tell_later(probe, of, load, np.array([error]))
    SampleProbe.tell_later(probe, "cells", 2.0, np.array([math.inf]))
    found = [
        SampleProbe.recalled(probe, "cells", one, 4.0, 1.5) for one in (0.6, 1.0, 1.9, 2.1, 13)
    ]
    assert found == [None, 3.0, 3.0, 2.0, None]
    assert SampleProbe.recalled(probe, "cells", 2.9, 2.0, 1.0) is None  # from lower loads alone


def test_errors_of_cells_are_not_kept_for_samples_that_have_worn_since():
    measured = []

    def of_regions(what, tell, some):
        measured.append(list(some))
        yield 0, np.ones((1, 13)), np.ones(1)

    probe = SimpleNamespace(told=[], samples=[SimpleNamespace(surfaces=[SimpleNamespace(area=1)])])
    probe.recalled = partial(SampleProbe.recalled, probe)
    probe.tell_later = partial(SampleProbe.tell_later, probe)
    probe._told_by, probe.of_regions = math.nan.__add__, of_regions
    for touch, load in ((0.0, 1.0), (0.0, 1.5), (0.1, 1.5), (0.1, 1.6)):
        law = SimpleNamespace(
            first_touch=touch,
            initial_separation=1.0,
            range=(0.0, 4.0),
            pressure=lambda closure: np.asarray(closure, dtype=float),
            closure_under=float,
            at=lambda closure, extend: SimpleNamespace(separation=1.0),
        )
        probe.table = SimpleNamespace(laws=[law])
        SampleProbe.of_cells(probe, np.array([load]), np.ones(1), np.zeros(1))
    assert measured == [[True], [False], [True], [False]]


def test_other_elements_whose_contact_fails_are_not_used_again():
    probe = LawErrorProbe(
        **dict.fromkeys(("problem", "face", "state", "cells", "step")),
        problem_with=lambda face, table: object(),
        table=None,
        samples=(),
        new_laws=(),
        elsewhere={"finer": ("known", None, known := object())},
    )
    with pytest.raises(NotConverged), probe._other("finer", lambda face: "new") as problem:
        assert problem is known
        raise NotConverged("a contact", reason="MAX_IT", iterations=1, remedy="smaller steps")
    assert not probe.elsewhere


def test_bodies_that_do_not_face_each_other_are_refused(mesh, tmp_path):
    turned = np.diag([1.0, -1.0, -1.0])
    ticks = TICKS[0], TICKS[1], np.asarray(TICKS[2]) - TICKS[2][-1]
    beside = write_box(tmp_path / "beside.msh", ticks, turn=turned, shift=(0.0, -0.01, 0.0))
    with pytest.raises(InputError, match=r"counter_body\.contact: .* no part in common"):
        Run(scene(mesh, counter_body=body(beside)))


def test_load_steps_that_the_error_of_a_shear_has_forgotten_are_said(all_measured):
    """Springs remember 64; what earlier ones erred by is told in results."""
    last = all_measured.steps[-1]
    for count, sheared, said in ((64, True, 0), (65, True, 1), (65, False, 0)):
        errors = (("steps", 1e-3),) if sheared else ()
        notes = list(omission_notes((), replace(last, step=count, shear_errors=errors)))
        assert sum(f"the last 64 of {count}" in note for note in notes) == said


@pytest.mark.long
def test_the_error_of_linear_elements_takes_memory_and_that_of_quadratic_ones_none(mesh):
    linear, quadratic = (
        {"body": Run(scene(mesh, element=one)).coupling.parts.body}
        for one in ("linear", "quadratic")
    )
    assert [one.key for one in check_requests(linear)] == ["output.check"]
    assert not list(check_requests(quadratic))
    (of_sliders,) = check_requests(quadratic, rubs=True)
    on_face = math.prod(2 * len(one) - 1 for one in TICKS[:2])
    # nodes are taken to lie as far apart along the face as below it
    assert of_sliders.shared == pytest.approx(30e3 * on_face, rel=0.5)


SHIFTED = {"force": "5.3 N", "steps": 1, "shear": [["0.2 um", "0.1 um"]], "shear_steps": 2}
RUBS = {"load": SHIFTED, "friction": {"coefficient": 0.4}}


@pytest.mark.long
@pytest.mark.parametrize(
    "kind", ["smooth", "by shift", "by force", pytest.param("mixed", marks=pytest.mark.slow)]
)
def test_the_error_of_linear_elements_takes_no_solve_on_quadratic_ones(
    mesh, kind, tmp_path, monkeypatch
):
    """Few products tell 0.6 to 1.6 of what quadratic elements change; 1.5 × that counts."""
    keys = {} if kind == "smooth" else RUBS
    if kind == "by force":
        keys = RUBS | {"load": SHIFTED | {"shear": None, "shear_force": [["0.8 N", "0.4 N"]]}}
    if kind == "mixed":
        ticks, turned = (
            [*TICKS[:2], np.asarray(TICKS[2]) - TICKS[2][-1]],
            np.diag([1.0, -1.0, -1.0]),
        )
        up = write_box(tmp_path / "up.msh", ticks, turn=turned, shift=(0.0, 0.9, 0.0))
        keys = {"counter_body": body(up, "quadratic")}
    whole, made = Run(scene(mesh, output={"check": "none"}, **keys)), []
    (*_, last) = whole.load_steps()
    own = elastic_body.body_solver
    monkeypatch.setattr(elastic_body, "body_solver", lambda *g: made.append(g) or own(*g))
    columns = whole.coupling.measured_errors(last)
    known = [one.body for one in whole.coupling.model.face.sides]
    assert all(one.degree == 1 or one in known for bodies, *_ in made for one in bodies)
    better = run(scene(mesh, output={"check": "none"}, element="quadratic", **keys)).steps[-1]
    error = dict(columns["errors"])["mesh"]
    if last.by_force:
        stiffness = sum(dict(columns["errors"]).values()) / columns["approach_error_mm"]
        changed = stiffness * (better.approach_mm - last.approach_mm)
    else:
        changed = better.force_N - last.force_N
    assert 0.9 < error / abs(changed) < 1.8
    if "friction" in keys:
        one, two = (response_of(step) for step in (last, better))
        error = dict(columns["shear_errors"])["mesh"]
        assert 0.9 < error / np.hypot(*(one - two)) < 2.4
