"""Errors of one load step by cause, as its columns state them and as a report says them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import Caution, percent, quantity
from patchlaw.support.arrays import Array

ERRORS_OF = {
    "contact_area_fraction": "contact_area_fraction_error",
    "mean_separation_mm": "mean_separation_error_mm",
}
"""Columns of what is read off besides the force, and of their errors, which runs state. Those of
stiffnesses would take linear solutions on every grid: a fifth of the time of a run, and more where
cells yield."""
ZERO = "zero"
"""Name of the error by the height that approaches count from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredErrors:
    """What the force under a given plane may be off by, and what else is read off there.

    Attributes:
        parts: Error of the force by cause [N]; infinite where it cannot be measured.
        stiffness: Change of the force with the approach [N/mm]; 0 without contact, and NaN where
            it was not requested.
        zero: Error of the height that the approach counts from [mm].
        further: Errors of other quantities by cause, under their names among the columns of load
            steps.
        shear: By cause errors of the shear force where the shift is prescribed [N], of the shift
            where the shear force is [mm]; of the energy lost [N mm]; and, where it is known, of the
            area that slips; shape (2,) or (3,). Empty without friction.
    """

    parts: dict[str, float]
    stiffness: float
    zero: float = 0.0
    further: dict[str, dict[str, float]] = field(default_factory=dict)
    shear: dict[str, Array] = field(default_factory=dict)

    @property
    def force(self) -> float:
        """Error of the force at the approach, the sum of all parts [N]."""
        return sum(self.parts.values())

    @property
    def approach(self) -> float:
        """Error of the approach under the force [mm]; 0 without contact, infinite if not known."""
        if self.stiffness > 0.0:  # which NaN is not
            others = self.force - self.parts.get(ZERO, 0.0)
            return others / self.stiffness + self.zero
        return math.inf if self.force else 0.0


def finite(error: float) -> float | None:
    """Return an error, or None for one that is not known."""
    return float(error) if math.isfinite(error) else None


def error_columns(step: LoadStep, found: MeasuredErrors) -> dict[str, Any]:
    """Return the columns of measured errors.

    Args:
        step: The load step.
        found: Its errors.
    """
    return {
        "force_error_N": 0.0 if step.by_force else finite(found.force),
        "approach_error_mm": finite(found.approach) if step.by_force else 0.0,
        "errors": tuple(found.parts.items()),
        **{ERRORS_OF[name]: finite(sum(parts.values())) for name, parts in found.further.items()},
        **(shear_error_columns(step, found.shear) if found.shear else {}),
    }


def further_error_columns(
    step: LoadStep, cause: str, errors: Array, stiffness: float
) -> dict[str, Any]:
    """Return the columns of errors by one more cause than those that a load step has.

    Args:
        step: The load step.
        cause: The cause.
        errors: Those of the approach where the force is prescribed [mm], of the force where the
            approach is [N]; and of the quantities of `ERRORS_OF`, in their order.
        stiffness: Change of the force with the approach [N/mm].
    """
    names = "approach_error_mm" if step.by_force else "force_error_N", *ERRORS_OF.values()
    known = [getattr(step, name) for name in names]
    changes: dict[str, Any] = {
        name: None if before is None else finite(before + error)
        for name, before, error in zip(names, known, errors, strict=True)
    }
    slope = stiffness if step.by_force else 1.0
    of_force = float(errors[0]) * slope if math.isfinite(slope) else math.inf
    return {"errors": (*step.errors, (cause, of_force)), **changes}


def shear_error_columns(step: LoadStep, parts: Mapping[str, Array]) -> dict[str, Any]:
    """Return the columns of measured errors of the shear.

    Args:
        step: The load step.
        parts: Errors by cause, see `MeasuredErrors.shear`.
    """
    shear, lost, slips = map(finite, [*sum(parts.values(), np.zeros(1)), math.inf][:3])
    return {
        "shear_force_error_N": shear if step.by_shift else 0.0,
        "shear_error_mm": 0.0 if step.by_shift else shear,
        "shear_errors": tuple((cause, float(error[0])) for cause, error in parts.items()),
        "dissipated_error_mJ": lost,
        "slip_area_error": slips,
    }


def response_of(step: LoadStep, *, prescribed: bool = False) -> Array:
    """Return the shear force where the shift is prescribed [N], else the shift [mm], shape (2,).

    Args:
        step: The load step.
        prescribed: Whether what is prescribed is returned instead.
    """
    pair = step.shear_x_mm, step.shear_y_mm
    if step.by_shift != prescribed:
        pair = step.shear_force_x_N, step.shear_force_y_N
    return np.array([one or 0.0 for one in pair])


def _causes_text(errors: Iterable[tuple[str, float]], unit: str) -> str:
    return ", ".join(
        f"{cause} {quantity(error, unit, 2) if math.isfinite(error) else 'not measured'}"
        for cause, error in errors
    )


def error_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the errors of the last load step that was measured.

    Args:
        steps: The load steps.
    """
    measured = [step for step in steps if step.errors]
    if not measured:
        return
    step = measured[-1]
    whole = sum(error for _, error in step.errors)
    causes = _causes_text(step.errors, "N")
    if whole == math.inf:
        largest = max(step.errors, key=lambda each: each[1])[0]
        yield Caution(
            f"measured at load step {step.step}: {causes}; the force has no stated error, as that "
            f"by {largest} may be larger than all others"
        )
        return
    text = f"measured at load step {step.step}: at its approach the force is "
    share = f" ({percent(whole / step.force_N)})" if step.force_N else ""
    if whole > step.force_N > 0.0:
        # towards full contact of a period it rises without bound
        text, share = f"{text}not known, as its error exceeds it", ""
    else:
        text += f"within {quantity(whole, 'N', 2)}"
    if step.approach_error_mm:
        size = quantity(step.approach_error_mm, "mm", 2)
        text += f", and under its force the approach within {size}"
    yield f"{text}{share}: {causes}{_further_text(step)}"


def _further_text(step: LoadStep) -> str:
    """Return the errors of what else is read off a load step."""
    area, gap = step.contact_area_fraction_error, step.mean_separation_error_mm
    parts = []
    if area is not None:
        parts.append(f"the contact area is within {percent(area)} of the face")
    if gap is not None:
        parts.append(f"the mean gap within {quantity(gap, 'mm', 2)}")
    return "".join(f"; {part}" for part in (", ".join(parts),) if part)


def shear_error_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the errors of the shear at the last load step that they were measured at.

    Args:
        steps: The load steps.
    """
    measured = [step for step in steps if step.shear_errors]
    if not measured:
        return
    step, unit = measured[-1], "N" if measured[-1].by_shift else "mm"
    whole = sum(error for _, error in step.shear_errors)
    size = float(np.hypot(*response_of(step)))
    known = math.isfinite(whole) and size > 0.0
    within = f"is within {quantity(whole, unit, 2)} ({percent(whole / size)})" if known else ""
    names = "at its shift the shear force", "under its shear force the shift"
    text = (
        f"measured at load step {step.step}: {names[not step.by_shift]} "
        f"{within or 'has no stated error'}: {_causes_text(step.shear_errors, unit)}"
    )
    yield text if math.isfinite(whole) else Caution(text)
