"""What several meshes of a rough surface say together: values at mesh size zero, error bars."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from multiscale.loading.load_step import LoadStep
from multiscale.results.extrapolation import Estimate, extrapolated

Array = NDArray[np.float64]

COLUMNS = (
    "step",
    "approach_mm",
    "force_N",
    "force_error_N",
    "force_rate",
    "contact_area_fraction",
    "contact_area_error",
    "area_rate",
    "approach_error_mm",
    "approach_rate",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferenceRecord:
    """Results of the meshes of a reference, and their limits; the finest mesh is the last.

    Attributes:
        sizes: Edge lengths in the contacts, falling, shape (meshes,) [mm].
        unknowns: Degrees of freedom, shape (meshes,).
        approach_mm: Approach on every mesh, shape (meshes, steps) [mm].
        force_N: Force on every mesh, shape (meshes, steps) [N].
        contact_area_fraction: Contact area likewise, relative to the nominal area.
        approach: The approach at mesh size zero; as prescribed where it is [mm].
        force: The force likewise [N].
        area: The contact area fraction likewise.
    """

    sizes: Array
    unknowns: tuple[int, ...]
    approach_mm: Array
    force_N: Array
    contact_area_fraction: Array
    approach: Estimate
    force: Estimate
    area: Estimate

    @property
    def by_force(self) -> bool:
        """Whether the force is prescribed: meshes then differ in approach, which else is given."""
        spread = np.ptp(self.approach_mm, axis=0)
        return bool(np.any(spread > 1e-12 * np.abs(self.approach_mm).max(axis=0)))

    @property
    def _unknown(self) -> tuple[Estimate, float, str]:
        """What is not prescribed, with the scale and unit that people read it in."""
        return (self.approach, 1e3, "µm") if self.by_force else (self.force, 1.0, "N")

    @property
    def _most(self) -> int:
        """Index of the step of the largest force."""
        return int(np.argmax(self.force_N[-1]))

    @property
    def relative_error(self) -> float:
        """Error bar at the largest force, relative: of the force, or of the approach by force."""
        if not self.force_N.any():
            return float("nan")
        found, last = self._unknown[0], self._most
        value, error = abs(float(found.value[last])), float(found.error[last])
        return error / value if value else error

    @property
    def label(self) -> str:
        """What a table or a legend says of the discretisation error."""
        if not np.isfinite(self.relative_error):
            return "no error bar"
        return f"± {100.0 * self.relative_error:.2g} %"

    @property
    def sentence(self) -> str:
        """What a report says of the discretisation error."""
        if len(self.sizes) == 1:
            return "one mesh: no error bar; reference.meshes = 2 gives one"
        if not self.force_N.size:
            return "no load step, no error bar"
        if not self.force_N.any():
            return "no contact on any mesh, no error bar"
        what = "approach" if self.by_force else "force"
        (found, scale, unit), last = self._unknown, self._most
        rate = float(found.rate[last])
        if np.isnan(rate):
            why = "the meshes show no rate, and the finest stands"
        elif len(self.sizes) == 2:
            why = f"two meshes, with the known order {rate:g} of their family"
        else:
            why = f"three meshes, with the rate {rate:.2g} that they show"
        return (
            f"{what} at mesh size zero, at the largest force: {scale * found.value[last]:.5g} "
            f"± {scale * found.error[last]:.2g} {unit} ({self.label}), extrapolated from {why}; "
            "the table holds the finest mesh"
        )

    @property
    def cells(self) -> tuple[str, list[str]]:
        """Heading and cells of a table's column that holds the values at mesh size zero."""
        found, scale, unit = self._unknown
        if len(self.sizes) == 1:
            return "at size zero", ["no error bar"] * found.value.size
        heading = f"at size zero [{unit}]"
        pairs = zip(scale * found.value, scale * found.error, strict=True)
        return heading, [
            "no error bar" if np.isnan(error) else f"{value:.5g} ± {error:.2g}"
            for value, error in pairs
        ]

    def without_bars(self, steps: NDArray[np.bool_]) -> ReferenceRecord:
        """Return the record with the errors of force and area unknown at some load steps.

        Args:
            steps: At which, shape (steps,).
        """
        force, area = (
            replace(one, error=np.where(steps, np.nan, one.error))
            for one in (self.force, self.area)
        )
        return replace(self, force=force, area=area)

    def with_errors(self, steps: Sequence[LoadStep]) -> tuple[LoadStep, ...]:
        """Return the load steps, which are the finest mesh's, with what they may be off by.

        That is the way to mesh size zero and the error bar there.

        Args:
            steps: The load steps.
        """
        force = np.abs(self.force_N[-1] - self.force.value) + self.force.error
        approach = np.abs(self.approach_mm[-1] - self.approach.value) + self.approach.error
        return tuple(
            replace(step, force_error_N=_known(force[i]), approach_error_mm=_known(approach[i]))
            for i, step in enumerate(steps)
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of ``reference.csv``: the meshes' own values follow the extrapolated ones."""
        names = ("force_N", "approach_mm", "contact_area_fraction")
        meshes = range(1, len(self.sizes) + 1)
        return (*COLUMNS, *(f"{name}_mesh_{mesh}" for name in names for mesh in meshes))

    def rows(self, steps: Sequence[LoadStep]) -> Iterator[tuple]:
        """Yield the rows of ``reference.csv``.

        Args:
            steps: The load steps.
        """
        force, area, approach = self.force, self.area, self.approach
        for i, step in enumerate(steps):
            yield (
                step.step,
                approach.value[i],
                *(force.value[i], force.error[i], force.rate[i]),
                *(area.value[i], area.error[i], area.rate[i]),
                *(approach.error[i], approach.rate[i]),
                *self.force_N[:, i],
                *self.approach_mm[:, i],
                *self.contact_area_fraction[:, i],
            )


def _known(error: float) -> float | None:
    return None if np.isnan(error) else float(error)


def reference_record(
    steps: Sequence[LoadStep],
    sizes: Array,
    unknowns: Sequence[int],
    *,
    force_order: float,
    area_order: float,
) -> ReferenceRecord:
    """Gather what every mesh found, and extrapolate it.

    Args:
        steps: The load steps of a reference.
        sizes: Edge lengths in the contacts, falling, shape (meshes,) [mm].
        unknowns: Degrees of freedom of the meshes.
        force_order: Known order of the force, and of the approach under a force, in the size.
        area_order: Known order of the contact area.
    """
    found = np.array([step.meshes for step in steps], float).reshape(len(steps), len(sizes), 3)
    approach, force, area = found.transpose(2, 1, 0)
    return ReferenceRecord(
        sizes=sizes,
        unknowns=tuple(unknowns),
        approach_mm=approach,
        force_N=force,
        contact_area_fraction=area,
        approach=extrapolated(approach, sizes, force_order),
        force=extrapolated(force, sizes, force_order),
        area=extrapolated(area, sizes, area_order),
    )
