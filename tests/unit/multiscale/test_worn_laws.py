"""Wear of faces under laws of samples and of patches: volume, heat, a user's problem, resuming."""

import numpy as np
import pytest
from dolfinx import fem
from helpers.resumed_runs import gone_on, ran_past

from patchlaw import run
from patchlaw.geometry import Control
from patchlaw.macro import ContactProblem, Interface, compat
from patchlaw.multiscale import Scene
from tests.helpers.user_problems import elastic

pytestmark = pytest.mark.long  # laws of eight worn samples: 8 s

COEFFICIENT, SLID, FORCE = 1.3e-8, (300.0, 4.1e3), 23.0
"""Of wear [mm²/N], what is slid [mm], and the force [N]."""


def scene(**changes):
    spectrum = {"hurst": 0.8, "waves": [2, 5], "rms_height": 3e-3, "seed": 5}
    data = {
        "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": [1.0, 1.0]},
        "block": {
            "young_modulus": "1 GPa",
            "poisson_ratio": 0.25,
            "height": "4 mm",
            "lengths": [6.0, 4.0],
            "cells": [3, 2, 1],
        },
        "law": {"kind": "representative", "largest_pressure": "4 MPa"},
        "coupling": {"table_tolerance": 0.05},
        "wear": {"coefficient": f"{COEFFICIENT!r} mm^2/N"},
        "friction": {"coefficient": 0.37, "speed": "2 m/s"},
        "load": {"force": f"{FORCE} N", "steps": 1, "tilt": [3e-4, 0.0], "sliding": list(SLID)},
        "output": {"figures": False, "report": False, "check": "last"},
    }
    return Scene.from_dict({**data, **changes})


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """A run, and the file to go on from that it left after its second load step."""
    checkpoint = tmp_path_factory.mktemp("worn") / "checkpoint.state"
    return ran_past(scene(), 2, checkpoint), checkpoint


def test_the_volume_is_that_of_archard(worn):
    history = worn[0].history()
    slid = np.array([0.0, *SLID])
    np.testing.assert_allclose(history.slid_mm, slid, rtol=1e-14)
    np.testing.assert_allclose(history.worn_volume_mm3, COEFFICIENT * FORCE * slid, rtol=1e-10)
    assert (np.diff(history.contact_area_fraction) > 0.0).all()
    assert (np.diff(history.interface_stiffness_N_per_mm) > 0.0).all()
    heat = 0.37 / COEFFICIENT * history.worn_volume_mm3
    np.testing.assert_allclose(history.dissipated_mJ, heat, rtol=1e-9)
    np.testing.assert_allclose(history.friction_power_W, 0.37 * FORCE * 2.0, rtol=1e-9)
    causes = dict(history.steps[-1].errors)
    assert 0.0 < causes["wear"] < 0.1 * FORCE and np.isfinite(history.approach_error_mm[-1])


def test_a_run_that_goes_on_wears_on(worn):
    whole, checkpoint = worn
    _, (again,) = gone_on(scene(), checkpoint)
    last = whole.history().steps[-1]
    for name in ("approach_mm", "contact_area_fraction", "worn_depth_mm", "worn_volume_mm3"):
        assert getattr(again, name) == pytest.approx(getattr(last, name), rel=1e-8), name


def test_a_users_problem_wears_as_the_scene(worn):
    """On the scene's mesh and laws, in the steps that the same errors choose."""
    run = worn[0]
    body = run.coupling.model.face.body
    space = compat.vector_space(body.mesh.mesh, 1)
    held = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[2], -4.0))
    support = fem.dirichletbc(np.zeros(3), held, space)
    u = fem.Function(space)
    rough = Interface(
        space, body.mesh.facet_tags, 2, laws=run.laws, wear=COEFFICIENT,
        indenter=Control(force=FORCE, tilt=(3e-4, 0.0)),
    )  # fmt: skip
    inner = elastic(u, young=1000.0, poisson=0.25, degree=body.quadrature_degree)
    problem = ContactProblem(inner, u, [support], rough)
    steps = run.history().steps
    problem.solve()
    for step, distance in zip(steps[1:], np.diff([0.0, *SLID]), strict=True):
        problem.slide(distance)
        assert rough.plane.approach == pytest.approx(step.approach_mm, rel=1e-7)
        assert rough.worn_volume == pytest.approx(step.worn_volume_mm3, rel=1e-8)
        assert rough.area / 24.0 == pytest.approx(step.contact_area_fraction, rel=1e-6)


