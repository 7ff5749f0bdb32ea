"""Results in three dimensions: values and places of what is drawn, pages, and what is refused."""

import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE
from PIL import Image

import patchlaw
from patchlaw import InputError, read_contact, read_fields
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.results.files import read_modes

REPORTED = SMALL_SCENE.replace("report = false", "report = true")
CHROMIUM = shutil.which("chromium")


@pytest.fixture(scope="module")
def contact(tmp_path_factory):
    """The results of cells that yield, with their report."""
    folder = tmp_path_factory.mktemp("contact")
    (folder / "scene.toml").write_text(REPORTED, encoding="utf-8")
    words = ["micro.hardness=100 MPa", "output.contact=all"]
    out = folder / "results"
    assert main(["run", str(folder / "scene.toml"), "--out", str(out), "-q", "--set", *words]) == 0
    return out


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    """The results of a block under a law of a sample, with fields and natural modes."""
    spectrum = "{ hurst = 0.8, waves = [2, 4], rms_height = '1 um' }"
    scene = f"""
    surface = {{ spectrum = {spectrum}, grid = [16, 16], lengths = [0.5, 0.5] }}
    block = {{ young_modulus = 4000, poisson_ratio = 0.3, density = "2000 kg/m^3", height = 4,
      lengths = [6, 6], cells = [2, 2, 2], element = "Q1" }}
    law.kind = "representative"
    load = {{ pressure = 5, steps = 2, sliding = ["1 m"] }}
    wear.coefficient = "1e-8 mm^2/N"
    vibration.modes = 2
    output = {{ figures = false, report = false, check = "none", fields = "all" }}
    """
    folder = tmp_path_factory.mktemp("body")
    (folder / "scene.toml").write_text(scene.replace(",\n", ","), encoding="utf-8")
    out = folder / "results"
    assert main(["run", str(folder / "scene.toml"), "--out", str(out), "-q"]) == 0
    return out


@pytest.mark.parametrize("missing", ["pyvista", "trame_pyvista"])
@pytest.mark.parametrize("words", ["view {}", "run {}.toml --out {}/new --set output.views=true"])
def test_without_the_extra_a_sentence_says_how_to_get_it(
    missing, words, tmp_path, monkeypatch, capsys
):
    (tmp_path / "scene.toml").write_text(REPORTED, encoding="utf-8")
    monkeypatch.setitem(sys.modules, "pyvista", None)
    monkeypatch.setitem(sys.modules, missing, None)
    words = words.replace("{}.toml", str(tmp_path / "scene.toml")).format(tmp_path)
    assert main(words.split()) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "is not installed, and results in three dimensions need it" in said
    assert 'pip install ".[view]"' in said
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.long
def test_a_map_lies_on_the_gaps_under_its_values(contact):
    pytest.importorskip("pyvista")
    record = read_contact(contact).at(1)
    plotter = patchlaw.view(contact, "plastic_depth", step=1, off_screen=True)
    (mesh,) = plotter.meshes
    plotter.close()
    values = mesh.cell_data["plastic depth [µm]"]
    depth = 1e3 * record.plastic_depth_mm.ravel(order="F")
    assert np.isnan(values[depth == 0.0]).all() and (depth > 0.0).any()
    np.testing.assert_allclose(values[depth > 0.0], depth[depth > 0.0], rtol=1e-6)  # single
    middles = mesh.cell_centers().points
    cells = np.stack(np.meshgrid(record.x_mm, record.y_mm, indexing="ij"), axis=-1)
    np.testing.assert_allclose(middles[:, :2], cells.reshape(-1, 2, order="F"), atol=1e-6)
    # heights are means of neighbours: they follow the gaps, and none is above the plane
    follows = np.corrcoef(middles[:, 2], -record.gap_mm.ravel(order="F"))[0, 1]
    assert follows > 0.9 and mesh.points[:, 2].max() <= 0.0


@pytest.mark.long
def test_a_body_shows_its_fields_and_modes_where_it_moves(body):
    pytest.importorskip("pyvista")
    fields, (mesh, _, moved) = read_fields(body), read_modes(body)
    for name, title, values, moves in (
        ("displacement", "displacement [µm]", 1e3 * fields.displacement_mm, fields.displacement_mm),
        ("mode", "natural mode", moved, moved),
    ):
        number = 2 if name == "mode" else None
        plotter = patchlaw.view(body, name, mode=number, off_screen=True)
        (shown,) = plotter.meshes
        plotter.close()
        found = shown.point_data[title]
        origin = np.asarray(shown["vtkOriginalPointIds"])
        expected = np.linalg.norm(values[-1], axis=-1)[origin]
        scale = 1.0 if name == "displacement" else expected.max()
        np.testing.assert_allclose(found, expected / scale, rtol=1e-5)
        ways = shown.points - mesh["points_mm"][origin]
        factor = np.linalg.norm(ways) / np.linalg.norm(moves[-1][origin])
        np.testing.assert_allclose(ways, factor * moves[-1][origin], atol=1e-5 * abs(ways).max())


