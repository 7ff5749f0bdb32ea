"""Writes the files of a run: tables, laws, provenance, figures, report."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from patchlaw.multiscale.figures.files import (
    Pictures,
    write_pictures,
)
from patchlaw.multiscale.laws.law_table import hdf5_bytes, write_laws
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.output.provenance import provenance
from patchlaw.multiscale.output.report import CONTACT_OF_STEP, report_html
from patchlaw.multiscale.output.run_figures import RunFigures
from patchlaw.multiscale.results.contact_record import FIELDS, SPOT_COLUMNS, ContactRecord
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.scene_run import Run
from patchlaw.support.collective import on_root
from patchlaw.support.own_files import OwnFiles
from patchlaw.support.whole_files import write_bytes, write_csv, write_text

_FIGURES = (
    "overview", "surface", "curves", "pressures", "contact", "shear", "laws", "block", "face",
    "leak",
)  # fmt: skip

FILES = (
    "history.csv", "patches.csv", "reference.csv", "laws.h5", "provenance.json", "report.html",
    "contacts.csv", "contact.h5", "fields.xdmf", "fields.h5", "fields.bp",
    "counter_fields.xdmf", "counter_fields.h5", "counter_fields.bp",
    *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")),
)  # fmt: skip
"""All files that a run may write."""


def write_results(
    folder: Path, run: Run, *, options: list[str], figures: RunFigures | None = None
) -> list[Path]:
    """Write the files of a run, finished or stopped.

    Args:
        folder: Folder of the results; made when missing.
        run: The run.
        options: PETSc options given by the user, for the provenance.
        figures: The figures of the run, where some were begun before; the caller ends them.

    Returns:
        The files written.

    Note:
        Collective: all ranks draw, rank 0 writes.
    """
    drawn = (figures or RunFigures(run.scene, run.comm)).drawn(run)
    run.remark(filter(None, (one.problem for one in drawn)))
    pictures = Pictures(dict(chain.from_iterable(one.files.items() for one in drawn)))
    with run.clock.phase("writing"):
        return on_root(run.comm, lambda: _write(folder, run, pictures, options))


def _write(folder: Path, run: Run, pictures: Pictures, options: list[str]) -> list[Path]:
    own = OwnFiles(folder)
    own.remove(FILES)  # of an earlier run, which must not stand beside those of this one
    with own.writing(FILES):
        return _write_all(folder, run, pictures, options)


def _write_all(folder: Path, run: Run, pictures: Pictures, options: list[str]) -> list[Path]:
    history, table = run.history(), run.laws
    files = write_tables(folder, history) + write_contacts(folder, run.contacts)
    if table is not None:
        files.append(write_laws(folder / "laws.h5", table))
    files += write_pictures(folder, pictures.without(CONTACT_OF_STEP))
    facts = provenance(run, options=options)
    files.append(write_text(folder / "provenance.json", json.dumps(facts, indent=2) + "\n"))
    if run.scene.output.report:
        files.append(write_text(folder / "report.html", report_html(run, pictures.files, facts)))
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
            group.attrs.update(
                approach_mm=record.approach_mm,
                force_N=record.force_N,
                unloading=record.unloading,
            )
            for name in FIELDS:
                if (data := getattr(record, name)) is not None:
                    # most of a map of pressures is zero
                    group.create_dataset(name, data=data, compression=1)

    if contacts[0].pressure_MPa is not None:
        files.append(write_bytes(folder / "contact.h5", hdf5_bytes(fill)))
    return files