def test_the_error_of_the_area_knows_on_which_cells_spots_have_grown():
    """Against four times as many a side, within 1.2 times; worn heights alone tell a third less."""
    spectrum = {"hurst": 0.8, "waves": [3, 6], "rms_height": 2.61e-3, "seed": 6}
    last = []
    for cells, check in ((24, "last"), (96, "none")):
        given = scene(
            surface={"spectrum": spectrum, "grid": [cells, cells], "lengths": [4.0, 4.0]},
            block={"young_modulus": 1e3, "poisson_ratio": 0.25, "height": 2.0,
                   "lengths": [4.0, 4.0], "cells": [2, 2, 1], "element": "Q2"},
            micro={"finite_slopes": False},
            law={"kind": "representative"}, friction=None,
            coupling={"table_tolerance": 5e-3},
            wear={"coefficient": 1e-8},
            load={"force": 12.9, "steps": 1, "sliding": [1.46e4]},
            output={"figures": False, "report": False, "check": check},
        )  # fmt: skip
        last.append(run(given).steps[-1])
    own, true = last
    off = abs(own.contact_area_fraction - true.contact_area_fraction)
    assert off < 1.2 * own.contact_area_fraction_error


def test_faces_fret_as_their_cells(tmp_path):
    """Where cells slip their roughness runs in: what wears lets the plane come 13 times as near."""
    wear, rubs = {"coefficient": "1.1e-4 mm^2/N"}, {"coefficient": 0.37}
    shear = {"shear": [[0.02, 0.0], [-0.02, 0.0]], "shear_steps": 1, "steps": 1}
    fretting = {"wear": wear, "friction": rubs, "load": {"force": f"{FORCE} N", **shear}}
    whole = ran_past(scene(**fretting), 2, tmp_path / "checkpoint.state")
    laws = whole.history()
    spectrum = {"hurst": 0.8, "waves": [2, 5], "rms_height": 3e-3, "seed": 5}
    surface = {"spectrum": spectrum, "grid": [16, 16], "lengths": [1.0, 1.0], "periodic": True}
    block = {"young_modulus": "1 GPa", "poisson_ratio": 0.25}
    rubs = {"friction": rubs | {"coupled": False}, "load": {"force": f"{FORCE / 24} N", **shear}}
    quiet = {"output": {"figures": False, "report": False}, "coupling": {"kind": "analytic"}}
    data = {"surface": surface, "block": block, "wear": wear, **rubs, **quiet}
    cells = run(Scene.from_dict(data))
    rates = []
    for history in (laws, cells):
        energy = 1.1e-4 / 0.37 * np.array(history.dissipated_mJ)
        np.testing.assert_allclose(history.worn_volume_mm3[1:], energy[1:], rtol=1e-8)
        depth, approach = np.array([history.mean_worn_depth_mm, history.approach_mm])
        rates.append((approach[-1] - approach[1]) / (depth[-1] - depth[1]))
    assert rates[1] > 10.0 and rates[0] == pytest.approx(rates[1], rel=0.15)
    last = laws.steps[-1]
    assert 0.0 < last.worn_volume_error_mm3 < last.worn_volume_mm3
    _, (*_, again) = gone_on(scene(**fretting), tmp_path / "checkpoint.state")
    for name in ("approach_mm", "shear_force_x_N", "worn_volume_mm3", "slid_mm", "dissipated_mJ"):
        assert getattr(again, name) == pytest.approx(getattr(last, name), rel=1e-7), name


