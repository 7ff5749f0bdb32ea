"""The report: results first, the solver's work folded; it escapes, and needs no other file."""

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.results.contacts import shown_contacts
from patchlaw.multiscale.runs.output.report import _parted, citations, filled, report_html, results
from patchlaw.multiscale.runs.output.results import provenance, write_results
from patchlaw.support.readable import percent, quantities

ROOT = Path(__file__).parents[5]
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
        if tag not in ("meta", "img", "input"):
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
        table=lambda *names: ([text, text], [[text, text]]), seconds={text: 1.0}, reference=None,
        contact=None, contact_records=(), steps=[SimpleNamespace(step=2)],
    )  # fmt: skip
    step = SimpleNamespace(step=2, errors=((text, 0.25), (text, 0.5)), force_N=3.0)
    pair = (text, text)
    content = {
        "title": text, "results": [(text, text, text)], "warnings": [text], "notes": [text],
        "details": [text], "inputs": [pair], "folded": [pair], "made": [pair] * 5,
        "citations": [text], "history": history, "measured": step, "reference": "",
        "finished": True, "contacts": [], "first_contact": 0, "unloaded": "",
        "pictures": PICTURES, "percent": percent, "quantities": quantities, "meanings": {},
        "zones": ((), ()), "zone_surfaces": [],
        "over_pressure": ((text, "", "", ""), [(text, "", "", text)]),
    }  # fmt: skip
    return filled("runs/output/report.jinja", **content | changes)


def test_report_shows_all_parts_and_escapes_them():
    page = parsed(report(RESERVED))
    # Title and heading, 3 of results, warning, 2 tables of 4, powers, causes, note, inputs, made,
    # citation
    assert page.text.count(RESERVED) == 2 + 3 + 1 + 8 + 3 + 2 + 1 + 2 + 6 + 1
    # Detail, statement, a table of 4, phase, made
    assert page.folded.count(RESERVED) == 1 + 2 + 4 + 1 + 4
    assert dict(page.seen)["img"]["src"] == "data:image/png;base64,dGhyZWU="
    assert ("td", {"class": "text"}) in page.seen
    assert {"altogether", "750 mN", "25 %"} <= set(page.text)
    assert "://" not in report(RESERVED)


def test_results_come_first_and_the_solver_last():
    assert parsed(report("text")).parts == [
        "dl", "The surface", "Load history", "Mean pressure over approach", "Over pressure",
        "Error of the force by cause, measured at load step 2", "Notes", "Contact and surface",
        "The surface", "Inputs", "Version and citation", "details",
    ]  # fmt: skip


def test_parts_that_are_empty_leave_no_element():
    nothing = {"measured": None, "pictures": {}, "notes": [], "results": []}
    less = parsed(report("text", over_pressure=((), ()), **nothing))
    assert less.parts == ["Inputs", "Version and citation", "details"]
    assert "No load step was accepted." in less.text
    assert not {"figure", "img", "dl"} & {tag for tag, _ in less.seen}


SMALL = ["surface.grid=[32, 32]", "load.steps=2", "patches.grid=[2, 2]", "output.figures=false"]
MICRO = ["block.young_modulus='200 Pa'"]
KILO = ["block.young_modulus='210 GPa'", "load.approach='30 um'"]
LAWS = ["coupling.kind=isolated", "block.cells=[8, 8, 4]"]


@pytest.mark.long
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
        (["coupling.kind=reference", "reference.fine='150 um'"], r"[\d.]+ ± [\d.]+ N"),
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
    assert "linear" not in page.text and {"iterations", "linear"} <= set(page.folded)
    assert {"material", "dimensions", "load", "surface"} <= set(page.text)
    assert "-ksp_rtol 1e-9" in page.folded
    assert set(citations()) <= set(page.text)


def test_results_stand_with_their_errors():
    steel = ["coupling.kind=analytic", "micro.model=half-space", *KILO]
    run = Run(Scene.load(PAPER, [*SMALL, *steel]))
    *_, last = run.load_steps()
    run.finish()
    found = {name: value for name, value, _ in results(last, run.coupling, run)}
    for name in ("real contact area", "interface stiffness", "interface stiffness per area"):
        assert re.fullmatch(r"[\d.]+ ± [\d.]+ \S+", found[name]), found[name]
    area, error = re.findall(r"[\d.]+", found["real contact area"])
    assert float(area) == pytest.approx(100.0 * last.contact_area_fraction, rel=0.02)
    # rounded to its second digit
    assert float(error) == pytest.approx(100.0 * last.contact_area_fraction_error, rel=0.05)


