"""The files of a run: tables, laws, figures, report; fields for ParaView; the provenance."""

from __future__ import annotations

import atexit
import io
import json
import os
import platform
import re
import shutil
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import to_jsonable_python

from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.machine import peak_memory
from patchlaw.multiscale.models.cell_contact import CellContact
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.results.files import Files, contact_files, history_files, write_files
from patchlaw.multiscale.runs import PAGES
from patchlaw.multiscale.runs.output.figures import OF_REPORT, RunFigures
from patchlaw.multiscale.runs.output.report import report_html
from patchlaw.multiscale.runs.scene_run import Run
from patchlaw.multiscale.scene.parts import BodyFacts
from patchlaw.multiscale.scene.scene import CONTENT
from patchlaw.support import NotWritten, PatchlawError, on_root
from patchlaw.support.files import PARTIAL_FOLDER, OwnFiles, fingerprint, remove, written

_FIGURES = (
    "overview", "surface", "curves", "pressures", "contact", "shear", "laws", "block", "face",
    "leak", "over_pressure", "vibration", "wear", "worn",
)  # fmt: skip

FILES = (
    "history.csv", "patches.csv", "reference.csv", "laws.h5", "provenance.json", "report.html",
    "contacts.csv", "contact.h5", "worn.npy", "worn.xyz", "fields.xdmf", "fields.h5", "fields.bp",
    "counter_fields.xdmf", "counter_fields.h5", "counter_fields.bp",
    "modes.csv", "modes.xdmf", "modes.h5", "modes.bp", "contact_stiffness.inp",
    "contact_stiffness.mtx", "counter_modes.xdmf", "counter_modes.h5", "counter_modes.bp",
    *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")), *PAGES,
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
    pictures = (figures or RunFigures(run.scene, run.comm)).drawn(run)

    def write() -> list[Path]:
        # those of an earlier run must not stand beside those of this one
        OwnFiles(folder).remove(FILES)
        return write_files(folder, _files(run, pictures, options), FILES)

    with run.clock.phase("writing"):
        return on_root(run.comm, write)


def _files(run: Run, pictures: Mapping[str, bytes], options: list[str]) -> Files:
    """Yield the files of a run as they are made."""
    history = run.history()
    yield from history_files(history)
    yield from contact_files(history.contact_records)
    if isinstance(run.coupling.made_model, CellContact) and run.scene.wear is not None:
        yield from _worn_heights(run)
    if run.laws is not None:
        from patchlaw.multiscale.laws.law_table import law_bytes

        yield "laws.h5", law_bytes(run.laws)
    yield from (one for one in pictures.items() if not one[0].startswith(OF_REPORT))
    facts = provenance(run, options=options)
    yield "provenance.json", json.dumps(facts, indent=2) + "\n"
    if run.scene.output.report:
        yield "report.html", report_html(run, pictures, facts)


def _worn_heights(run: Run) -> Files:
    """Yield the files of the heights that the loads have left, worn and yielded [mm].

    Where those of the scene came from a list of points, so do these, with the sides of the map.
    """
    micro, model, file = run.coupling.parts.micro, run.coupling.model, io.BytesIO()
    assert isinstance(micro, HalfSpaceModel) and isinstance(model, CellContact)
    surface, lowered = micro.surface, model.lowered
    heights = surface.heights - (0.0 if lowered is None else lowered)
    np.save(file, heights)
    yield "worn.npy", file.getvalue()
    if str(run.scene.surface.file).lower().endswith(".xyz"):
        x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
        points, text = np.stack([x, y, heights], axis=-1).reshape(-1, 3), io.StringIO()
        np.savetxt(text, points, fmt="%.17g")
        yield "worn.xyz", text.getvalue()


LIBRARIES = "numpy scipy dolfinx petsc4py mpi4py h5py pydantic pint matplotlib".split()
"""Libraries whose versions are recorded."""


def provenance(run: Run, *, options: list[str]) -> dict[str, Any]:
    """Collect versions, scene, options, times and convergence of a run.

    Args:
        run: The run, finished or stopped.
        options: PETSc options given by the user.

    Returns:
        A dictionary that JSON can hold; what is unknown or infinite is None.
    """
    history, coupling, whole = run.history(), run.coupling, run.identity
    content = {
        "patchlaw": version("patchlaw"),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "scene_file": run.scene.file,
        "scene": run.scene.to_dict(),
        "scene_given": run.given.to_dict(),
        "files": {
            key[len(CONTENT) :]: one for key, one in whole.items() if key.startswith(CONTENT)
        },
        "units": "mm, N, MPa",
        "surface": _surface(coupling),
        "patches": None if coupling.parts.regions else list(coupling.parts.patches.grid),
        "regions": list(coupling.parts.regions.names) if coupling.parts.regions else None,
        "bodies": [_body(one) for one in coupling.parts.shown_bodies],
        "contact_modulus_MPa": coupling.parts.materials.contact_modulus,
        "micro_model": coupling.record().get("micro_model"),
        "ranks": 1 if run.comm is None else run.comm.size,
        "threads": os.environ.get("OMP_NUM_THREADS"),
        "petsc_options": options,
        "unknowns": coupling.unknowns,
        "reference": _reference(run, history.reference) if history.reference else None,
        "seconds": history.seconds,
        "memory_bytes": peak_memory(),
        "errors_N": [dict(step.errors) for step in history],
        "decision": coupling.parts.decision and asdict(coupling.parts.decision),
        "accuracy": history.accuracy
        and {**asdict(history.accuracy), "kept": history.accuracy.kept},
        "steps": len(history),
        "finished": run.finished,
        "contacts": [
            {"step": record.step, "spots": len(record.spots)} for record in history.contact_records
        ],
        "reasons": sorted({step.reason for step in history}),
        "notes": list(history.notes),
        "versions": library_versions(),
        "machine": platform.platform(),
    }
    known: dict[str, Any] = to_jsonable_python(content, inf_nan_mode="null", fallback=str)
    return known


def _surface(coupling: Coupling) -> dict[str, Any]:
    """Return what provenance says of the surface; the SHA-256 is that of all samples."""
    parts, surface, summits = coupling.parts, coupling.parts.surface, dict[str, int]()
    if parts.summits is not None:
        summits["summits"] = parts.summits.count
        summits["summits_in_reach"] = int(parts.interfering_summits.sum())
        summits["border_maxima_in_reach"] = parts.interfering_border_maxima
    samples = () if parts.regions is None else parts.rough_surfaces
    return {
        "source": surface.source,
        "notes": list(surface.notes),
        "lengths_mm": list(surface.lengths),
        "heights_sha256": fingerprint([one.heights for one in (surface, *samples)]),
        "highest_mm": surface.highest,
        "zero_below_highest_mm": parts.zero,
        **summits,
    }


def _body(face: BodyFacts) -> dict[str, Any]:
    """Return what is known of a body and its contact face."""
    return {
        "mesh_sha256": face.digest or None,
        "cells": face.cells,
        "element": face.element,
        "unknowns": face.unknowns,
        "contact_area_mm2": face.area,
        "contact_lengths_mm": list(face.lengths),
        "depth_mm": face.depth,
        "above_contact_plane": face.above,
    }


def _reference(run: Run, record: ReferenceRecord) -> dict[str, Any]:
    """Return the meshes of a reference and its errors."""
    return {
        **run.coupling.record(),
        "sizes_mm": record.sizes.tolist(),
        "unknowns": record.unknowns,
        "active_sets": [step.newton_iterations for step in run.steps],
        "force_rate": record.force.rate.tolist(),
        "area_rate": record.area.rate.tolist(),
        "error": record.label,
    }


def library_versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that took part."""
    loaded = (name for name in LIBRARIES if name in sys.modules)
    found = {name: _version(name, sys.modules[name]) for name in loaded}
    return {"python": platform.python_version(), **found}


def _version(name: str, module: Any) -> str:
    """Return the version of a library, whose attribute some packagings leave out."""
    with suppress(PackageNotFoundError):
        return str(getattr(module, "__version__", None) or version(name))
    return str(getattr(getattr(module, "version", None), "version", "unknown"))


_FILE_ERROR = re.compile("file|HDF5|XDMF|ADIOS", re.IGNORECASE)
"""Texts of the errors that dolfinx raises when a file cannot be written."""


def write_fields(folder: Path, run: Run) -> list[Path]:
    """Write displacements, stresses and pressures of the load steps that a scene names.

    Where no mesh was pressed itself, they are those of the scene's block under the contact
    pressures, or with laws under the mean pressures of the patches. Of a reference they are those
    of its finest rough block, with the pressures of the nodes.

    Args:
        folder: Folder of the results; made when missing.
        run: The run.

    Returns:
        The files written; none when no block took part, or a run that ended early came to none of
        the load steps.

    Raises:
        NotWritten: When they cannot be written whole.

    Note:
        Collective: every rank writes its part.
    """
    if not run.coupling.scene.has_body or not (run.finished or run.observers.fields.kept):
        return []

    # The XDMF file contains the name of its HDF5 file. Both are therefore written under their
    # final names into a partial folder, and moved when they are complete.
    partial = folder / PARTIAL_FOLDER

    def make_empty() -> None:
        shutil.rmtree(partial, ignore_errors=True)  # A killed run may have left one.
        with written(partial):
            partial.mkdir(parents=True)

    on_root(run.comm, make_empty)
    try:
        _dump_fields(run, partial / "fields.xdmf")
        return on_root(run.comm, lambda: _move(partial, folder))
    except BaseException:
        # Every rank removes the folder: the others may be blocked in a collective call.
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _dump_fields(run: Run, path: Path) -> None:
    """Write fields; an error of dolfinx about files becomes NotWritten, a bug stays as it is."""
    try:
        run.observers.fields.write(path, run.steps, finished=run.finished)
        for one in run.observers:
            one.write_files(path.parent)
    except (OSError, RuntimeError) as error:
        if isinstance(error, PatchlawError) or not _FILE_ERROR.search(str(error)):
            raise
        atexit.register(_end_process, run.comm)
        final = path.parent.parent / path.name
        raise NotWritten(f"{final}: cannot be written: {error}") from error


def _end_process(comm: Any) -> None:
    """End a process that could not write fields, before MPI and HDF5 do.

    HDF5 1.10 does not survive a file that it could not close: the destructor of dolfinx's file
    aborts, and without it ``MPI_Finalize``, which closes the file again, is a segmentation fault.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    if comm is not None:
        comm.Abort(NotWritten.exit_code)
    os._exit(NotWritten.exit_code)


def _move(partial: Path, folder: Path) -> list[Path]:
    """Move files to their final place once all are complete.

    That is checked here, because not every writer raises an error when a disk is full.
    """
    names = sorted(path.name for path in partial.iterdir())
    for name in names:
        with written(folder / name):
            _check_complete(partial / name)
    with OwnFiles(folder).writing(names):
        for name in names:
            with written(folder / name):
                remove(folder / name)
                (partial / name).replace(folder / name)
    partial.rmdir()
    return [folder / name for name in names]


def _check_complete(path: Path) -> None:
    """Raise an OSError unless the disk holds the whole file."""
    if path.is_dir():
        return
    with path.open("rb") as file:
        os.fsync(file.fileno())
    if path.suffix == ".h5":
        import h5py

        h5py.File(path, "r").close()
    elif path.suffix == ".xdmf":
        from xml.etree import ElementTree

        try:
            ElementTree.parse(path)
        except ElementTree.ParseError:
            raise OSError("it is cut short") from None
