"""Writes the files of a run: tables, laws, provenance, figures, report."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from itertools import islice, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from geometry.collective import on_root, together
from multiscale.laws.files import write_laws
from multiscale.output.provenance import provenance
from multiscale.output.report import report_html
from multiscale.planning import plan
from multiscale.results.history import COLUMNS, PATCH_COLUMNS, History
from multiscale.run import Run
from multiscale.storage import (
    remove,
    write_bytes,
    write_csv,
    write_json,
    write_text,
    write_whole,
    written,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILES = (
    "history.csv", "patches.csv", "reference.csv", "laws.h5", "provenance.json", "report.html",
    "surface.png", "curves.png", "pressures.png", "laws.png", "fields.xdmf", "fields.h5",
    "fields.bp",
)  # fmt: skip
"""All files that a run may write."""

DOTS_PER_INCH = 130
"""Resolution of the figures."""

MOST_FIGURES = 4
"""Ranks beyond this number draw nothing, and do not load matplotlib."""


class Drawing(NamedTuple):
    """A figure of a run.

    Attributes:
        name: Name of its file, without the ending.
        caption: What it shows.
        png: The image.
    """

    name: str
    caption: str
    png: bytes


def write_results(folder: Path, run: Run, *, options: list[str]) -> list[Path]:
    """Write the files of a run, finished or stopped.

    Args:
        folder: Folder of the results; made when missing.
        run: The run.
        options: PETSc options given by the user, for the provenance.

    Returns:
        The files written.

    Note:
        Collective: all ranks draw, rank 0 writes.
    """
    drawings: Sequence[Drawing] = ()
    if run.scene.output.figures and run.steps:
        with run.phase("output"):
            drawings = _drawings(run)
    return on_root(run.comm, lambda: _write(folder, run, drawings, options))


def _write(folder: Path, run: Run, drawings: Sequence[Drawing], options: list[str]) -> list[Path]:
    for name in FILES:  # Files of an earlier run must not stand beside those of this one.
        with written(folder / name):
            remove(folder / name)
    history, table = run.history(), run.table
    files = write_tables(folder, history)
    if table is not None:
        files.append(write_whole(folder / "laws.h5", lambda path: write_laws(path, table)))
    files += [write_bytes(folder / f"{one.name}.png", one.png) for one in drawings]
    files.append(write_json(folder / "provenance.json", provenance(run, options=options)))
    if run.scene.output.report:
        page = report_html(
            title=f"patchlaw: {run.scene.name}",
            statements=plan.statements(run.setup),
            warnings=list(plan.warnings(run.setup)),
            history=history,
            figures={one.caption: one.png for one in drawings},
        )
        files.append(write_text(folder / "report.html", page))
    return files


def write_tables(folder: Path, history: History) -> list[Path]:
    """Write ``history.csv``, ``patches.csv`` and, for a reference, ``reference.csv``.

    Args:
        folder: Folder of the results; made when missing.
        history: The load steps.

    Returns:
        The files written.
    """
    header = [column.name for column in COLUMNS]
    rows = ([column.of(step) for column in COLUMNS] for step in history)
    files = [
        write_csv(folder / "history.csv", header, rows),
        write_csv(folder / "patches.csv", PATCH_COLUMNS, history.patch_rows()),
    ]
    if history.reference is not None:
        columns = history.reference.columns(history.steps)
        values = zip(*columns.values(), strict=True)
        files.append(write_csv(folder / "reference.csv", list(columns), values))
    return files


def png(figure: Figure) -> bytes:
    """Return a matplotlib figure as a PNG image."""
    content = BytesIO()
    figure.savefig(content, dpi=DOTS_PER_INCH)
    return content.getvalue()


def write_figure(path: Path, figure: Figure) -> Path:
    """Write a matplotlib figure as a PNG file."""
    return write_bytes(path, png(figure))


def _drawings(run: Run) -> list[Drawing]:
    """Return the figures on rank 0; every rank draws its share of them."""
    comm = run.comm
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)

    def draw() -> list[Drawing]:
        mine = islice(_figures(run), rank, None, size) if rank < MOST_FIGURES else ()
        return [Drawing(name, caption, png(make())) for name, caption, make in mine]

    mine = together(comm, draw)
    parts = [mine] if comm is None else comm.gather(mine) or []
    # Rank k has the figures k, k + size, ….
    return [one for figures in zip_longest(*parts) for one in figures if one is not None]


def _figures(run: Run) -> Iterator[tuple[str, str, Callable[[], Figure]]]:
    """Yield file name, caption and function that draws; matplotlib is loaded only here."""
    from multiscale.output import figures

    setup, history, table = run.setup, run.history(), run.table
    yield (
        "surface",
        "The rough surface with its summits and the patches.",
        lambda: figures.surface_figure(setup.surface, setup.asperities, setup.patches),
    )
    bands = "" if history.reference is None else " Bands: error bars about mesh size zero."
    yield (
        "curves",
        f"Mean pressure, contact area and mean separation.{bands}",
        lambda: figures.history_figure({run.scene.coupling.kind: history}),
    )
    yield (
        "pressures",
        "Mean pressure of every patch at the last load step.",
        lambda: figures.pressure_figure(history),
    )
    if table is not None:
        yield "laws", "The patch laws.", lambda: figures.law_figure(table)
