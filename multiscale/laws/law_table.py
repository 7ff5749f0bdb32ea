"""The laws of all patches or regions of an interface, what they say of themselves, and their file.

The file has columns of rows, with units, behind a checksum.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import Field, dataclass, fields, replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry import PatchGrid, Regions
from patchlaw.geometry.surface import FIRST_TOUCH
from patchlaw.multiscale.laws.patch_law import PatchLaw, PatchLaws, repaired_law
from patchlaw.multiscale.laws.rows import LawRows, PlanePath, Transmissivity, Untouched
from patchlaw.multiscale.laws.worn_laws import RunningInLaws, WornLaws
from patchlaw.support import Array, Indices, InputError, check_fields, check_file, checked, located
from patchlaw.support.files import check_hdf5, hdf5_bytes, write_bytes
from patchlaw.support.packages import optional_packages
from patchlaw.support.readable import (
    Caution,
    Detail,
    Displayed,
    Table,
    column,
    number,
    of_columns,
    percent,
    quantities,
    spread,
)

PATCH_FACTOR = 20.0
"""Tolerance of a patch's pressure, relative to the tolerance of the force."""

_SCATTER_AT = 0.02, 0.1, 0.5  # of the largest pressure of a law; faces carry less on average
_REPORTED_REPAIR = 1e-6  # smaller repairs are rounding and the tolerance of the micro model

