"""What is gone is refused in one sentence, and is no difference of results."""

import json

import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import read_history
from patchlaw.multiscale.cli.command_line import main
from patchlaw.support.files import OwnFiles

INSTEAD = "micro.model = 'half-space', on a coarser surface.grid where speed matters)"
GONE = [
    ("micro.model", "islands", INSTEAD),
    ("micro.model", "auto", INSTEAD),
    ("micro.curvature", "contact", INSTEAD),
    ("micro.curvature", "summit", "(allowed: leave it out"),
    ("micro.border", "ignore", "(allowed: leave it out"),
    ("micro.tolerance", 0.02, "(allowed: leave it out"),
    ("micro.solver", "truncated-newton", "Newton's method on the active set"),
    ("coupling.newton", "full", "the program chooses"),
    ("coupling.compliance", "decomposed", "the program chooses"),
    ("coupling.kind", "auto", "with 'accuracy' beside it"),
    ("patches.grid", "auto", "with 'accuracy' beside it"),
    ("block.cells", "auto", "with 'accuracy' beside it"),
    ("surface.grid", "auto", "with 'accuracy' beside it"),
    ("reference.mesher", "gmsh", "a mesh of your own, by gmsh too, goes into [body]"),
    ("reference.mesh", "hexahedra", "all meshes are of tetrahedra"),
    ("reference.cells", [12, 12, 6], "states the edge length"),
]


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SMALL_SCENE, encoding="utf-8")
    return path


@pytest.mark.parametrize(("key", "value", "allowed"), GONE)
@pytest.mark.parametrize("command", ["run", "plan", "compare"])
def test_a_scene_is_told_what_to_write_instead(command, key, value, allowed, scene_file, capsys):
    out = scene_file.parent / "out"
    words = [command, str(scene_file), "--set", f"{key}={value}"]
    words += [] if command == "plan" else ["--out", str(out)]
    assert main(words) == 2
    shown = capsys.readouterr()
    assert f"{scene_file}: {key} = {value!r}: is gone (" in shown.err
    assert allowed in shown.err and shown.err.count("\n") == 1
    assert "unknown key" not in shown.err and not shown.out
    assert not out.exists()


def test_results_with_keys_that_are_gone_are_those_of_the_same_scene(scene_file, capsys):
    out = scene_file.parent / "out"
    words = ["run", str(scene_file), "--out", str(out)]
    assert main(words) == 0
    path = out / "provenance.json"
    facts = json.loads(path.read_text(encoding="utf-8"))

    def record(**micro):
        given = facts["scene_given"]
        given = given | {"micro": given["micro"] | {"curvature": "summit"} | micro}
        with OwnFiles(out).writing([path.name]):
            path.write_text(json.dumps(facts | {"scene_given": given}), encoding="utf-8")

    record()
    assert len(read_history(out)) == 2
    assert main([*words, "--resume"]) == 0  # nothing is left to do
    assert json.loads(path.read_text(encoding="utf-8"))["written"] == facts["written"]
    record(model="islands")
    capsys.readouterr()
    assert main([*words, "--resume"]) == 2
    assert "where micro.model was 'islands'" in capsys.readouterr().err
