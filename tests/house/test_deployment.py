"""Scripts for clusters and for other Debian releases: what can be said of them without either."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HPC = ROOT / "demos" / "hpc"
RUNNER = ROOT / "tests" / "releases" / "run"
FINDINGS = sorted((ROOT / "findings").glob("*.sh"))
SCRIPTS = [
    *sorted(HPC.glob("*.sbatch")), *FINDINGS, RUNNER, ROOT / ".ci" / "run", ROOT / "setup.sh",
]  # fmt: skip
PAGE = (ROOT / "docs" / "hpc.md").read_text(encoding="utf-8")


def call(*words):
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=100)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_scripts_are_executable_and_parse(script):
    assert script.stat().st_mode & 0o111
    assert call("bash", "-n", script).returncode == 0


def test_definition_installs_as_everybody_does_and_compiles_ahead():
    sections = re.split(
        r"^%(\w+)\n", (HPC / "patchlaw.def").read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    steps = dict(zip(sections[1::2], sections[2::2], strict=True))
    assert {"files", "post", "environment", "test", "runscript"} == set(steps)
    assert "./setup.sh" in steps["post"]
    # what is compiled while the image is built is looked for there when it runs
    (made,) = re.findall(r"XDG_CACHE_HOME=(\S+) .*patchlaw warm", steps["post"])
    assert f"export XDG_CACHE_HOME={made}\n" in steps["environment"]


def test_every_script_is_named():
    for path in (*HPC.glob("*.sbatch"), HPC / "patchlaw.def", HPC / "spack.yaml"):
        assert f"demos/hpc/{path.name}" in PAGE
    assert "](scaling.md)" in PAGE


def test_runner_says_how_it_is_called():
    done = call(RUNNER)
    assert done.returncode == 2
    assert "--ranks N" in done.stderr


def test_runner_skips_what_it_cannot_build_with_one_line():
    done = call(RUNNER, "no-such-release")
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"releases: SKIPPED: .+\n", done.stdout)
