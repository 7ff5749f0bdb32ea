"""Scenes on bodies from meshes, against blocks, closed forms and each other."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.box_msh import write_box
from helpers.laws_on_mesh import lay_on_mesh
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from patchlaw import InputError
from patchlaw.geometry import BlockShape, Control
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import Run, Scene, difference, read_history
from patchlaw.multiscale.laws.export import export_texts
from patchlaw.multiscale.results.figures.contact import face_shear_figure
from patchlaw.multiscale.runs.output.results import write_results

CELLS, HEIGHT = (6, 6, 4), 1.0
TICKS = BlockShape(interface=(1.0, 1.0), height=HEIGHT, cells=CELLS).ticks
E, NU = 4000.0, 0.15
CONSTANTS = {"young_modulus": E, "poisson_ratio": NU}
HELD = [{"surface": "bottom"}]
SPECTRUM = {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.2, "seed": 3}
SURFACE = {"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [1, 1]}
SAMPLE = {**SURFACE, "lengths": [0.1, 0.1]}
HALVES = {
    "body": {"young_modulus": E, "poisson_ratio": 0},
    "other": {"young_modulus": 2 * E, "poisson_ratio": 0},
}
SOFT = 60.0
QUIET = {"figures": False, "report": False, "check": "none", "contact": "none"}
PATCHES = {
    "surface": SURFACE,
    "patches": {"grid": [2, 2]},
    "micro": {"finite_slopes": False},
    "load": {"approach": "6 um", "steps": 2, "tilt": [1e-3, 0]},
    "output": QUIET,
}
WAYS = {"condensed": {}, "full": {}, "pointwise": {"interface": "pointwise"}}
TURN = (Rotation.from_euler("x", -2.0) * Rotation.from_euler("y", 0.7)).as_matrix()
"""Turns the face out of its plane, but not in it: its first axis stays that nearest to x."""


ASKEW = Rotation.from_euler("z", 0.6).as_matrix()
"""Turns the face in its plane."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder with the cube, turned and shifted, and its mirror image above it."""
    place = tmp_path_factory.mktemp("meshes")
    x, y, z = TICKS
    write_box(place / "cube.msh", TICKS)
    write_box(place / "turned.msh", TICKS, turn=TURN, shift=(30.0, -20.0, 10.0))
    write_box(place / "askew.msh", TICKS, turn=ASKEW, shift=(3.0, 4.0, 5.0))
    write_box(place / "above.msh", (x, y, -z[::-1]))
    write_box(place / "halves.msh", TICKS, halves=True)
    return place


def body(folder, name="cube", **changes):
    found = {"mesh": str(folder / f"{name}.msh"), "contact": "top", "supports": HELD, **CONSTANTS}
    return found | changes


def done(*, table=None, **sections):
    whole = Run(Scene.from_dict(sections))
    whole.coupling.table = table
    list(whole.load_steps())
    return whole


def forces(whole):
    return np.array([step.force_N for step in whole.steps])


@pytest.fixture(scope="module")
def sampled(folder):
    """Laws of the sample, which no body changes."""
    load, sections = {"approach": "6 um", "steps": 1}, {"surface": SAMPLE, "output": QUIET}
    run = done(**sections, law={"kind": "representative"}, body=body(folder), load=load)
    return run.coupling.table


