"""Errors of the shear that a run measures: what they contain, when they are there, if they hold."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.pressed_cells import pressed_cells

from patchlaw.macro import LawContactProblem
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.models.measured_errors import shear
from patchlaw.multiscale.models.measured_errors.errors import ERRORS_OF
from patchlaw.multiscale.models.measured_errors.shear import turning_points
from patchlaw.support.readable import WHOLE

SPECTRUM = {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.1, "seed": 12}
SHEAR = {"shear": [[1e-3, 0.0], [-6e-4, 3e-4]], "shear_steps": 2}


@cache
def ran(kind="analytic", cells=32, check="last", load="force", by_force=False, coupled=False):
    loads = {"force": {"force": 6.0}, "approach": {"approach": 9e-3}}[load] | {"steps": 2}
    shear = {"shear_force": [[0.9, 0.2]], "shear_steps": 2} if by_force else SHEAR
    return run(
        pressed_cells(
            kind, loads | shear,
            surface={"spectrum": SPECTRUM, "grid": [cells, cells], "lengths": [1.0, 1.0]},
            friction={"coefficient": 0.3, "coupled": coupled},
            output={"check": check, "figures": False, "report": False},
        )
    )  # fmt: skip


def _share(errors, cause):
    return dict(errors)[cause] / sum(dict(errors).values())


def response(step, *, by_force=False):
    if by_force:
        return np.array([step.shear_x_mm, step.shear_y_mm])
    return np.array([step.shear_force_x_N, step.shear_force_y_N])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "by_force"),
    [("analytic", False), pytest.param("concurrent", True, marks=pytest.mark.long)],
)
def test_the_errors_stated_are_those_of_finer_cells_and_of_the_coupling(kind, by_force):
    step = ran(kind, by_force=by_force).steps[-1]
    parts = dict(step.shear_errors)
    body = ["body"] if kind == "concurrent" else []
    steps = [] if by_force else ["steps"]  # which go along one line there
    assert list(parts) == ["grid", *body, "coupling", *steps]
    columns = step.shear_force_error_N, step.shear_error_mm
    assert columns == ((0.0, pytest.approx(sum(parts.values()))) if by_force else
                       (pytest.approx(sum(parts.values())), 0.0))  # fmt: skip
    own = response(step, by_force=by_force)
    finer = ran(kind, 64, "none", by_force=by_force).steps[-1]
    off = np.hypot(*(response(finer, by_force=by_force) - own))
    assert off <= 1.5 * (parts["grid"] + parts.get("body", 0.0))
    # measured on half as many cells, through the turning points alone
    other = ran(kind, 32, "none", by_force=by_force, coupled=True).steps[-1]
    apart = np.hypot(*(response(other, by_force=by_force) - own))
    assert 0.5 * parts["coupling"] <= 1.5 * apart
    assert apart <= 1.5 * parts["coupling"]
    # tractions lift the plane, too
    of_approach = step.approach_error_mm * _share(step.errors, "coupling")
    lifted = abs(other.approach_mm - step.approach_mm)
    assert 0.5 * of_approach <= 1.5 * lifted
    assert lifted <= 1.5 * of_approach < 1.5 * step.approach_error_mm


@pytest.mark.slow
@pytest.mark.parametrize("load", [{"force": 300.0}, {"approach": 3e-3}])
def test_what_tractions_lift_is_in_all_errors_of_the_normal_contact(load):
    """Area and mean gap change as much as the load does where ν = 0 and friction is strong."""
    shear = {"steps": 2, "shear": [[3e-3, 0.0]], "shear_steps": 2}
    own, other = (
        run(
            pressed_cells(
                "concurrent", load | shear,
                block={"young_modulus": 210e3, "poisson_ratio": 0.0},
                surface={
                    "spectrum": {"rms_height": 1e-3, "hurst": 0.8, "waves": [1, 3], "seed": 3},
                    "grid": [24, 24],
                    "lengths": [1.0, 1.0],
                },
                friction={"coefficient": 1.0, "coupled": coupled},
                output={"check": check, "figures": False, "report": False},
            )
        ).steps[-1]
        for coupled, check in ((False, "last"), (True, "none"))
    )  # fmt: skip
    prescribed = "force_N" if "force" in load else "approach_mm"
    columns = {"force_N": "force_error_N", "approach_mm": "approach_error_mm", **ERRORS_OF}
    for name in columns.keys() - {prescribed}:
        apart, error = abs(getattr(other, name) - getattr(own, name)), getattr(own, columns[name])
        assert apart <= 1.5 * error <= 12.0 * apart + 0.03 * abs(getattr(own, name)), name


@pytest.mark.long
def test_notes_say_them():
    notes = " ".join(ran().notes)
    assert "measured at load step 6: at its shift the shear force is within" in notes
    assert ", coupling " in notes
    notes = " ".join(ran(by_force=True).notes)
    assert "measured at load step 4: under its shear force the shift is within" in notes


@pytest.mark.long
def test_coupled_runs_have_no_error_by_the_coupling():
    found = ran(cells=24, coupled=True).steps[-1].shear_errors
    assert [cause for cause, _ in found] == ["grid", "steps"]


TURNS = 7e-4 * np.stack([np.cos(angles := 0.3 + np.arange(7) * np.pi / 3), np.sin(angles)], axis=1)


@pytest.mark.long
@pytest.mark.parametrize("coupled", [False, pytest.param(True, marks=pytest.mark.long)])
def test_errors_by_steps_hold_on_turning_paths_and_where_coupled_contacts_are_pressed(coupled):
    """Steps an eighth as long on the same cells tell the error by the steps."""
    points = TURNS[:1] * 0.3 if coupled else TURNS[:5]

    def end(times, check):
        load = {"force": 5.3, "steps": 2 * times, "shear": points.tolist(), "shear_steps": times}
        surface = {"spectrum": SPECTRUM | {"seed": 5}, "grid": [32, 32], "lengths": [1.0, 1.0]}
        rubs = {"coefficient": 0.37, "coupled": coupled}
        quiet = {"check": check, "figures": False, "report": False, "contact": "none"}
        return run(pressed_cells(
            "analytic", load, surface=surface, friction=rubs, output=quiet,
            micro={"finite_slopes": False},
        )).steps[-1]  # fmt: skip

    one, fine = end(1, "last"), end(8, "none")
    by_steps = np.hypot(*(response(fine) - response(one)))
    assert by_steps > 2e-3 * np.hypot(*response(fine))  # it matters
    assert by_steps <= 1.5 * dict(one.shear_errors)["steps"]
    assert one.shear_force_error_N == pytest.approx(sum(dict(one.shear_errors).values()))
    lost = abs(fine.dissipated_mJ - one.dissipated_mJ)
    assert 0.02 * fine.dissipated_mJ < lost <= 1.5 * one.dissipated_error_mJ
    assert abs(fine.slip_area_fraction - one.slip_area_fraction) <= 1.5 * one.slip_area_error
    of_approach = one.approach_error_mm * _share(one.errors, "steps") if coupled else 0.0
    raised = abs(fine.approach_mm - one.approach_mm)
    assert raised <= 1.5 * of_approach + 1e-9 * one.approach_mm  # to which the force is met
    assert (raised > 1e-4 * one.approach_mm) == coupled
    assert of_approach <= one.approach_error_mm


def test_steps_along_one_line_do_not_matter():
    straight = ran(by_force=True).steps[-1]
    assert "steps" not in dict(straight.shear_errors)
    assert straight.dissipated_error_mJ > 0.0


@pytest.mark.long
def test_errors_by_steps_hold_where_load_and_shear_grow_from_nothing():
    """One step or 16 to the same point: cells that touch in a step follow all of its slip."""

    def end(steps, check):
        along = {"force": 5.3, "steps": steps, "shear": [[5e-4, 2e-4]], "shear_path": "along"}
        quiet = {"check": check, "figures": False, "report": False, "contact": "none"}
        rubs = {"coefficient": 0.37, "coupled": False}
        return run(pressed_cells("analytic", along, friction=rubs, output=quiet)).steps[-1]

    one, fine = end(1, "last"), end(16, "none")
    by_steps = np.hypot(*(response(fine) - response(one)))
    assert by_steps > 0.01 * np.hypot(*response(fine))  # it matters
    assert by_steps <= 1.5 * dict(one.shear_errors)["steps"]
    assert abs(fine.dissipated_mJ - one.dissipated_mJ) <= 1.5 * one.dissipated_error_mJ
    assert abs(fine.slip_area_fraction - one.slip_area_fraction) <= 1.5 * one.slip_area_error


@pytest.mark.long
def test_under_an_approach_the_normal_force_errs_too():
    step = ran(load="approach").steps[-1]
    others = sum(error for cause, error in step.errors if cause not in ("grid", "coupling"))
    coupled = ran(load="approach", check="none", coupled=True).steps[-1]
    assert abs(coupled.force_N - step.force_N) <= 1.5 * dict(step.errors)["coupling"]
    share = np.hypot(*response(step)) * others / step.force_N
    assert dict(step.shear_errors)["normal force"] == pytest.approx(share, rel=1e-9)


@pytest.mark.long
def test_unless_asked_for_and_on_few_cells_there_are_none():
    step = ran(check="none").steps[-1]
    assert step.shear_force_error_N is None
    assert step.shear_errors == ()
    few = ran(cells=12).steps[-1]
    assert few.shear_errors == (("grid", np.inf),)
    assert few.shear_force_error_N is None
    assert "the shear force has no stated error: grid not measured" in " ".join(ran(cells=12).notes)
    every = ran(check="all", by_force=True).steps
    assert all(step.shear_errors for step in every)


def test_paths_are_gone_through_their_turning_points():
    steps = ran(check="none").steps
    assert [step.step for step in turning_points(steps)] == [2, 4, 6]
    # a load that changes under shear needs every step, and one that has fallen its largest
    eased = [replace(step, force_N=6.0 - 0.1 * step.step, approach_mm=step.step) for step in steps]
    assert [step.step for step in turning_points(eased[1:])] == [2, 3, 4, 5, 6]
    assert turning_points(steps[:1]) == list(steps[:1])
    every = turning_points(steps, every_load=True)
    assert [step.step for step in every] == [1, 2, 4, 6]


LAWS = {
    "friction": {"coefficient": 0.3},
    "patches": {"grid": [2, 2]},
    "micro": {"finite_slopes": False},  # isolated laws have none
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "load"), [("consistent", {"force": 6.0}), ("isolated", {"approach": 7e-3})]
)
def test_errors_of_laws_are_those_against_coupled_cells_on_the_body(kind, load):
    surface = {"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [1.0, 1.0]}
    block = {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [3, 3, 2]}
    loads = load | {"steps": 1, "shear": [[1e-3, 2e-4]], "shear_steps": 1}
    quiet = {"figures": False, "report": False}
    sections = LAWS | {"surface": surface, "block": block}
    laws = run(pressed_cells(kind, loads, output=quiet | {"check": "last"}, **sections))
    own = laws.steps[-1]
    sections["friction"] = {"coefficient": 0.3, "coupled": True}
    whole = kind == "consistent"
    check = {"check": "last" if whole else "none"}
    cells = run(pressed_cells("concurrent", loads, output=quiet | check, **sections))
    exact = cells.steps[-1]
    parts = dict(own.shear_errors)
    assert list(parts)[:3] == ["laws", "grid", "body"]
    assert "coupling" not in parts  # which the laws are compared with
    assert parts["steps"] > 0.0  # friction holds the face while it is pressed, too
    apart = np.hypot(*(response(own) - response(exact)))
    assert parts["laws"] == pytest.approx(apart, rel=0.01)  # of steps that agree to 1e-6
    assert parts["laws"] > 0.02 * np.hypot(*response(exact))
    if whole:
        assert parts["grid"] == pytest.approx(
            dict(exact.shear_errors)["grid"], rel=1e-3
        )  # of cells
    assert own.shear_force_error_N == pytest.approx(sum(parts.values()))
    under_approach = dict(own.errors)["laws"]
    if "approach" in load:
        assert under_approach == pytest.approx(abs(own.force_N - exact.force_N), rel=0.01)
    else:
        way = abs(own.approach_mm - exact.approach_mm)
        assert own.approach_error_mm >= 0.7 * way  # by the stiffness of a frictionless contact
    for name, error in ERRORS_OF.items():
        assert abs(getattr(own, name) - getattr(exact, name)) <= getattr(own, error) < np.inf
    assert "its shift the shear force is within" in " ".join(laws.notes)


SLAB = {"young_modulus": 4000.0, "poisson_ratio": 0.15, "lengths": [5.0, 4.0], "height": 2.0}


def of_samples(*, by_force=False, approach=False, shear=True, law=(), load=None, check="last"):
    """A slab with the law of a sample on its face, sheared."""
    surface = {"spectrum": SPECTRUM | {"waves": [2, 4]}, "grid": [16, 16], "lengths": [1.0, 1.0]}
    loads = {"approach": 9e-3} if approach else {"force": 110.0}
    shears = {"shear_force": [[14.0, 6.0]]} if by_force else {"shear": [[1e-3, 2e-4]]}
    load = load or loads | {"steps": 1} | (shears | {"shear_steps": 1} if shear else {})
    data = {
        "surface": surface, "law": {"kind": "representative"} | dict(law),
        "block": SLAB | {"cells": [3, 3, 2]}, "friction": {"coefficient": 0.3}, "load": load,
        "output": {"check": check, "figures": False, "report": False},
    }  # fmt: skip
    return run(Scene.from_dict(data))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("by_force", "seeds"), [pytest.param(True, (), marks=pytest.mark.long), (False, (12, 5))]
)
def test_laws_of_samples_state_errors_of_normal_force_and_shear(by_force, seeds, monkeypatch):
    """Several samples add their scatter."""
    solved, solve = [], LawContactProblem.solve
    monkeypatch.setattr(
        LawContactProblem, "solve", lambda *of: solved.append(solve(*of)) or solved[-1]
    )
    approach, law = not by_force, [("seeds", seeds)] if seeds else []
    history = of_samples(by_force=by_force, approach=approach, law=law)
    nearer = approach  # by the error of the zero; other elements take products
    assert len(solved) == len(history.steps) + nearer
    step, scatter = history.steps[-1], ["samples"] if seeds else []
    for parts in (dict(step.errors), dict(step.shear_errors)):
        causes = [
            "mesh",
            "quadrature",
            "laws",
            *scatter,
            "grid",
            "slopes",
            "edges",
            "zero",
            "steps",
        ]
        assert list(parts) == causes
        assert all(0.0 < error < np.inf for cause, error in parts.items() if cause != "zero")
    shear, size = sum(dict(step.shear_errors).values()), response(step, by_force=by_force)
    columns = step.shear_force_error_N, step.shear_error_mm
    assert columns == pytest.approx((0.0, shear) if by_force else (shear, 0.0))
    of_one = shear - dict(step.shear_errors).get("samples", 0.0)
    assert 0.01 < of_one / np.hypot(*size) < 0.6
    assert 0.0 < step.dissipated_error_mJ < np.inf
    assert (step.force_error_N > 0.0) is approach
    assert (step.approach_error_mm > 0.0) is not approach
    assert "under its shear force the shift is within" in " ".join(history.notes) or not by_force
    parts = dict(step.shear_errors)
    assert not seeds or parts["samples"] > parts["slopes"]
    pairs = [
        (step.contact_area_fraction, step.contact_area_fraction_error),
        (step.mean_separation_mm, step.mean_separation_error_mm),
        (step.interface_stiffness_N_per_mm, step.interface_stiffness_error_N_per_mm),
    ]
    if approach and step.force_error_N > step.force_N:  # two samples: it may not touch at all
        assert pairs.pop()[1] is None
    for value, error in pairs:
        assert 0.0 < error < (np.inf if seeds else value)


@pytest.mark.slow
def test_the_scatter_of_area_gap_and_stiffness_is_that_between_runs_of_single_samples():
    """Of two samples Student's t of 19 in 20 is 12.7, their mean errs by 6.35 of the difference."""

    def read(seeds):
        seed = SPECTRUM["seed"] if len(seeds) > 1 else seeds[0]
        surface = {"spectrum": SPECTRUM | {"seed": seed}, "grid": [32, 32], "lengths": [1.0, 1.0]}
        law = {"kind": "representative"} | ({"seeds": seeds} if len(seeds) > 1 else {})
        data = {
            "surface": surface | {"periodic": True},
            "law": law,
            "block": SLAB | {"cells": [2, 2, 2]},
            "load": {"force": 600.0, "steps": 1},
            "output": {"check": "last", "figures": False, "report": False},
        }
        step = run(Scene.from_dict(data)).steps[-1]
        values = step.contact_area_fraction, step.mean_separation_mm
        errors = step.contact_area_fraction_error, step.mean_separation_error_mm
        of_stiffness = step.interface_stiffness_N_per_mm, step.interface_stiffness_error_N_per_mm
        return np.array([[*values, of_stiffness[0]], [*errors, of_stiffness[1]]])

    both, *each = read([12, 5]), read([12]), read([5])
    by_samples = both[1] - 0.5 * (each[0][1] + each[1][1])  # less what a single sample errs by
    apart = np.abs(each[0][0] - each[1][0])
    # the pressure on the face is uniform to a few per cent, and the causes add up
    np.testing.assert_allclose(by_samples, 6.353 * apart, rtol=0.25)


