"""The report of a run, and how pages are filled that need no network and no other file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.multiscale.loading.load_step import COLUMNS, LoadStep
from patchlaw.multiscale.models import describe
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.errors import MEANINGS
from patchlaw.multiscale.results.contacts import shown_contacts
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.results.run_curves import over_pressure
from patchlaw.multiscale.runs.output.figures import CONTACT_OF_STEP, SURFACE_OF_ZONE
from patchlaw.multiscale.runs.scene_run import Run
from patchlaw.support.readable import (
    Caution,
    Detail,
    Table,
    duration,
    measured,
    number,
    percent,
    quantities,
    quantity,
    shown_unit,
    table_html,
    usual,
    with_error,
)

if TYPE_CHECKING:
    from jinja2 import Environment


PAPER = (
    "Y. Waddad, V. Magnier, P. Dufrénoy, G. De Saxcé: A multiscale method for frictionless contact "
    "mechanics of rough surfaces. Tribology International (2016), "
    "doi 10.1016/j.triboint.2015.12.023"
)
"""The paper whose method is implemented."""

_OF_INPUTS = ("surface", "two rough sides", "load", "micro model", "coupling", "error")
"""Topics of the plan that say what was computed; the others say how, and are folded."""

_MOST_COLUMNS = 7
"""Columns of a table beside its first, of those whose number depends on the run."""


def report_html(run: Run, pictures: Mapping[str, bytes], facts: Mapping[str, Any]) -> str:
    """Return the report of a run: a complete HTML document that needs no network.

    Args:
        run: The run, finished or stopped.
        pictures: Files of the figures by name, see `multiscale.runs.output.figures.pictures_of`.
        facts: The provenance of the run, see `multiscale.runs.output.results.provenance`.
    """
    history, coupling = run.history(), run.coupling
    statements = dict(coupling.about.statements())
    folded = [(topic, text) for topic, text in statements.items() if topic not in _OF_INPUTS]
    cautions = [note for note in history.notes if isinstance(note, Caution)]
    return filled(
        "runs/output/report.jinja",
        title=f"patchlaw: {run.scene.name}",
        history=history,
        results=list(results(history.steps[-1], coupling, run)) if len(history) else [],
        zones=history.zone_table(),
        zone_surfaces=[
            (f"{SURFACE_OF_ZONE}{zone}", f"{describe.samples(region)}.")
            for zone, region in enumerate(coupling.parts.samples)
        ][1:],
        reference=history.reference.sentence if history.reference else "",
        finished=run.finished,
        warnings=list(dict.fromkeys([*cautions, *coupling.about.warnings()])),
        notes=[note for note in history.notes if not isinstance(note, Caution | Detail)],
        details=[note for note in history.notes if isinstance(note, Detail)],
        inputs=[
            *_inputs(coupling),
            *((name, statements[name]) for name in _OF_INPUTS[1:] if name in statements),
        ],
        folded=[pair for pair in folded if pair[0] != "inputs"],
        measured=next((step for step in reversed(history.steps) if step.errors), None),
        meanings=MEANINGS,
        pictures=pictures,
        **_contacts(history, pictures),
        unloaded=_unloaded(history),
        over_pressure=_over_pressure(history),
        made=_made(facts),
        citations=citations(),
        percent=percent,
        quantities=quantities,
    )


def _contacts(history: History, pictures: Mapping[str, bytes]) -> dict[str, Any]:
    """Return pictures and captions of contacts, and the number of that of the largest force."""
    known = shown_contacts(history.contact_records)
    known = [one for one in known if f"{CONTACT_OF_STEP}{one.step}.png" in pictures]
    contacts = [
        (f"{CONTACT_OF_STEP}{one.step}.png", f"{one.title[0].upper()}{one.title[1:]}.")
        for one in known
    ]
    forces = [record.force_N for record in known]
    return {"contacts": contacts, "first_contact": forces.index(max(forces)) if forces else 0}


def _over_pressure(history: History) -> Table:
    """Return a table of what is read over the mean pressure: its range, and the power of it."""
    rows = []
    for one in over_pressure(history):
        first = np.flatnonzero(~one.back & np.isfinite(one.values))
        name, size = shown_unit(one.values[first].tolist(), one.quantity.unit)
        ends = (with_error(one.values[k] / size, one.errors[k] / size, 4) for k in first[[0, -1]])
        rows.append((f"{one.quantity.text} [{name}]", *ends, one.text or "–"))
    return ("", "at first", "at the largest load", "power of the mean pressure p"), rows


def _unloaded(history: History) -> str:
    """Return a sentence where the last load step has no force but others have."""
    if not len(history) or history.steps[-1].force_N > 0.0:
        return ""
    most = max(history.steps, key=lambda step: step.force_N)
    if not most.force_N > 0.0:
        return "The force is zero at all load steps: nothing is in contact."
    last, force = history.steps[-1].step, quantity(most.force_N, "N")
    return (
        f"At load step {last} the force is zero and nothing is in contact; it was largest at load "
        f"step {most.step}, {force}."
    )


def results(last: LoadStep, coupling: Coupling, run: Run) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and a remark of what a run found at its last load step.

    Args:
        last: The load step.
        coupling: What was made of the scene.
        run: The run.
    """
    for name, value, error, unit, given in (
        ("force", last.force_N, last.force_error_N, "N", last.by_force),
        ("approach", last.approach_mm, last.approach_error_mm, "mm", not last.by_force),
    ):
        remark = "prescribed" if given else "" if error else "error not measured"
        yield name, measured(value, None if given else error, unit), remark
    if (approach := last.first_touch_approach_mm) is not None:
        above = f"which is {usual(last.zero_mm, 'mm')} above the {coupling.scene.loading.zero}"
        yield "approach from first touch", usual(approach, "mm"), above
    face = coupling.parts.area
    if verdict := run.history().accuracy:
        kept = {True: "kept", False: "not kept", None: "not known whether it is kept"}
        yield "accuracy asked for", percent(verdict.requested, 3), kept[verdict.kept]
    share, error = last.contact_area_fraction, last.contact_area_fraction_error or 0.0
    of_face = f"{usual(share * face, 'mm²', 3)} of the face"
    yield "real contact area", f"{with_error(100.0 * share, 100.0 * error, 3)} %", of_face
    if last.peak_pressure_MPa:
        yield "peak pressure", usual(last.peak_pressure_MPa, "MPa", 3), ""
    record = run.history().contact
    spots = len(record.spots) if record and record.step == last.step else last.contacts
    if spots:
        yield "contact spots", number(spots, 9), ""
    yield "mean pressure", usual(last.mean_pressure_MPa, "MPa"), "over the whole face"
    for one in run.observers:
        yield from ((name, value, "") for name, value in one.results(last))
    for column in COLUMNS:
        if column.in_report and (value := column.of(last)):
            yield column.in_report, measured(value, column.error_of(last), column.unit), ""