@pytest.mark.slow
@pytest.mark.parametrize("name", WAYS)
def test_a_cube_from_a_file_is_the_block(folder, name, monkeypatch):
    if name == "full":
        lay_on_mesh(monkeypatch)
    coupling = {"coupling": {"kind": "isolated", "table_tolerance": 1e-2, **WAYS[name]}}
    block = {"block": {**CONSTANTS, "cells": CELLS}}
    expected = done(**PATCHES, **coupling, **block)
    table = expected.coupling.table
    assert forces(expected)[-1] > 0.1
    found = done(**PATCHES, **coupling, body=body(folder), table=table)
    assert forces(found) == pytest.approx(forces(expected), rel=1e-10)
    found = done(**PATCHES, **coupling, body=body(folder, "turned"), table=table)
    assert forces(found) == pytest.approx(forces(expected), rel=1e-9)
    np.testing.assert_allclose(found.coupling.parts.body.lengths, [1, 1], rtol=1e-12)
    axis = [float(part) for part in 3.0 * ASKEW[:, 0] + [0.0, 0.0, 7.0]]
    found = done(**PATCHES, **coupling, body=body(folder, "askew", first_axis=axis), table=table)
    assert forces(found) == pytest.approx(forces(expected), rel=1e-9)


@pytest.mark.long
def test_laws_of_samples_do_not_depend_on_where_the_body_lies(folder):
    sections = {"law": {"kind": "representative"}, "surface": SAMPLE, "output": QUIET}
    load = {"load": {"force": "2 N", "steps": 2}}
    here = done(**sections, **load, body=body(folder))
    there = done(**sections, **load, body=body(folder, "turned"), table=here.coupling.table)
    approach = [[step.approach_mm for step in whole.steps] for whole in (here, there)]
    assert approach[1] == pytest.approx(approach[0], rel=1e-9)
    block = {**CONSTANTS, "cells": CELLS, "lengths": [1, 1], "height": HEIGHT}
    on_block = done(**sections, **load, block=block, table=here.coupling.table)
    approach = [step.approach_mm for step in on_block.steps]
    assert approach == pytest.approx([step.approach_mm for step in here.steps], rel=1e-10)


ROLLERS = [
    *HELD,
    *({"surface": name, "displacement": [0, "free", "free"]} for name in ("left", "right")),
    *({"surface": name, "displacement": ["free", 0, "free"]} for name in ("front", "back")),
]


def column(law, approach, height=HEIGHT, young_modulus=E):
    """Return the pressure of a column without lateral strain in series with a law."""
    confined = young_modulus * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    compliance = height / confined

    def excess(pressure):
        return float(law.pressure(approach - compliance * pressure)) - pressure

    return brentq(excess, 0.0, approach / compliance, xtol=1e-14)


@pytest.mark.long
def test_a_column_in_series_with_the_law_of_a_sample(folder):
    found = done(
        surface=SAMPLE,
        law={"kind": "representative", "seeds": [1, 2]},
        body=body(folder, supports=ROLLERS),
        load={"approach": "6 um", "steps": 2},
        output=QUIET,
    )
    law = found.coupling.table.laws[0]
    expected = [column(law, step.approach_mm) for step in found.steps]
    assert forces(found) == pytest.approx(expected, rel=1e-10)  # on 1 mm²
    peaks = [step.peak_pressure_MPa for step in found.steps]
    assert peaks == pytest.approx(expected, rel=1e-8)  # residual of Newton's method at points


