"""README is true: its example runs, its commands and files exist."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_example_runs():
    (example,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(example.splitlines()) <= 25
    shown = subprocess.run(
        [sys.executable, "-c", example], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert shown.returncode == 0, shown.stderr
    lines = shown.stdout.splitlines()
    assert [line.split()[0] for line in lines[:4]] == ["2", "4", "6", "8"]
    assert lines[4].startswith("largest patch pressure")


def test_ci_runs_the_test_command():
    command = "./setup.sh && .venv/bin/python -m pytest"
    assert command in TEXT
    assert command in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("path", sorted(set(re.findall(r"\]\(((?!http)[^)]+)\)", TEXT))))
def test_linked_files_exist(path):
    assert (ROOT / path).is_file()


def test_every_name_in_the_floor_plan_is_a_module():
    plan = re.findall(r"^(geometry|micro|macro|multiscale)/ +(.*)$", TEXT, re.MULTILINE)
    assert len(plan) == 4
    for package, names in plan:
        for name in names.split(" · "):
            assert (ROOT / package / f"{name.strip()}.py").is_file(), name


def test_packages_are_listed():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = settings["tool"]["setuptools"]["packages"]
    assert listed == sorted(listed, key=["geometry", "micro", "macro", "multiscale"].index)
    for package in listed:
        assert (ROOT / package / "__init__.py").is_file()
