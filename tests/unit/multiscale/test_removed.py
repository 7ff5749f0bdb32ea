"""What is gone is refused in one sentence: in scenes, laws and results."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw import InputError
from patchlaw.geometry import PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import micro_model
from patchlaw.multiscale import Scene, read_history, read_laws
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.laws.isolated import isolated_laws
from patchlaw.multiscale.laws.law_file import write_laws

INSTEAD = "(allowed: micro.model = 'half-space', on a coarser surface.grid where speed matters)"
LEAVE_OUT = "(allowed: leave it out)"
BY_ACCURACY = "(allowed: leave it out, with 'accuracy' beside it, which chooses what is not stated)"
GONE = [
    ("micro.model", "islands", INSTEAD),
    ("micro.model", "auto", INSTEAD),
    ("micro.curvature", "contact", INSTEAD),
    ("micro.curvature", "summit", LEAVE_OUT),
    ("micro.border", "include", INSTEAD),
    ("micro.border", "ignore", LEAVE_OUT),
    ("micro.tolerance", 0.02, INSTEAD),
    ("micro.solver", "truncated-newton", LEAVE_OUT),
    ("coupling.newton", "full", LEAVE_OUT),
    ("coupling.compliance", "decomposed", LEAVE_OUT),
    ("coupling.kind", "auto", BY_ACCURACY),
    ("patches.grid", "auto", BY_ACCURACY),
    ("block.cells", "auto", BY_ACCURACY),
    ("surface.grid", "auto", BY_ACCURACY),
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
    assert shown.err.strip().endswith(f"{scene_file}: {key} = {value!r}: is gone {allowed}")
    assert "unknown key" not in shown.err and not shown.out
    assert not out.exists()


@pytest.mark.parametrize(("key", "value", "allowed"), GONE)
def test_python_is_told_the_same(key, value, allowed, scene_file):
    text = re.escape(f"{key} = {value!r}: is gone {allowed}")
    with pytest.raises(InputError, match=text):
        Scene.load(scene_file).with_({key: value})


def recorded(scene, **micro):
    """Return what an earlier version recorded of a scene, where it said these of its micro model.

    Args:
        scene: The scene as it is recorded now.
        micro: Keys of the micro model.
    """
    former = {"curvature": "summit", "border": "ignore", "tolerance": None, "solver": "active-set"}
    coupling = scene["coupling"] | {"newton": "full", "compliance": "auto"}
    return scene | {"micro": scene["micro"] | former | micro, "coupling": coupling}


def test_results_of_what_is_gone_are_refused_and_others_are_read(scene_file, capsys):
    out = scene_file.parent / "out"
    words = ["run", str(scene_file), "--out", str(out)]
    assert main(words) == 0
    path = out / "provenance.json"
    facts = json.loads(path.read_text(encoding="utf-8"))

    def record(**micro):
        given = recorded(facts["scene_given"], **micro)
        path.write_text(json.dumps(facts | {"scene_given": given}), encoding="utf-8")
        (out / ".patchlaw-files").unlink(missing_ok=True)  # earlier versions wrote none

    record()
    assert len(read_history(out)) == 2
    assert main([*words, "--resume"]) == 0  # they are those of the same scene, and finished
    assert json.loads(path.read_text(encoding="utf-8"))["written"] == facts["written"]
    record(model="islands")
    text = "micro.model = 'islands': is gone, and so is what was computed with it " + INSTEAD
    with pytest.raises(InputError, match=re.escape(f"{path}: {text}")):
        read_history(out)
    capsys.readouterr()
    assert main(words) == 2
    assert "holds results of another scene, where micro.model was 'islands'" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize("model", ["islands", "elliptic, curvature contact, border ignore"])
def test_laws_of_what_is_gone_are_refused(model, tmp_path):
    spectrum = Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=1)
    surface = synthesise(spectrum, grid=(16, 16), lengths=(1.0, 1.0))
    patches = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    table = isolated_laws(
        micro_model("elliptic", surface, contact_modulus=4000.0), patches,
        mean_heights=patch_means(surface, patches), closure_ends=np.array([4e-3]), tolerance=0.1,
    )  # fmt: skip
    path = tmp_path / "laws.h5"
    write_laws(path, table)
    assert read_laws(path).made_by["model"] == "elliptic"
    write_laws(path, replace(table, made_by=table.made_by | {"model": model}))
    text = f"{path}: {model!r}: is the micro model of these laws, and is gone (allowed: laws made"
    with pytest.raises(InputError, match=re.escape(text)):
        read_laws(path)
