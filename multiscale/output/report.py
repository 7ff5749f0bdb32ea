"""The readable report of a run: one HTML page that needs no network."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

from multiscale.results.history import History

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; color: #1c2833; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #d5d8dc; }
th:first-child, td:first-child { text-align: left; } th { background: #f4f6f7; }
td.text { text-align: left; } figure { margin: 1.2rem 0; } img { max-width: 100%; }
figcaption, .note { color: #566573; }
.wide { overflow-x: auto; font-size: .85rem; } .wide td, .wide th { padding: .2rem .45rem; }
.warning { border-left: 4px solid #d68910; padding-left: .8rem; }
"""


def report_html(
    *,
    title: str,
    statements: Iterable[tuple[str, str]],
    warnings: Sequence[str],
    history: History,
    figures: Mapping[str, Path],
) -> str:
    """Compose the page.

    Args:
        title: Heading.
        statements: Topics and sentences of the plan.
        warnings: What a user should know about validity.
        history: The run.
        figures: PNG files by caption; embedded into the page.

    Returns:
        A complete HTML document.
    """
    parts = [
        f"<h1>{escape(title)}</h1>",
        _headline(history),
        *(f'<p class="warning">{escape(text)}</p>' for text in warnings),
        "<h2>What was done</h2>",
        table(("topic", "what"), statements, text_columns={1}),
        "<h2>Force–approach curve</h2>",
        table(*curve_cells(history)),
        *(figure_element(caption, path) for caption, path in figures.items()),
        "<h2>What it took</h2>",
        table(("phase", "wall time [s]"), _times(history)),
        *_errors(history),
        *(f'<p class="note">{escape(note)}</p>' for note in history.notes),
    ]
    return page(title, parts)


def page(title: str, parts: Iterable[str]) -> str:
    """Return a complete HTML document that needs no network.

    Args:
        title: Its title.
        parts: Elements of its body.
    """
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>'
    body = "\n".join(parts)
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>{body}</body></html>\n'


def curve_cells(history: History) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and formatted rows of the force–approach table, in µm, N, MPa and %."""
    header: tuple[str, ...] = (
        "step", "approach [µm]", "force [N]", "pressure [MPa]", "area [%]", "separation [µm]",
        "contacts", "Newton", "linear", "time [s]",
    )  # fmt: skip
    rows: list[tuple[str, ...]] = [
        (
            str(step.step),
            with_error(1e3 * step.approach_mm, 1e3 * (step.approach_error_mm or 0.0), digits=4),
            with_error(step.force_N, step.force_error_N, digits=6),
            f"{step.mean_pressure_MPa:.5g}",
            f"{100 * step.contact_area_fraction:.4g}",
            f"{1e3 * step.mean_separation_mm:.4g}",
            str(step.contacts),
            str(step.newton_iterations),
            str(step.linear_iterations),
            f"{step.wall_s:.2f}",
        )
        for step in history
    ]
    if history.reference is not None:
        heading, cells = history.reference.cells
        header = (*header, heading)
        rows = [(*row, cell) for row, cell in zip(rows, cells, strict=True)]
    return header, rows


def with_error(value: float, error: float | None, *, digits: int) -> str:
    """Return a value with its error, both to the error's second digit; alone where that is none.

    Args:
        value: The value.
        error: Its error; 0 or None for none.
        digits: Digits of a value alone.
    """
    if not error:
        return f"{value:.{digits}g}"
    places = max(1 - math.floor(math.log10(error)), 0)
    return f"{value:.{places}f} ± {error:.{places}f}"


def _times(history: History) -> Iterator[tuple[str, str]]:
    for phase, seconds in history.seconds.items():
        yield phase, f"{seconds:.2f}"


def _errors(history: History) -> Iterator[str]:
    """Yield a heading and a table of the latest errors that were measured by cause."""
    measured = [step for step in history if step.errors]
    if not measured:
        return
    step, rows = measured[-1], dict(measured[-1].errors)
    rows["altogether"] = sum(rows.values())
    yield f"<h2>What the force may be off by, measured at load step {step.step}</h2>"
    yield table(
        ("cause", "force [N]", "of the force [%]"),
        [
            (cause, f"{error:.2g}", f"{100 * error / step.force_N:.2g}" if step.force_N else "–")
            for cause, error in rows.items()
        ],
    )


def _headline(history: History) -> str:
    if not len(history):
        return "<p>No load step was accepted.</p>"
    last, record = history.steps[-1], history.reference
    error = "" if record is None else f" Discretisation error: {escape(record.label)}."
    area = f"{100 * last.contact_area_fraction:.3g} % of the nominal area"
    approach = with_error(1e3 * last.approach_mm, 1e3 * (last.approach_error_mm or 0.0), digits=4)
    force = with_error(last.force_N, last.force_error_N, digits=5)
    return (
        f"<p>At an approach of {approach} µm the plane carries "
        f"<b>{force} N</b> ({last.mean_pressure_MPa:.4g} MPa) on {last.contacts} "
        f"contacts covering {area}.{error}</p>"
    )


def table(
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    text_columns: frozenset[int] | set[int] = frozenset(),
) -> str:
    """Return a table.

    Args:
        header: Heads of the columns.
        rows: Texts of the cells.
        text_columns: Columns that are aligned to the left.
    """
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="text">{escape(cell)}</td>'
            if index in text_columns
            else f"<td>{escape(cell)}</td>"
            for index, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def figure_element(caption: str, path: Path) -> str:
    """Return a figure with its caption, the picture inside the page.

    Args:
        caption: What it shows.
        path: PNG file.
    """
    data = base64.b64encode(path.read_bytes()).decode()
    return (
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