@pytest.mark.long
def test_pages_are_linked_and_need_no_network(contact, tmp_path, capsys):
    pytest.importorskip("trame_pyvista")
    report = contact / "report.html"
    assert '<p class="views"></p>' in report.read_text(encoding="utf-8")
    for _ in range(2):  # again, nothing is added
        assert main(["view", str(contact)]) == 0
        names = ["view_pressure.html", "view_gap.html", "view_plastic_depth.html"]
        assert sorted(path.name for path in contact.glob("view_*")) == sorted(names)
        links = re.findall(r'<a href="([^"]+)">', report.read_text(encoding="utf-8"))
        assert links == names
    assert "trame_vtklocal.module.wasm" not in sys.modules  # which downloads another viewer
    said = capsys.readouterr().out
    assert all(name in said for name in names)
    for name in names:
        page = (contact / name).read_text(encoding="utf-8")
        assert "load step 2: approach 8 µm" in page and "kitware.github.io/vtk-js/icon" not in page
        assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", page)
    if CHROMIUM is None:
        pytest.skip("no Chromium")
    where = f"--user-data-dir={tmp_path / 'profile'}"
    words = [
        "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--enable-unsafe-swiftshader", "--virtual-time-budget=15000", "--window-size=500,400",
        "--host-resolver-rules=MAP * ~NOTFOUND", where,
    ]  # fmt: skip
    shot, log = tmp_path / "shot.png", tmp_path / "log.json"
    page = (contact / "view_pressure.html").resolve().as_uri()
    more = [f"--screenshot={shot}", f"--log-net-log={log}", page]
    subprocess.run([CHROMIUM, *words, *more], check=True, capture_output=True, timeout=120)
    asked = set(re.findall(r'"url":"(https?://[^"]+)"', log.read_text(encoding="utf-8")))
    assert not {one for one in asked if "kitware" in one or "vtk" in one}
    red, _, blue = np.moveaxis(np.asarray(Image.open(shot).convert("RGB"), int), -1, 0)
    grey = (abs(red - blue) < 40) & (red < 230)
    assert (red - blue > 80).mean() > 0.005 and grey.mean() > 0.05  # contact, and the open surface


@pytest.mark.long
@pytest.mark.parametrize(("words", "match"), [
    (["--show", "mode"], "show = 'mode': is not known.*allowed: pressure, gap, plastic_depth"),
    (["--step", "7"], "step = 7: is no load step whose contact was recorded.*allowed: 1, 2"),
    (["--mode", "2"], "mode = 2: has no effect.*where a natural mode is shown, of pressure, gap"),
])  # fmt: skip
def test_what_results_lack_is_refused(contact, words, match, capsys):
    pytest.importorskip("pyvista")
    assert main(["view", str(contact), *words]) == 2
    assert re.search(match, " ".join(capsys.readouterr().err.split()))


@pytest.mark.long
def test_no_results_and_no_display_are_refused(contact, body, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyvista")
    for folder in (tmp_path, tmp_path / "none"):
        assert main(["view", str(folder)]) == 2
    assert not (tmp_path / "none").exists() and not any(tmp_path.iterdir())
    with pytest.raises(InputError, match=r"mode = 3: was not written \(allowed: 1, 2\)"):
        patchlaw.view(body, "mode", mode=3)
    with pytest.raises(InputError, match=r"mode = 3: has no effect .* of body_pressure none is"):
        patchlaw.view(body, mode=3)  # which shows the first of all
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["view", str(contact), "--window"]) == 2
    assert "there is no display" in capsys.readouterr().err


@pytest.mark.long
def test_worn_depths_of_a_body_are_shown_where_it_wears(body):
    pytest.importorskip("pyvista")
    worn = read_fields(body).worn_depth_mm[-1]
    plotter = patchlaw.view(body, "body_worn_depth", off_screen=True)
    (shown,) = plotter.meshes
    plotter.close()
    (title,) = (name for name in shown.point_data if name.startswith("worn depth of the body"))
    scale = {"nm": 1e6, "µm": 1e3}[title.partition("[")[2][:-1]]
    values, expected = shown.point_data[title], scale * worn[shown["vtkOriginalPointIds"]]
    assert np.isnan(values[expected == 0.0]).all() and (expected > 0.0).any()
    np.testing.assert_allclose(values[expected > 0.0], expected[expected > 0.0], rtol=1e-6)
    with pytest.raises(InputError, match=r"step = 1: has no effect \(allowed: .* of mode none is"):
        patchlaw.view(body, "mode", step=1)


@pytest.mark.long
def test_load_steps_of_fields_need_no_map_of_the_contact(body, contact, tmp_path, monkeypatch):
    pytest.importorskip("pyvista")
    mixed = shutil.copytree(body, tmp_path / "mixed")
    (mixed / "contact.h5").touch()
    read = "patchlaw.multiscale.runs.output.view.read_contact"  # of load steps 1 and 2
    monkeypatch.setattr(read, lambda folder: read_contact(contact))
    plotter = patchlaw.view(mixed, "displacement", step=3, off_screen=True)
    (shown,) = plotter.meshes
    plotter.close()
    moved = np.linalg.norm(read_fields(body).displacement_mm[2], axis=-1)
    moved = 1e3 * moved[shown["vtkOriginalPointIds"]]
    np.testing.assert_allclose(shown.point_data["displacement [µm]"], moved, rtol=1e-5)
    with pytest.raises(InputError, match="step = 3: is no load step whose contact was recorded"):
        patchlaw.view(mixed, "pressure", step=3)


@pytest.mark.long
def test_windows_open_for_all_that_is_named_in_turn(contact, monkeypatch):
    plotters = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(
        "patchlaw.multiscale.runs.output.view.view",
        lambda folder, name, **which: SimpleNamespace(show=lambda: plotters.append(name)),
    )
    assert main(["view", str(contact), "--window", "--show", "gap", "pressure"]) == 0
    assert main(["view", str(contact), "--window"]) == 0
    assert plotters == ["gap", "pressure", ""]