def _inputs(coupling: Coupling) -> Iterator[tuple[str, str]]:
    """Yield what the user gave, with its topic."""
    parts = coupling.parts
    yield "material", describe.materials(parts)
    yield "dimensions", describe.dimensions(parts, has_body=coupling.scene.has_body)
    yield "surface", describe.surface(parts)
    if coefficients := coupling.scene.coefficients:
        said = describe.of_zones(parts, map(number, coefficients))
        yield "coefficient of friction", said
    if said := describe.hardnesses(parts):
        yield "hardness", said


def _made(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what made the report: version, date, scene, processes, options, libraries."""
    written = datetime.fromisoformat(facts["written"])
    return [
        ("patchlaw", facts["patchlaw"]),
        ("written", f"{written:%d %B %Y, %H:%M} UTC"),
        ("scene", facts["scene_file"] or "made in Python"),
        ("heights, SHA-256", facts["surface"]["heights_sha256"]),
        ("processes", f"{facts['ranks']}, threads: {facts['threads'] or 'all'}"),
        ("PETSc options", " ".join(facts["petsc_options"]) or "none given"),
        ("libraries", ", ".join(f"{name} {one}" for name, one in facts["versions"].items())),
    ]


def citations() -> tuple[str, str]:
    """Return the references of the program, in the installed version, and of the paper."""
    program = (
        "The patchlaw developers: patchlaw: multiscale contact of rough surfaces in FEniCSx. "
        f"Version {version('patchlaw')}"
    )
    return program, PAPER


def filled(template: str, **content: Any) -> str:
    """Return a template filled with content; characters that HTML reserves are escaped.

    Args:
        template: Its file, relative to the folder of this package.
        content: What stands in it, by name.
    """
    return _templates().get_template(template).render(**content) + "\n"


def _look(picture: bytes) -> str:
    """Return the class of a picture in PNG: narrow where it is no wider than a column of text."""
    return "narrow" if int.from_bytes(picture[16:20], "big") < 1000 else "wide"


def _parted(table: tuple[Sequence[str], Sequence[Sequence[str]]]) -> Iterator[Any]:
    """Yield parts of a table that fit a page, about as wide, each with its first column."""
    headings, rows = table
    count = -(-(len(headings) - 1) // _MOST_COLUMNS)
    for part in np.array_split(np.arange(1, len(headings)), max(count, 1)):
        if part.size:
            columns = slice(part[0], part[-1] + 1)
            yield (headings[0], *headings[columns]), [(row[0], *row[columns]) for row in rows]


@cache
def _templates() -> Environment:
    """Return the templates; jinja2, whose import takes 40 ms, is loaded only when one is used."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parents[2]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["base64"] = lambda content: b64encode(content).decode()
    templates.filters["duration"] = duration
    templates.filters |= {"look": _look, "parted": _parted}
    templates.globals["table"] = lambda *content: Markup(table_html(*content))
    return templates
