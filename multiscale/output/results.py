"""Writes everything a run leaves behind: tables, laws, provenance, figures, report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.collective import on_root, together
from multiscale.laws.files import write_laws
from multiscale.output.provenance import provenance
from multiscale.output.report import report_html
from multiscale.output.tables import write_tables
from multiscale.planning import plan
from multiscale.run import Run
from multiscale.storage.whole_files import (
    remove,
    write_bytes,
    write_json,
    write_text,
    write_whole,
    written,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FILES = (
    "history.csv", "patches.csv", "reference.csv", "laws.h5", "provenance.json", "report.html",
    "surface.png", "curves.png", "pressures.png", "laws.png", "fields.xdmf", "fields.h5",
    "fields.bp",
)  # fmt: skip
_RESOLUTION = 130  # of figures [dots per inch]
_MOST_FIGURES = 4

Drawing = tuple[str, str, bytes]
"""A figure: name of its file, caption, PNG."""


def write_results(folder: Path, run: Run, *, options: list[str]) -> list[Path]:
    """Write the files of a run, finished or stopped: rank 0 writes, all draw.

    Args:
        folder: Where to; made when missing.
        run: The run.
        options: PETSc options given by the user, for the provenance.

    Returns:
        The files written.

    Note:
        Collective.
    """
    drawn: list[Drawing] = []
    if run.scene.output.figures and run.steps:
        with run.phase("output"):
            drawn = _drawn(run)
    return on_root(run.comm, lambda: _written(folder, run, drawn, options))


def _written(folder: Path, run: Run, drawn: list[Drawing], options: list[str]) -> list[Path]:
    """Write the files of a run with the figures drawn."""
    history = run.history()
    _remove_older(folder)
    files = write_tables(folder, history)
    table = run.table
    if table is not None:
        files.append(write_whole(folder / "laws.h5", lambda path: write_laws(path, table)))
    figures = {caption: folder / f"{name}.png" for name, caption, _ in drawn}
    for path, (_, _, content) in zip(figures.values(), drawn, strict=True):
        files.append(write_bytes(path, content))
    files.append(write_json(folder / "provenance.json", provenance(run, options=options)))
    if run.scene.output.report:
        page = report_html(
            title=f"patchlaw: {run.scene.name}",
            statements=plan.statements(run.setup),
            warnings=list(plan.warnings(run.setup)),
            history=history,
            figures=figures,
        )
        files.append(write_text(folder / "report.html", page))
    return files


def _remove_older(folder: Path) -> None:
    """Remove an earlier run's files, lest this run's tables stand beside another scene's laws."""
    for name in _FILES:
        with written(folder / name):
            remove(folder / name)


def write_figure(path: Path, figure: Figure) -> Path:
    """Write a figure as PNG.

    Args:
        path: File to write.
        figure: A matplotlib figure.
    """
    return write_whole(path, lambda partial: figure.savefig(partial, dpi=_RESOLUTION))


def _drawn(run: Run) -> list[Drawing]:
    """Draw the figures, each on a rank of its own where there are as many; rank 0 gets them."""
    comm = run.comm
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)

    def draw() -> dict[int, Drawing]:
        if rank >= _MOST_FIGURES:
            return {}
        mine = list(enumerate(_figures(run)))[rank::size]
        return {at: (name, caption, _png(make())) for at, (name, caption, make) in mine}

    drawn = together(comm, draw)
    if comm is not None:
        drawn = {at: one for part in comm.gather(drawn) or () for at, one in part.items()}
    return [drawn[at] for at in sorted(drawn)]


def _png(figure: Figure) -> bytes:
    content = BytesIO()
    figure.savefig(content, dpi=_RESOLUTION)
    return content.getvalue()


def _figures(run: Run) -> Iterator[tuple[str, str, Callable[[], Figure]]]:
    """Yield file name, caption and maker; matplotlib is loaded only when a figure is wanted."""
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
