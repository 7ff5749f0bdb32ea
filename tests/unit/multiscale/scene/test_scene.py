"""Reading scenes: what is accepted, and the words with which the rest is refused."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pint
import pytest

from patchlaw.multiscale import Scene, make_setup
from patchlaw.multiscale.scene.schema import scene_schema
from patchlaw.support import InputError

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"


@pytest.mark.parametrize(("overrides", "decomposed"), [
    (["kind=isolated"], False), (["kind=consistent"], True),
    (["kind=consistent", "interface=pointwise"], False), (["kind=concurrent"], True),
    (["kind=analytic"], False),
])  # fmt: skip
def test_which_block_stands_under_the_patches(overrides, decomposed):
    scene = Scene.load(PAPER, [f"coupling.{text}" for text in overrides])
    assert scene.decomposed == decomposed


def test_loads_in_newtons_up_and_down():
    data = Scene.load(PAPER).to_dict()
    data["load"] = {"force": ["5 N", "1000 mN", 0, "2 N"], "steps": 2, "tilt": "free"}
    path = Scene.from_dict(data).loading.path()
    assert (path.quantity, path.tilt) == ("force", None)
    forces = [step.force for step in path]
    assert forces == pytest.approx([2.5, 5, 3, 1, 0.5, 0, 1, 2], rel=1e-14)  # rounding


def test_override_needs_an_equals_sign():
    with pytest.raises(InputError, match=r"'load.steps': is not an override .allowed: --set key=v"):
        Scene.load(PAPER, ["load.steps"])


def test_common_units_are_those_of_pint():
    quantity = pint.UnitRegistry().Quantity
    for number in ("8", "0.3", "7.7e-1"):
        for unit in ("mm", "um", "µm", "m"):
            scene = Scene.load(PAPER, [f"block.height='{number} {unit}'"])
            assert scene.block.height == quantity(f"{number} {unit}").to("mm").magnitude
        for unit in ("Pa", "kPa", "MPa", "GPa"):
            scene = Scene.load(PAPER, [f"block.young_modulus='{number} {unit}'"])
            assert scene.block.young_modulus == quantity(f"{number} {unit}").to("MPa").magnitude
        tilt = Scene.load(PAPER, [f"load.tilt=['{number} um/mm', 0]"]).loading.tilt
        assert tilt[0] == quantity(f"{number} um/mm").to("dimensionless").magnitude


def test_the_papers_scene_needs_no_registry_of_units():
    code = f"import sys; from patchlaw.multiscale import Scene; Scene.load('{PAPER}'); " + (
        "sys.exit('pint' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0


def test_paths_start_in_the_folder_of_the_scene(tmp_path):
    path = tmp_path / "scene.toml"
    text = PAPER.read_text(encoding="utf-8").replace("spectrum = {", 'file = "scan.npy" # {')
    path.write_text(text, encoding="utf-8")
    scene = Scene.load(path)
    assert scene.path_of(scene.surface.file) == tmp_path / "scan.npy"


@pytest.mark.parametrize(
    ("named", "found"),
    [
        ("../heights/scan.npy", "heights/scan.npy"),  # out of the scene's folder is allowed
        ("{}/heights/scan.npy", "heights/scan.npy"),
        ("~/scan.npy", "scenes/~/scan.npy"),  # as a shell would not have it
    ],
)
def test_where_files_of_heights_are_looked_for(tmp_path, named, found):
    for place in (tmp_path / "heights", tmp_path / "scenes" / "~"):
        place.mkdir(parents=True)
        np.save(place / "scan.npy", 0.1 * np.random.default_rng(1).random((8, 8)))
    path = tmp_path / "scenes" / "scene.toml"
    text = f'surface = {{ file = "{named.format(tmp_path)}", lengths = [1.0, 1.0] }}\n'
    text += "block = { young_modulus = 4e3, poisson_ratio = 0.3 }\npatches.grid = [1, 1]\n"
    path.write_text(text + "load.approach = 0.01\n", encoding="utf-8")
    scene = Scene.load(path)
    path = scene.path_of(scene.surface.file)
    assert path.resolve() == tmp_path / found
    assert make_setup(scene).parts.surface.source == f"{path}, heights taken in mm"


def test_scene_is_frozen():
    with pytest.raises(AttributeError, match="cannot assign to field 'steps'"):
        Scene.load(PAPER).loading.steps = 3


def test_schema_knows_every_section():
    schema = scene_schema()
    assert {"surface", "block", "patches", "micro", "coupling", "load"} <= set(schema["properties"])
    assert schema["additionalProperties"] is False


def test_byte_order_mark_of_some_editors_is_passed_over(tmp_path):
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + PAPER.read_bytes())
    assert Scene.load(path).to_dict() == Scene.load(PAPER).to_dict()


def test_a_key_replaces_the_one_that_it_excludes():
    scene = Scene.load(PAPER, ["load.force=2 N"])
    assert (scene.loading.approach, scene.loading.force) == (None, (2.0,))
    scene = scene.with_({"load.approach": "4 um", "surface.file": "scan.npy"})
    assert (scene.loading.approach, scene.loading.force) == ((4e-3,), None)
    assert (scene.surface.spectrum, scene.path_of(scene.surface.file)) == (
        None,
        PAPER.parent / "scan.npy",
    )


@pytest.mark.parametrize("name", ["map.npy", "map.txt", "map.csv", "large.csv", "map"])
def test_a_map_is_told_from_a_scene(tmp_path, name):
    heights = np.random.default_rng(0).normal(size=(200, 100) if name == "large.csv" else (5, 4))
    with (tmp_path / name).open("wb") as file:
        np.save(file, heights) if name == "map.npy" else np.savetxt(file, heights)
    path = tmp_path / name
    with pytest.raises(InputError, match=f"{path}: is no scene, .* 'patchlaw init {path}' writes"):
        Scene.load(path)


@pytest.mark.parametrize(("content", "problem"), [("[load]\nx", "TOML"), ("# x\n", "surface")])
def test_a_scene_of_any_name_is_no_map(tmp_path, content, problem):
    (tmp_path / "scene.txt").write_text(content)
    with pytest.raises(InputError, match=f"scene.txt: .*{problem}"):
        Scene.load(tmp_path / "scene.txt")


def test_with_leaves_the_scene_what_it_was():
    scene = Scene.load(PAPER)
    other = scene.with_({"block.young_modulus": "70 GPa", "surface.spectrum.seed": 7})
    assert (other.block.young_modulus, other.surface.spectrum.seed) == (7e4, 7)
    assert other.name == scene.name
    assert scene == Scene.load(PAPER)
    with pytest.raises(InputError, match=r"'spectrum' is not a section|is not a section"):
        scene.with_({"accuracy.spectrum": 1, "accuracy.spectrum.seed": 2})
    with pytest.raises(InputError, match="did you mean 'seed'"):
        scene.with_({"surface.spectrum.sed": 7})
