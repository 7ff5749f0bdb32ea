"""Every picture has one sentence, which stands once, and a script that draws it."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.picture_answers import answer_of, still_found
from PIL import Image

ROOT = Path(__file__).parents[2]
DEMOS, DOCS = ROOT / "demos", ROOT / "docs"
ENTRY = re.compile(
    r"^### (?P<title>.+)\n\n!\[(?P<alt>.+)\]\((?P<picture>.+)\)\n\n(?:\*(?P<caption>.+)\*\n\n)?"
    r"\[`(?P<name>.+)`\]\((?P<script>.+)\)(?:, \d+ (?:s|min))?; \[discussed here\]"
    r"\((?P<page>[^)#]+)(?P<part>#.+)?\)$",
    re.MULTILINE,
)
GALLERY = runpy.run_path(str(DOCS / "generated.py"))["gallery"]()
TEXT = f"{(DOCS / 'demos.md').read_text('utf-8')}\n{GALLERY}"
ENTRIES = [entry.groupdict() for entry in ENTRY.finditer(TEXT)]
PICTURES = sorted({*DEMOS.glob("pictures/*.png"), *DEMOS.glob("bodies/*.png")})
LARGEST = 350_000
"""Bytes of a picture."""
CHEAP = ("four_models", "large_block", "rough_block", "tilt", "worn")
"""Scripts that draw their picture in at most a minute, and say in its file what came out."""


def test_gallery_has_every_picture_once():
    shown = [(DOCS / entry["picture"]).resolve() for entry in ENTRIES]
    assert sorted(shown) == PICTURES
    for entry in ENTRIES:
        assert (DOCS / entry["script"]).is_file()
        assert (DOCS / entry["page"]).is_file()


def shown_on(page):
    """Yield title, file and sentence of the pictures of a page; None for no sentence."""
    text = page.read_text(encoding="utf-8")
    for found in re.finditer(r"!\[([^\]]*)\]\(([^)]+)\)\n(?:\s*\*(.+)\*\n)?", text):
        yield found[1], (page.parent / found[2]).resolve(), found[3]


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["title"])
def test_a_picture_has_one_sentence_beside_it_where_it_is_discussed(entry):
    """In the gallery it stands only for pictures that no other page shows."""
    pages = [ROOT / "README.md", *(one for one in DOCS.glob("*.md") if one.stem != "demos")]
    picture = (DOCS / entry["picture"]).resolve()
    shown = [one for page in pages for one in shown_on(page) if one[1] == picture]
    captions = [caption for *_, caption in shown]
    assert captions.count(None) == 0
    assert (entry["caption"] is None) == bool(captions)
    (caption,) = {*captions, entry["caption"]} - {None}
    assert caption.endswith(".")
    assert not re.search(r"[.!?] [A-Z]", caption)
    for title, *_ in shown:
        assert title == entry["title"] == entry["alt"]  # screen readers say it before the caption
    answer = answer_of(picture)
    assert answer or "%" not in caption, "the picture's file does not say what its script found"
    if picture.stem != "report":  # see test_readme.py
        assert all(part in caption for part in (answer or "").split(", ")), answer


def test_run_times_are_those_that_the_scripts_state():
    stated = dict(re.findall(r"/demos/(\w+)\.py\)[,\s]+\(?(\d+ (?:s|min))", TEXT))
    assert len(stated) > 10
    for name, time in stated.items():
        (own,) = re.findall(r"Run time: (\d+ (?:s|min))", (DEMOS / f"{name}.py").read_text("utf-8"))
        assert own == time, name


@pytest.mark.slow
@pytest.mark.parametrize("name", CHEAP)
def test_a_script_still_finds_what_its_picture_says(name, tmp_path):
    words = [sys.executable, f"demos/{name}.py", "--out", tmp_path]
    subprocess.run(words, cwd=ROOT, check=True, capture_output=True)
    still_found(tmp_path / f"{name}.png")


@pytest.mark.parametrize("path", PICTURES, ids=lambda path: path.stem)
def test_a_picture_is_of_print_and_small(path):
    with Image.open(path) as image:
        assert image.info["dpi"] == pytest.approx((200, 200), abs=0.1)
    assert path.stat().st_size < LARGEST