FORMAT = "patchlaw laws 3"
_SCALARS = {
    "touch": "first_touch",
    "reach": "initial_separation",
    "interpolation_error": "interpolation_error",
    "stiffness_error": "stiffness_error",
    "warned_from": "warning_pressure",
    "repaired": "repaired",
    "sample_area_mm2": "sample_area",
    "stiffness_ratio": "stiffness_ratio",
}
_OPTIONAL = "sample_area_mm2", "stiffness_ratio"
"""Scalars that are NaN where they are not known, and then not stored."""
_FLOW, _PATH, _SPRINGS, _UNTOUCHED = "transmissivity", "path", "springs", "untouched"
_UNTOUCHED_COLUMNS = [one.name for one in fields(Untouched)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class LawTable(Displayed):
    """The laws of all patches of an interface, or of all regions of a face.

    Attributes:
        patches: The partition: patches, or regions where the laws stand for faces of any outline.
        laws: One law per patch, in the order of the flat patch index, or per region in theirs.
        made_by: How they were made: coupling, micro model, Love's displacement, tolerance, and the
            slopes of the plane that pressed the whole surface.
        force_error: Estimated error of the force between the rows, see
            `multiscale.laws.refinement`: of all patches together, or the largest where each was
            tabulated alone.
        path: The planes that pressed the whole surface; None for patches alone and samples.
        worn: The laws as the roughness runs in, by rising depths; none where it does not. The file
            of the laws leaves them out.

    Raises:
        InputError: When there is not one law per patch.
    """

    patches: PatchGrid | Regions
    laws: tuple[PatchLaw, ...]
    made_by: dict[str, str]
    force_error: float = float("nan")
    path: PlanePath | None = None
    worn: tuple[WornLaws, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, finite=False)
        if len(self.laws) != self.patches.count:
            raise InputError("needs one law per patch", value=len(self.laws))

    def __getitem__(self, index: int | str) -> PatchLaw:
        if isinstance(index, str) and isinstance(self.patches, Regions):
            return self.laws[self.patches.index(index)]
        return self.laws[int(index)]

    def together(self) -> PatchLaws:
        """Return the laws of the new interface as one, which evaluates them together."""
        return PatchLaws(self.laws)

    @property
    def running_in(self) -> RunningInLaws | None:
        """The laws as functions of worn depths; None where they are not."""
        if not self.worn or self.worn[0].slid is not None:
            return None
        depths = [np.zeros(len(self.laws)), *(level.depth for level in self.worn)]
        return RunningInLaws(self.levels, np.array(depths))

    @property
    def levels(self) -> list[tuple[PatchLaw, ...]]:
        """The laws of the new face, and those of every depth or distance that has worn it."""
        return [self.laws, *(level.laws for level in self.worn)]

    def nearest_levels(self, depth: Array) -> Indices:
        """Return how many of the depths of `worn` lie nearest to depths or before it, shape (N,).

        Args:
            depth: Worn depths of the patches or regions, shape (N,) [mm].
        """
        depths = np.array([np.zeros(len(depth)), *(level.depth for level in self.worn)])
        return np.argmin(np.abs(depths - depth), axis=0)

    def at_levels(self, levels: Indices) -> LawTable:
        """Return the laws at depths of `worn`, 0 for those of new surfaces.

        Args:
            levels: Number of the depth of every law, see `nearest_levels`.
        """
        every = self.levels
        laws = tuple(every[level][patch] for patch, level in enumerate(levels))
        return replace(self, laws=laws, worn=())

    def with_stiffness_ratios(self, ratios: Sequence[float]) -> LawTable:
        """Return the laws with Mindlin's ratios of the bodies, which friction takes.

        Args:
            ratios: One for every law, see `MaterialPair.stiffness_ratio`.
        """
        return self._mapped(
            lambda laws: tuple(
                replace(law, stiffness_ratio=ratio) for law, ratio in zip(laws, ratios, strict=True)
            )
        )

    def _mapped(self, change: Callable[[tuple[PatchLaw, ...]], tuple[PatchLaw, ...]]) -> LawTable:
        """Return the table with all laws changed, those of worn surfaces too."""
        worn = tuple(replace(level, laws=change(level.laws)) for level in self.worn)
        return replace(self, laws=change(self.laws), worn=worn)

    def displayed(self) -> tuple[str, Table]:
        """Return what the laws are in a line, and a table of the ranges of some of them."""
        places = spread(len(self.laws), 60)
        laws = [self.laws[place] for place in places]
        table = of_columns(
            [_part(self.patches), *(_part(self.patches, place) for place in places)],
            ["rows", *(str(len(law.rows)) for law in laws)],
            column("first touch", (law.first_touch for law in laws), "mm"),
            column("to closure", (law.range[1] for law in laws), "mm"),
            column("pressure there", (_last(law, "pressure") for law in laws), "MPa"),
            column("area there", (_last(law, "contact_area_fraction") for law in laws), "%"),
            column("error", (law.interpolation_error for law in laws), "%", 2),
        )
        made = ", ".join(filter(None, map(self.made_by.get, ("coupling", "model"))))
        count = len(self.laws)
        return f"LawTable of {count} law{'s' * (count > 1)} in {self.rows} rows: {made}", table

    @property
    def rows(self) -> int:
        """Number of rows of all laws together."""
        return sum(len(law.rows) for law in self.laws)

    @property
    def touched(self) -> Indices:
        """Indices of the patches that do not stay open, ascending."""
        return np.flatnonzero([not law.is_open for law in self.laws])

    @property
    def largest_pressure(self) -> float:
        """Largest pressure of any law [MPa]; zero where no patch is touched."""
        return max(float(law.rows.pressure.max(initial=0.0)) for law in self.laws)

    @property
    def grid(self) -> PatchGrid:
        """The patches of a rectangle.

        Raises:
            InputError: When the laws are those of regions.
        """
        if isinstance(self.patches, Regions):
            raise InputError("these laws are not those of patches", value=self.patches.names)
        return self.patches

    @property
    def zero(self) -> str:
        """What closures count from, see `geometry.surface.Zero`."""
        return self.made_by.get("zero", FIRST_TOUCH)

    def counted_from(self, name: str, zero: float) -> LawTable:
        """Return the laws with approach and closure counted from another height.

        Args:
            name: What it is.
            zero: Approach at which the plane is at this height [mm].
        """
        path = self.path
        return replace(
            self._mapped(lambda laws: tuple(law.shifted(-zero) for law in laws)),
            made_by=self.made_by | {"zero": name},
            path=None if path is None else path.shifted(-zero),
        )

    def notes(self, tolerance: float) -> Iterator[str]:
        """Yield what a report says of the laws: their errors, and whether they were repaired.

        Args:
            tolerance: Error of the force that was asked for.
        """
        largest = max(law.interpolation_error for law in self.laws)
        yield Detail(
            f"interpolation error of the laws between their rows: {percent(self.force_error)} of "
            f"the force, {percent(largest)} of a patch's pressure or the mean, if more"
        )
        reached = max(self.force_error, largest / PATCH_FACTOR)
        if reached > tolerance:
            yield Caution(
                f"the laws miss coupling.table_tolerance = {tolerance:g} with all the rows that "
                f"are solved at most; what they reach is a tolerance of {number(reached, 2)}"
            )
        changes = [law.repaired for law in self.laws if law.repaired > _REPORTED_REPAIR]
        if changes:
            yield Detail(
                f"monotone repair: in the laws of {len(changes)} of {len(self.laws)} patches "
                "pressure or closure fell as the plane came nearer; evened out, by up to "
                f"{percent(max(changes))} of their largest"
            )
        if isinstance(self.patches, Regions):
            yield from filter(None, map(_scatter_note, self.patches.names, self.laws))


def _last(law: PatchLaw, name: str) -> float:
    """Return a column of a law at the end of its range, 0 of a patch that stays open."""
    return float(getattr(law.rows, name)[law.rising_rows - 1]) if len(law.rows) else 0.0


def _part(patches: PatchGrid | Regions, index: int | None = None) -> str:
    """Return what a table calls a patch or region, without an index the heading of the column."""
    if isinstance(patches, Regions):
        return "region" if index is None else patches.names[index]
    return "patch" if index is None else ", ".join(map(str, patches.unravel(index)))


def part_key(patches: PatchGrid | Regions, index: int) -> str:
    """Return the name of a patch or region in files, ``patch_IX_IY`` or ``region_I``.

    Args:
        patches: The partition.
        index: Flat index of the patch, or that of the region.
    """
    if isinstance(patches, Regions):
        return f"region_{index}"
    ix, iy = patches.unravel(index)
    return f"patch_{ix}_{iy}"


def _scatter_note(region: str, law: PatchLaw) -> str | None:
    """Return what is said of the scatter among the samples of a law."""
    rows = law.rows
    if not rows.pressure_scatter.any():
        return None
    at = np.searchsorted(rows.pressure, np.multiply(_SCATTER_AT, rows.pressure[-1]))
    pressure, scatter = rows.pressure[at], rows.pressure_scatter[at]
    sides = scatter / np.array([law.along(one).stiffness for one in rows.approach[at]])
    pressures, closures = quantities(pressure, "MPa", 3), quantities(sides, "mm", 2)
    found = [
        f"{percent(share)} at {where} ({closure} of closure)"
        for share, where, closure in zip(scatter / pressure, pressures, closures, strict=True)
    ]
    return (
        f"{region}: the pressure of single samples scatters about that of their mean by "
        f"{', '.join(found)}; standard deviations, which are smaller for larger samples"
    )


def write_laws(path: Path, table: LawTable) -> Path:
    """Write all laws to one HDF5 file, whole or not at all; see `law_bytes`.

    Args:
        path: File to write; one that exists is replaced.
        table: The laws.

    Raises:
        NotWritten: When the system refuses.
    """
    return write_bytes(path, law_bytes(table))


@lru_cache(maxsize=1)  # every checkpoint asks for the same
def law_bytes(table: LawTable) -> bytes:
    """Return the content of a law file.

    It has a group ``patch_IX_IY`` per patch, or ``region_I`` per region, with a dataset per column,
    and a group for the path of the plane where there is one. In a law the group ``springs`` has the
    springs of `PatchLaw.springs` where the tangential stiffness is known, and ``transmissivity``
    what leaks over the mean separation where a leak was asked for. The group ``untouched`` has the
    rows of `PatchLaw.untouched` of all laws in turn, and how many each has. A checksum stands
    before the content; see `support.files`.

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
            group = file.create_group(part_key(table.patches, index))
            _write(group, _columns(law.rows))
            for name, attribute in _SCALARS.items():
                if name not in _OPTIONAL or np.isfinite(getattr(law, attribute)):
                    group.attrs[name] = getattr(law, attribute)
            if law.transmissivity is not None:
                _write(group.create_group(_FLOW), _columns(law.transmissivity))
            if np.isfinite(law.stiffness_ratio) and not law.is_flat:
                _write_springs(group.create_group(_SPRINGS), law)
        untouched = [law.untouched for law in table.laws]
        if any(map(len, untouched)):
            columns: dict[str, tuple[Any, str]] = {
                name: (np.concatenate([getattr(one, name) for one in untouched]), "mm")
                for name in _UNTOUCHED_COLUMNS
            }
            columns["count"] = np.array(list(map(len, untouched))), "1"
            _write(file.create_group(_UNTOUCHED), columns)
        if table.path is not None:
            _write(file.create_group(_PATH), _columns(table.path))

    import h5py

    return hdf5_bytes(h5py.File, fill)


def _write(group: Any, columns: dict[str, tuple[Any, str]]) -> None:
    """Write columns with their units."""
    for name, (values, unit) in columns.items():
        group.create_dataset(name, data=values).attrs["unit"] = unit


def _write_springs(group: Any, law: PatchLaw) -> None:
    """Write the springs of a law under friction, which follow from its rows, for other programs."""
    bed = law.springs
    group.attrs["error"] = bed.error
    columns = {
        "first_touch": (bed.start, "mm"),
        "last_touch": (bed.start + bed.width, "mm"),
        "normal_stiffness": (bed.stiffness, "MPa/mm"),
        "tangential_stiffness": (bed.stiffness / law.stiffness_ratio, "MPa/mm"),
        "coupling": (np.broadcast_to(bed.coupling, len(bed)), "1"),
    }
    _write(group, columns)


def _names(one: Field[Any]) -> list[str]:
    """Return the names of the columns of a field of a record: of both axes, or one."""
    name = one.metadata.get("stored", one.name)
    return [f"{name}_{axis}" for axis in one.metadata.get("axes", ())] or [name]


def _columns(record: Any) -> dict[str, tuple[Any, str]]:
    """Return the columns of a record, with their units, by name."""
    found: dict[str, tuple[Any, str]] = {}
    for one in (one for one in fields(record) if "unit" in one.metadata):
        names, values = _names(one), getattr(record, one.name)
        if values.any() or not one.metadata.get("optional"):
            each = values.T if len(names) > 1 else [values]
            found |= {
                name: (column, one.metadata["unit"])
                for name, column in zip(names, each, strict=True)
            }
    return found


def _record(kind: Any, group: Any) -> Any:
    """Return a record of columns that a group has."""
    found = {}
    for one in (one for one in fields(kind) if "unit" in one.metadata):
        names = _names(one)
        if names[0] in group or not one.metadata.get("optional"):
            columns = [_numbers(group[name]) for name in names]
            found[one.name] = np.stack(columns, axis=1) if len(names) > 1 else columns[0]
    return kind(**found)


@checked
def read_laws(path: str | Path | BinaryIO) -> LawTable:
    """Read a law file.

    The pressure of a patch alone rises with the approach; where noise in a table from elsewhere
    makes it fall, it is repaired, and the law states by how much (`PatchLaw.repaired`). Consistent
    laws are taken as they are: neighbours that take load over make their pressures fall.

    Args:
        path: The file, by name or open.

    Raises:
        InputError: When the file cannot be read, is no law file, damaged, lacks anything, has no
            checksum, or names a micro model that no longer exists.
    """
    with optional_packages():
        import h5py  # takes longer than all else that a plan needs of laws

    path = Path(path) if isinstance(path, str) else path
    name = str(path) if isinstance(path, Path) else None
    if isinstance(path, Path):
        check_file(path, name)
    with located(name, unreadable="is not a readable law file"):
        content = path.read_bytes() if isinstance(path, Path) else path.read()
        check_hdf5(content)
        with h5py.File(BytesIO(content), "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise InputError("is not a law file of patchlaw")
            return _table(file)


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
    laws = [_law(file[part_key(patches, index)]) for index in range(patches.count)]
    if _UNTOUCHED in file:
        group = file[_UNTOUCHED]
        ends = np.cumsum(_numbers(group["count"]))[:-1].astype(np.int64)
        columns = [np.split(_numbers(group[name]), ends) for name in _UNTOUCHED_COLUMNS]
        laws = [
            replace(law, untouched=Untouched(**dict(zip(_UNTOUCHED_COLUMNS, own, strict=True))))
            for law, *own in zip(laws, *columns, strict=True)
        ]
    if made_by.get("coupling") != "consistent":
        laws = [repaired_law(law) for law in laws]
    return LawTable(
        patches=patches,
        laws=tuple(laws),
        made_by=made_by,
        force_error=float(file.attrs["force_error"]),
        path=_record(PlanePath, file[_PATH]) if _PATH in file else None,
    )


def _law(group: Any) -> PatchLaw:
    if hasattr(group, "dtype"):  # h5py would look for names among all its numbers
        raise InputError(f"{group.name} is no group of columns")
    known = dict.fromkeys(_OPTIONAL, np.nan) | dict(group.attrs)
    scalars: dict[str, Any] = {
        attribute: float(known[name]) for name, attribute in _SCALARS.items()
    }
    flow = _record(Transmissivity, group[_FLOW]) if _FLOW in group else None
    return PatchLaw(rows=_record(LawRows, group), transmissivity=flow, **scalars)


def _numbers(item: Any) -> NDArray[Any]:
    """Return the numbers of an HDF5 dataset, if the file itself holds as many as it promises."""
    kind = getattr(getattr(item, "dtype", None), "kind", "")
    if not kind or kind not in "biuf":
        raise InputError(f"{item.name} is not a column of numbers")
    # our columns are not compressed and lie in the file itself: larger than it, they are damaged
    if item.nbytes > item.id.get_storage_size() or item.external:
        raise InputError(f"{item.name} is not whole", value=item.shape)
    return np.asarray(item[()])
