"""Pages escape what they quote, and need no other file."""

from html.parser import HTMLParser

from multiscale.results.html_page import Section, page_html, table_html

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


def test_page_shows_all_parts_and_escapes_them():
    section = Section(
        heading=RESERVED, paragraphs=[RESERVED], items=[RESERVED], warnings=[RESERVED],
        table=([RESERVED], [[RESERVED]]), text_columns=(0,), wide=True,
        figures={RESERVED: b"PNG"}, preformatted=RESERVED, notes=[RESERVED],
    )  # fmt: skip
    page = parsed(page_html(RESERVED, [section]))
    # The page's title and heading, and all parts of the section but the alternative text.
    assert page.text.count(RESERVED) == 11
    attributes = dict(page.seen)["img"]
    assert attributes == {"alt": RESERVED, "src": "data:image/png;base64,UE5H"}
    assert ("td", {"class": "text"}) in page.seen
    assert ("div", {"class": "wide"}) in page.seen
    assert "://" not in page_html(RESERVED, [section])


def test_parts_that_are_empty_leave_no_element():
    page = parsed(page_html("title", [Section(paragraphs=["text"])]))
    assert [tag for tag, _ in page.seen] == [
        "html", "head", "meta", "title", "style", "body", "h1", "p",
    ]  # fmt: skip


def test_table_alone_is_escaped():
    assert "<td>a &lt; b" in table_html((["head"], [[RESERVED]]))
