"""The laws of all patches or regions of an interface, and what they say of themselves.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from patchlaw.geometry import PatchGrid, Regions
from patchlaw.geometry.zero import FIRST_TOUCH
from patchlaw.multiscale.laws.patch_law import PatchLaw, PatchLaws
from patchlaw.multiscale.laws.rows import PlanePath
from patchlaw.multiscale.readable import Caution, Detail, column, number, percent, quantity
from patchlaw.support.arguments import check_fields
from patchlaw.support.arrays import Indices
from patchlaw.support.displayed import Displayed, Table, of_columns, spread
from patchlaw.support.errors import InputError

PATCH_FACTOR = 20.0
"""Tolerance of a patch's pressure, relative to the tolerance of the force."""

_SCATTER_AT = 0.02, 0.1, 0.5  # of the largest pressure of a law; faces carry less on average
_REPORTED_REPAIR = 1e-6  # smaller repairs are rounding and the tolerance of the micro model


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
        check_fields(self, finite=False)
        if len(self.laws) != self.patches.count:
            raise InputError("needs one law per patch", value=len(self.laws))

    def __getitem__(self, index: int | str) -> PatchLaw:
        if isinstance(index, str) and isinstance(self.patches, Regions):
            return self.laws[self.patches.index(index)]
        return self.laws[int(index)]

    def together(self) -> PatchLaws:
        """Return the laws as one, which evaluates them together."""
        return PatchLaws(self.laws)

    def with_stiffness_ratios(self, ratios: Sequence[float]) -> LawTable:
        """Return the laws with Mindlin's ratios of the bodies, which friction takes.

        Args:
            ratios: One for every law, see `MaterialPair.stiffness_ratio`.
        """
        pairs = zip(self.laws, ratios, strict=True)
        return replace(self, laws=tuple(replace(law, stiffness_ratio=r) for law, r in pairs))

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
        """What closures count from, see `geometry.zero.Zero`."""
        return self.made_by.get("zero", FIRST_TOUCH)

    def counted_from(self, name: str, zero: float) -> LawTable:
        """Return the laws with approach and closure counted from another height.

        Args:
            name: What it is.
            zero: Approach at which the plane is at this height [mm].
        """
        path = self.path
        return replace(
            self,
            laws=tuple(law.shifted(-zero) for law in self.laws),
            made_by=self.made_by | {"zero": name},
            path=None if path is None else replace(path, approach=path.approach - zero),
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
    found = []
    for share in _SCATTER_AT:
        row = int(np.searchsorted(rows.pressure, share * rows.pressure[-1]))
        scatter, stiffness = rows.pressure_scatter[row], law.along(rows.approach[row]).stiffness
        found.append(
            f"{percent(scatter / rows.pressure[row])} at {quantity(rows.pressure[row], 'MPa', 3)} "
            f"({quantity(scatter / float(stiffness), 'mm', 2)} of closure)"
        )
    return (
        f"{region}: the pressure of single samples scatters about that of their mean by "
        f"{', '.join(found)}; standard deviations, which are smaller for larger samples"
    )
