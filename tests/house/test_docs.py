"""The documentation has every page, key and column; continuous integration builds its site."""

import fnmatch
import re
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale import Scene
from patchlaw.multiscale.laws.export import CSV_COLUMNS, FLOW_COLUMNS
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.results.contacts import FIELDS, SPOT_COLUMNS
from patchlaw.multiscale.results.history import PATCH_COLUMNS, PATCH_MORE
from patchlaw.multiscale.runs.output.results import FILES
from patchlaw.multiscale.scene.schema import scene_keys

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RESULTS = (DOCS / "results.md").read_text(encoding="utf-8")
BUILD = r"\.venv/bin/python -m sphinx .*-W .*-c docs \. docs/_build"


@pytest.fixture(scope="module")
def generated():
    return runpy.run_path(str(DOCS / "generated.py"))


def test_every_key_is_in_the_table(generated):
    table = generated["scene_key_tables"]()
    for key in scene_keys().values():
        if not key.is_section:
            assert f"`{key.name}`" in table
    row = next(line for line in table.splitlines() if line.startswith("| `load.steps`"))
    assert row.split(" | ")[1:] == ["Load steps to every turning point.", "whole number ≥ 1 and "
                                    "≤ 1e+06", "`8` |"]  # fmt: skip


def test_whole_scenes_on_pages_are_accepted():
    pages = [page.read_text("utf-8") for page in (ROOT / "README.md", *DOCS.glob("*.md"))]
    blocks = [one for page in pages for one in re.findall(r"```toml\n(.*?)```", page, re.DOTALL)]
    scenes = [one for one in map(tomllib.loads, blocks) if {"surface", "load"} <= one.keys()]
    assert len(scenes) >= 4
    for scene in scenes:
        Scene.from_dict(scene)


def test_every_column_of_the_history_is_in_the_table(generated):
    table = generated["history_columns"]()
    for column in COLUMNS:
        assert f"| `{column.name}` | {column.meaning} | {column.unit or '–'} |" in table


def test_every_map_of_a_contact_is_in_the_table(generated):
    rows = generated["contact_maps"]().splitlines()[2:]
    assert [row.split(" | ")[0] for row in rows] == [f"| `{name}`" for name in FIELDS]
    assert rows[FIELDS.index("gap_mm")].split(" | ")[1].startswith("Gaps between the plane and the")


def columns_of_a_reference():
    record = ReferenceRecord.of([], np.ones(1), (1,), force_order=2.0)
    return tuple(record.columns(()))


@pytest.mark.parametrize(("file", "columns"), [
    ("patches.csv", (*PATCH_COLUMNS, "region", *PATCH_MORE)),
    ("contacts.csv", ("step", "spot", *SPOT_COLUMNS)), ("reference.csv", columns_of_a_reference()),
    ("laws.csv",
     ("ix", "iy", "region", "approach_mm", *CSV_COLUMNS, *FLOW_COLUMNS, "pressure_scatter_MPa")),
])  # fmt: skip
def test_every_column_is_described(file, columns):
    section = RESULTS.partition(f"\n## `{file}`\n\n")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", section)) == set(columns)


def test_every_file_of_a_run_is_described():
    table = RESULTS.partition("## Files of a run")[2].partition("\n## ")[0]
    for file in FILES:
        assert Path(file).stem in table


def test_every_page_is_in_the_navigation():
    trees = re.findall(r"```\{toctree\}\n(.*?)```", (DOCS / "index.md").read_text(), re.DOTALL)
    lines = [line for tree in trees for line in tree.splitlines() if line[:1] not in (":", "")]
    entries = [re.sub(r".*<(.*)>", r"\1", line) for line in lines]
    shown = [entry[1:] if entry.startswith("/") else f"docs/{entry}" for entry in entries]
    pages = [*ROOT.glob("*.md"), *DOCS.glob("*.md")]
    for page in {path.relative_to(ROOT).with_suffix("") for path in pages} - {Path("docs/index")}:
        assert any(fnmatch.fnmatch(str(page), entry) for entry in shown), page


def test_continuous_integration_builds_the_site_as_the_readme_does():
    assert re.search(rf"^{BUILD} >", (ROOT / ".ci" / "run").read_text(), re.MULTILINE)
    assert re.search(BUILD, (ROOT / "docs" / "features.md").read_text(encoding="utf-8"))
