"""Stores patch laws in HDF5 and reads them back bit for bit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from geometry.errors import InputError
from geometry.patches import PatchGrid
from multiscale.laws.patch_law import PatchLaw
from multiscale.laws.plane_path import PlanePath
from multiscale.laws.repair import evened_law
from multiscale.storage.serialisation import checksummed, stored_numbers, verified

_COLUMNS = {
    "approach": "mm",
    "closure": "mm",
    "pressure": "MPa",
    "contact_area_fraction": "1",
    "contacts": "1",
    "relief": "mm",
}
_SCALARS = {
    "touch": "mm",
    "reach": "mm",
    "interpolation_error": "1",
    "stiffness_error": "1",
    "warned_from": "MPa",
    "repaired": "1",
}
_PATH = "path"
_PLANES = {"approach": "mm", "tilt": "1", "force": "N", "moment": "N mm"}
FORMAT = "patchlaw laws 3"


@dataclass(frozen=True, slots=True, kw_only=True)
class LawTable:
    """The laws of all patches of an interface.

    Attributes:
        patches: The partition.
        laws: One law per patch, in the order of the flat patch index.
        made_by: How they were made: coupling, micro model, Love's displacement, tolerance, and the
            slopes of the plane that pressed the whole surface.
        force_error: Estimated error of the force between the rows, see `refinement.Errors`: of
            all patches together, or of the worst where each was tabulated alone.
        path: The planes that pressed the whole surface, where they were free to turn; None where
            the tilt was prescribed, and for patches alone.
    """

    patches: PatchGrid
    laws: tuple[PatchLaw, ...]
    made_by: dict[str, str]
    force_error: float = float("nan")
    path: PlanePath | None = None

    def __post_init__(self) -> None:
        if len(self.laws) != self.patches.count:
            raise InputError("needs one law per patch", value=len(self.laws))

    def __getitem__(self, index: int) -> PatchLaw:
        return self.laws[index]


def write_laws(path: Path | BinaryIO, table: LawTable) -> None:
    """Write all laws to one HDF5 file: a group ``patch_IX_IY`` per patch, a dataset per column.

    A path is a group of its own. A checksum stands before the content; see
    `multiscale.storage.serialisation`.

    Args:
        path: File to write, by name or open; one that exists is replaced.
        table: The laws.
    """
    content = checksummed(lambda file: _fill(file, table))
    if isinstance(path, Path):
        path.write_bytes(content)
    else:
        path.write(content)


def _fill(file: Any, table: LawTable) -> None:
    file.attrs["format"] = FORMAT
    file.attrs["patch_grid"] = table.patches.grid
    file.attrs["lengths_mm"] = table.patches.lengths
    file.attrs["origin_mm"] = table.patches.origin
    file.attrs["force_error"] = table.force_error
    for name, text in table.made_by.items():
        file.attrs[f"made_by_{name}"] = text
    for index, law in enumerate(table.laws):
        group = file.create_group(_group_name(table.patches, index))
        for name, unit in _COLUMNS.items():
            group.create_dataset(name, data=getattr(law, name)).attrs["unit"] = unit
        for name in _SCALARS:
            group.attrs[name] = getattr(law, name)
    if table.path is not None:
        group = file.create_group(_PATH)
        for name, unit in _PLANES.items():
            group.create_dataset(name, data=getattr(table.path, name)).attrs["unit"] = unit


def read_laws(path: Path | BinaryIO) -> LawTable:
    """Read a law file.

    The pressure of a patch alone rises with the approach; where noise in a table from elsewhere
    makes it fall, it is repaired, and the law says by how much (`PatchLaw.repaired`). Consistent
    laws are taken as they are: neighbours that take load over make their pressures fall.

    Args:
        path: The file, by name or open.

    Raises:
        InputError: When the file cannot be read, is no law file, damaged, lacks anything, or was
            written before law files had a checksum.
    """
    name = str(path) if isinstance(path, Path) else None
    if isinstance(path, Path) and not path.is_file():  # a pipe would be waited for
        raise InputError("is not a readable law file: there is no such file", file=name)
    try:
        with h5py.File(verified(path), "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise InputError("is not a law file of patchlaw", file=name)
            return _table(file)
    except InputError as error:
        raise error.located(file=name) from None
    except Exception as error:  # h5py raises errors of many families
        raise InputError(f"is not a readable law file: {error}", file=name) from None


def _table(file: Any) -> LawTable:
    patches = PatchGrid(
        grid=_pair(file.attrs["patch_grid"], int),
        lengths=_pair(file.attrs["lengths_mm"], float),
        origin=_pair(file.attrs["origin_mm"], float),
    )
    if math.prod(patches.grid) > len(file):
        raise InputError("lacks laws", value=patches.grid, allowed=f"{len(file)} groups")
    groups = [file[_group_name(patches, index)] for index in range(patches.count)]
    made_by = {
        name.removeprefix("made_by_"): str(text)
        for name, text in file.attrs.items()
        if name.startswith("made_by_")
    }
    law = _law if made_by.get("coupling") == "consistent" else _evened
    return LawTable(
        patches=patches,
        laws=tuple(map(law, groups)),
        made_by=made_by,
        force_error=float(file.attrs["force_error"]),
        path=_path(file[_PATH]) if _PATH in file else None,
    )


def _law(group: Any) -> PatchLaw:
    content: dict[str, Any] = {name: stored_numbers(group[name]) for name in _COLUMNS}
    content.update({name: float(group.attrs[name]) for name in _SCALARS})
    return PatchLaw(**content)


def _path(group: Any) -> PlanePath:
    return PlanePath(**{name: stored_numbers(group[name]) for name in _PLANES})


def _evened(group: Any) -> PatchLaw:
    return evened_law(_law(group))


def _group_name(patches: PatchGrid, index: int) -> str:
    ix, iy = patches.unravel(index)
    return f"patch_{ix}_{iy}"


def _pair(values: Sequence[Any], kind: type) -> Any:
    first, second = values
    return kind(first), kind(second)
