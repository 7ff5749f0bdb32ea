"""Writes the files of a comparison: table, figures and one HTML page."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from multiscale.comparison.comparison import Comparison
from multiscale.comparison.error_measures import __doc__ as measures_text
from multiscale.output.results import Drawing, png
from multiscale.results.html_page import Section, Table, page_html
from multiscale.storage import write_bytes, write_csv, write_text


def write_comparison(folder: Path, comparison: Comparison) -> list[Path]:
    """Write ``compare.csv``, the figures and ``report.html``.

    Args:
        folder: Folder of the results; made when missing.
        comparison: The comparison.

    Returns:
        The files written.
    """
    columns = comparison.to_dict()
    files = [write_csv(folder / "compare.csv", list(columns), zip(*columns.values(), strict=True))]
    drawings = list(_drawings(comparison))
    files += [write_bytes(folder / f"{one.name}.png", one.png) for one in drawings]
    page = comparison_html(comparison, {one.caption: one.png for one in drawings})
    return [*files, write_text(folder / "report.html", page)]


def _drawings(comparison: Comparison) -> Iterator[Drawing]:
    if not comparison.curves:
        return
    from multiscale.comparison.figures import curves_figure, maps_figure, pareto_figure

    if comparison.measure is not None:
        yield Drawing(
            "pareto",
            "Error against wall time. No other configuration is both faster and closer than one on "
            "the frontier; numbers are those of the table. The measure stands at its own "
            "uncertainty.",
            png(pareto_figure(comparison)),
        )
    yield Drawing(
        "curves",
        "Curves of the measure, the scene as it is and the closest configurations; on the right "
        "their differences from the measure, whose uncertainty is grey.",
        png(curves_figure(comparison)),
    )
    yield Drawing(
        "pressures",
        "Mean pressure of every patch at the last load step, on one scale.",
        png(maps_figure(comparison)),
    )


def comparison_html(comparison: Comparison, figures: Mapping[str, bytes]) -> str:
    """Compose the page.

    Args:
        comparison: The comparison.
        figures: PNG images by caption; they become part of the page.

    Returns:
        A complete HTML document.
    """
    failed = [
        (row.name, row.status, _number(row.exit_code, "d"), row.message)
        for row in comparison.rows
        if row.status != "done"
    ]
    without_result = Section(
        heading="Configurations without a result",
        table=(("configuration", "status", "exit code", "message"), failed),
        text_columns=(1, 3),
    )
    sections = [
        Section(
            paragraphs=list(headline(comparison)),
            items=list(frontier_lines(comparison)),
            warnings=comparison.warnings,
        ),
        Section(figures=dict(list(figures.items())[:1])),
        Section(
            heading="Configurations",
            table=_table(_configuration_cells(comparison)),
            text_columns=(1, 2),
            wide=True,
            figures=dict(list(figures.items())[1:]),
        ),
        Section(
            heading="Errors by cause",
            paragraphs=[
                "Signed shares of the error at the last load step, in % of the measure; they add "
                "up. A share is empty where the configurations that show it were not reached."
            ],
            table=_table(_share_cells(comparison)),
            text_columns=(1,),
            wide=True,
        ),
        *([without_result] if failed else []),
        Section(
            heading="How errors are measured",
            preformatted=(measures_text or "").strip(),
            notes=[
                f"Timed on {platform.platform()}, {os.cpu_count()} cores, "
                f"threads: {os.environ.get('OMP_NUM_THREADS', 'all')}."
            ],
        ),
    ]
    return page_html(f"patchlaw compare: {comparison.scene}", sections)


def headline(comparison: Comparison) -> Iterator[str]:
    """Yield sentences on the number of configurations that were run, and on the measure."""
    done = sum(row.status == "done" for row in comparison.rows)
    yield f"{done} of {len(comparison)} configurations were run to the end of the load."
    if comparison.measure is None:
        return
    response = comparison.response
    own = comparison.uncertainty
    bars = (
        (getattr(own, f"{response}_max"), f"of the {response}"),
        (own.area_max, "of the contact area"),
        (own.distribution, "of the mean pressure in the distribution of pressures"),
    )
    known = ", ".join(f"{_percent(bar)} % {part}" for bar, part in bars if bar > 0)
    yield (
        f"They are compared with “{comparison.measure}”, whose own uncertainty is "
        f"{known or 'not known'}."
    )


def frontier_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line on each configuration of the frontier: its time and its error."""
    bar = getattr(comparison.uncertainty, f"{comparison.response}_max")
    for row in comparison.frontier():
        size = comparison.error(row)
        less = "no more than the uncertainty of the measure, " if size <= bar else ""
        yield f"{row.seconds:.3g} s: error {less}{_percent(size)} %: {row.name}"


def _table(rows: Sequence[Mapping[str, str]]) -> Table | None:
    """Return a table of rows by column; None without any."""
    return (list(rows[0]), [list(row.values()) for row in rows]) if rows else None


def _configuration_cells(comparison: Comparison) -> list[dict[str, str]]:
    response, frontier = comparison.response, comparison.frontier()
    rows = []
    for number, row in enumerate(comparison.rows, 1):
        mark = " — measure, with its uncertainty" if row.is_measure else ""
        errors = row.errors
        rows.append(
            {
                "#": str(number),
                "configuration": row.name + mark + " — frontier" * (row in frontier),
                "status": row.status,
                "time [s]": _number(row.seconds, ".2f"),
                "set-up": _number(row.seconds_setup, ".2f"),
                "laws": _number(row.seconds_laws, ".2f"),
                "steps": _number(row.seconds_steps, ".2f"),
                "start": _number(row.seconds_start, ".2f"),
                "memory [MB]": _number(row.peak_MB, ".0f"),
                f"{response} max [%]": _percent(getattr(errors, f"{response}_max")),
                f"{response} last [%]": _percent(getattr(errors, f"{response}_last")),
                "area max [%]": _percent(errors.area_max),
                "separation max [%]": _percent(errors.separation_max),
                "pressure L1 [%]": _percent(errors.pressure_l1),
                "distribution [%]": _percent(errors.distribution),
            }
        )
    return rows


def _share_cells(comparison: Comparison) -> list[dict[str, str]]:
    return [
        {
            "#": str(number),
            "configuration": row.name,
            "error": _percent(getattr(row.errors, f"{comparison.response}_last")),
            "micro model": _percent(row.shares.micro),
            "coupling": _percent(row.shares.coupling),
            "half-space for block": _percent(row.shares.block),
            "small slopes": _percent(row.shares.slopes),
            "discretisation and rest": _percent(row.shares.discretisation),
        }
        for number, row in enumerate(comparison.rows, 1)
        if not row.is_measure and row.shares.discretisation is not None
    ]


def _number(value: float | None, shown: str) -> str:
    return "" if value is None or value != value else f"{value:{shown}}"


def _percent(value: float | None) -> str:
    return "" if value is None else _number(100.0 * value, ".3g")
