"""Scenes of any content are planned, or refused in one line that names file, key and value."""

import os
import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.scene_inputs import BASE, KEYS, damaged, odd_text, planned, put, ran, scenes, toml
from patchlaw.multiscale import Scene, make_setup
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.scene.scene import MOST_BYTES
from patchlaw.multiscale.scene.surfaces import make_surface
from patchlaw.support import InputError

few = settings(
    derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
)


@pytest.mark.long
@settings(few, max_examples=50)
@given(scenes())
def test_scenes_of_any_values(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "scene.toml"
    path.write_text(toml(data), encoding="utf-8", errors="surrogatepass")
    planned(path)


@settings(few, max_examples=25)
@given(damaged())
def test_scenes_of_any_bytes(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    path.write_bytes(content)
    planned(path)


@settings(few, max_examples=50)
@given(st.one_of(odd_text, st.builds("{}={}".format, st.sampled_from(sorted(KEYS)), odd_text)))
def test_overrides_of_any_text(tmp_path_factory, word):
    path = tmp_path_factory.getbasetemp() / "base.toml"
    path.write_text(toml(BASE), encoding="utf-8")
    planned(path, [word])


@pytest.mark.long
@settings(few, max_examples=25)
@given(scenes())
def test_small_scenes_run(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "run.toml"
    data = put(put(data, "coupling.kind", "analytic"), "block.cells", [4, 4, 4])
    path.write_text(toml(data), encoding="utf-8", errors="surrogatepass")
    ran(path)


def refused(tmp_path, key, value, *, kind="isolated"):
    """Return why a scene with one more key is refused."""
    path = tmp_path / "scene.toml"
    path.write_text(toml(put(put(BASE, "coupling.kind", kind), key, value)), encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        make_setup(Scene.load(path))
    return str(refusal.value)


def test_a_law_for_every_patch_takes_memory(tmp_path):
    path = tmp_path / "scene.toml"
    data = put(put(BASE, "coupling.kind", "isolated"), "block.cells", [4, 4, 2])
    path.write_text(toml(put(data, "patches.grid", [12, 12])), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"\[12, 12\]: a law for every patch needs about 0.00216 GB"
    ):
        make_setup(Scene.load(path), nodes=ClusterNodes(memory=1.44e6))


def test_more_bombs(tmp_path):
    fine = refused(tmp_path, "reference.fine", "1 nm", kind="reference")
    assert "reference.fine = 1.0000000000000002e-06: the reference needs about" in fine
    path = tmp_path / "margin.toml"
    data = put(put(BASE, "coupling.kind", "isolated"), "block.margin", "1 mm")
    path.write_text(toml(put(data, "block.margin_cells", 10**9)), encoding="utf-8")
    text = r"block.margin_cells = 1000000000: needs about 3.2e\+13 GB"
    with pytest.raises(InputError, match=text):
        make_setup(Scene.load(path))


@pytest.mark.long
def test_tiny_edges_below_a_summit_between_the_heights_are_counted_soon(tmp_path):
    """No height of the grid lies above the plane, so that no node is known to be in contact."""
    path = tmp_path / "between.toml"
    data = put(put(BASE, "coupling.kind", "reference"), "reference.fine", "1 nm")
    path.write_text(toml(put(data, "load", {"approach": "1 nm"})), encoding="utf-8")
    scene = Scene.load(path)
    surface = make_surface(scene)
    assert surface.highest - surface.heights.max() > 1e-6
    with pytest.raises(InputError, match=r"reference.fine = 1.0\d*e-06: the reference needs about"):
        make_setup(scene)


def test_a_tilt_presses_an_edge_of_a_thin_block_to_nothing(tmp_path):
    path = tmp_path / "edge.toml"
    data = put(put(BASE, "coupling.kind", "concurrent"), "block.height", "20 um")
    path.write_text(toml(put(data, "load", {"approach": "1 um", "tilt": [0.0, 0.1]})))
    with pytest.raises(InputError, match=r"load.tilt = .*an edge of the body to nothing, 0.05 mm"):
        make_setup(Scene.load(path))


def test_block_of_a_kilometre_needs_no_layers_to_be_counted(tmp_path):
    text = refused(tmp_path, "block.height", "1e9 km", kind="reference")
    assert "reference.fine = None: the reference needs about" in text


def test_force_beyond_the_block(tmp_path):
    data = put(put(BASE, "coupling.kind", "concurrent"), "load", {"force": [1.0, "5 kN"]})
    path = tmp_path / "scene.toml"
    path.write_text(toml(data), encoding="utf-8")
    message = (
        r"load.force = \['1 N', '5000 N'\]: presses the body to nothing \(allowed: at most E t"
    )
    with pytest.raises(InputError, match=message):
        make_setup(Scene.load(path))


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"#" * (MOST_BYTES + 1), f"larger than any scene .allowed: {MOST_BYTES} bytes"),
        (b"x = " + b"[" * 10**4, "is not valid TOML: it is nested too deeply"),
        (b"x = " + b"{a=" * 10**4, "is not valid TOML: it is nested too deeply"),
        (b"x" + b".x" * 10**4 + b" = 1", "is nested too deeply, or within itself"),
        (b"x = " + b"1" * 10**4, "is not valid TOML: Exceeds the limit"),
        (b"x = 0x" + b"f" * 10**4, "x: unknown key"),
        (b"accuracy = 0x" + b"f" * 10**4, "accuracy = <int>: must be a valid number"),
        ("grid = 1".encode("utf-16"), "is not UTF-8 text"),
        ("# höhe".encode("latin-1"), "is not UTF-8 text"),
        (bytes(range(1, 128)), "is not valid TOML"),
        (b"[load\n", "is not valid TOML"),
        (b"[surface]\n", "surface: needs exactly one source"),
        (b"", "surface: is required and missing"),
    ],
    ids=range(13),
)
def test_files_that_are_no_scenes(tmp_path, content, text):
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"^{re.escape(str(path))}: .*{text}"):
        Scene.load(path)


def test_what_is_no_regular_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, problem in (
        (tmp_path, "is a folder"),
        (tmp_path / "pipe", "is no regular file"),
        ("/dev/zero", "is no regular file"),
        ("x" * 300, "cannot be read: File name too long"),
        ("a\0b", "there is no such file"),
    ):
        with pytest.raises(InputError, match=f"^{re.escape(str(path))}: {problem}"):
            Scene.load(path)


def test_override_with_a_second_line_is_a_text(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(toml(BASE), encoding="utf-8")
    with pytest.raises(InputError, match=r"load.steps = '2\\nx = 3': must be a valid integer"):
        Scene.load(path, ["load.steps=2\nx = 3"])


def test_override_of_endless_sections(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(toml(BASE), encoding="utf-8")
    with pytest.raises(InputError, match="is not an override"):
        Scene.load(path, ["a." * 5000 + "b=1"])


def test_sections_within_themselves_are_refused():
    section = {}
    section["surface"] = section
    with pytest.raises(InputError, match="is nested too deeply, or within itself"):
        Scene.from_dict(section)
