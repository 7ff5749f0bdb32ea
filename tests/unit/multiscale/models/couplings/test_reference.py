"""The meshed rough surface as a coupling: history, loads, error bars, files, refusals."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.results.figures.contact import pressure_figure
from patchlaw.multiscale.results.figures.curves import history_figure
from patchlaw.support import InputError

PAPER = Path(__file__).parents[5] / "demos" / "scenes" / "paper.toml"
COARSE = [
    "coupling.kind=reference", "surface.spectrum.waves=[1, 3]", "surface.grid=[32, 32]",
    "patches.grid=[3, 2]", "load.steps=2",
]  # fmt: skip
EDGES = "reference.fine='50 um'"


def scene(*more, edges=EDGES):
    return Scene.load(PAPER, [*COARSE, edges, *more])


@pytest.fixture(scope="module")
def history():
    return run(scene("reference.meshes=3"))


def test_patches_add_up(history):
    pressure = history.patch_pressure_MPa.mean(axis=1)  # equal patches, 1 mm² together
    np.testing.assert_allclose(pressure, history.mean_pressure_MPa, rtol=1e-12)  # rounding
    areas = [step.patches.contact_area_fraction.mean() for step in history]
    np.testing.assert_allclose(areas, history.contact_area_fraction, rtol=1e-12)
    # a patch sinks by much less than the approach, and may rise beside its neighbour; measured 0.25
    assert np.all(np.abs(history.closure_mm / history.approach_mm[:, None] - 1.0) < 0.3)


def test_support_bears_the_force(history):
    # the residual is 1e-10 of the contact forces
    assert max(abs(step.imbalance) for step in history) < 1e-9


def test_finest_mesh_is_the_history_and_meshes_differ(history):
    record = history.reference
    assert np.array_equal(record.force.meshes[-1], history.force_N)
    fraction = history.contact_area_fraction  # but for the order of its sum
    np.testing.assert_allclose(record.area.meshes[-1], fraction, rtol=1e-14)
    assert np.all(np.diff(record.sizes) < 0.0)
    assert np.all(np.diff(record.unknowns) > 0)
    assert np.all(record.approach.meshes == history.approach_mm)
    assert np.all(record.approach.error == 0.0)
    assert np.all(np.ptp(record.force.meshes, axis=0) > 0.0)
    assert np.all(record.force.error > 0.0)


def test_error_bar_is_reported_everywhere(history):
    label = history.reference.label
    assert re.fullmatch(r"± [\d.e+]+ %", label)
    header, rows = history.table()
    assert header[-1] == "at size zero [N]"
    assert all("±" in row[-1] for row in rows)
    assert any(label in note for note in history.notes)


def test_one_mesh_has_no_error_bar():
    history = run(scene("reference.meshes=1", "load.steps=1"))
    assert history.reference.label == "no error bar"
    assert np.isnan(history.reference.force.error).all()
    header, rows = history.table()
    assert (header[-1], rows[0][-1]) == ("at size zero", "no error bar")
    assert not history.reference.by_force
    assert any("no error bar" in note for note in history.notes)


def test_figures_show_the_error_bar_or_that_there_is_none(history):
    (force, area, _) = history_figure(history, "reference").axes
    assert [band.get_label() for band in force.patches] == [history.reference.label]
    assert len(area.patches) == 1
    alone = replace(history, reference=ReferenceRecord.of(
        [replace(step, meshes=step.meshes[-1:]) for step in history], history.reference.sizes[-1:],
        history.reference.unknowns[-1:], force_order=2.0,
    ))  # fmt: skip
    (force, area, _) = history_figure(alone, "reference").axes
    assert not force.patches
    assert not area.patches
    assert "(no error bar)" in force.get_legend_handles_labels()[1]
    assert "no error bar" in pressure_figure(alone).axes[0].get_title()


@pytest.fixture(scope="module")
def by_force():
    data = scene("load.steps=1").to_dict()
    data["load"] = {"force": ["2 N", "0.5 N"], "steps": 1, "tilt": "free"}
    return run(Scene.from_dict(data))


@pytest.mark.long
def test_forces_and_no_moment(by_force):
    np.testing.assert_allclose(by_force.force_N, [2.0, 0.5], rtol=1e-9)  # met to 1e-10
    moments = [step.moment_N_mm for step in by_force]
    assert np.abs(moments).max() < 1e-8
    assert by_force.approach_mm[1] < by_force.approach_mm[0]
    assert np.all(by_force.tilt_x != 0.0)


@pytest.mark.long
def test_under_a_force_the_approach_has_the_error_bar(by_force):
    record = by_force.reference
    assert record.by_force
    assert np.all(record.approach.error > 0.0)
    assert np.all(record.force.error < 1e-8 * by_force.force_N)  # met to 1e-10
    assert by_force.table()[0][-1] == "at size zero [µm]"
    assert "approach at mesh size zero" in record.sentence


@pytest.mark.long
def test_large_changes_of_the_force_are_halved_on_all_meshes():
    history = run(scene(
        "load.steps=1", "load.force_change=0.6", "load.tilt=[0.001, 0]",
        "load.approach=['8 um', '1 um']",
    ))  # fmt: skip
    assert len(history) > 2
    assert history.reference.force.meshes.shape == (2, len(history))
    assert np.all(history.tilt_x == 0.001)


@pytest.mark.long
def test_contact_that_all_meshes_miss_has_no_error_bar():
    """Nodes miss the highest point of the surface: that no mesh finds a force is no agreement."""
    history = run(scene("load.approach=['1e-9 um', '8 um']", "load.steps=1"))
    assert history.force_N[0] == 0.0 < history.force_N[1]
    assert history.contacts[0] == 0
    assert np.all(history.patch_pressure_MPa[0] == 0.0)
    record = history.reference
    assert np.isnan([record.force.error[0], record.area.error[0]]).all()
    assert record.force.error[1] > 0.0
    assert record.cells[1][0] == "no error bar"
    assert np.isnan(record.columns(history.steps)["force_error_N"][0])


def command(folder):
    """Return the words that run the scene with fields."""
    return ["run", str(PAPER), "--out", str(folder), "--set", *COARSE, EDGES, "output.fields=true"]


@pytest.mark.slow
def test_files(capsys, tmp_path):
    words = command(tmp_path)
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "keys of [micro] are not used" in shown
    names = {path.name for path in tmp_path.iterdir() if path.suffix != ".svg"}
    assert names == {
        "history.csv", "patches.csv", "reference.csv", "provenance.json", "report.html",
        "overview.png", "surface.png", "curves.png", "pressures.png", "fields.xdmf", "fields.h5",
        "contacts.csv", "contact.h5", "contact.png", "over_pressure.png", ".patchlaw-files",
    }  # fmt: skip
    with (tmp_path / "reference.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with (tmp_path / "history.csv").open(encoding="utf-8") as file:
        forces = [row["force_N"] for row in csv.DictReader(file)]
    assert [row["force_N_mesh_2"] for row in rows] == forces
    value, error, finest = (
        float(rows[-1][name]) for name in ("force_N", "force_error_N", "force_N_mesh_2")
    )
    assert 0.0 < abs(value - finest) < 4.0 * error
    assert "nan" not in (tmp_path / "reference.csv").read_text(encoding="utf-8")  # but empty cells
    facts = json.loads((tmp_path / "provenance.json").read_text(encoding="utf-8"))
    assert facts["micro_model"] is None
    assert facts["unknowns"] == facts["reference"]["unknowns"][-1]
    assert 0.0 < facts["reference"]["mesh_quality"][-1]["thinnest"] <= 1.0
    assert "Reference: " in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_what_is_not_known_is_null_in_the_provenance(capsys, tmp_path):
    words = [
        "run", str(PAPER), "--out", str(tmp_path), "--set", *COARSE, EDGES, "reference.meshes=1",
    ]  # fmt: skip
    assert main([*words, "output.figures=false", "output.report=false", "load.steps=1"]) == 0

    def refused(constant):
        raise AssertionError(f"{constant} is no JSON")

    text = (tmp_path / "provenance.json").read_text(encoding="utf-8")
    facts = json.loads(text, parse_constant=refused)
    assert facts["reference"]["force_rate"] == [None]


@pytest.mark.long
def test_fields_are_those_of_the_rough_block(capsys, tmp_path):
    words = [*command(tmp_path), "block.element=P1"]  # no nodes in the middles of edges
    assert main([*words, "output.figures=false", "output.report=false"]) == 0
    with h5py.File(tmp_path / "fields.h5") as file:
        points = file["Mesh/mesh/geometry"][:]
        moved, pressure = (
            next(iter(file[f"Function/{name}"].values()))[:]
            for name in ("displacement", "pressure")
        )
    surface = make_setup(scene()).parts.surface
    top = pressure[:, 0] > 1e-9  # interpolation leaves rounding elsewhere
    assert 0 < top.sum() < 100
    heights = surface.height_at(points[top, 0], points[top, 1]) - surface.mean_height
    np.testing.assert_allclose(points[top, 2], heights, atol=1e-9)
    # pressed nodes lie in the plane
    level = surface.highest - surface.mean_height - 0.008
    np.testing.assert_allclose(points[top, 2] + moved[top, 2], level, atol=1e-9)
    assert pressure.max() > 10.0


def test_tetrahedra_are_small_where_contact_can_occur():
    setup = make_setup(Scene.load(PAPER, COARSE))
    statements = dict(setup.about.statements())
    assert "tetrahedra (P2)" in statements["block"]
    assert "across a typical contact" in statements["block"]
    assert setup.parts.micro is None


def test_the_blocks_cells_are_not_the_references():
    """Of the paper's scene, which states cells under laws, by its kind alone."""
    given = Scene.load(PAPER, ["coupling.kind=reference"])
    assert given.block.cells == (40, 40, 25)
    setup = make_setup(given)
    default = make_setup(given.with_({"block.cells": None}))
    assert setup.rough_meshes.unknowns == default.rough_meshes.unknowns


