"""Writes the files of a run: tables, laws, provenance, figures, report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from multiscale.couplings.coupling import Coupling
from multiscale.laws.law_file import hdf5_bytes, write_laws
from multiscale.output.provenance import provenance
from multiscale.output.report import report_html
from multiscale.results.contact_record import FIELDS, SPOT_COLUMNS, ContactRecord
from multiscale.results.history import COLUMNS, History
from multiscale.run import Run
from support.collective import on_root, shared
from support.errors import NotInstalled
from support.packages import optional_packages
from support.whole_files import remove, write_bytes, write_csv, write_text, written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FIGURES = ("overview", "surface", "curves", "pressures", "contact", "laws", "block", "face")

FILES = (
    "history.csv", "patches.csv", "reference.csv", "laws.h5", "provenance.json", "report.html",
    "contacts.csv", "contact.h5", "fields.xdmf", "fields.h5", "fields.bp",
    "counter_fields.xdmf", "counter_fields.h5", "counter_fields.bp",
    *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")),
)  # fmt: skip
"""All files that a run may write."""

_COMPRESSION = 1
"""Level of gzip for maps: most of a map of pressures is zero."""


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
    drawn: list[Pictures] = []
    if run.scene.output.figures and run.steps:
        figures = list(_figures(run).items())
        with run.phase("output"):
            drawn = shared(run.comm, len(figures), lambda index: pictures_of(*figures[index]))
    run.remark(filter(None, (one.problem for one in drawn)))
    pictures = {name: content for one in drawn for name, content in one.files.items()}
    with run.phase("writing"):
        return on_root(run.comm, lambda: _write(folder, run, pictures, options))


def _write(folder: Path, run: Run, pictures: dict[str, bytes], options: list[str]) -> list[Path]:
    for name in FILES:  # Files of an earlier run must not stand beside those of this one.
        with written(folder / name):
            remove(folder / name)
    history, table = run.history(), run.laws
    files = write_tables(folder, history) + write_contacts(folder, run.contacts)
    if table is not None:
        files.append(write_laws(folder / "laws.h5", table))
    files += write_pictures(folder, pictures)
    content = json.dumps(provenance(run, options=options), indent=2)
    files.append(write_text(folder / "provenance.json", content + "\n"))
    if run.scene.output.report:
        files.append(
            write_text(folder / "report.html", report_html(run, pictures, options=options))
        )
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
        write_csv(folder / "patches.csv", history.patch_columns, history.patch_rows()),
    ]
    if history.reference is not None:
        columns = history.reference.columns(history.steps)
        values = zip(*columns.values(), strict=True)
        files.append(write_csv(folder / "reference.csv", list(columns), values))
    return files


def write_records(path: Path, records: Iterator[Mapping[str, Any]]) -> Path | None:
    """Write records as rows; the names of the first one's values are the columns.

    Args:
        path: File to write.
        records: The records; none make no file.
    """
    first = next(records, None)
    if first is None:
        return None
    return write_csv(path, list(first), (list(one.values()) for one in chain([first], records)))


def write_contacts(folder: Path, contacts: Sequence[ContactRecord]) -> list[Path]:
    """Write ``contacts.csv`` and, where fields are known, ``contact.h5``, with a group a load step.

    Args:
        folder: Folder of the results; made when missing.
        contacts: The contacts, nothing is written without any.

    Returns:
        The files written.
    """
    if not contacts:
        return []
    header = ("step", "spot", *SPOT_COLUMNS)
    rows = (row for record in contacts for row in record.rows())
    files = [write_csv(folder / "contacts.csv", header, rows)]

    def fill(file: Any) -> None:
        file.attrs["units"] = "mm, N, MPa"
        for record in contacts:
            group = file.create_group(f"step_{record.step}")
            group.attrs.update(approach_mm=record.approach_mm, force_N=record.force_N)
            for name in FIELDS:
                if (data := getattr(record, name)) is not None:
                    group.create_dataset(name, data=data, compression=_COMPRESSION)

    if contacts[0].pressure_MPa is not None:
        files.append(write_bytes(folder / "contact.h5", hdf5_bytes(fill)))
    return files


class Pictures(NamedTuple):
    """The files of figures.

    Attributes:
        files: Their contents by name.
        problem: Why there are none; empty where there are.
    """

    files: dict[str, bytes]
    problem: str = ""


def pictures_of(name: str, draw: Callable[[], Figure]) -> Pictures:
    """Return the files of a figure: PNG, and SVG beside it.

    Results do not depend on figures: without matplotlib, or with one that fails, there are none.

    Args:
        name: Name of the files without an ending.
        draw: Draws the figure.
    """
    try:
        with optional_packages():
            from multiscale.figures.style import encoded  # loads matplotlib

            found = encoded(draw())
    except NotInstalled as error:
        return Pictures({}, f"no figures are drawn: {error}")
    return Pictures({f"{name}.{kind}": content for kind, content in found.items()})


def write_pictures(folder: Path, pictures: Mapping[str, bytes]) -> list[Path]:
    """Write pictures by the names of their files.

    Args:
        folder: Folder of the results; made when missing.
        pictures: The content of each file, see `pictures_of`.

    Returns:
        The files written.
    """
    return [write_bytes(folder / name, content) for name, content in pictures.items()]


def _figures(run: Run) -> dict[str, Callable[[], Figure]]:
    """Return the functions that draw the figures of a run, by their names.

    Note:
        Collective; drawing is not.
    """
    coupling, history, face = run.coupling, run.history(), run.coupling.face_pressures()
    surface, of_samples = coupling.surface, coupling.regions is not None
    figures: dict[str, Callable[[], Figure]] = {
        "overview": _from("contact", "overview_figure", surface, of_samples, history, face),
        "surface": partial(surface_picture, coupling),
        "curves": partial(history.plot, run.scene.kind),
    }
    if not of_samples:
        figures["pressures"] = _from("contact", "pressure_figure", history)
    if face is not None:
        figures["face"] = _from("contact", "face_figure", face, history.steps[-1])
    if run.contacts:
        contact = run.contacts[-1]
        figures["contact"] = contact.plot
        of_cells = getattr(contact.pressure_MPa, "shape", None) == surface.grid
        if run.scene.output.figures == "all" and of_cells:
            ratio = coupling.materials.first.poisson_ratio
            figures["block"] = _from("block", "contact_block", surface, contact, ratio)
    if coupling.table is not None:
        figures["laws"] = _from("curves", "law_figure", run.laws)
    return figures


def surface_picture(coupling: Coupling) -> Figure:
    """Draw the surface of a scene, with its summits where the micro model uses them.

    Args:
        coupling: What was made of the scene.
    """
    from multiscale.figures.surface import surface_figure  # loads matplotlib

    target = coupling.scene.surface.spectrum
    return surface_figure(coupling.surface, coupling.summits, coupling.patches, target)


def _from(module: str, function: str, *arguments: Any) -> Callable[[], Figure]:
    """Return what draws a figure; matplotlib is loaded only when it is called."""
    return lambda: getattr(import_module(f"multiscale.figures.{module}"), function)(*arguments)
