"""``patchlaw laws --export``: files beside the laws; wrong words are refused beforehand."""

import csv

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import read_laws
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.laws import FORMATS
from patchlaw.support.files import LIST

FILES = {"laws.csv", "laws_4c", "laws_abaqus.inp", "laws_calculix.inp"}
LAWS = ("laws", "scene.toml", "--set", "coupling.kind=isolated", "patches.grid=[1, 2]", "--out")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SMALL_SCENE, encoding="utf-8")
    return tmp_path / "out"


@pytest.mark.long
def test_laws_are_exported_beside_their_file(folder, capsys):
    words = [word for name in FORMATS for word in ("--export", name)]
    assert main([*LAWS, "out", *words]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert {path.name for path in folder.iterdir()} == {"laws.h5", "laws.png", LIST, *FILES}
    assert "laws.h5, laws.png, laws.csv, laws_4c, laws_abaqus.inp, laws_calculix.inp" in shown
    assert len(list((folder / "laws_4c").iterdir())) == 2
    table = read_laws(folder / "laws.h5")
    with (folder / "laws.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["iy"] == "0"]
    closure, pressure = (
        np.array([float(row[name]) for row in rows]) for name in ("closure_mm", "pressure_MPa")
    )
    np.testing.assert_allclose(pressure, table[0].pressure(closure), rtol=1e-9, atol=1e-12)
    assert main([*LAWS, "out", "--export", "4c", "--export", "calculix", "--name", "pad"]) == 0
    modules = {path.name for path in (folder / "laws_4c").iterdir()}
    assert modules == {"law_pad_0_0.py", "law_pad_0_1.py"}
    assert "NAME=PAD_PATCH_0_0" in (folder / "laws_calculix.inp").read_text()
    # laws made anew take the exports of earlier ones with them
    assert main([*LAWS, "out"]) == 0
    assert FILES & {path.name for path in folder.rglob("*.*")} == set()


def test_names_that_programs_cannot_read_are_refused_beforehand(folder, capsys):
    assert main([*LAWS, "out", "--export", "4c", "--name", "a-b"]) == 2
    assert "name = 'a-b': does not fit into names of exported laws" in capsys.readouterr().err
    assert not folder.exists()
