"""The page on what works with what is current: the code refuses what it says, in these words."""

import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "what_works.md").read_text(encoding="utf-8")
ANEW = "is not current: .venv/bin/python docs/what_works.py writes it anew"


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(DOCS / "what_works.py"))


@pytest.mark.long  # 10 s
def test_page_says_what_is_refused(script):
    found = script["page"](pairs=False)
    tables, _, reasons = found.partition("## Reasons\n")
    assert tables.strip() == PAGE.partition("## Two choices together")[0].strip(), ANEW
    assert PAGE.partition("## Reasons\n")[2].startswith(reasons), ANEW


@pytest.mark.slow  # minutes: hundreds of scenes
def test_page_says_which_choices_do_not_go_together(script):
    assert script["page"]() == PAGE, ANEW


def test_page_has_refusals_and_all_couplings_work():
    """Guards against a page on which all, or nothing, is refused."""
    row = PAGE.partition("| `micro.hardness` | ")[2].partition("\n")[0].split(" | ")
    reason = row[3]
    assert row == ["●", "●", "●", reason, "●", f"{reason} |"]
    assert f"\n{reason}. does not go with this coupling, which is elastic\n" in PAGE
    everywhere = PAGE.partition("These work with every coupling: ")[2].partition(".\n")[0]
    assert "`load.force`" in everywhere
    assert PAGE.count("●") > 50


def test_choices_are_keys_of_scenes(script):
    """A choice whose key is misspelt would be refused everywhere, and stand there as such."""
    assert "unknown key" not in PAGE
    for choices in script["CHOICES"].values():
        assert all(changes for changes in choices.values())
