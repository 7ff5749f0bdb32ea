"""Writes everything a run leaves behind: tables, laws, provenance, figures, report."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.collective import on_root, together
from multiscale import plan
from multiscale.law_tables.law_files import write_laws
from multiscale.reference.coupling import ReferenceCoupling
from multiscale.reporting.outputs import (
    write_bytes,
    write_json,
    write_tables,
    write_text,
    write_whole,
    written,
)
from multiscale.reporting.provenance import provenance
from multiscale.reporting.report import report_html
from multiscale.run import Run

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
    made = run.forecast
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
            statements=plan.statements(run.stage, made),
            warnings=list(plan.warnings(run.stage, made)),
            history=history,
            figures=figures,
            made=made,
        )
        files.append(write_text(folder / "report.html", page))
    return files


def _remove_older(folder: Path) -> None:
    """Remove an earlier run's files, lest this run's tables stand beside another scene's laws."""
    for name in _FILES:
        with written(folder / name):
            _remove(folder / name)


def _remove(path: Path) -> None:
    """Remove a file or a folder (ADIOS2 writes folders), if it is there."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


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
    from multiscale import figures

    stage, history, table = run.stage, run.history(), run.table
    yield (
        "surface",
        "The rough surface with its summits and the patches.",
        lambda: figures.surface_figure(stage.surface, stage.asperities, stage.patches),
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


def write_fields(folder: Path, run: Run) -> list[Path]:
    """Write displacement and pressure of the last load step as XDMF and VTX, for ParaView.

    Args:
        folder: Where to; made when missing.
        run: The run.

    Returns:
        The files written; none when no block took part. Where the mesh was not pressed itself,
        the displacements are those of the scene's block under the patches' mean pressures. A
        reference has its finest rough block and the pressures of its nodes.

    Note:
        Collective: every rank writes its part.
    """
    if not run.stage.embedded or not run.steps:
        return []

    # The XDMF file names its HDF5 file, so both are written under their names in a folder aside.
    aside = folder / ".fields.partial"

    def empty() -> None:
        shutil.rmtree(aside, ignore_errors=True)  # a crash may have left one
        aside.mkdir(parents=True)

    on_root(run.comm, empty)
    _write_xdmf(aside / "fields.xdmf", run)

    def move() -> list[Path]:
        files = []
        for path in sorted(aside.iterdir()):
            _remove(folder / path.name)
            files.append(path.replace(folder / path.name))
        aside.rmdir()
        return files

    return on_root(run.comm, move)


def _write_xdmf(path: Path, run: Run) -> None:
    """Write the last load step's fields: of the rough block, or of the flat one with patches."""
    import macro

    if isinstance(run.coupling, ReferenceCoupling):
        macro.write_rough_fields(path, run.coupling.finest, run.coupling.latest)
        return
    interface, displacement = run.last_field()
    macro.write_fields(path, interface, displacement, run.steps[-1].patches.pressure_MPa)
