"""patchlaw init writes a scene that runs; patchlaw help explains keys as text."""

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.scene.schema import scene_keys


def call(capsys, *words):
    code = main(list(words))
    shown = capsys.readouterr()
    return code, " ".join(shown.out.split()), shown.err


@pytest.fixture
def rough(tmp_path, monkeypatch):
    """A folder with a tilted map without lengths, of which one height is missing."""
    monkeypatch.chdir(tmp_path)
    x = np.linspace(0.0, 1.0, 32)
    heights = np.add.outer(0.02 * x, 0.001 * np.cos(12 * x)) + 0.001 * np.sin(9 * x)[:, None]
    heights[3, 4] = np.nan
    (tmp_path / "maps").mkdir()
    np.save("maps/my.npy", heights)
    return tmp_path


LENGTHS = ("--lengths", "2 mm", "1 mm")


def test_a_measured_map_runs_at_once(capsys, rough):
    code, shown, err = call(capsys, "init", "maps/my.npy", *LENGTHS, "--force", "2 N")
    assert (code, err) == (0, "")
    assert "32 × 32 heights on 2 mm × 1 mm" in shown
    assert "Heights are missing" in shown
    assert "As it was: the map is tilted" in shown
    assert shown.endswith("to run it: patchlaw run my.toml")
    said = tomllib.loads((rough / "my.toml").read_text(encoding="utf-8"))
    assert said["surface"] == {
        "file": "maps/my.npy", "lengths": ["2 mm", "1 mm"], "missing": "fill", "detrend": "plane",
    }  # fmt: skip
    assert said["load"] == {"force": "2 N", "steps": 8}
    assert said["block"]["height"] == "1 mm"
    quick = ("--set", "coupling.kind=analytic", "load.steps=1", "output.figures=false")
    code, shown, err = call(capsys, "run", "my.toml", *quick)
    assert (code, err) == (0, "")
    assert "level plane" not in shown


def test_the_command_to_run_it_is_one_that_the_shell_finds(capsys, rough, monkeypatch):
    """In a clone it is called by its path, as the first page does."""
    monkeypatch.setattr("sys.argv", [".venv/bin/patchlaw"])
    beside = str(Path(sys.executable).parent)
    for path, command in (("", ".venv/bin/patchlaw"), (beside, "patchlaw")):
        monkeypatch.setenv("PATH", path)
        words = ("maps/my.npy", *LENGTHS, "--force", "2 N", "--out", f"of {len(path)}.toml")
        _, shown, _ = call(capsys, "init", *words)
        assert shown.endswith(f"to run it: {command} run 'of {len(path)}.toml'")


@pytest.mark.parametrize("name", ['q\x07\x7f"\u2028m.npy', "-m =1.npy", "$m{.npy"])
def test_maps_of_odd_names_make_scenes_that_are_read(capsys, rough, name):
    (rough / "maps" / "my.npy").rename(rough / "maps" / name)
    code, shown, err = call(
        capsys, "init", f"maps/{name}", *LENGTHS, "--force", "2 N", "--out", "s.toml"
    )
    assert (code, err) == (0, "") and not set("\x07\x7f") & set(shown)
    said = tomllib.loads((rough / "s.toml").read_text(encoding="utf-8"))
    assert said["surface"]["file"] == f"maps/{name}"


@pytest.mark.parametrize("name", [".", "maps", "maps/none.npy", "maps/" + 300 * "x"])
def test_what_is_no_map_writes_no_scene(capsys, rough, name):
    code, shown, err = call(capsys, "init", name, *LENGTHS)
    assert (code, shown, err.count("\n")) == (2, "", 1)
    assert not list(rough.glob("*.toml"))


def test_names_that_no_scene_can_hold_are_refused(capsys, rough):
    (rough / "maps" / "my.npy").rename(rough / "maps" / "m\udcff.npy")
    code, shown, err = call(capsys, "init", "maps/m\udcff.npy", *LENGTHS)
    assert (code, shown) == (2, "") and "a name in UTF-8" in err
    assert not list(rough.glob("*.toml"))