def test_plan_of_one_coarse_mesh():
    setup = make_setup(scene("reference.meshes=1", "block.element=P1"))
    statements, warnings = dict(setup.about.statements()), " ".join(setup.about.warnings())
    assert "one mesh of tetrahedra (P1), small only where" in statements["block"]
    assert "edges there of 50 µm" in statements["block"]
    assert "no error bar" in warnings
    assert "refine reference.fine" in warnings


REFUSED = {
    "margin": (["block.margin='1 mm'"], "block.margin = 1.0: does not go with coupling.kind"),
    "meshes": (["reference.meshes=4"], "reference.meshes = 4: must be less than or equal to 3"),
    "unknown": (["reference.methods=penalty"], "unknown key; did you mean 'method'?"),
    "method": (["reference.method=penalty"], "must be 'active-set' or 'augmented-lagrangian'"),
    "love": (["coupling.love=centre"], "love = 'centre' does not go with kind = 'reference'"),
    "interface": (["coupling.interface=pointwise"], "interface = 'pointwise' does not go with k"),
    "table": (["coupling.table_tolerance=1e-3"], "table_tolerance = 0.001 does not go with kind"),
}  # fmt: skip


@pytest.mark.parametrize(("overrides", "text"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_fit_is_refused(overrides, text):
    with pytest.raises(InputError, match=re.escape(str(PAPER)) + ".*" + re.escape(text)):
        make_setup(scene(*overrides))


def test_roughness_that_no_mesh_carries_names_file_and_key():
    high = scene("surface.spectrum.rms_slope=1.9", "block.height=0.2 mm", "load.steps=1")
    text = rf"{re.escape(str(PAPER))}: surface = .*valley of the roughness is too deep"
    with pytest.raises(InputError, match=text):
        run(high)


@pytest.mark.slow
def test_patches_without_a_node_are_closed_like_the_nearest():
    history = run(scene("patches.grid=[30, 30]", "load.steps=1", "reference.meshes=1"))
    few = run(scene("patches.grid=[12, 12]", "load.steps=1", "reference.meshes=1"))
    pressed = history.patch_pressure_MPa[0].reshape(30, 30)
    assert pressed.mean() == pytest.approx(history.mean_pressure_MPa[0], rel=1e-12)  # rounding
    closure = history.closure_mm[0].reshape(30, 30)
    # no place sinks by more than the approach, nor rises by much beside a contact; measured 0.07
    assert np.all((closure > 0.0) & (closure < 1.1 * 0.008))
    # means over the same surface, by other nodes
    assert closure.mean() == pytest.approx(few.closure_mm[0].mean(), rel=0.02)


def test_record_of_no_step():
    record = ReferenceRecord.of([], np.array([2.0, 1.0]), (10, 20), force_order=2.0)
    assert record.label == "no error bar"
    assert record.sentence.startswith("no load step")
