"""Every demo runs in reduced size; each asserts its own number."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.picture_answers import still_found

ROOT = Path(__file__).parents[2]
DEMOS = sorted((ROOT / "demos").glob("*.py"))


QUICK = {"four_models"}
"""Demos that take seconds; the others are among the long tests."""
SLOW = {
    "compare", "couplings", "embedded_vs_reference", "flange_leak", "hard_cases", "heat",
    "large_face", "paper_figures_block", "paper_figures_models", "report", "rough_block",
    "rough_brake_pad", "seal_leak", "squeal", "wearing_pad", "worn",
}  # fmt: skip
"""Demos of four seconds and more even in reduced size; these run by hand."""


def test_scripts_load_mpi_before_dolfinx():
    """The wheels of dolfinx find its library only where mpi4py or patchlaw has loaded it."""
    scripts = [one for folder in ("demos", "benchmarks") for one in ROOT.glob(f"{folder}/**/*.py")]
    assert len(scripts) > 50
    for script in scripts:
        imports = re.findall(r"^(?:from|import) (\w+)", script.read_text("utf-8"), re.MULTILINE)
        before = imports[: imports.index("dolfinx")] if "dolfinx" in imports else ["mpi4py"]
        assert {"mpi4py", "patchlaw"} & set(before), script


def duration(demo):
    """Return the marks of a demo in reduced size."""
    if demo.stem in QUICK:
        return []
    return pytest.mark.slow if demo.stem in SLOW else pytest.mark.long


@pytest.mark.parametrize(
    ("demo", "words"),
    [
        *(pytest.param(demo, ["--quick"], marks=duration(demo), id=demo.stem) for demo in DEMOS),
        *(
            pytest.param(
                demo,
                ["--data", "demos/data"],
                marks=pytest.mark.long,
                id=f"{demo.stem}, drawn again",
            )
            for demo in DEMOS
            if demo.stem == "compare"
        ),
    ],
)
def test_demo_runs(demo, words, root, tmp_path):
    done = subprocess.run(
        [sys.executable, demo, *words, "--out", tmp_path],
        cwd=root,
        env=dict(os.environ),  # without what MPI has put into this process behind Python's back
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    assert all(picture.stat().st_size > 10_000 for picture in pictures)
    if words[0] == "--data":
        still_found(tmp_path / f"{demo.stem}.png")


@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_demo_is_a_narrative_that_asserts_a_number(demo):
    text = demo.read_text(encoding="utf-8")
    assert text.startswith("# %% [markdown]")
    assert "\nassert " in text or "\n    assert " in text
    assert len(text.splitlines()) <= 130


@pytest.mark.long
def test_demo_runs_under_mpi(waiting_ranks, tmp_path):
    done = waiting_ranks(2, "demos/rough_block.py", "--quick", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob("*.png"))
    assert done.stdout.count("rough block  approach") == 1