@pytest.mark.slow
def test_regions_are_columns_of_their_own_where_nothing_moves_sideways(folder, tmp_path):
    smooth = {**SAMPLE, "spectrum": {**SPECTRUM, "rms_slope": 0.1}, "surface": "upper half"}
    found = done(
        surface=SAMPLE,
        law={"kind": "representative", "regions": [smooth]},
        body=body(
            folder,
            "halves",
            supports=[*HELD, {"surface": "top", "displacement": [0, 0, "free"]}][:1],
            materials=HALVES,
            young_modulus=None,
            poisson_ratio=None,
        ),
        load={"approach": "6 um", "steps": 1},
        leak={"viscosity": "1 mPa s", "pressures": [1.0, 0.0], "inlet": "front", "outlet": "back"},
        output={**QUIET, "figures": True, "report": True},
    )
    rows = found.history().patch_records()
    assert [row["region"] for row in rows] == ["top", "upper half"]
    assert rows[0]["pressure_MPa"] < rows[1]["pressure_MPa"]
    areas = np.array([0.5, 0.5])
    pressures = [row["pressure_MPa"] for row in rows]
    assert found.steps[0].force_N == pytest.approx(areas @ pressures, rel=1e-12)
    # every zone has its row in history, report and comparison
    assert [row["force_N"] for row in rows] == pytest.approx(areas * pressures, rel=1e-12)
    touching = [row["contact_area_mm2"] / row["contact_area_fraction"] for row in rows]
    assert touching == pytest.approx(areas, rel=1e-12)
    # halves side by side between inlet and outlet: each leaves what flows through it
    leaks = [row["leak_mm3_per_s"] for row in rows]
    assert sum(leaks) == pytest.approx(found.steps[0].leak("face").rate, rel=1e-9)
    solver = found.coupling.model
    points, separation = solver.face.sides[0].quadrature, solver.point_separations
    flows = [
        points.weight[points.patch == zone]
        @ law.transmissivity.at(separation[points.patch == zone])[:, 1]
        / 12e-9
        for zone, law in enumerate(found.laws.laws)
    ]  # 1 mm wide and long, and nothing varies along the flow
    assert leaks == pytest.approx(flows, rel=1e-3)  # facets beside the border share its nodes
    write_results(tmp_path, found, options=[])
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Zones of the face at load step 1" in report
    assert 'alt="upper half: a periodic sample' in report  # its surface
    assert not list(tmp_path.glob("surface_of_zone*"))
    again = read_history(tmp_path)
    assert again.patch_records() == rows
    headings, cells = again.zone_table()
    assert [row[0] for row in cells] == ["top", "upper half"]
    assert headings[1] == "force [N]" and headings[-1].startswith("leaves there")
    both = difference(found.history(), tmp_path)
    forces = both.of("upper half force_N")
    assert forces.values[:, -1] == pytest.approx([rows[1]["force_N"]] * 2, rel=1e-12)


@pytest.fixture(scope="module")
def zones(folder):
    """A face that slides, of one roughness, whose upper half yields and has another friction."""
    half = {**SAMPLE, "surface": "upper half", "hardness": SOFT, "friction": 0.1}
    return done(
        surface=SAMPLE,
        law={"kind": "representative", "regions": [half], "largest_pressure": 40.0},
        body=body(folder, "halves", materials=HALVES, young_modulus=None, poisson_ratio=None),
        friction={"coefficient": 0.4},
        load={"force": "4 N", "steps": 1, "shear": [["50 um", "0 um"]], "shear_steps": 1},
        output={**QUIET, "report": True},
    )


def test_every_zone_has_its_own_friction_and_hardness(zones, tmp_path):
    last = zones.steps[-1]
    normal = last.patches.force_N
    # where all of a face slides its shear stresses are μ times the pressures
    assert last.shear_force_x_N == pytest.approx([0.4, 0.1] @ normal, rel=1e-9)
    sample = zones.coupling.parts.surface
    for law, modulus, hardness in zip(zones.laws.laws, (E, 2 * E), (None, SOFT), strict=True):
        row = law.rows[-2:-1]  # against the contact problem of its cells
        under = Control(approach=float(row.closure[0]))
        model = HalfSpaceModel(sample, contact_modulus=modulus, periodic=True)
        cells = replace(model, hardness=hardness).press(under)
        assert row.pressure[0] == pytest.approx(cells.mean_pressure, rel=1e-6)  # of the cells
    assert cells.mean_pressure < 0.9 * model.press(under).mean_pressure  # it yields
    write_results(tmp_path, zones, options=[])
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "0.4 on top, 0.1 on upper half" in report  # friction
    assert "none on top, 60 MPa on upper half" in report  # hardness


