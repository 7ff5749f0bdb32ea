"""Writes everything a run leaves behind: tables, laws, provenance, figures, report."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.collective import on_root
from multiscale import plan
from multiscale.law_tables.law_files import write_laws
from multiscale.reference.coupling import ReferenceCoupling
from multiscale.reporting.outputs import write_json, write_tables, write_text, write_whole, written
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


def write_results(folder: Path, run: Run, *, options: list[str]) -> list[Path]:
    """Write the files of a run, finished or stopped; call it on one rank.

    Args:
        folder: Where to; made when missing.
        run: The run.
        options: PETSc options given by the user, for the provenance.

    Returns:
        The files written.
    """
    made = run.forecast
    history = run.history()
    _remove_older(folder)
    files = write_tables(folder, history)
    table = run.table
    if table is not None:
        files.append(write_whole(folder / "laws.h5", lambda path: write_laws(path, table)))
    output = run.scene.output
    drawn = {}
    if output.figures and len(history):
        with run.phase("output"):
            for name, caption, figure in _figures(run):
                drawn[caption] = write_figure(folder / f"{name}.png", figure)
        files.extend(drawn.values())
    files.append(write_json(folder / "provenance.json", provenance(run, options=options)))
    if output.report:
        page = report_html(
            title=f"patchlaw: {run.scene.name}",
            statements=plan.statements(run.stage, made),
            warnings=list(plan.warnings(run.stage, made)),
            history=run.history(),
            figures=drawn,
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
    return write_whole(path, lambda partial: figure.savefig(partial, dpi=130))


def _figures(run: Run) -> Iterator[tuple[str, str, Figure]]:
    """Yield file name, caption and figure; matplotlib is loaded only when one is wanted."""
    from multiscale import figures

    stage, history = run.stage, run.history()
    yield (
        "surface",
        "The rough surface with its summits and the patches.",
        figures.surface_figure(stage.surface, stage.asperities, stage.patches),
    )
    bands = "" if history.reference is None else " Bands: error bars about mesh size zero."
    yield (
        "curves",
        f"Mean pressure, contact area and mean separation.{bands}",
        figures.history_figure({run.scene.coupling.kind: history}),
    )
    yield (
        "pressures",
        "Mean pressure of every patch at the last load step.",
        figures.pressure_figure(history),
    )
    if run.table is not None:
        yield "laws", "The patch laws.", figures.law_figure(run.table)


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