def of_patches(kind, **changes):
    """Return a scene of four patches of a map, or of its cells."""
    spectrum = {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1, "seed": 5}
    block = {"young_modulus": "70 GPa", "poisson_ratio": 0.3, "height": "1 mm"}
    data = {
        "surface": {"spectrum": spectrum, "grid": [20, 20], "lengths": [0.93, 0.81]},
        "block": block,
        "coupling": {"kind": kind},
        "patches": {"grid": [2, 2]},
        "wear": {"coefficient": "3.1e-10 mm^2/N"},
        "friction": {"coefficient": 0.37},
        "load": {"force": "21 N", "steps": 1, "tilt": [2e-4, 0.0], "sliding": [1.3e3, 6.1e3]},
        "output": {"figures": False, "report": False, "check": "last"},
    }
    return Scene.from_dict({**data, **changes})


def test_laws_of_patches_run_in_as_their_cells(tmp_path):
    """Laws follow the distance slid."""
    whole = ran_past(of_patches("consistent"), 2, tmp_path / "checkpoint.state")
    laws = whole.history()
    cells = run(of_patches("concurrent", output={"figures": False, "report": False}))
    for name, share in (
        ("approach_mm", 2e-3),
        ("contact_area_fraction", 0.05),
        ("mean_separation_mm", 1e-3),  # patches that stay open sink and rise with the others
        ("worn_volume_mm3", 1e-9),
        ("dissipated_mJ", 1e-9),
    ):
        np.testing.assert_allclose(getattr(laws, name), getattr(cells, name), share, err_msg=name)
    assert cells.contact_area_fraction[-1] > 2.0 * cells.contact_area_fraction[0]
    last, causes = laws.steps[-1], dict(laws.steps[-1].errors)
    assert 0.0 < causes["laws"] < 0.02 * 21.0 and causes["wear"] > 0.0
    assert abs(last.approach_mm - cells.approach_mm[-1]) < last.approach_error_mm
    _, (again,) = gone_on(of_patches("consistent"), tmp_path / "checkpoint.state")
    for name in ("approach_mm", "contact_area_fraction", "worn_volume_mm3", "dissipated_mJ"):
        assert getattr(again, name) == pytest.approx(getattr(last, name), rel=1e-8), name


def test_laws_of_patches_run_in_under_a_plane_that_turns_as_their_cells(tmp_path):
    """Also at a distance between two that laws were made for."""
    quiet = {"figures": False, "report": False, "check": "none"}
    load = {"force": "21 N", "steps": 1, "tilt": "free"}
    given, cells = (
        of_patches(kind, load=load | change, output=quiet)
        for kind, change in (  # where steps may be halved laws are made at distances between
            ("consistent", {"sliding": [6.1e3], "force_change": 0.9}),
            ("concurrent", {"sliding": [3e3, 6.1e3]}),
        )
    )
    laws = ran_past(given, 1, tmp_path / "checkpoint.state")
    model, (new, between, last) = laws.coupling.model, run(cells).steps
    past, stiffness = model.past, model.stiffness()[:2]
    found = [*laws.history().steps[-2:], model.press(Control(force=21.0, tilt=None, slid=3e3))]
    for own, true in zip(found, (new, last, between), strict=True):
        for name, share in (("approach_mm", 2e-3), ("mean_separation_mm", 2e-3)):
            assert getattr(own, name) == pytest.approx(getattr(true, name), rel=share), name
        assert own.tilt == pytest.approx(true.tilt, abs=0.01 * np.hypot(*new.tilt))
        for name in ("force_N", "worn_volume_mm3", "dissipated_mJ"):
            known = getattr(true, name)
            # volumes between two distances are as linear as they are
            assert getattr(own, name) == pytest.approx(known, rel=1e-9, abs=1e-12), name
    assert np.hypot(*np.subtract(new.tilt, last.tilt)) > 0.05 * np.hypot(*new.tilt)
    # a load step that is taken back takes back the surface that had slid
    model.past = past
    assert model.stiffness()[:2] == pytest.approx(stiffness, rel=1e-12)


