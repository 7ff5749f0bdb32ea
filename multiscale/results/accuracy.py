"""How accurate results are: against what was asked for, and of a reference at mesh size zero.

Theory: docs/theory.md, sections 12 and 13.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.multiscale.loading.load_step import LoadStep, with_exact_zeros
from patchlaw.support import Array, Flags, InputError
from patchlaw.support.readable import Caution, measured, percent, usual_unit, with_error


@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyVerdict:
    """The accuracy that was asked for, and the error that was measured in the run.

    Attributes:
        requested: Relative error of the force that was asked for.
        error: Measured relative error of the force, the larger of those of the last load step and
            of that of the largest force; None where neither was measured.
        step: Number of the load step that has it; 0 where it was not measured.
        causes: Relative errors by cause there; empty where they are not told apart.
        unknown: Why it was not measured; empty where it was.
    """

    requested: float
    error: float | None = None
    step: int = 0
    causes: Mapping[str, float] = field(default_factory=dict)
    unknown: str = ""

    @property
    def kept(self) -> bool | None:
        """Whether the error keeps the accuracy; None where it was not measured."""
        return None if self.error is None else self.error <= self.requested

    @property
    def sentence(self) -> str:
        """The verdict in words, a caution unless the accuracy is kept."""
        asked = f"accuracy of {percent(self.requested, 3)}"
        if self.error is None:
            return Caution(f"whether the {asked} is kept is not known: {self.unknown}")
        found = percent(self.error)
        if self.kept:
            return f"{asked} kept: measured at load step {self.step}, the force is within {found}"
        return Caution(
            f"the {asked} is not kept: measured at load step {self.step}, the force may be off by "
            f"{found}{_most_of_it(self.causes)}"
        )


def relative_error(step: LoadStep) -> float | None:
    """Return the measured error of a load step relative to its force; None where it has none.

    Args:
        step: The load step, under a force. Where that is prescribed, the error of a reference is
            that of the approach, whose power 3/2 the force grows with.
    """
    if step.errors:
        return sum(error for _, error in step.errors) / step.force_N
    if not step.by_force:
        return None if step.force_error_N is None else step.force_error_N / step.force_N
    if step.approach_error_mm is None or not step.approach_mm:
        return None
    return 1.5 * step.approach_error_mm / abs(step.approach_mm)


def verdict(
    steps: Sequence[LoadStep], accuracy: float | None, unknown: str
) -> AccuracyVerdict | None:
    """Return whether load steps keep an accuracy; None where none was asked for.

    Args:
        steps: The load steps, with the errors that were measured.
        accuracy: Relative error of the force that was asked for, or None.
        unknown: Why errors are not measured; empty where they should have been.
    """
    if accuracy is None:
        return None
    loaded = [step for step in steps if step.force_N > 0.0]
    if not loaded:
        return AccuracyVerdict(requested=accuracy, unknown="no load step has a force")
    decisive = (loaded[-1], max(loaded, key=lambda step: step.force_N))
    found = [(relative_error(step), step) for step in decisive]
    known = [(error, step) for error, step in found if error is not None]
    if unknown or not known:
        why = unknown or "the errors of its load steps were not measured"
        return AccuracyVerdict(requested=accuracy, unknown=why)
    error, step = max(known, key=lambda each: each[0])
    causes = {cause: part / step.force_N for cause, part in step.errors}
    if error == math.inf:
        why = f"the error by {_worst(causes)} could not be measured at load step {step.step}"
        return AccuracyVerdict(requested=accuracy, step=step.step, unknown=why)
    return AccuracyVerdict(requested=accuracy, error=error, step=step.step, causes=causes)


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was taken, and the errors that were measured for it before the run.

    Attributes:
        accuracy: Relative error of the force that was requested.
        taken: The coupling, and the cells, meshes or micro model that it works on.
        why: Why this coupling was taken; empty where the scene states it or it was missed for.
        errors: Measured errors of the force by cause, relative to it, at the load where they are
            worst; empty where they cannot be measured beforehand. That of laws is among them only
            after the run.
        missed: Errors by cause of what was tried first and could not keep the accuracy, if any.
        trials: How many cells or meshes were tried for it.
        keys: What the scene left open, and what that became, by dotted key.
    """

    accuracy: float
    taken: str
    errors: Mapping[str, float]
    why: str = ""
    missed: Mapping[str, float] = field(default_factory=dict)
    trials: int = 0
    keys: Mapping[str, Any] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """Measured relative error of the force; 0 where it was not measured."""
        return sum(self.errors.values())

    @property
    def kept(self) -> bool:
        """Whether the measured error is within the accuracy."""
        return bool(self.errors) and self.error <= self.accuracy

    @property
    def sentence(self) -> str:
        """What was taken, why, and what was measured for it."""
        parts = [
            self.taken + f" ({self.why})" * bool(self.why),
            f"an accuracy of {100 * self.accuracy:.3g} % is asked for, {_listed(self.errors)}",
        ]
        if self.missed:
            parts.append(f"without meshing the roughness {_listed(self.missed)}")
        if self.trials:
            parts.append(f"the choice took {self.trials} trial{'s' * (self.trials > 1)}")
        if self.keys:
            parts.append("chosen: " + ", ".join(f"{key} = {one}" for key, one in self.keys.items()))
        return "; ".join(parts)

    @property
    def warning(self) -> str | None:
        """A warning that the accuracy is not kept; None where it is, or is not known beforehand."""
        if self.kept or not self.errors:
            return None
        if self.error == math.inf:
            return (
                f"whether an accuracy of {100 * self.accuracy:.3g} % is kept is not known: the "
                f"error by {_worst(self.errors)} could not be measured at the largest load"
            )
        return (
            f"an accuracy of {100 * self.accuracy:.3g} % is not kept: measured at the largest "
            f"load, the force may be off by {100 * self.error:.2g} %{_most_of_it(self.errors)}"
        )


