"""Every demo runs in reduced size; each asserts its own number."""

import re
from pathlib import Path

import pytest
from helpers.picture_answers import still_found
from helpers.waiting_ranks import alone
from matplotlib import rc_context

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


@pytest.mark.parametrize("demo", [
    pytest.param(demo, marks=duration(demo), id=demo.stem) for demo in DEMOS
])  # fmt: skip
def test_demo_runs(demo, tmp_path):
    drawn(demo, "--quick", "--out", tmp_path)


@pytest.mark.long
def test_a_comparison_is_drawn_again_from_its_data(tmp_path):
    drawn(ROOT / "demos" / "compare.py", "--data", ROOT / "demos" / "data", "--out", tmp_path)
    still_found(tmp_path / "compare.png")


def drawn(*words):
    """Run a demo in this process, and look at its pictures."""
    with rc_context():  # demos set the style of all figures
        done = alone(list(map(str, words)))
    assert done.returncode == 0, done.stderr
    pictures = list(words[-1].glob("*.png"))
    assert pictures
    assert all(picture.stat().st_size > 10_000 for picture in pictures)


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