def test_a_face_that_slides_is_drawn_so_facet_by_facet(zones):
    corners, stress, slips = zones.coupling.model.facet_shear()
    ahead, last = np.roll(corners, -1, axis=1), zones.steps[-1]
    crossed = corners[..., 0] * ahead[..., 1] - corners[..., 1] * ahead[..., 0]
    areas = 0.5 * np.abs(crossed.sum(axis=1))
    assert areas @ stress[:, 0] == pytest.approx(last.shear_force_x_N, rel=1e-9)
    assert slips == pytest.approx(1.0)
    figure = face_shear_figure(zones.history(), corners, stress, slips)
    assert [axes.get_title() for axes in figure.axes[:2]] == [
        "100 % of the contact area slips",
        "shear stress, averaged over the roughness",
    ]


def test_laws_of_zones_are_exported_with_their_friction(zones):
    text = export_texts(zones.laws, "calculix", friction=zones.scene.coefficients)
    rows = text["laws_calculix.inp"].split("*FRICTION\n")[1:]
    assert [float(row.split(",")[0]) for row in rows] == [0.4, 0.1]
    with pytest.raises(InputError, match="one of each of 2 laws"):
        export_texts(zones.laws, "calculix", friction=[0.4])


@pytest.mark.long
def test_a_crown_is_a_gap_of_the_face(folder, sampled):
    """The same parabola as a key, and as nodes of the mesh that lie lower."""
    ticks = np.linspace(0, 1, 21), *TICKS[1:]
    write_box(folder / "fine.msh", ticks)
    write_box(folder / "crowned.msh", ticks, crown=1e-2)
    sections = {"surface": SAMPLE, "output": QUIET, "load": {"approach": "6 um", "steps": 1}}
    law, crowned = {"kind": "representative"}, body(folder, "crowned")
    flat = done(**sections, law=law, body=body(folder, "fine"), table=sampled)
    key = done(
        **sections, law={**law, "crown": ["0.1 m", "inf"]}, body=body(folder, "fine"), table=sampled
    )
    found = done(**sections, law=law, body=crowned, table=sampled)
    assert forces(found)[-1] < 0.95 * forces(flat)[-1]
    assert forces(found) == pytest.approx(forces(key), rel=2e-3)  # chords of the parabola
    assert "below its highest point" in found.coupling.parts.body.notes[0]
    with pytest.raises(InputError, match=r"is not planar: its nodes are up to 0\.000625 mm off"):
        Run(Scene.from_dict({**PATCHES, "body": crowned}))


REFUSED = {
    "contact": ({"contact": "topp"}, "body.contact = 'topp': the mesh has no surface .*did you me"),
    "supports": ({"supports": [{"surface": "botom"}]}, "body.supports = 'botom': .*mean 'bottom'"),
    "free": (
        {"supports": [{"surface": "bottom", "displacement": ["free", 0, 0]}]},
        "body.supports: the supports leave the body free to move: translation along x",
    ),
    "held contact": ({"supports": [{"surface": "top"}]}, "'top' is the contact face and cannot"),
    "materials": (
        {"young_modulus": None, "poisson_ratio": None, "materials": {"bodi": CONSTANTS}},
        "body.materials = 'bodi': the mesh has no volume of this name; did you mean 'body'",
    ),
    "file": ({"mesh": "nowhere.msh"}, "there is no such file"),
    "place": (
        {"place": ["0.2 mm", 0]},
        "body.place: the surface's rectangle, 1 × 1 mm, does not lie on the contact face, which "
        "covers 80 % of it .*law.kind = 'representative'",
    ),
}


@pytest.mark.parametrize(("changes", "text"), REFUSED.values(), ids=REFUSED)
def test_bodies_that_do_not_fit_are_refused(folder, changes, text):
    with pytest.raises(InputError, match=text):
        Run(Scene.from_dict({**PATCHES, "body": body(folder, **changes)}))


def test_faces_that_do_not_face_each_other_are_refused(folder):
    upside = body(folder, "above", contact="left", supports=[{"surface": "top"}])
    with pytest.raises(InputError, match=r"counter_body.contact: does not face the body"):
        Run(Scene.from_dict({**PATCHES, "body": body(folder), "counter_body": upside}))
