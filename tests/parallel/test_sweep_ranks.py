"""A sweep gives the same numbers on any number of ranks, bit by bit, and after a kill."""

import csv

import pytest
from helpers.on_ranks import RANKS
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale.cli import main
from patchlaw.support.files import unsealed

CHEAP = ("--set", "coupling.kind=analytic", "output.check=none", "load.steps=2")
"""Cases do not know their sweep: what they solve does not matter here."""


@pytest.fixture
def words(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SMALL_SCENE)
    return ["sweep", str(scene), "--vary", "surface.spectrum.seed=0..6", *CHEAP]


def tables(out):
    """Return the rows of all tables without times."""
    found = []
    for name in ("cases", "history", "statistics"):
        with (out / f"{name}.csv").open(newline="") as file:
            rows = [{**row, "wall_s": None} for row in csv.DictReader(file)]
        found.append([row for row in rows if row.get("column") != "wall_s"])
    return found


def journals(out):
    return sorted((out / "cases").glob("*/*.cases"))


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_share_the_cases(waiting_ranks, tmp_path, words, ranks):
    one, many = tmp_path / "one", tmp_path / "many"
    assert main([*words, "--out", str(one)]) == 0
    done = waiting_ranks(ranks, "-m", "patchlaw", *words, "--out", str(many))
    assert done.returncode == 0, done.stderr
    assert tables(one) == tables(many)
    assert len(tables(one)[2]) > 10
    assert len(journals(one)) == 1
    assert len(journals(many)) == ranks  # one entry for each rank, and none for cases


@pytest.mark.long
def test_a_killed_sweep_goes_on_with_other_ranks(waiting_ranks, tmp_path, words):
    one, out = tmp_path / "one", tmp_path / "out"
    assert main([*words, "--out", str(one)]) == 0
    assert waiting_ranks(2, "-m", "patchlaw", *words, "--out", str(out)).returncode == 0
    first, second = journals(out)
    first.write_bytes(first.read_bytes()[:-30])  # as a kill leaves it
    first.rename(first.with_name("rank-9.cases"))  # of a job with more ranks
    second.write_bytes(second.read_bytes()[:20])  # not even its header is whole
    for table in out.glob("*.csv"):
        table.unlink()
    assert waiting_ranks(2, "-m", "patchlaw", *words, "--out", str(out)).returncode == 0
    assert tables(out) == tables(one)
    kept = [mark for path in journals(out) for _, mark in unsealed(path.read_bytes())]
    assert len(kept) - len(journals(out)) == 7  # a head each, and no case is run twice


@pytest.mark.long
def test_ranks_compare_two_runs_and_refuse_together(waiting_ranks, tmp_path):
    """Rank 0 reads and writes; the others learn what it found, or why nothing was."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SMALL_SCENE)
    for name, modulus in (("soft", "4 GPa"), ("stiff", "8 GPa")):
        words = ["run", str(scene), "--out", str(tmp_path / name), *CHEAP]
        assert main([*words, f"block.young_modulus={modulus}"]) == 0
    both = ["compare", str(tmp_path / "soft"), str(tmp_path / "stiff")]
    assert main([*both, "--out", str(tmp_path / "one")]) == 0
    done = waiting_ranks(2, "-m", "patchlaw", *both, "--out", str(tmp_path / "two"))
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("stiff / soft") == 1
    for name in ("diff.csv", "diff.html"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    (tmp_path / "stiff" / "history.csv").unlink()
    done = waiting_ranks(2, "-m", "patchlaw", *both, "--out", str(tmp_path / "three"))
    assert done.returncode == 2
    assert done.stderr.count("stiff: holds no run: there is no history.csv in it") == 1
    assert not (tmp_path / "three").exists()


COMPARED = """
import sys
from patchlaw.multiscale.cli import main
from patchlaw.multiscale.runs import comparison

all_of = comparison.configurations
some = ("the scene", "analytic, half-space", "concurrent, half-space")
comparison.configurations = lambda scene: [c for c in all_of(scene) if c.name.startswith(some)]
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.long
def test_ranks_share_the_configurations_of_a_comparison(waiting_ranks, tmp_path):
    """Each takes its own; errors are those of one process, and one table holds all."""
    scene, script = tmp_path / "scene.toml", tmp_path / "compared.py"
    scene.write_text(SMALL_SCENE)
    script.write_text(COMPARED)
    tables = []
    for ranks in (1, 2):
        out = tmp_path / f"on {ranks}"
        words = ["compare", scene, "--out", out, "--against", "concurrent", *CHEAP[:1], *CHEAP[2:]]
        done = waiting_ranks(ranks, script, *words)
        assert done.returncode == 0, done.stderr
        with (out / "compare.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        tables.append([{**row, "seconds": None} for row in rows])
        assert sum(float(row["seconds"]) > 0.0 for row in rows) == len(rows) > 4
    assert tables[0] == tables[1]
    assert len(journals(out)) == 2  # the ranks' own
