"""Displacements and stresses of a body at load steps, read from the files made for ParaView."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from patchlaw.multiscale.readable import number, times
from patchlaw.support.arguments import check_fields, checked
from patchlaw.support.arrays import Array
from patchlaw.support.displayed import Displayed, Table, dataset
from patchlaw.support.errors import InputError
from patchlaw.support.packages import optional_packages

_NAMES = {
    "displacement": "displacement_mm",
    "stress": "stress_MPa",
    "von_Mises": "von_mises_MPa",
    "pressure": "pressure_MPa",
    "fluid_pressure": "fluid_pressure_MPa",
}
"""Attributes of `BodyFields` by the names that the files have."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class BodyFields(Displayed):
    """Fields of a body on n vertices and m cells at some load steps, which are the first axis.

    Attributes:
        step: Numbers of the load steps, shape (steps,).
        points_mm: Places of the vertices of the undeformed body, shape (n, 3) [mm].
        cells: Vertices of each cell in the order of XDMF and VTK, shape (m, vertices of a cell).
        cell_type: Kind of the cells as XDMF names it, such as ``"Hexahedron"``.
        displacement_mm: Displacements of the vertices, shape (steps, n, 3) [mm].
        stress_MPa: Stresses at the middles of the cells, shape (steps, m, 3, 3) [MPa].
        von_mises_MPa: Equivalent stresses there, shape (steps, m) [MPa].
        pressure_MPa: Contact pressures: on a flat face those of the cells below it, shape
            (steps, m), of a rough block those of its vertices, shape (steps, n) [MPa]; None where
            they were not written.
        fluid_pressure_MPa: Pressures of a fluid that leaks over the face, at its vertices and 0 at
            others, shape (steps, n) [MPa]; None without.
    """

    step: NDArray[np.int64]
    points_mm: Array
    cells: NDArray[np.int64]
    cell_type: str
    displacement_mm: Array
    stress_MPa: Array
    von_mises_MPa: Array
    pressure_MPa: Array | None = None
    fluid_pressure_MPa: Array | None = None

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    def displayed(self) -> tuple[str, Table]:
        """Return what this is in a line, and a table of the fields with their ranges."""
        steps = ", ".join(map(str, self.step))
        line = (
            f"BodyFields of load step{'s' * (len(self.step) > 1)} {steps}: "
            f"{len(self.points_mm)} vertices, {len(self.cells)} cells ({self.cell_type})"
        )
        fields = {name: getattr(self, name) for name in ("points_mm", *_NAMES.values())}
        rows = [
            (name, times(one.shape), number(one.min()), number(one.max()))
            for name, one in fields.items()
            if one is not None
        ]
        return line, (("field", "shape", "least", "largest"), rows)

    def to_xarray(self) -> Any:
        """Return the fields as an xarray dataset; dimensions are step, point, cell, axis, other.

        Raises:
            ImportError: When xarray, which patchlaw does not require, is not installed.
        """
        values = {
            "displacement_mm": (("step", "point", "axis"), self.displacement_mm),
            "stress_MPa": (("step", "cell", "axis", "other"), self.stress_MPa),
            "von_mises_MPa": (("step", "cell"), self.von_mises_MPa),
            "cells": (("cell", "corner"), self.cells),
        }
        if self.pressure_MPa is not None:
            where = "cell" if self.pressure_MPa.shape[1] == len(self.cells) else "point"
            values["pressure_MPa"] = (("step", where), self.pressure_MPa)
        if self.fluid_pressure_MPa is not None:
            values["fluid_pressure_MPa"] = (("step", "point"), self.fluid_pressure_MPa)
        places = {"step": self.step, "points_mm": (("point", "axis"), self.points_mm)}
        return dataset(values, places, {"units": "mm, MPa", "cell_type": self.cell_type})


@checked
def read_fields(folder: str | Path, *, counter: bool = False) -> BodyFields:
    """Read the fields of a run from its results.

    Args:
        folder: Folder that ``patchlaw run`` wrote with ``output.fields``; ``fields.xdmf`` and
            ``fields.h5`` are read.
        counter: Whether those of the counter-body are, from ``counter_fields.xdmf``.

    Returns:
        The fields of the load steps that ``output.fields`` named.

    Raises:
        InputError: When a file is missing, damaged or cut short.
    """
    path = Path(folder) / ("counter_fields.xdmf" if counter else "fields.xdmf")
    if not path.is_file():
        allowed = "the results of a run with output.fields = 'last' or 'all', which has a body"
        raise InputError("there are no fields", file=str(path), allowed=allowed)
    with optional_packages():
        import h5py
    try:
        domain = ElementTree.parse(path).getroot()[0]
        with h5py.File(path.with_suffix(".h5"), "r") as file:
            return BodyFields(**_mesh(domain, file), **_values(domain, file))
    except InputError as error:
        raise error.located(file=str(path)) from None
    except Exception as error:  # h5py raises errors of many families
        problem = f"cannot be read with {path.stem}.h5 beside it: {error}"
        raise InputError(problem, file=str(path)) from None


def _mesh(domain: Any, file: Any) -> dict[str, Any]:
    """Return vertices and cells, by the names that `BodyFields` has for them."""
    topology, geometry = domain.find("Grid/Topology"), domain.find("Grid/Geometry")
    cell_type = topology.get("TopologyType")
    return {
        "points_mm": _array(geometry, file).reshape(-1, 3),
        "cells": _array(topology, file).astype(np.int64),
        "cell_type": cell_type,
    }


def _values(domain: Any, file: Any) -> dict[str, Any]:
    """Return load steps and fields, by the names that `BodyFields` has for them."""
    steps, values = [], dict[str, list[Array]]()
    for grid in _load_steps(domain):
        steps.append(round(float(grid.find("Time").get("Value"))))
        for field in grid.findall("Attribute"):
            name = _NAMES[field.get("Name")]
            values.setdefault(name, []).append(_shaped(_array(field, file)))
    if not steps:
        raise InputError("has no load steps")
    return {"step": np.array(steps)} | {name: np.stack(found) for name, found in values.items()}


def _shaped(array: Array) -> Array:
    """Return rows as what they are: tensors of 9 components, vectors of 3, numbers."""
    if array.shape[1] == 9:
        return array.reshape(-1, 3, 3)
    return array[:, 0] if array.shape[1] == 1 else array


def _load_steps(domain: Any) -> Iterator[Any]:
    """Yield the grid of every load step."""
    for grid in domain.findall("Grid"):
        if grid.get("GridType") == "Collection":
            yield from grid.findall("Grid")


def _array(element: Any, file: Any) -> Array:
    """Return the array that an element of the file names, of the shape it states."""
    item = element.find("DataItem")
    shape = tuple(int(size) for size in item.get("Dimensions").split())
    found = np.asarray(file[item.text.strip().partition(":")[2]][()])
    if found.shape != shape:
        raise InputError(f"states {shape} numbers where {found.shape} are")
    return found