def test_citation_is_that_of_the_file():
    given = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    program, paper = citations()
    stated = dict(re.findall(r'^\s*-?\s*([a-z-]+): "?([^"\n]+)"?$', given, re.M))
    assert stated["doi"] in paper and stated["journal"] in paper and stated["year"] in paper
    assert "version" not in stated and version("patchlaw") in program
    for title in re.findall(r'title: "(.*)"', given):
        assert title in program + paper
    for name in re.findall(r'family-names: "?([^"\n]+)"?', given):
        assert name in paper


def cycle(folder, *words):
    """Return the report of a surface that yields under a load which goes back to zero."""
    scene = folder / "scene.toml"
    scene.write_text(SMALL_SCENE.replace('approach = "8 um"', "force = ['1.5 N', '0 N']"))
    run = Run(
        Scene.load(scene, ["micro.hardness=80 MPa", "output.report=true", "load.steps=3", *words])
    )
    list(run.load_steps())
    run.finish()
    write_results(folder, run, options=[])
    return (folder / "report.html").read_text()


@pytest.mark.slow
def test_slider_chooses_from_all_recorded_contacts(tmp_path):
    text = cycle(tmp_path, "output.figures=true", "output.contact=all")
    page = parsed(text)
    (slider,) = [found for tag, found in page.seen if tag == "input"]
    assert (slider["type"], slider["min"], slider["max"]) == ("range", "0", "5")
    assert slider["value"] == "2"  # the largest force, load step 3
    captions = [found["alt"] for tag, found in page.seen if tag == "img"]
    captions = [caption for caption in captions if caption.startswith("Load step")]
    assert [caption.split(":")[0] for caption in captions] == [
        *(f"Load step {step}, loading" for step in (1, 2, 3)),
        *(f"Load step {step}, unloading" for step in (4, 5, 6)),
    ]
    assert captions[-1].endswith("force 0 N, no contact.")
    said = "At load step 6 the force is zero and nothing is in contact; it was largest at load step"
    assert f"{said} 3, 1.5 N." in page.text
    assert {"loading", "unloading"} <= set(page.text)
    assert "://" not in text and 'src="http' not in text
    assert not list(tmp_path.glob("contact_of_step_*"))


@pytest.mark.long
def test_single_contact_has_no_slider(tmp_path):
    page = parsed(cycle(tmp_path, "output.figures=true"))
    assert "input" not in {tag for tag, _ in page.seen}


def test_slider_works_as_a_browser_runs_it(tmp_path):
    """Without a browser: the script runs in Node on elements that have what it uses."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no Node")
    page = (ROOT / "multiscale/runs/output/report.jinja").read_text(encoding="utf-8")
    script = page.partition("<script>")[2].partition("</script>")[0]
    before = """
    const slider = { value: "2", listeners: {}, attributes: {},
      addEventListener(name, call) { this.listeners[name] = call; },
      setAttribute(name, value) { this.attributes[name] = value; } };
    const bar = { hidden: true };
    const figures = [0, 1, 2, 3, 4, 5].map(index => ({ hidden: false,
      querySelector: () => ({ textContent: `caption ${index}` }) }));
    const part = { querySelectorAll: () => figures,
      querySelector: what => what === "input" ? slider : bar };
    const document = { querySelectorAll: () => [part] };
    const shown = () => [figures.map(one => !one.hidden), slider.attributes, bar.hidden];
    """
    after = """
    const first = JSON.stringify(shown());
    slider.value = "5";
    slider.listeners.input();
    console.log(JSON.stringify([JSON.parse(first), shown()]));
    """
    (tmp_path / "run.js").write_text(before + script + after)
    done = subprocess.run([node, tmp_path / "run.js"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for index, (visible, attributes, hidden) in zip((2, 5), json.loads(done.stdout), strict=True):
        assert visible == [number == index for number in range(6)]
        assert attributes == {"aria-valuetext": f"caption {index}"}
        assert hidden is False


def test_of_many_contacts_some_are_shown():
    records = [SimpleNamespace(force_N=float(index == 777), step=index) for index in range(1000)]
    steps = [record.step for record in shown_contacts(records)]
    assert len(steps) == 40 and steps == sorted(steps)
    assert {0, 777, 999} <= set(steps)
    assert shown_contacts(records[:1]) == []
    assert shown_contacts(records[:40]) == records[:40]


def test_parts_of_a_table_are_about_as_wide():
    headings = ["step", *"abcdefghi"]
    rows = [[str(k) for k in range(10)]]
    parts = list(_parted((headings, rows)))
    assert [list(heading) for heading, _ in parts] == [["step", *"abcde"], ["step", *"fghi"]]
    assert [list(row) for _, (row,) in parts] == [list("012345"), list("06789")]
    assert list(_parted((["step"], [["1"]]))) == []
