"""README is true: its example runs, its commands and files exist."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from setuptools import find_packages

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
DEMOS = ROOT / "demos"
PAGES = sorted(DEMOS.rglob("*.md"))


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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_name_files_that_exist(page):
    text = page.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(((?!http|#)[^)#]+)", text):
        assert (page.parent / link).is_file(), link
    for name in re.findall(r"\b(?:demos|tests)/[\w/]+\.\w+\b", text):
        assert (ROOT / name).is_file(), name


def test_every_demo_page_and_picture_is_shown():
    pages = {page: page.read_text(encoding="utf-8") for page in PAGES}
    index = pages[DEMOS / "README.md"]
    for path in (*DEMOS.glob("*.py"), *DEMOS.glob("scenes/*.toml")):
        assert str(path.relative_to(DEMOS)) in index, path
    linked = {
        (page.parent / link).resolve()
        for page, text in {**pages, ROOT / "README.md": TEXT}.items()
        for link in re.findall(r"\]\(((?!http|#)[^)#]+)", text)
    }
    assert {*PAGES, *DEMOS.glob("pictures/*")} <= linked


def test_every_name_in_the_floor_plan_is_a_module():
    block = TEXT[TEXT.index("\nmultiscale/ ") :].partition("```")[0]
    lines = [
        re.match(r"(\w+/)? {2,}(?:(\w+)/ +)?(.*)", line) for line in block.strip().splitlines()
    ]
    package, packages = "", []
    for line in lines:
        assert line is not None
        if line[1]:
            package = line[1]
            packages.append(package)
        for name in line[3].split(" · "):
            assert (ROOT / package / (line[2] or "") / f"{name.strip()}.py").is_file(), name
    assert packages == ["multiscale/", "micro/", "macro/", "geometry/"]


def test_packages_are_found():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = settings["tool"]["setuptools"]["packages"]["find"]["include"]
    found = find_packages(str(ROOT), include=wanted)
    made = {path.parent for name in ("geometry", "micro", "macro", "multiscale")
            for path in (ROOT / name).rglob("__init__.py")}  # fmt: skip
    assert {ROOT / name.replace(".", "/") for name in found} == made