def test_nothing_is_overwritten_unasked(capsys, rough):
    words = ("init", "maps/my.npy", *LENGTHS, "--approach", "1 um")
    assert call(capsys, *words)[0] == 0
    before = (rough / "my.toml").read_bytes()
    code, shown, err = call(capsys, *words[:-1], "2 um")
    assert (code, shown) == (2, "")
    assert "--out = 'my.toml': exists already (allowed: another file, or --overwrite)" in err
    assert (rough / "my.toml").read_bytes() == before
    assert call(capsys, *words[:-1], "2 um", "--overwrite")[0] == 0
    assert 'approach = "2 um"' in (rough / "my.toml").read_text(encoding="utf-8")


def test_without_a_surface_it_is_synthesised(capsys, rough):
    constants = ("--young-modulus", "3 GPa", "--poisson-ratio", "0.4")
    code, shown, _ = call(capsys, "init", *constants, "--out", "deep/new.toml")
    assert code == 0
    assert "The force of" in shown
    assert "steel" not in shown
    said = tomllib.loads((rough / "deep" / "new.toml").read_text(encoding="utf-8"))
    assert said["surface"]["spectrum"]["hurst"] == 0.8
    assert (said["block"]["young_modulus"], said["block"]["poisson_ratio"]) == ("3 GPa", 0.4)


def test_file_is_found_from_the_folder_of_the_scene(capsys, rough):
    assert call(capsys, "init", "maps/my.npy", *LENGTHS, "--out", "scenes/my.toml")[0] == 0
    assert call(capsys, "plan", "scenes/my.toml")[0] == 0


@pytest.mark.parametrize(("words", "text"), [
    (("nowhere.npy",), "there is no such file"),
    (("maps/my.npy",), "allowed: --lengths LX LY, such as --lengths '2 mm' '1 mm'; --height-unit"),
    (("maps/my.npy", *LENGTHS, "--force", "2 mm"), "load.force = '2 mm'"),
    (("maps/my.npy", *LENGTHS, "--poisson-ratio", "0.7"), "block.poisson_ratio = 0.7"),
    (("maps/my.npy", *LENGTHS, "--height-unit", "parsec"), "is no unit of heights"),
    (("maps/my.npy", *LENGTHS, "--channel", "3"), "which have one channel only"),
    (("maps/my.npy", "--force", "1 N", "--approach", "1 um"), "not allowed with argument"),
    (("scene.toml",), "is a scene, not a surface"), (("--out", "x" * 300), "cannot be written"),
])  # fmt: skip
def test_wrong_words_write_nothing(capsys, rough, words, text):
    code, shown, err = call(capsys, "init", *words)
    assert (code, shown) == (5 if "written" in text else 2, "")
    assert text in err
    assert err.count("\n") == 1
    assert [path.name for path in rough.iterdir()] == ["maps"]


def test_help_lists_sections(capsys):
    code, shown, _ = call(capsys, "help")
    assert code == 0
    for name, key in scene_keys().items():
        assert ("." in name) or key.meaning in shown


@pytest.mark.parametrize("topic", ["load.force", "force"])
def test_help_on_a_key(capsys, topic):
    code, shown, _ = call(capsys, "help", topic)
    assert code == 0
    assert shown.startswith(f"load.force {scene_keys()['load.force'].meaning} values: quantity")
    assert shown.endswith("default: not given")


def test_help_on_nothing(capsys):
    code, shown, err = call(capsys, "help", "load.forze")
    assert (code, shown) == (2, "")
    assert "is no key of a scene; did you mean 'load.force'?" in err


def test_spikes_above_all_else_are_removed(capsys, rough):
    heights = np.load("maps/my.npy")
    heights[20, 20] += 0.05
    np.save("maps/my.npy", heights)
    code, shown, err = call(capsys, "init", "maps/my.npy", *LENGTHS, "--force", "2 N")
    assert (code, err) == (0, "")
    assert "As it was: 1 height is a spike" in shown
    said = tomllib.loads((rough / "my.toml").read_text(encoding="utf-8"))
    assert said["surface"]["outliers"] == "remove"


