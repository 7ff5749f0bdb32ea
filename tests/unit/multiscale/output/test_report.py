"""The report escapes what it quotes, leaves out what there is not, and needs no other file."""

from html.parser import HTMLParser
from types import SimpleNamespace

from multiscale.results.html_page import filled, table_html

RESERVED = "a < b & \"c\" > 'd'"


class Tags(HTMLParser):
    """Collects the tags that are open, and the text."""

    def __init__(self):
        super().__init__()
        self.open, self.seen, self.text = [], [], []

    def handle_starttag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def parsed(page):
    found = Tags()
    found.feed(page)
    assert found.open == []
    return found


def report(text, **changes):
    history = SimpleNamespace(
        table=lambda: ([text], [[text]]),
        seconds={text: 1.0},
        notes=[text],
        reference=None,
        contact=None,
    )
    step = SimpleNamespace(step=2, errors=((text, 0.25), (text, 0.5)), force_N=3.0)
    content = {
        "title": text, "headline": text, "warnings": [text], "statements": [(text, text)],
        "history": history, "measured": step, "pictures": {"surface.png": b"PNG"},
    }  # fmt: skip
    return filled("output/report.jinja", **content | changes)


def test_report_shows_all_parts_and_escapes_them():
    page = parsed(report(RESERVED))
    # Title and heading, headline, warning, statement, table, phase, causes, note.
    assert page.text.count(RESERVED) == 12
    attributes = dict(page.seen)["img"]
    assert attributes["src"] == "data:image/png;base64,UE5H"
    assert ("td", {"class": "text"}) in page.seen
    assert {"altogether", "0.75", "25"} <= set(page.text)
    assert "://" not in report(RESERVED)


def test_parts_that_are_empty_leave_no_element():
    whole, less = parsed(report("text")), parsed(report("text", measured=None, pictures={}))
    assert [tag for tag, _ in whole.seen].count("h2") == 4
    assert [tag for tag, _ in less.seen].count("h2") == 3
    assert not {"figure", "img"} & {tag for tag, _ in less.seen}


def test_table_alone_is_escaped():
    assert "<td>a &lt; b" in table_html((["head"], [[RESERVED]]))