@pytest.mark.parametrize(
    "load",
    [
        {"force": "43 N", "steps": 1, "sliding": [1.1e3, 9.3e3]},
        {"approach": "9 um", "steps": 1, "sliding": [4e3], "force_change": 0.4},
    ],
    ids=["nearly all in contact", "between two distances at a held approach"],
)
def test_laws_of_patches_close_as_their_cells(load):
    """The pressure of a patch that is nearly closed is no function of its closure."""
    spectrum = {"hurst": 0.8, "waves": [2, 8], "rms_slope": 0.1, "seed": 5}
    changes = {
        "surface": {"spectrum": spectrum, "grid": [24, 24], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "height": 1.0},
        "micro": {"finite_slopes": False},
        "wear": {"coefficient": "1e-8 mm^2/N"},
        "output": {"figures": False, "report": False, "check": "none"},
    }
    laws = run(of_patches("consistent", load=load, **changes))
    slides = {"sliding": [one for one in laws.slid_mm if one], "force_change": None}
    cells = run(of_patches("concurrent", load=load | slides, **changes))
    last, count = cells.steps[-1], len(cells.steps)
    for name, share in (
        ("approach_mm", 2e-3),
        ("force_N", 5e-3),
        ("contact_area_fraction", 0.02),
        ("worn_volume_mm3", 1e-2),
    ):
        given, true = (getattr(one, name)[-count:] for one in (laws, cells))
        np.testing.assert_allclose(given, true, atol=share * true.max(), rtol=0.0, err_msg=name)
    assert last.contact_area_fraction > 0.8 or (last.force_N < 0.5 * cells.force_N[0] and count > 2)


def test_patches_that_nothing_touches_do_not_wear():
    load = {"approach": "0.01 um", "steps": 1, "tilt": "free", "sliding": [1.3e3]}
    last = run(of_patches("consistent", load=load)).steps[-1]
    assert last.force_N == last.worn_volume_mm3 == last.worn_depth_mm == 0.0


def test_laws_of_patches_wear_and_yield_as_their_cells():
    """Laws are made of heights that are lower by both depths; faces know what has worn off."""
    quiet = {"figures": False, "report": False, "check": "none"}
    changes = {"micro": {"hardness": "3 GPa"}, "output": quiet}
    laws, cells = (run(of_patches(kind, **changes)) for kind in ("consistent", "concurrent"))
    elastic = run(of_patches("concurrent", output=quiet))
    for name, share in (
        ("approach_mm", 2e-3),
        ("contact_area_fraction", 0.01),
        ("mean_separation_mm", 1e-3),
        ("worn_volume_mm3", 1e-9),
    ):
        np.testing.assert_allclose(getattr(laws, name), getattr(cells, name), share, err_msg=name)
    assert laws.approach_mm[-1] > 1.01 * elastic.approach_mm[-1]


def test_laws_of_patches_leak_as_their_cells(tmp_path):
    """One patch has all gaps between its walls, also as they wear; before as after."""
    leak = {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"], "direction": "x"}
    spectrum = {"hurst": 0.8, "waves": [2, 4], "rms_height": 1e-3, "seed": 5}
    changes = {
        "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": [0.93, 0.81]},
        "patches": {"grid": [1, 1]},
        "micro": {"finite_slopes": False},
        "load": {"force": "2 N", "steps": 1, "sliding": [1.3e4]},
        "leak": leak,
    }
    whole = ran_past(of_patches("consistent", **changes), 1, tmp_path / "checkpoint.state")
    laws, cells = whole.history(), run(of_patches("concurrent", **changes))
    np.testing.assert_allclose(laws.leak_x_mm3_per_s, cells.leak_x_mm3_per_s, rtol=0.02)
    assert cells.leak_x_mm3_per_s[-1] < 0.8 * cells.leak_x_mm3_per_s[0]
    assert dict(laws.steps[-1].leaks[0].causes)["wear"] > 0.0
    model = whole.coupling.model  # between two distances the surface leaks that presses
    step = model.press(Control(force=2.0, slid=6e3))
    through = model.past[0].transmissivities(step.approach_mm, step.patches.closure_mm)
    np.testing.assert_allclose(model.transmissivities(step, None, 0.0), through, rtol=1e-12)