def test_the_other_reading_of_a_map_is_shown_and_can_be_taken(capsys, rough):
    np.savetxt("turned.txt", 1e-3 * np.random.default_rng(2).normal(size=(40, 20)))
    words = ("init", "turned.txt", "--lengths", "1 mm", "2 mm")
    code, shown, _ = call(capsys, *words)
    assert code == 0
    assert "40 × 20 heights make cells of 25 × 100 µm on these sides" in shown
    assert "20 × 40 heights make square ones of 50 × 50 µm" in shown
    code, shown, _ = call(capsys, *words, "--swap-xy", "--overwrite")
    assert code == 0
    assert "20 × 40 heights on 1 mm × 2 mm" in shown
    assert "make cells" not in shown
    said = tomllib.loads((rough / "turned.toml").read_text(encoding="utf-8"))
    assert said["surface"]["swap_xy"] is True


def test_codes_of_no_data_are_removed_where_a_map_would_be_too_steep(capsys, rough):
    heights = np.load("maps/my.npy")
    heights[10:15, 5:9] = -9999.0
    np.save("codes.npy", heights)
    code, shown, err = call(capsys, "init", "codes.npy", *LENGTHS)
    assert (code, err) == (0, "")
    assert "20 spikes removed and filled" in shown
    said = tomllib.loads((rough / "codes.toml").read_text(encoding="utf-8"))
    assert (said["surface"]["missing"], said["surface"]["outliers"]) == ("fill", "remove")


@pytest.mark.parametrize("command", ["run", "surface", "plan"])
def test_a_map_is_no_scene(capsys, rough, command):
    code, shown, err = call(capsys, command, "maps/my.npy")
    assert (code, shown) == (2, "")
    assert "maps/my.npy: is no scene, it looks like a height map: 'patchlaw init maps/" in err
    assert not (rough / "results").exists()


def test_lengths_without_a_unit_are_in_mm_as_in_scenes(capsys, rough):
    code, shown, err = call(capsys, "init", "maps/my.npy", "--lengths", "2", "1")
    assert (code, err) == (0, "") and "32 × 32 heights on 2 mm × 1 mm" in shown
    said = tomllib.loads((rough / "my.toml").read_text(encoding="utf-8"))
    assert said["surface"]["lengths"] == [2.0, 1.0]


def test_an_image_whose_rows_run_along_x_says_the_word_that_turns_it(capsys, rough):
    np.savetxt("image.csv", np.random.default_rng(1).random((20, 40)) * 1e-5, delimiter=",")
    words = ("init", "image.csv", "--lengths", "0.4", "0.2", "--force", "2 N")
    _, shown, _ = call(capsys, *words)
    assert "is a row of the map one along x? Then --swap-xy" in shown
    _, shown, _ = call(capsys, *words, "--swap-xy", "--overwrite")
    assert "40 × 20 heights on 400 µm × 200 µm" in shown and "a row of the map" not in shown


def test_points_and_heights_in_metres(capsys, rough):
    """A suspicion says the words that cure it."""
    x = 1e-6 * np.arange(12)
    heights = 1e-7 * np.random.default_rng(1).random((12, 12))
    rows = [(a, b, heights[i, j]) for i, a in enumerate(x) for j, b in enumerate(x)]
    np.savetxt("points.xyz", rows, fmt="%.12g")
    code, shown, err = call(capsys, "init", "points.xyz")
    assert (code, err) == (0, "") and "Then say --xy-unit m, and --height-unit m" in shown
    metres = ("--xy-unit", "m", "--height-unit", "m", "--overwrite")
    code, shown, err = call(capsys, "init", "points.xyz", *metres)
    assert (code, err) == (0, "")
    assert "12 × 12 heights on 12 µm × 12 µm" in shown and "are they in m" not in shown
    np.savetxt("heights.txt", heights)
    code, shown, err = call(capsys, "init", "heights.txt", "--lengths", "0.5 mm", "0.5 mm")
    assert (code, err) == (0, "") and "For heights in m say --height-unit m" in shown
