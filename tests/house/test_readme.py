"""README is true: its example runs, its commands and files exist."""

import re
import runpy
import subprocess
import tomllib
from hashlib import sha256
from pathlib import Path

import pytest
from helpers.waiting_ranks import alone
from PIL import Image
from setuptools import find_packages

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
DEMOS, DOCS = ROOT / "demos", ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
SITE = [
    *ROOT.glob("*.md"), *PAGES, *DOCS.glob("api/*.md")
]  # fmt: skip
LINK = re.compile(r"\]\((?!http)([^)#]*)(?:#([^)]+))?\)")


def tracked_files():
    """Return the files under version control: what a mesh script made here is not in a clone."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(listed.stdout.splitlines())


PLAN = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
FEATURES = (DOCS / "features.md").read_text(encoding="utf-8")


def test_composed_example():
    example = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)[0]
    (shown,) = re.findall(r"It ends with `(.*?)`", TEXT)
    done = alone(["-c", example])
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == shown


@pytest.mark.long
def test_example_of_a_run():
    (example,) = re.findall(r"```python\n(.*?)```", FEATURES, re.DOTALL)
    (shown,) = re.findall(r"```none\n(.*?)```", FEATURES, re.DOTALL)
    done = alone(["-c", example])
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == shown.splitlines()


def test_scene_shown_first_is_the_one_that_is_run_first():
    (shown,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    assert len(shown.splitlines()) <= 20
    scene = tomllib.loads((DEMOS / "scenes" / "my_surface.toml").read_text(encoding="utf-8"))
    assert tomllib.loads(shown) == scene


def test_picture_shows_the_run_that_the_text_tells():
    """`demos/report.py` writes into its picture what it was made from and what came out."""
    scene = DEMOS / "scenes" / "my_surface.toml"
    inputs = scene.read_bytes() + scene.with_name("ground_steel.txt").read_bytes()
    with Image.open(DEMOS / "pictures" / "report.png") as image:
        about = image.text
    assert about["inputs"] == sha256(inputs).hexdigest()
    approach, spots, yields = about["answer"].split(", ")
    assert f"by {approach}, on {spots}; {yields} of the cells in contact" in TEXT
    assert f"`{approach.removesuffix(' µm')}` µm at 20 N" in TEXT


def test_readme_is_short():
    assert len(TEXT.splitlines()) <= 140


def test_ci_runs_the_test_command():
    command = "./setup.sh && .venv/bin/python -m pytest"
    assert command in TEXT
    assert command in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


def anchors_of(page):
    """Return the addresses of a page's headings, made as on the site."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", SITE, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page):
    text, tracked = page.read_text(encoding="utf-8"), tracked_files()
    for link, heading in LINK.findall(text):
        target = page.parent / link if link else page
        assert str(target.resolve().relative_to(ROOT)) in tracked, link
        assert not heading or heading in anchors_of(target), f"{link}#{heading}"
    for name in re.findall(r"\b(?:demos|docs|tests)/[\w/]+\.(?!html)\w+\b", text):
        assert name in tracked, name


def test_every_demo_and_picture_is_shown():
    pages = {page: page.read_text(encoding="utf-8") for page in PAGES}
    gallery = runpy.run_path(str(DOCS / "generated.py"))["gallery"]()
    index = pages[DOCS / "demos.md"] + gallery
    for path in (*DEMOS.glob("*.py"), *DEMOS.glob("scenes/*.toml")):
        assert str(path.relative_to(DEMOS)) in index, path
    linked = {
        (page.parent / link).resolve()
        for page, text in {**pages, ROOT / "README.md": TEXT}.items()
        for link, _ in LINK.findall(text)
    }
    assert {*DEMOS.glob("pictures/*")} <= linked


def test_every_name_in_the_floor_plan_is_a_folder_or_a_module():
    block = PLAN[PLAN.index("\nmultiscale/ ") :].partition("```")[0]
    package, packages = "", []
    for line in block.strip().splitlines():
        named = re.match(r"(\w+/)? {2,}(.*)", line)
        assert named is not None
        if named[1]:
            package = named[1]
            packages.append(package)
        for name in named[2].split(" · "):
            place = ROOT / package / name.strip()
            assert place.is_dir() or place.with_suffix(".py").is_file(), name
    assert packages == ["multiscale/", "micro/", "macro/", "geometry/", "support/"]


def test_every_folder_is_in_the_floor_plan():
    block = PLAN[PLAN.index("\nmultiscale/ ") :].partition("```")[0]
    for package in ("multiscale", "micro", "macro"):
        for path in (ROOT / package).glob("*/__init__.py"):
            if path.parent.name not in ("pairs", "complementarity"):
                assert re.search(rf"\b{path.parent.name}\b", block), path.parent


def test_packages_are_found():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = settings["tool"]["setuptools"]["packages"]
    folders = ("support", "geometry", "micro", "macro", "multiscale")
    made = find_packages(str(ROOT), include=[f"{name}*" for name in folders])
    assert sorted(listed) == sorted(["patchlaw", *(f"patchlaw.{name}" for name in made)])
    mapped = settings["tool"]["setuptools"]["package-dir"]
    assert mapped == {f"patchlaw.{name}": name for name in folders}