_REMEDIES = {
    "edges": "which no refinement lessens: take cells of the whole face, by a map that covers it "
    "and coupling.kind = 'concurrent', or a sample that is smaller than the face",
    "samples": "which more samples lessen (law.seeds, or further maps in law.samples)",
}
"""What lessens errors that finer cells and meshes do not."""


def _worst(causes: Mapping[str, float]) -> str:
    return max(causes, key=lambda cause: causes[cause])


def _most_of_it(causes: Mapping[str, float]) -> str:
    """Return which cause errs most, and what lessens it where refinement does not."""
    if not causes:
        return ""
    said = f", most of it by {_worst(causes)}", _REMEDIES.get(_worst(causes))
    return ", ".join(filter(None, said))


def _listed(errors: Mapping[str, float]) -> str:
    if not errors:
        return "which is not measured beforehand"
    if math.inf in errors.values():
        return f"which is not known: the error by {_worst(errors)} could not be measured"
    causes = ", ".join(f"{cause} {100 * error:.2g} %" for cause, error in errors.items())
    return f"measured at the largest load {100 * sum(errors.values()):.2g} % ({causes})"


RATE_MARGIN = 1.25
"""The error bar allows a rate this much below the known order.

The margin is at most half the order. From first order on, c + a hᵖ (1 + b h) with b h > −0.4 and
sizes that differ by a factor of two or more is not 0.75 below its order. The rest is for nodes that
happen to lie well or badly: of seven rough blocks of order 3, whose finer edges were a third of a
contact's radius, the slowest showed 2.0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A quantity on every mesh and its values at mesh size zero; arrays over load steps.

    Attributes:
        meshes: The results of the meshes, the finest last, shape (meshes, steps).
        value: The values at mesh size zero, shape (steps,); exact where they are prescribed.
        error: Half widths of their error bars, shape (steps,); NaN where nothing is known.
        rate: The known order that was used; NaN where none was, as before the first touch. Shape
            (steps,).
    """

    meshes: Array
    value: Array
    error: Array
    rate: Array

    def at(self, steps: slice) -> Estimate:
        """Return the values at some load steps alone.

        Args:
            steps: Their places.
        """
        return Estimate(**{one.name: getattr(self, one.name)[..., steps] for one in fields(self)})

    @property
    def of_finest(self) -> list[float | None]:
        """Errors of the finest mesh, None where unknown: its distance from the value, and its bar.

        Shape (steps,).
        """
        bounds = (np.abs(self.meshes[-1] - self.value) + self.error).tolist()
        return [None if math.isnan(bound) else bound for bound in bounds]