@pytest.mark.long
@pytest.mark.parametrize("by_force", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_errors_by_steps_of_laws_of_samples_hold_on_turning_paths(by_force):
    """Steps a quarter as long on the same mesh tell the error by the steps."""
    points = TURNS[:3] if not by_force else 3e4 * TURNS[:3]

    def end(times, check):
        key = "shear_force" if by_force else "shear"
        load = {"force": 110.0, "steps": times, key: points.tolist(), "shear_steps": times}
        return of_samples(load=load, check=check).steps[-1]

    one, fine = end(1, "last"), end(4, "none")
    own, exact = (response(step, by_force=by_force) for step in (one, fine))
    by_steps = np.hypot(*(exact - own))
    assert by_steps > 2e-3 * np.hypot(*exact)  # it matters
    assert by_steps <= 1.5 * dict(one.shear_errors)["steps"]
    lost = abs(fine.dissipated_mJ - one.dissipated_mJ)
    assert 0.02 * fine.dissipated_mJ < lost <= 1.5 * one.dissipated_error_mJ


@pytest.mark.long
def test_laws_of_samples_without_shear_state_the_error_of_what_holds_the_face():
    step = of_samples(shear=False).steps[-1]
    assert np.hypot(*response(step)) < 1e-3 * step.force_N  # the face is as symmetric as its mesh
    assert step.shear_force_error_N >= 0.0
    assert step.approach_error_mm > 0.0


@pytest.mark.long
def test_laws_without_shear_state_what_holds_their_face():
    """Friction holds the face under the plane, and its shear force has an error."""
    surface = {"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [1.0, 1.0]}
    block = {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [3, 3, 2]}
    sections = LAWS | {"surface": surface, "block": block}
    quiet = {"figures": False, "report": False, "check": "last"}
    step = run(pressed_cells("consistent", {"force": 6.0, "steps": 2}, output=quiet, **sections))
    assert dict(step.steps[-1].shear_errors)["laws"] > 0.0


@pytest.mark.long
def test_a_path_goes_on_from_where_it_was_measured_before_as_it_would_from_its_start(monkeypatch):
    load = {"force": 3.0, "steps": 1, "shear_force": [[0.5, 0.1]], "shear_steps": 3}
    surface = {"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [1.0, 1.0]}
    rubs = {"coefficient": 0.3, "coupled": True}
    whole, went = Run(pressed_cells("analytic", load, surface=surface, friction=rubs)), []
    press, (*past, third, last) = shear.press_coupled, whole.load_steps()
    monkeypatch.setattr(shear, "press_coupled", lambda *a, **k: went.append(a) or press(*a, **k))
    third = replace(third, **whole.coupling.measured_errors(third, past, normal=False))
    presses, errors = [len(went)], []
    for begins_anew in (False, True):
        if begins_anew:
            whole.coupling._walks.clear()
        errors.append(whole.coupling.measured_errors(last, [*past, third], normal=False))
        presses.append(len(went) - sum(presses))
    assert errors[0] == errors[1]
    assert 3 * presses[1] < presses[2]


@pytest.mark.long
def test_how_much_of_the_check_is_done_is_told():
    """From nothing on, and never all before its end, so that what is left can be told."""
    told = []
    scene = pressed_cells(
        "analytic",
        {"approach": 9e-3, "steps": 1} | SHEAR,
        surface={"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [1.0, 1.0]},
        friction={"coefficient": 0.3, "coupled": True},
        output={"check": "last", "figures": False, "report": False},
    )
    run_of = Run(scene, observe=lambda *what: told.append(what))
    for _ in run_of.load_steps():
        pass
    shares = [done for what, done, most in told if what == "check of friction" and most is WHOLE]
    assert shares[0] == 0 and shares == sorted(shares) and 90 <= shares[-1] < 100
