"""The report: results first, the solver's work folded; it escapes, and needs no other file."""

import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import pytest

from multiscale.output.provenance import provenance
from multiscale.output.report import citations, report_html
from multiscale.readable import percent, quantity
from multiscale.results.html_page import filled, table_html
from multiscale.run import Run
from multiscale.scene.scene import Scene

ROOT = Path(__file__).parents[4]
PAPER = ROOT / "demos" / "scenes" / "paper.toml"
PICTURES = {"overview.png": b"one", "curves.png": b"two", "surface.png": b"three"}

RESERVED = "a < b & \"c\" > 'd'"


class Tags(HTMLParser):
    """Collects the tags that are open, headings, pictures, and visible and folded text."""

    def __init__(self):
        super().__init__()
        self.open, self.seen, self.text, self.folded, self.parts = [], [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))
        if tag not in ("meta", "img"):
            self.open.append(tag)
        if tag == "img":
            self.parts.append(dict(attributes)["alt"].split(",")[0].split(":")[0])
        if tag in ("dl", "details"):
            self.parts.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "h2":
            self.parts.append(data)
        if not {"style", "script"} & set(self.open) and data.strip():
            (self.folded if "details" in self.open else self.text).append(data)


def parsed(page):
    found = Tags()
    found.feed(page)
    assert found.open == []
    return found


def report(text, **changes):
    history = SimpleNamespace(
        table=lambda *names: ([text, text], [[text, text]]),
        seconds={text: 1.0},
        reference=None,
        contact=None,
        steps=[SimpleNamespace(step=2)],
    )
    step = SimpleNamespace(step=2, errors=((text, 0.25), (text, 0.5)), force_N=3.0)
    pair = (text, text)
    content = {
        "title": text, "results": [(text, text, text)], "warnings": [text], "notes": [text],
        "details": [text], "inputs": [pair], "folded": [pair], "made": [pair] * 5,
        "citations": [text], "history": history, "measured": step, "reference": "",
        "finished": True, "pictures": PICTURES, "percent": percent, "quantity": quantity,
    }  # fmt: skip
    return filled("output/report.jinja", **content | changes)


def test_report_shows_all_parts_and_escapes_them():
    page = parsed(report(RESERVED))
    # Title and heading, 3 of results, warning, 2 tables of 4, causes, note, inputs, made, citation
    assert page.text.count(RESERVED) == 2 + 3 + 1 + 8 + 2 + 1 + 2 + 6 + 1
    # Detail, statement, a table of 4, phase, made
    assert page.folded.count(RESERVED) == 1 + 2 + 4 + 1 + 4
    assert dict(page.seen)["img"]["src"] == "data:image/png;base64,dGhyZWU="
    assert ("td", {"class": "text"}) in page.seen
    assert {"altogether", "750 mN", "25 %"} <= set(page.text)
    assert "://" not in report(RESERVED)


def test_results_come_first_and_the_solver_last():
    assert parsed(report("text")).parts == [
        "dl", "The surface", "Load history", "Mean pressure over approach",
        "Error of the force by cause, measured at load step 2", "Notes", "Contact and surface",
        "The surface", "Inputs", "Version and citation", "details",
    ]  # fmt: skip


def test_parts_that_are_empty_leave_no_element():
    less = parsed(report("text", measured=None, pictures={}, notes=[], results=[]))
    assert less.parts == ["Inputs", "Version and citation", "details"]
    assert "No load step was accepted." in less.text
    assert not {"figure", "img", "dl"} & {tag for tag, _ in less.seen}


SMALL = ["surface.grid=[32, 32]", "load.steps=2", "patches.grid=[2, 2]", "output.figures=false"]
MICRO = ["block.young_modulus='200 Pa'"]
KILO = ["block.young_modulus='210 GPa'", "load.approach='30 um'"]
LAWS = ["coupling.kind=isolated", "block.cells=[8, 8, 4]"]


@pytest.mark.parametrize(
    ("words", "force"),
    [
        (["coupling.kind=analytic", "micro.model=elliptic"], r"[\d.]+ N"),
        (["coupling.kind=analytic", "micro.model=elliptic", *MICRO], r"[\d.]+ nN"),
        (["coupling.kind=analytic", "micro.model=half-space", *KILO], r"[\d.]+ ± [\d.]+ N"),
        pytest.param(
            ["coupling.kind=consistent", "micro.model=elliptic"],
            r"[\d.]+ N",
            marks=pytest.mark.long,
        ),
        (["coupling.kind=reference", "reference.cells=[8, 8, 4]"], r"[\d.]+ ± [\d.]+ N"),
        (LAWS, r"[\d.]+ N"),
    ],
    ids=["asperities", "nanonewtons", "steel", "laws", "reference", "isolated"],
)
def test_every_coupling_has_a_readable_report(words, force):
    run = Run(Scene.load(PAPER, [*SMALL, *words]))
    list(run.load_steps())
    run.finish()
    page = parsed(report_html(run, {}, provenance(run, options=["-ksp_rtol", "1e-9"])))
    names = page.text[page.text.index("force") :]
    assert re.fullmatch(force, names[1])
    assert {"approach", "real contact area", "mean pressure"} <= set(names)
    visible = " ".join(page.text)
    assert not re.search(r"\de[+-]?\d|nan|None", visible.partition("heights, SHA")[0])
    assert "Newton" not in visible and "Newton" in " ".join(page.folded)
    assert {"material", "dimensions", "load", "surface"} <= set(page.text)
    assert "-ksp_rtol 1e-9" in page.folded
    assert set(citations()) <= set(page.text)


def test_citation_is_that_of_the_file():
    given = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    program, paper = citations()
    stated = dict(re.findall(r'^\s*-?\s*([a-z-]+): "?([^"\n]+)"?$', given, re.M))
    assert stated["doi"] in paper and stated["journal"] in paper and stated["year"] in paper
    assert stated["version"] in program
    for title in re.findall(r'title: "(.*)"', given):
        assert title in program + paper
    for name in re.findall(r'family-names: "?([^"\n]+)"?', given):
        assert name in paper


def test_table_alone_is_escaped():
    assert "<td>a &lt; b" in table_html((["head"], [[RESERVED]]))
