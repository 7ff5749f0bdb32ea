"""What patchlaw did not write is replaced when that is asked for, and what it reads never."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Scene
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.runs import comparison
from patchlaw.support.files import LIST, append, unsealed

MINE = b"what nobody else has\n"
SMALLER = ["--set", "patches.grid=[1, 1]", "block.cells=[4, 4, 3]", "load.steps=1"]
ISOLATED = [*SMALLER, "coupling.kind=isolated", "output.figures=true"]
COMMANDS = {
    "run": (["run", "scene.toml", *SMALLER], ["history.csv", "report.html", "laws.h5", "leak.png"]),
    "laws": (
        ["laws", "scene.toml", "--export", "csv", "--export", "4c", *ISOLATED],
        ["laws.png", "laws.h5", "laws.csv", "laws_4c/law_mine.py"],
    ),
    "surface": (["surface", "scene.toml", *SMALLER], ["surface.png"]),
    "sweep": (
        ["sweep", "scene.toml", "--vary", "surface.spectrum.seed=1,2", *SMALLER],
        ["cases.csv", "history.csv", "statistics.csv", "sweep.svg"],
    ),
    "compare": (["compare", "scene.toml", "--against", "half-space", *SMALLER], ["report.html"]),
    "compare results": (["compare", "one", "one"], ["diff.csv", "diff.html"]),
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    alone = [one for one in comparison.configurations(Scene.from_dict(tomllib.loads(SMALL_SCENE)))
             if one.name.startswith("analytic, half-space")]  # fmt: skip
    monkeypatch.setattr(comparison, "configurations", lambda scene: alone)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SMALL_SCENE, encoding="utf-8")
    return tmp_path / "mine"


def put(folder, name, content=MINE):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def words_of(command):
    if command == "compare results":
        assert main(["run", "scene.toml", "--out", "one", *SMALLER]) == 0
    return [*COMMANDS[command][0], "--out", "mine"]


@pytest.mark.long
@pytest.mark.parametrize("command", COMMANDS)
def test_files_of_the_user_end_a_command_before_it_begins(folder, capsys, command):
    words = words_of(command)
    for name in COMMANDS[command][1]:
        mine = put(folder, name)
        assert main(words) == 2, name
        error = capsys.readouterr().err
        assert f"--out = 'mine': holds {name}, which is no result of patchlaw" in error
        assert [path for path in folder.rglob("*") if path.is_file()] == [mine]
        assert mine.read_bytes() == MINE
        mine.unlink()


def test_overwrite_takes_no_more_than_it_needs(folder):
    mine = [put(folder, name) for name in ("fields.bp/data.0", "leak.png", "laws_4c/law_1.py")]
    mine += [put(folder, name) for name in (".notes.partial-1", ".old.partial-2/notes")]
    (folder / "checkpoint.state").write_bytes(MINE)
    words = ["run", "scene.toml", "--out", "mine", *SMALLER]
    assert main(words) == 2
    assert main([*words, "--overwrite"]) == 0
    assert [path.read_bytes() for path in mine] == [MINE] * len(mine)


def test_a_killed_command_is_repeated(folder):
    """It ends between its files and what the list says of them, or within a line of that."""
    words = words_of("run")
    assert main(words) == 0
    *before, last = (folder / LIST).read_text().rstrip().splitlines()
    for left in ("", last[: len(last) // 2]):
        (folder / LIST).write_text("\n".join([*before, left]))
        put(folder, "history.csv", b"half of it")
        assert main(words) == 0


def test_a_scene_does_not_replace_its_surface(tmp_path, capsys):
    mine = put(tmp_path, "map.txt", b"1 2 3\n4 5 6\n7 8 10\n")
    words = ["init", "map.txt", "--lengths", "1 mm", "1 mm", "--height-unit", "um"]
    assert main([*words, "--out", "./map.txt", "--overwrite"]) == 2
    assert "is the surface" in capsys.readouterr().err
    assert mine.read_bytes().startswith(b"1 2 3")


@pytest.mark.parametrize("words", [["run"], ["surface"], ["sweep", "--vary", "load.steps=1,2"]])
def test_nothing_replaces_what_the_scene_reads(tmp_path, capsys, words):
    name = "surface.png" if words[0] == "surface" else "history.csv"
    heights = np.random.default_rng(1).standard_normal((16, 16)).astype(str)
    mine = put(tmp_path, name, "\n".join(map(",".join, heights)).encode())
    content = mine.read_bytes()
    mapped = 'file = "' + name + '"\nheight_unit = "um"\nlengths'
    text = SMALL_SCENE.replace("grid = [16, 16]\nlengths", mapped, 1)
    text = "\n".join(line for line in text.splitlines() if not line.startswith("spectrum"))
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    command, *more = words
    for last in ([], ["--overwrite"]):
        assert main([command, "scene.toml", "--out", ".", *more, *last]) == 2
        assert f"results would replace {name}, which is read" in capsys.readouterr().err
        assert mine.read_bytes() == content


def test_nothing_replaces_a_file_that_is_varied(tmp_path, capsys):
    heights = np.random.default_rng(1).standard_normal((16, 16)).astype(str)
    mine = put(tmp_path, "cases.csv", "\n".join(map(",".join, heights)).encode())
    vary = ["--vary", "surface.file=cases.csv,other.csv", "--overwrite"]
    assert main(["sweep", "scene.toml", "--out", ".", *vary]) == 2
    assert "results would replace cases.csv" in capsys.readouterr().err
    assert mine.is_file()


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_a_link_in_the_place_of_a_file_is_replaced(folder, tmp_path, link):
    """The file of cases that are done grows in place: a file that it is linked with must not."""
    path = Path(link.__name__)
    end = append(path, 1, 0)
    path.replace(tmp_path / "elsewhere")
    link(tmp_path / "elsewhere", path)
    content = (tmp_path / "elsewhere").read_bytes()
    append(path, 2, end)
    assert (tmp_path / "elsewhere").read_bytes() == content
    assert [value for value, _ in unsealed(path.read_bytes())] == [1, 2]
    folder.mkdir()
    mine = put(tmp_path, "table.csv")
    os.symlink(mine, folder / "history.csv")
    assert main(["run", "scene.toml", "--out", "mine"]) == 0
    assert mine.read_bytes() == MINE and not (folder / "history.csv").is_symlink()
