"""HTML pages and tables, filled into templates; a page needs no network and no other file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from jinja2 import Environment

Table: TypeAlias = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings of the columns, and the rows with a text for each column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A section of a page; its parts stand below each other in the order given here.

    Attributes:
        heading: The heading; empty for none.
        paragraphs: Paragraphs of text.
        items: Items of a list.
        warnings: Paragraphs that a reader should not miss.
        table: A table.
        text_columns: Indices of the table's columns that hold text and are aligned to the left.
        wide: Whether the table is set smaller, and scrolls when the window is narrow.
        figures: PNG images by caption.
        preformatted: Text whose lines and spaces stay as they are.
        notes: Paragraphs of secondary importance.
    """

    heading: str = ""
    paragraphs: Sequence[str] = ()
    items: Sequence[str] = ()
    warnings: Sequence[str] = ()
    table: Table | None = None
    text_columns: Sequence[int] = ()
    wide: bool = False
    figures: Mapping[str, bytes] = field(default_factory=dict)
    preformatted: str = ""
    notes: Sequence[str] = ()


def page_html(title: str, sections: Iterable[Section]) -> str:
    """Return a complete HTML document; characters that HTML reserves are escaped.

    Args:
        title: The title and main heading.
        sections: The sections.
    """
    return filled("results/page.jinja", title=title, sections=list(sections))


def filled(template: str, **content: Any) -> str:
    """Return a template filled with content; characters that HTML reserves are escaped.

    Args:
        template: Its file, relative to the folder of this package.
        content: What stands in it, by name.
    """
    return _templates().get_template(template).render(**content) + "\n"


def table_html(table: Table) -> str:
    """Return a table as an HTML element.

    Args:
        table: Its headings and rows.
    """
    return str(_templates().get_template("results/table.jinja").module.table(table))  # type: ignore[attr-defined]


@cache
def _templates() -> Environment:
    """Return the templates; jinja2, whose import takes 40 ms, is loaded only when one is used."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parents[1]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["base64"] = lambda content: b64encode(content).decode()
    return templates
