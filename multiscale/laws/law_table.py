"""The laws of all patches or regions of an interface, what they say of themselves, their file.

Theory: demos/theory.md, section 10.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from geometry import InputError, PatchGrid, Regions
from multiscale.laws.patch_law import PatchLaw
from multiscale.laws.rows import LawRows, PlanePath
from multiscale.storage import checksummed, stored_numbers, verified

Array = NDArray[np.float64]

PATCH_FACTOR = 20.0
"""Tolerance of a patch's pressure, relative to the tolerance of the force."""

_REPORTED_REPAIR = 1e-6  # smaller repairs are rounding and the tolerance of the micro model

FORMAT = "patchlaw laws 3"
_COLUMNS = {one.metadata.get("stored", one.name): one for one in fields(LawRows)}
_SCALARS = {
    "touch": "first_touch",
    "reach": "initial_separation",
    "interpolation_error": "interpolation_error",
    "stiffness_error": "stiffness_error",
    "warned_from": "warning_pressure",
    "repaired": "repaired",
}
_PATH = "path"
_PATH_UNITS = {"approach": "mm", "tilt": "1", "force": "N", "moment": "N mm"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawTable:
    """The laws of all patches of an interface, or of all regions of a face.

    Attributes:
        patches: The partition: patches, or regions where the laws stand for faces of any outline.
        laws: One law per patch, in the order of the flat patch index, or per region in theirs.
        made_by: How they were made: coupling, micro model, Love's displacement, tolerance, and the
            slopes of the plane that pressed the whole surface.
        force_error: Estimated error of the force between the rows, see
            `multiscale.laws.refinement`: of all patches together, or the largest where each was
            tabulated alone.
        path: The planes that pressed the whole surface, where they were free to turn; None where
            the tilt was prescribed, and for patches alone.

    Raises:
        InputError: When there is not one law per patch.
    """

    patches: PatchGrid | Regions
    laws: tuple[PatchLaw, ...]
    made_by: dict[str, str]
    force_error: float = float("nan")
    path: PlanePath | None = None

    def __post_init__(self) -> None:
        if len(self.laws) != self.patches.count:
            raise InputError("needs one law per patch", value=len(self.laws))

    def __getitem__(self, index: int | str) -> PatchLaw:
        if isinstance(index, str) and isinstance(self.patches, Regions):
            return self.laws[self.patches.index(index)]
        return self.laws[int(index)]

    @property
    def grid(self) -> PatchGrid:
        """The patches of a rectangle.

        Raises:
            InputError: When the laws are those of regions.
        """
        if isinstance(self.patches, Regions):
            raise InputError("these laws are not those of patches", value=self.patches.names)
        return self.patches

    def notes(self, tolerance: float) -> Iterator[str]:
        """Yield what a report says of the laws: their errors, and whether they were repaired.

        Args:
            tolerance: Error of the force that was asked for.
        """
        largest = max(law.interpolation_error for law in self.laws)
        yield (
            f"interpolation error of the laws between their rows: {self.force_error:.1e} of the "
            f"force, {largest:.1e} of a patch's pressure or the mean, if more"
        )
        reached = max(self.force_error, largest / PATCH_FACTOR)
        if reached > tolerance:
            yield (
                f"the laws miss coupling.table_tolerance = {tolerance:g} with all the rows that "
                f"are solved at most; what they reach is a tolerance of {reached:.1e}"
            )
        changes = [law.repaired for law in self.laws if law.repaired > _REPORTED_REPAIR]
        if changes:
            yield (
                f"monotone repair: in the laws of {len(changes)} of {len(self.laws)} patches "
                "pressure or closure fell as the plane came nearer; evened out, by up to "
                f"{max(changes):.1e} of their largest"
            )
        if isinstance(self.patches, Regions):
            yield from filter(None, map(_scatter_note, self.patches.names, self.laws))


def write_laws(path: Path, table: LawTable) -> None:
    """Write all laws to one HDF5 file, see `law_bytes`.

    Args:
        path: File to write; one that exists is replaced.
        table: The laws.
    """
    path.write_bytes(law_bytes(table))


@lru_cache(maxsize=1)  # every checkpoint asks for the same
def law_bytes(table: LawTable) -> bytes:
    """Return the content of a law file.

    It has a group ``patch_IX_IY`` per patch, or ``region_I`` per region, with a dataset per column,
    and a group for the path of the plane where there is one. A checksum stands before the content;
    see `multiscale.storage`.

    Args:
        table: The laws.
    """

    def fill(file: Any) -> None:
        file.attrs["format"] = FORMAT
        if isinstance(table.patches, Regions):
            file.attrs["regions"] = table.patches.names
        else:
            file.attrs["patch_grid"] = table.patches.grid
            file.attrs["lengths_mm"] = table.patches.lengths
            file.attrs["origin_mm"] = table.patches.origin
        file.attrs["force_error"] = table.force_error
        for name, text in table.made_by.items():
            file.attrs[f"made_by_{name}"] = text
        for index, law in enumerate(table.laws):
            group = file.create_group(_group_name(table.patches, index))
            for name, column in _COLUMNS.items():
                values = getattr(law.rows, column.name)
                if values.any() or not column.metadata.get("optional"):
                    stored = group.create_dataset(name, data=values)
                    stored.attrs["unit"] = column.metadata["unit"]
            for name, attribute in _SCALARS.items():
                group.attrs[name] = getattr(law, attribute)
            if np.isfinite(law.sample_area):
                group.attrs["sample_area_mm2"] = law.sample_area
        if table.path is not None:
            group = file.create_group(_PATH)
            for name, unit in _PATH_UNITS.items():
                group.create_dataset(name, data=getattr(table.path, name)).attrs["unit"] = unit

    return checksummed(fill)


def read_laws(path: str | Path | BinaryIO) -> LawTable:
    """Read a law file.

    The pressure of a patch alone rises with the approach; where noise in a table from elsewhere
    makes it fall, it is repaired, and the law states by how much (`PatchLaw.repaired`). Consistent
    laws are taken as they are: neighbours that take load over make their pressures fall.

    Args:
        path: The file, by name or open.

    Raises:
        InputError: When the file cannot be read, is no law file, damaged, lacks anything, or was
            written before law files had a checksum.
    """
    path = Path(path) if isinstance(path, str) else path
    name = str(path) if isinstance(path, Path) else None
    if isinstance(path, Path) and not path.is_file():  # reading a pipe would wait for its writer
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


def repaired_law(law: PatchLaw) -> PatchLaw:
    """Return a law whose pressure rises; the same one where it does.

    Args:
        law: The law of a patch alone, as a table from elsewhere may have it.
    """
    if np.all(np.diff(law.rows.pressure) >= 0.0):
        return law
    rows, change = law.rows.with_rising_pressure()
    return replace(law, rows=rows, repaired=max(change, law.repaired))


def _scatter_note(region: str, law: PatchLaw) -> str | None:
    """Return what is said of the scatter among the samples of a law."""
    rows = law.rows
    if not rows.pressure_scatter.any():
        return None
    half = int(np.searchsorted(rows.pressure, 0.5 * rows.pressure[-1]))
    pressure, scatter = rows.pressure[half], rows.pressure_scatter[half]
    stiffness = float(law.along(rows.approach[half]).stiffness)
    return (
        f"{region}: where the mean pressure is {pressure:.3g} MPa, that of single samples scatters "
        f"by {scatter / pressure:.1%} (standard deviation), as by {1e3 * scatter / stiffness:.2g} "
        "µm of closure; larger samples scatter less"
    )


def _partition(file: Any) -> PatchGrid | Regions:
    if "regions" in file.attrs:
        return Regions(tuple(file.attrs["regions"]))
    patches = PatchGrid(
        grid=tuple(file.attrs["patch_grid"]),
        lengths=tuple(file.attrs["lengths_mm"]),
        origin=tuple(file.attrs["origin_mm"]),
    )
    if math.prod(patches.grid) > len(file):
        raise InputError("lacks laws", value=patches.grid, allowed=f"{len(file)} groups")
    return patches


def _table(file: Any) -> LawTable:
    patches = _partition(file)
    made_by = {
        name.removeprefix("made_by_"): str(text)
        for name, text in file.attrs.items()
        if name.startswith("made_by_")
    }
    laws = [_law(file[_group_name(patches, index)]) for index in range(patches.count)]
    if made_by.get("coupling") != "consistent":
        laws = [repaired_law(law) for law in laws]
    path = {name: stored_numbers(file[_PATH][name]) for name in _PATH_UNITS if _PATH in file}
    return LawTable(
        patches=patches,
        laws=tuple(laws),
        made_by=made_by,
        force_error=float(file.attrs["force_error"]),
        path=PlanePath(**path) if path else None,
    )


def _law(group: Any) -> PatchLaw:
    found = {
        one.name: stored_numbers(group[name])
        for name, one in _COLUMNS.items()
        if name in group or not one.metadata.get("optional")
    }
    scalars = {attribute: float(group.attrs[name]) for name, attribute in _SCALARS.items()}
    scalars["sample_area"] = float(group.attrs.get("sample_area_mm2", np.nan))
    return PatchLaw(rows=LawRows(**found), **scalars)


def _group_name(patches: PatchGrid | Regions, index: int) -> str:
    if isinstance(patches, Regions):
        return f"region_{index}"
    ix, iy = patches.unravel(index)
    return f"patch_{ix}_{iy}"
