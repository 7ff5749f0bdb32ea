"""Results in three dimensions, by PyVista: the map under its contact, bodies, natural modes."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.results.contacts import ContactHistory
from patchlaw.multiscale.results.files import read_contact, read_fields, read_history, read_modes
from patchlaw.multiscale.runs import PAGES, VIEWS
from patchlaw.support import Array, InputError, Limits, checked
from patchlaw.support.files import OwnFiles, write_text
from patchlaw.support.packages import optional_packages
from patchlaw.support.readable import times, usual, usual_unit

_OF_CONTACT = ("pressure", "gap", "plastic_depth", "worn_depth")
_OF_BODIES = {
    "body_pressure": "pressure_MPa", "fluid_pressure": "fluid_pressure_MPa",
    "von_Mises": "von_mises_MPa", "displacement": "displacement_mm",
    "body_worn_depth": "worn_depth_mm",
}  # fmt: skip
"""What is read off maps, and off `BodyFields` by attribute."""
_OPEN = (
    "pressure", "plastic_depth", "worn_depth", "body_pressure", "fluid_pressure", "body_worn_depth",
)  # fmt: skip
"""What is grey where there is none."""
_CELLS = {
    "Tetrahedron": 10, "Hexahedron": 12, "Tetrahedron_10": 24, "Hexahedron_20": 25,
    "Hexahedron_27": 29,
}  # fmt: skip
"""Types of VTK by the names that XDMF has for them."""
_MOST_CELLS = 256
"""Cells of a map along a side; finer maps are shown by blocks of cells, to keep pages small."""
_RELIEF, _MOVED = 0.12, 0.05
"""Largest heights that are drawn over the shorter side of a map, and largest displacement over the
size of the bodies."""
_BAR = {
    "vertical": True, "position_x": 0.85, "width": 0.05, "title_font_size": 14,
    "label_font_size": 12,
}  # fmt: skip
_LINKS = re.compile('<p class="views">.*?</p>', re.DOTALL)
_DOWNLOADER = "trame.widgets.vtklocal"
"""Module of trame that downloads another viewer, which pages do not use."""
_FAVICON, _HEAD = "https://kitware.github.io/vtk-js/icon/", re.compile("<title>.*?</title>")
_CAPTION = (
    "<style>body::before {{ content: {}; position: fixed; z-index: 9; left: 1rem; top: .6rem; "
    "max-width: 80%; pointer-events: none }}</style>"
)


_Number = Annotated[int, Limits(ge=1, le=1e6)]


class _Drawn(NamedTuple):
    """What is drawn: meshes, a value at each of their cells or points, and what they are of."""

    meshes: Sequence[Any]
    values: Sequence[Array]
    caption: str


@checked
def view(
    folder: str | Path,
    show: str = "",
    *,
    step: _Number | None = None,
    mode: _Number | None = None,
    off_screen: bool = False,
) -> Any:
    """Show results in three dimensions, to be turned by hand.

    Contacts are shown on the deformed surface as the plane sees it; bodies and modes with
    displacements that are enlarged. A caption says how much.

    Args:
        folder: Folder that ``patchlaw run`` wrote.
        show: What is shown, a name of `views_of`; by default the first of them.
        step: Number of the load step; by default the last one that was written.
        mode: Number of the natural mode, from 1; by default the first.
        off_screen: Whether no window is opened, as for pictures and pages.

    Returns:
        A ``pyvista.Plotter``; its ``show()`` opens a window, or shows it in a notebook.

    Raises:
        InputError: When the folder holds no such results.
        NotInstalled: When PyVista is missing.
    """
    ((name, drawn),) = _chosen(Path(folder), [show] if show else [], step, mode, most=1)
    return _plotter(name, drawn(), off_screen=off_screen)


@checked
def views_of(folder: str | Path) -> tuple[str, ...]:
    """Return what `view` can show of results.

    Args:
        folder: Folder that ``patchlaw run`` wrote.

    Raises:
        InputError: When the folder holds no results, or they are damaged.
    """
    return tuple(_known(Path(folder), None, None))


def write_views(
    folder: Path, shown: Sequence[str] = (), *, step: int | None = None, mode: int | None = None
) -> list[Path]:
    """Write pages that show results in three dimensions, and link them from the report.

    A page is one file that needs no network.

    Args:
        folder: Folder that ``patchlaw run`` wrote.
        shown: Names of what is shown; by default all that `views_of` knows.
        step: Number of the load step; by default the last one that was written.
        mode: Number of the natural mode, from 1; by default the first.

    Returns:
        The pages.

    Raises:
        InputError: When the folder holds no such results.
        NotInstalled: When PyVista is missing.
        NotWritten: When the system refuses a file.
    """
    OwnFiles(folder).refuse_others(PAGES)
    pages = [(name, _page(name, drawn())) for name, drawn in _chosen(folder, shown, step, mode)]
    with OwnFiles(folder).writing(PAGES):
        files = [write_text(folder / f"view_{name}.html", page) for name, page in pages]
    report = folder / "report.html"
    if report.is_file():
        there = [name for name in VIEWS if (folder / f"view_{name}.html").is_file()]
        links = ", ".join(f'<a href="view_{one}.html">{VIEWS[one][0]}</a>' for one in there)
        text = f'<p class="views">In three dimensions: {links}.</p>'
        write_text(report, _LINKS.sub(text, report.read_text(encoding="utf-8"), count=1))
    return files


def load_viewer() -> None:
    """Load PyVista and what makes pages of its scenes.

    Raises:
        NotInstalled: When either is missing, or cannot be imported.
    """
    with optional_packages():
        import pyvista  # noqa: F401
        import trame_pyvista  # noqa: F401


def _chosen(
    folder: Path, shown: Sequence[str], step: int | None, mode: int | None, most: int | None = None
) -> list[tuple[str, Callable[[], _Drawn]]]:
    """Return what draws what is to be shown, or what results have, the first of it at most."""
    load_viewer()
    known = _known(folder, step, mode)
    for name in shown:
        if name not in known:
            allowed = f"{', '.join(known)} of these results"
            raise InputError("is not known", key="show", value=name, allowed=allowed)
    chosen = list(shown or known)[:most]
    for key, value, used, allowed in (
        ("mode", mode, "mode" in chosen, "where a natural mode is shown"),
        ("step", step, chosen != ["mode"], "where maps or fields of a load step are shown"),
    ):
        if value is not None and not used:
            allowed = f"{allowed}, of {', '.join(chosen)} none is"
            raise InputError("has no effect", key=key, value=value, allowed=allowed)
    return [(name, known[name]) for name in chosen]


def _known(folder: Path, step: int | None, mode: int | None) -> dict[str, Callable[[], _Drawn]]:
    """Return what draws everything that results have, by name in the order of `VIEWS`."""
    known: dict[str, Callable[[], _Drawn]] = {}
    history = read_history(folder)  # says what is wrong where there are no results
    if (folder / "contact.h5").is_file():
        contacts = read_contact(folder)
        likewise = contacts.at(step) if step in [one.step for one in contacts] else contacts[-1]
        for name in _OF_CONTACT:
            attribute = f"{name}_{VIEWS[name][1]}"
            if getattr(likewise, attribute) is not None:
                known[name] = partial(_contact, contacts, attribute, step)
    if (folder / "fields.xdmf").is_file():
        bodies = _bodies(folder, "fields", read_fields)
        for name, attribute in _OF_BODIES.items():
            if getattr(bodies[0], attribute) is not None:
                known[name] = partial(_fields, bodies, attribute, step, history)
    if (folder / "modes.xdmf").is_file():
        shapes = _bodies(folder, "modes", read_modes)
        known["mode"] = partial(_mode, shapes, mode or 1, history[-1])
    if not known:
        allowed = "output.contact or output.fields = 'last' or 'all'"
        raise InputError("has no maps and no fields", file=str(folder), allowed=allowed)
    return {name: known[name] for name in VIEWS if name in known}


def _bodies(folder: Path, stem: str, read: Callable[..., Any]) -> list[Any]:
    """Return what a function reads of the body and, where there is one, of the counter-body."""
    counter = (folder / f"counter_{stem}.xdmf").is_file()
    return [read(folder), *([read(folder, counter=True)] if counter else [])]


def _place(known: list[Any], wanted: int | None, key: str) -> int:
    """Return the place of a load step or mode among those that were written."""
    if wanted is not None and wanted not in known:
        allowed = ", ".join(f"{one:g}" for one in known)
        raise InputError("was not written", key=key, value=wanted, allowed=allowed)
    return len(known) - 1 if wanted is None else known.index(wanted)


def _contact(contacts: ContactHistory, attribute: str, step: int | None) -> _Drawn:
    """Return a map of a contact on the deformed surface, which touches the plane at height 0."""
    from pyvista import PolyData, StructuredGrid

    from patchlaw.multiscale.results.figures import style

    record = contacts[-1] if step is None else contacts.at(step)
    values = getattr(record, attribute)
    assert record.gap_mm is not None and record.x_mm is not None and record.y_mm is not None
    gaps, lengths = record.gap_mm, record.lengths_mm
    enlarged = style.rounded_down(_RELIEF * min(lengths) / (float(np.ptp(gaps)) or 1.0))
    caption = (
        f"{record.title}. The deformed surface under the plane, "
        f"{times(f'{one:.4g}' for one in lengths)} mm, heights {_enlarged(enlarged)}."
    )
    if gaps.ndim == 1:  # nodes of a reference
        points = np.column_stack([record.x_mm, record.y_mm, -enlarged * gaps])
        mesh = PolyData(points).delaunay_2d()
        return _Drawn([mesh], [values], caption)
    steps = [-(-count // _MOST_CELLS) for count in gaps.shape]
    if max(steps) > 1:
        gaps = style.blocks_of(gaps, steps).min(axis=(1, 3))
        values = style.blocks_of(values, steps).max(axis=(1, 3))
        caption += f" {times(steps)} cells are drawn as one, by their largest value."
    corners = style.means_at_corners(np.pad(gaps, 1, mode="edge"))
    x, y = (
        length * np.arange(n) / (n - 1) for length, n in zip(lengths, corners.shape, strict=True)
    )
    mesh = StructuredGrid(*np.meshgrid(x, y, [0.0], indexing="ij"))
    mesh.points[:, 2] = -enlarged * corners.ravel(order="F")
    return _Drawn([mesh], [values.ravel(order="F")], caption)


def _fields(bodies: Sequence[Any], attribute: str, step: int | None, history: Any) -> _Drawn:
    """Return a field of bodies at a load step."""
    place = _place(bodies[0].step.tolist(), step, "step")
    number = int(bodies[0].step[place])
    load = next(one for one in history if one.step == number)
    caption = (
        f"load step {number}: approach {usual(load.approach_mm, 'mm')}, force "
        f"{usual(load.force_N, 'N')}"
    )
    fields = [
        (one.points_mm, one.cells, one.cell_type, one.displacement_mm[place], found[place])
        for one in bodies
        if (found := getattr(one, attribute)) is not None
    ]
    return _displaced(fields, caption)


def _mode(shapes: Sequence[Any], mode: int, about: LoadStep) -> _Drawn:
    """Return the shape of a natural mode about a load step."""
    place = _place(shapes[0][1].tolist(), mode, "mode")
    fields = [
        (mesh["points_mm"], mesh["cells"], mesh["cell_type"], moved[place], moved[place])
        for mesh, _, moved in shapes
    ]
    number = int(shapes[0][1][place])
    found = [usual(one.frequency_Hz, "Hz") for one in about.modes if one.mode == number]
    return _displaced(fields, f"{', '.join([f'{number}', *found])}, about load step {about.step}")


def _displaced(fields: Sequence[tuple[Any, ...]], caption: str) -> _Drawn:
    """Return the surfaces of bodies, given by points, cells, their type, displacement and value."""
    from pyvista import UnstructuredGrid

    from patchlaw.multiscale.results.figures import style

    size = max(float(np.linalg.norm(np.ptp(points, axis=0))) for points, *_ in fields)
    largest = max(float(np.linalg.norm(moved, axis=-1).max()) for *_, moved, _ in fields)
    enlarged = style.rounded_down(_MOVED * size / (largest or 1.0), least=0.0)
    meshes, shown = [], []
    for points, cells, kind, moved, values in fields:
        if kind not in _CELLS:
            raise InputError(
                "cells of this type are not shown", value=kind, allowed=", ".join(_CELLS)
            )
        mesh = UnstructuredGrid({_CELLS[kind]: cells}, points + enlarged * moved)
        where = mesh.cell_data if len(values) == len(cells) else mesh.point_data
        where["value"] = values if values.ndim == 1 else np.linalg.norm(values, axis=-1)
        surface = mesh.extract_surface(algorithm="dataset_surface")
        meshes.append(surface)
        shown.append(np.asarray(surface["value"]))
    return _Drawn(meshes, shown, f"{caption}; displacements {_enlarged(enlarged)}.")


def _plotter(name: str, drawn: _Drawn, *, off_screen: bool) -> Any:
    """Return the scene of a view."""
    import pyvista

    from patchlaw.multiscale.results.figures import style

    meaning, unit, colours = VIEWS[name]
    top = max(float(np.max(values, initial=0.0)) for values in drawn.values)
    text, size = usual_unit([top], unit) if unit else ("", top or 1.0)
    title = f"{meaning} [{text}]" if text else meaning
    plotter = pyvista.Plotter(off_screen=off_screen or None, window_size=[1000, 700])
    for mesh, values in zip(drawn.meshes, drawn.values, strict=True):
        open_ = np.where(values > 0.0, values, np.nan) if name in _OPEN else values
        where = mesh.cell_data if len(values) == mesh.n_cells else mesh.point_data
        where[title] = open_ / size
        plotter.add_mesh(
            mesh,
            scalars=title,
            cmap=getattr(style, colours, colours),
            clim=(0.0, top / size or 1.0),
            nan_color="#d9d9d6",
            scalar_bar_args=_BAR,
        )
    plotter.add_text(drawn.caption, position="upper_left", font_size=9)
    plotter.view_vector((-0.6, -1.0, 0.8))
    return plotter


def _page(name: str, drawn: _Drawn) -> str:
    """Return the page of a view, as trame makes it for vtk.js, with its caption.

    Its texts are not in that page, and it would look for an icon in the network.
    """
    from vtkmodules.vtkCommonCore import vtkLogger

    modules: Any = sys.modules
    modules.setdefault(_DOWNLOADER, None)  # cannot be imported then, and trame does without it
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # it warns of a display that is missing
    plotter = _plotter(name, drawn, off_screen=True)
    try:
        text = plotter.trame.export_html(None).getvalue().replace(_FAVICON, "data:,")
    finally:
        plotter.close()
    caption = json.dumps(f"{VIEWS[name][0]}, {drawn.caption}", ensure_ascii=False)
    head = f"<title>patchlaw: {VIEWS[name][0]}</title>{_CAPTION.format(caption)}"
    return _HEAD.sub(lambda _: head, text, count=1)


def _enlarged(factor: float) -> str:
    return "to scale" if factor == 1.0 else f"{factor:g} times as large"
