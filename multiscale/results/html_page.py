"""Fills templates of HTML pages; a page needs no network and no other file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multiscale.readable import duration
from support.displayed import table_html

_MOST_COLUMNS = 7
"""Columns of a table beside its first, of those whose number depends on the run."""

if TYPE_CHECKING:
    from jinja2 import Environment


def filled(template: str, **content: Any) -> str:
    """Return a template filled with content; characters that HTML reserves are escaped.

    Args:
        template: Its file, relative to the folder of this package.
        content: What stands in it, by name.
    """
    return _templates().get_template(template).render(**content) + "\n"


def _look(picture: bytes) -> str:
    """Return the class of a picture in PNG: narrow where it is no wider than a column of text."""
    return "narrow" if int.from_bytes(picture[16:20], "big") < 1000 else "wide"


def _parted(table: tuple[Sequence[str], Sequence[Sequence[str]]]) -> Iterator[Any]:
    """Yield parts of a table that fit a page, each with its first column."""
    headings, rows = table
    for start in range(1, len(headings), _MOST_COLUMNS):
        part = slice(start, start + _MOST_COLUMNS)
        yield (headings[0], *headings[part]), [(row[0], *row[part]) for row in rows]


@cache
def _templates() -> Environment:
    """Return the templates; jinja2, whose import takes 40 ms, is loaded only when one is used."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parents[1]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["base64"] = lambda content: b64encode(content).decode()
    templates.filters["duration"] = duration
    templates.filters |= {"look": _look, "parted": _parted}
    templates.globals["table"] = lambda *content: Markup(table_html(*content))
    return templates