def extrapolated(
    values: ArrayLike, sizes: ArrayLike, order: float | None = None, scatter: ArrayLike = 0.0
) -> Estimate:
    """Extrapolate results of meshes of falling size with a known order (Richardson).

    With f = c + a hᵖ on meshes h₁ < h₂ the finest mesh is wrong by
    a h₁ᵖ = (f₂ − f₁) / (rᵖ − 1), r = h₂ / h₁, where h₂ is the coarsest mesh. The error bar is the
    difference between this correction and the one that a rate lower by `RATE_MARGIN` would give.
    Meshes between the two check the order: what lies between their results and those of the
    formula is added to the bar. A rate is not observed: it would have to be that of three
    results, whose scatter by where nodes happen to lie is as large as their differences.

    Meshes may also agree by accident. Therefore the scatter of single meshes, where it is known,
    is added, and no relative error bar is less than half the median over all load steps.

    Args:
        values: Results of every mesh, the finest last, shape (meshes, steps).
        sizes: Mesh sizes, falling, shape (meshes,).
        order: Known rate of convergence; required for several meshes.
        scatter: Relative scatter of the results, shape (steps,) or one for all.

    Raises:
        InputError: When shapes or sizes do not fit, or several meshes come without an order.

    Source:
        Roache 1994, doi 10.1115/1.2910291, on why an error bar is more than the correction.
    """
    results, h = _checked(values, sizes, order)
    if len(h) == 1:
        nothing = np.full(results.shape[1], np.nan)
        return Estimate(meshes=results, value=results[0], error=nothing, rate=nothing.copy())
    assert order is not None
    difference, ratio = results[0] - results[-1], h[0] / h[-1]
    correction = difference / (ratio**order - 1.0)
    slower = max(order - RATE_MARGIN, 0.5 * order)
    error = np.abs(difference / (ratio**slower - 1.0) - correction)
    expected = results[-1] + correction * ((h[:, None] / h[-1]) ** order - 1.0)
    size = np.abs(results[-1])
    error += np.abs(results - expected).max(axis=0) + np.asarray(scatter) * size
    usual = np.median(error[size > 0.0] / size[size > 0.0]) if size.any() else 0.0
    return Estimate(
        meshes=results,
        value=results[-1] - correction,
        error=np.maximum(error, 0.5 * usual * size),
        rate=np.where(np.ptp(results, axis=0) == 0.0, np.nan, order),
    )


