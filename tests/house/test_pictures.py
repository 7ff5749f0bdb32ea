"""Every picture has one sentence, the same wherever it is shown, and a script that draws it."""

import re
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
DEMOS, DOCS = ROOT / "demos", ROOT / "docs"
ENTRY = re.compile(
    r"^### (?P<title>.+)\n\n!\[(?P<alt>.+)\]\((?P<picture>.+)\)\n\n\*(?P<caption>.+)\*\n\n"
    r"\[`(?P<name>.+)`\]\((?P<script>.+)\) · \[discussed here\]"
    r"\((?P<page>[^)#]+)(?P<part>#.+)?\) · ",
    re.MULTILINE,
)
ENTRIES = [entry.groupdict() for entry in ENTRY.finditer((DOCS / "demos.md").read_text("utf-8"))]
PICTURES = sorted({*DEMOS.glob("pictures/*.png"), *DEMOS.glob("bodies/*.png")})
LARGEST = 350_000
"""Bytes of a picture."""


def test_gallery_has_every_picture_once():
    shown = [(DOCS / entry["picture"]).resolve() for entry in ENTRIES]
    assert sorted(shown) == PICTURES
    for entry in ENTRIES:
        assert (DOCS / entry["script"]).is_file()
        assert (DOCS / entry["page"]).is_file()


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted(DOCS.glob("*.md"))], ids=str)
def test_a_picture_says_the_same_on_every_page(page):
    entries = {(DOCS / entry["picture"]).resolve(): entry for entry in ENTRIES}
    text = page.read_text(encoding="utf-8")
    for alt, path in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text):
        entry = entries[(page.parent / path).resolve()]
        assert alt == entry["title"]  # screen readers say it before the caption
        assert f"*{entry['caption']}*" in text


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["title"])
def test_a_caption_is_one_sentence(entry):
    assert entry["alt"] == entry["title"]
    assert entry["caption"].endswith(".")
    assert not re.search(r"[.!?] [A-Z]", entry["caption"])


@pytest.mark.parametrize("path", PICTURES, ids=lambda path: path.stem)
def test_a_picture_is_of_print_and_small(path):
    with Image.open(path) as image:
        assert image.info["dpi"] == pytest.approx((200, 200), abs=0.1)
    assert path.stat().st_size < LARGEST
