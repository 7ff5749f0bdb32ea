"""Writes what a comparison leaves behind: table, figures and one HTML page."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path

from multiscale.comparison.comparison import Comparison, Row
from multiscale.comparison.measures import __doc__ as measures_text
from multiscale.output.report import figure_element, page, table
from multiscale.output.results import write_figure
from multiscale.storage.whole_files import write_csv, write_text

_SHARES = ("micro", "coupling", "block", "slopes", "discretisation")


def write_comparison(folder: Path, comparison: Comparison) -> list[Path]:
    """Write ``compare.csv``, the figures and ``report.html``.

    Args:
        folder: Where to; made when missing.
        comparison: The comparison.

    Returns:
        The files written.
    """
    columns = comparison.to_dict()
    files = [write_csv(folder / "compare.csv", list(columns), zip(*columns.values(), strict=True))]
    drawn = dict(_drawn(folder, comparison))
    files.extend(drawn.values())
    return [*files, write_text(folder / "report.html", comparison_html(comparison, drawn))]


def _drawn(folder: Path, comparison: Comparison) -> Iterator[tuple[str, Path]]:
    """Draw what there is to be seen; yield captions and files."""
    if not comparison.curves:
        return
    from multiscale.comparison import figures as compare_figures
    from multiscale.comparison import pareto_figure

    if comparison.measure is not None:
        yield (
            "Error against wall time. No other level is both faster and closer than one on the "
            "frontier; numbers are those of the table. The measure stands at its own uncertainty.",
            write_figure(folder / "pareto.png", pareto_figure.pareto_figure(comparison)),
        )
    yield (
        "Curves of the measure, the scene as it is and the closest levels; on the right what they "
        "differ from the measure, whose uncertainty is grey.",
        write_figure(folder / "curves.png", compare_figures.curves_figure(comparison)),
    )
    yield (
        "Mean pressure of every patch at the last load step, on one scale.",
        write_figure(folder / "pressures.png", compare_figures.maps_figure(comparison)),
    )


def comparison_html(comparison: Comparison, figures: Mapping[str, Path]) -> str:
    """Compose the page.

    Args:
        comparison: The comparison.
        figures: PNG files by caption; embedded into the page.

    Returns:
        A complete HTML document.
    """
    elements = [figure_element(caption, path) for caption, path in figures.items()]
    title = f"patchlaw compare: {comparison.scene}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        *(f"<p>{escape(text)}</p>" for text in headline(comparison)),
        "<ul>",
        *(f"<li>{escape(text)}</li>" for text in bargains(comparison)),
        "</ul>",
        *(f'<p class="warning">{escape(text)}</p>' for text in comparison.warnings),
        *elements[:1],
        "<h2>Levels</h2>",
        f'<div class="wide">{table(*level_cells(comparison), text_columns={1, 2})}</div>',
        *elements[1:],
        "<h2>Where the errors come from</h2>",
        "<p>Signed shares of the error at the last load step, in % of the measure; they add up. "
        "Empty where the levels that would tell were not reached.</p>",
        f'<div class="wide">{table(*_share_cells(comparison), text_columns={1})}</div>',
        *_failures(comparison),
        "<h2>How errors are measured</h2>",
        f"<pre>{escape((measures_text or '').strip())}</pre>",
        f'<p class="note">{escape(_machine())}</p>',
    ]
    return page(title, parts)


def headline(comparison: Comparison) -> Iterator[str]:
    """Yield how many levels were run and what they are compared with, in words."""
    done = sum(row.status == "done" for row in comparison.rows)
    yield f"{done} of {len(comparison)} levels were run to the end of the load."
    if comparison.measure is None:
        return
    response, own = comparison.response, comparison.uncertainty
    bars = [
        (f"{response}_max", f"of the {response}"),
        ("area_max", "of the contact area"),
        ("distribution", "of the mean pressure in the distribution of pressures"),
    ]
    known = [
        f"{_percent(getattr(own, name))} % {of}" for name, of in bars if getattr(own, name) > 0
    ]
    yield (
        f"They are compared with “{comparison.measure}”, whose own uncertainty is "
        f"{', '.join(known) if known else 'not known'}."
    )


def bargains(comparison: Comparison) -> Iterator[str]:
    """Yield what time buys: the levels on the frontier, in words."""
    bar = getattr(comparison.uncertainty, f"{comparison.response}_max")
    for row in comparison.frontier():
        size = comparison.error(row)
        less = "no more than the measure's uncertainty, " if size <= bar else ""
        yield f"{row.seconds:.3g} s: error {less}{_percent(size)} %: {row.name}"


def level_cells(comparison: Comparison) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and formatted rows of the table of levels."""
    response = comparison.response
    header = (
        "#", "level", "status", "time [s]", "set-up", "laws", "steps", "start", "memory [MB]",
        f"{response} max [%]", f"{response} last [%]", "area max [%]", "separation max [%]",
        "pressure L1 [%]", "distribution [%]",
    )  # fmt: skip
    best = comparison.frontier()
    rows = []
    for number, row in enumerate(comparison.rows, 1):
        mark = " — measure, with its uncertainty" if row.is_measure else ""
        mark += " — frontier" if row in best else ""
        times = (row.seconds, row.seconds_setup, row.seconds_laws, row.seconds_steps)
        found = row.errors
        errors = (
            getattr(found, f"{response}_max"), getattr(found, f"{response}_last"), found.area_max,
            found.separation_max, found.pressure_l1, found.distribution,
        )  # fmt: skip
        rows.append(
            (
                str(number),
                row.name + mark,
                row.status,
                *(_seconds(spent) for spent in (*times, row.seconds_start)),
                "" if row.peak_MB != row.peak_MB else f"{row.peak_MB:.0f}",
                *map(_percent, errors),
            )
        )
    return header, rows


def _share_cells(comparison: Comparison) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    header = (
        "#", "level", "error", "micro model", "coupling", "half-space for block", "small slopes",
        "discretisation and rest",
    )  # fmt: skip
    rows = [
        (
            str(number),
            row.name,
            _percent(getattr(row.errors, f"{comparison.response}_last")),
            *(_percent(getattr(row.causes, name)) for name in _SHARES),
        )
        for number, row in enumerate(comparison.rows, 1)
        if not row.is_measure and row.causes.discretisation is not None
    ]
    return header, rows


def _failures(comparison: Comparison) -> Iterator[str]:
    """Yield a section on levels that did not come to an end, where there are any."""
    failed = [row for row in comparison.rows if row.status != "done"]
    if failed:
        yield "<h2>Levels without a result</h2>"
        rows = [(row.name, row.status, _code(row), row.message) for row in failed]
        yield table(("level", "status", "exit code", "message"), rows, text_columns={1, 3})


def _code(row: Row) -> str:
    return "" if row.exit_code is None else str(row.exit_code)


def _percent(value: float | None) -> str:
    return "" if value is None or value != value else f"{100.0 * value:.3g}"


def _seconds(spent: float) -> str:
    return "" if spent != spent else f"{spent:.2f}"


def _machine() -> str:
    threads = os.environ.get("OMP_NUM_THREADS", "all")
    return f"Timed on {platform.platform()}, {os.cpu_count()} cores, threads: {threads}."