def _checked(values: ArrayLike, sizes: ArrayLike, order: float | None) -> tuple[Array, Array]:
    results, h = np.asarray(values, float), np.asarray(sizes, float)
    if results.ndim != 2 or h.shape != results.shape[:1] or not len(h):
        raise InputError(
            "results and mesh sizes do not fit together",
            value=(np.shape(values), np.shape(sizes)),
            allowed="(meshes, steps) and (meshes,)",
        )
    if not (np.all(h > 0.0) and np.all(np.diff(h) < 0.0)):
        raise InputError("mesh sizes must fall", value=h.tolist(), allowed="the finest last")
    if len(h) > 1 and order is None:
        raise InputError("meshes alone show no rate", value=order, allowed="a known order > 0")
    if order is not None and not order > 0.0:
        raise InputError("the order must be positive", value=order, allowed="> 0")
    return results, h


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferenceRecord:
    """Results of the meshes of a reference and their limits; the finest mesh is the last.

    Attributes:
        sizes: Edge lengths in the contacts, falling, shape (meshes,) [mm].
        unknowns: Degrees of freedom, shape (meshes,).
        approach: The approach [mm].
        force: The force [N].
        area: The contact area fraction.
    """

    sizes: Array
    unknowns: tuple[int, ...]
    approach: Estimate
    force: Estimate
    area: Estimate

    @classmethod
    def of(
        cls,
        steps: Sequence[LoadStep],
        sizes: Array,
        unknowns: Sequence[int],
        *,
        force_order: float,
        scatter: Array | float = 0.0,
    ) -> ReferenceRecord:
        """Gather the results of every mesh, and extrapolate them to mesh size zero.

        Args:
            steps: The load steps of a reference.
            sizes: Edge lengths in the contacts, falling, shape (meshes,) [mm].
            unknowns: Degrees of freedom of the meshes.
            force_order: Known order of convergence of the force, and of the approach under a force.
            scatter: Relative scatter of the force on single meshes, or of the approach under a
                force, shape (steps,).
        """
        found = np.array([step.meshes for step in steps], float).reshape(len(steps), len(sizes), 3)
        approach, force, area = found.transpose(2, 1, 0)
        of_approach, of_force = (scatter, 0.0) if _by_force(approach) else (0.0, scatter)
        return cls(
            sizes=sizes,
            unknowns=tuple(unknowns),
            approach=extrapolated(approach, sizes, force_order, of_approach),
            force=extrapolated(force, sizes, force_order, of_force),
            area=extrapolated(area, sizes, 1.0),
        )

    @property
    def by_force(self) -> bool:
        """Whether the force is prescribed: the approach then differs between the meshes."""
        return _by_force(self.approach.meshes)

    @property
    def _response(self) -> tuple[Estimate, str]:
        """Return force or approach, whichever is not prescribed, with its unit."""
        return (self.approach, "mm") if self.by_force else (self.force, "N")

    @property
    def _at_largest_force(self) -> tuple[float, float]:
        """Return value and error of the response at the largest force, in mm or N."""
        found, force = self._response[0], self.force.meshes
        if not force.any():
            return 0.0, np.nan
        step = int(np.argmax(force[-1]))
        return float(found.value[step]), float(found.error[step])

    @property
    def label(self) -> str:
        """The error bar relative to the response at the largest force, for tables and legends."""
        value, error = self._at_largest_force
        return f"± {percent(error / (abs(value) or 1.0))}" if np.isfinite(error) else "no error bar"

    @property
    def sentence(self) -> str:
        """The discretisation error and where it is from, as reports show it."""
        if len(self.sizes) == 1:
            return "one mesh: no error bar; reference.meshes = 2 gives one"
        if not self.force.meshes.any():
            nothing = "contact on any mesh" if self.force.meshes.size else "load step"
            return f"no {nothing}, no error bar"
        meshes = f"{'two' if len(self.sizes) == 2 else 'three'} meshes of a family of known order"
        size = measured(*self._at_largest_force, self._response[1])
        return (
            f"{'approach' if self.by_force else 'force'} at mesh size zero, at the largest force: "
            f"{size} ({self.label}), from {meshes}; "
            "the table holds the finest mesh"
        )

    @property
    def cells(self) -> tuple[str, list[str]]:
        """Heading and cells of a table's column that holds the values at mesh size zero."""
        found, unit = self._response
        if len(self.sizes) == 1:
            return "at size zero", ["no error bar"] * found.value.size
        name, size = usual_unit(found.value, unit)
        return f"at size zero [{name}]", [
            "no error bar" if np.isnan(error) else with_error(value, error) if error else "0 ± 0"
            for value, error in zip(found.value / size, found.error / size, strict=True)
        ]

    def without_bars(self, steps: Flags) -> ReferenceRecord:
        """Return the record with unknown errors of force and area at some load steps.

        Args:
            steps: True at these load steps, shape (steps,).
        """
        force, area = (
            replace(one, error=np.where(steps, np.nan, one.error))
            for one in (self.force, self.area)
        )
        return replace(self, force=force, area=area)

    def with_errors(self, steps: Sequence[LoadStep]) -> tuple[LoadStep, ...]:
        """Return the load steps, which are those of the finest mesh, with its errors.

        Args:
            steps: The load steps.
        """
        names = "force_error_N", "approach_error_mm", "contact_area_fraction_error"
        errors = (one.of_finest for one in (self.force, self.approach, self.area))
        return tuple(
            replace(step, **with_exact_zeros(step, dict(zip(names, found, strict=True))))
            for step, *found in zip(steps, *errors, strict=True)
        )

    def counted_from(self, zero: float) -> ReferenceRecord:
        """Return the record with approaches counted from another height.

        Args:
            zero: Approach at which the plane is at this height [mm].
        """
        meshes, value = self.approach.meshes - zero, self.approach.value - zero
        return replace(self, approach=replace(self.approach, meshes=meshes, value=value))

    def at(self, steps: slice) -> ReferenceRecord:
        """Return the record of some load steps alone.

        Args:
            steps: Their places.
        """
        parts = {name: getattr(self, name).at(steps) for name in ("approach", "force", "area")}
        return replace(self, **parts)

    def columns(self, steps: Sequence[LoadStep]) -> dict[str, Sequence[float] | Array]:
        """Return the columns of ``reference.csv``: the limits, then the values on every mesh.

        Args:
            steps: The load steps.
        """
        approach, force, area = self.approach, self.force, self.area
        limits: dict[str, Sequence[float] | Array] = {
            "step": [step.step for step in steps],
            "approach_mm": approach.value,
            "force_N": force.value,
            "force_error_N": force.error,
            "force_rate": force.rate,
            "contact_area_fraction": area.value,
            "contact_area_error": area.error,
            "area_rate": area.rate,
            "approach_error_mm": approach.error,
            "approach_rate": approach.rate,
        }
        names = {"force_N": force, "approach_mm": approach, "contact_area_fraction": area}
        return limits | {
            f"{name}_mesh_{number}": values
            for name, found in names.items()
            for number, values in enumerate(found.meshes, 1)
        }


def _by_force(approach: Array) -> bool:
    """Tell whether approaches, shape (meshes, steps), differ between the meshes."""
    spread = np.ptp(approach, axis=0)
    return bool(np.any(spread > 1e-12 * np.abs(approach).max(axis=0)))
