"""Errors of one load step by cause, as its columns state them and as a report says them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from patchlaw.micro.half_space.error_probe import ZERO, ContactErrors, stated
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.support import Array
from patchlaw.support.readable import Caution, percent, quantities, quantity

AREA, SEPARATION = "contact_area_fraction", "mean_separation_mm"
ERRORS_OF = {AREA: "contact_area_fraction_error", SEPARATION: "mean_separation_error_mm"}
"""Columns of what is read off solutions besides the force, and of their errors."""
_ROUNDING = 1e-9
"""Share of a worn depth that solutions of one force differ by."""

MEANINGS = {
    "grid": "size of the cells",
    "zero": "height that the approach counts from, which lies between given heights",
    "slopes": "slopes of the roughness, beyond second order",
    "body": "modes and elements of the finite body",
    "laws": "patch laws in place of cells, interpolation between their rows",
    "mesh": "elements of the bodies",
    "quadrature": "number of points on the face at which laws are evaluated",
    "samples": "scatter among the samples that laws are means of",
    "edges": "edges of the face, which laws of periodic samples leave out",
    "wear": "length of the steps in which surfaces slide and wear",
    "steps": "length of the load steps of a shear",
    "coupling": "tractions of friction that change pressures",
}
"""Causes of errors, and what they mean in a report."""


_OF_LAWS = "laws", "samples", "grid", "slopes"
"""Causes that change a law alike wherever it holds."""


class WearErrors(NamedTuple):
    """What is known of the errors of a surface that wears.

    Attributes:
        by_steps: Errors by the steps of wear of force [N], approach [mm], contact area fraction,
            mean gap, mean and largest worn depth [mm], see `micro.wear.Worn`.
        known: By cause errors of both depths that are known otherwise, shape (2,) [mm].
        by_zones: Whether zones wear by coefficients of their own, so that the mean depth depends
            on where the force is.
        one_law: Whether one law holds everywhere, so that its errors move no even pressure.
    """

    by_steps: Sequence[float]
    known: Mapping[str, Array] = MappingProxyType({})
    by_zones: bool = False
    one_law: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredErrors(ContactErrors):
    """Errors of a load step: of its contacts, of what has worn off them and of their shear.

    Attributes:
        worn: By cause errors of the mean and of the largest worn depth [mm], shape (2,); empty
            where nothing wears.
        shear: By cause errors of the shear force where the shift is prescribed [N], of the shift
            where the shear force is [mm]; of the energy lost [N mm]; and, where it is known, of the
            area that slips; shape (2,) or (3,). Empty without friction.
    """

    worn: dict[str, Array] = field(default_factory=dict)
    shear: dict[str, Array] = field(default_factory=dict)

    def with_cause(
        self, step: LoadStep, cause: str, force: float, approach: float, area: float, gap: float
    ) -> MeasuredErrors:
        """Return the errors with those by one more cause.

        Args:
            step: The load step.
            cause: The cause.
            force: Error of the force at the approach [N].
            approach: Error of the approach under the force [mm], which adds to that.
            area: Error of the contact area fraction.
            gap: Error of the mean gap [mm].
        """
        whole = share = 0.0
        if step.force_N:
            whole = force + (approach * self.stiffness if approach else 0.0)
        elif not step.by_force:
            whole = force
        if step.force_N and step.contact_area_fraction:
            # as the area or as the force at the approach, as areas of few cells may not change
            share = max(whole / step.force_N, area / step.contact_area_fraction)
        size = max(map(len, self.by_cause.values()))
        errors = stated([whole, area, gap, share, share, share])[:size]
        return replace(self, by_cause=self.by_cause | {cause: errors})

    def with_wear(
        self, step: LoadStep, past: Sequence[LoadStep], wear: WearErrors
    ) -> MeasuredErrors:
        """Return the errors with those by the steps of wear, and with those of worn depths.

        Under a force the mean depth is exact, the largest errs at most as the force at the approach
        does: pressures change places. At a held approach both err as what wears them. The force F
        falls from F₀ as the gaps open. An error dF at its end was dF F₀/F at its beginning if it
        goes with the force, and the depths then err by the share x/(eˣ − 1) dF/F, x = log F₀/F;
        dF/F₀ if it does not, as that by the zero. (1 + x) dF/F₀ is more than both.

        Args:
            step: The load step.
            past: All load steps before it.
            wear: What is known of the wear.
        """
        by_steps, known, by_zones, one_law = wear
        found = self.with_cause(step, "wear", *by_steps[:4])
        own = step.force_N, self.parts
        of_steps = [(one.force_N, dict(one.errors)) for one in past if one.errors]
        force, parts = next((one for one in (own, *of_steps[::-1]) if one[0]), own)
        every = [*past, step]
        mean, largest = step.mean_worn_depth_mm or 0.0, step.worn_depth_mm or 0.0
        rises = np.diff([one.mean_worn_depth_mm or 0.0 for one in every], prepend=0.0)
        held = sum(rise for rise, one in zip(rises, every, strict=True) if not one.by_force)
        held_force = max((one.force_N for one in every if not one.by_force), default=0.0)
        fallen = min(force / held_force, 1.0) if held_force else 0.0
        fallen *= 1.0 - math.log(fallen or 1.0)
        # without a force the share of its error is not known
        at_held = held / mean * (fallen or 1.0) if mean else 0.0
        at_force = 1.0 - held / mean if mean else 0.0
        worn = {}
        for cause, error in parts.items():
            share = (error / force if force else math.inf) if error else 0.0
            depths = _shares(share, at_held * mean, at_held * largest)
            if cause == ZERO:  # a plane that is nearer by it wears off no more than that
                worn[cause] = np.minimum(depths, self.zero)
            else:
                uneven = largest - mean if one_law and cause in _OF_LAWS else largest
                moved = _shares(share, at_force * mean * by_zones, at_force * uneven)
                worn[cause] = depths + moved
        return replace(found, worn=worn | {"wear": np.array(by_steps[4:])} | dict(known))

    def with_fretting(self, step: LoadStep, known: Mapping[str, Array]) -> MeasuredErrors:
        """Return the errors with those of depths that slip wore off: as of the energy it took.

        Args:
            step: The load step.
            known: By cause errors of both depths that are known otherwise, shape (2,) [mm].
        """
        sizes = step.mean_worn_depth_mm or 0.0, step.worn_depth_mm or 0.0
        energy = step.dissipated_mJ or math.nan
        worn = {
            cause: _shares(float(part[1]) / energy, *sizes) for cause, part in self.shear.items()
        }
        return replace(self, worn=worn | dict(known))


def _shares(share: float, *sizes: float) -> Array:
    """Return a share of sizes, of nothing 0 even where the share is not known."""
    return np.array([share * size if size else 0.0 for size in sizes])


def finite(error: float) -> float | None:
    """Return an error, or None for one that is not known."""
    return float(error) if math.isfinite(error) else None


def error_columns(step: LoadStep, found: MeasuredErrors) -> dict[str, Any]:
    """Return the columns of measured errors.

    Args:
        step: The load step.
        found: Its errors.
    """
    _, *others = sum(found.by_cause.values(), np.zeros(1)).tolist()
    columns = {
        "force_error_N": 0.0 if step.by_force else finite(found.force),
        "approach_error_mm": finite(found.approach) if step.by_force else 0.0,
        "errors": tuple(found.parts.items()),
        **{name: finite(error) for name, error in zip(ERRORS_OF.values(), others, strict=False)},
        **(shear_error_columns(step, found.shear) if found.shear else {}),
        **(worn_error_columns(step, found.worn) if found.worn else {}),
    }
    if (area := columns.get(ERRORS_OF[AREA])) is not None:
        touching = step.contact_area_fraction  # and at most all of the face, at least nothing
        columns[ERRORS_OF[AREA]] = min(area, max(touching, 1.0 - touching))
    if len(others) > len(ERRORS_OF):
        area, gap, *shares = others
        if not step.by_force and found.force > step.force_N:  # it may not touch at all
            shares = [math.inf]
        errors = stiffness_errors(step, shares, area, gap)
        columns |= {name: finite(error) for name, error in errors.items()}
    return columns


def worn_error_columns(step: LoadStep, parts: Mapping[str, Array]) -> dict[str, Any]:
    """Return the columns of errors of what has worn off.

    Args:
        step: The load step.
        parts: Errors by cause, see `MeasuredErrors.worn`.
    """
    mean, largest = map(finite, sum(parts.values(), np.zeros(2)))
    depth = step.mean_worn_depth_mm or 0.0
    if mean is not None and mean < _ROUNDING * depth:
        mean = 0.0
    area = (step.worn_volume_mm3 or 0.0) / depth if depth else 0.0
    return {
        "worn_volume_error_mm3": None if mean is None else area * mean,
        "mean_worn_depth_error_mm": mean,
        "worn_depth_error_mm": largest,
    }


def stiffness_errors(
    step: LoadStep, shares: Sequence[float], area_error: float, gap_error: float
) -> dict[str, float]:
    """Return errors of stiffnesses and of conductances, by their columns.

    Contacts conduct in proportion to the stiffness. What gaps conduct changes with mean gap and
    open area, and with the cells next to contacts, where a load step knows by how much.

    Args:
        step: The load step.
        shares: Relative errors of the interface's stiffness by other causes than its scatter, of
            what contacts conduct, and of the stiffness against the approach; one for all.
        area_error: Error of the contact area fraction.
        gap_error: Error of the mean separation [mm].
    """
    own, conducts, whole = np.broadcast_to(shares, 3).tolist()
    errors: dict[str, float] = {}
    scatter = step.stiffness_scatter or 0.0
    if (stiffness := step.interface_stiffness_N_per_mm) is not None:
        errors["interface_stiffness_error_N_per_mm"] = (own + scatter) * abs(stiffness)
    if (stiffness := step.approach_stiffness_N_per_mm) is not None:
        errors["approach_stiffness_error_N_per_mm"] = (whole + scatter) * abs(stiffness)
    if (electrical := step.electrical_conductance_S) is not None:
        errors["electrical_conductance_error_S"] = conducts * electrical
    if (thermal := step.thermal_conductance_W_per_K) is not None:
        gaps = step.gap_conductance_W_per_K or 0.0
        through = step.gap_conductance_error_W_per_K or 0.0
        if gaps:
            is_open = 1.0 - step.contact_area_fraction
            through += gaps * (gap_error / step.mean_separation_mm + area_error / is_open)
        errors["gap_conductance_error_W_per_K"] = through
        errors["thermal_conductance_error_W_per_K"] = conducts * (thermal - gaps) + through
    return errors


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


def _causes_text(errors: Sequence[tuple[str, float]], unit: str) -> tuple[str, str]:
    """Return the sum of errors, and errors by cause, in one unit."""
    sizes = [error for _, error in errors]
    whole, *parts = quantities((sum(sizes), *sizes), unit, 2)
    causes = (
        f"{cause} {text if math.isfinite(error) else 'not measured'}"
        for (cause, error), text in zip(errors, parts, strict=True)
    )
    return whole, ", ".join(causes)


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
    size, causes = _causes_text(step.errors, "N")
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
        text += f"within {size}"
    gap, approach = step.mean_separation_error_mm or 0.0, step.approach_error_mm or 0.0
    gap_text, approach_text = quantities((gap, approach), "mm", 2)
    if approach:
        text += f", and under its force the approach within {approach_text}"
    further = []
    if step.contact_area_fraction_error is not None:
        share_of_face = percent(step.contact_area_fraction_error)
        further.append(f"the contact area is within {share_of_face} of the face")
    if gap:
        further.append(f"the mean gap within {gap_text}")
    if step.worn_depth_error_mm:
        further.append(f"the worn depth within {quantity(step.worn_depth_error_mm, 'mm', 2)}")
    if step.interface_stiffness_error_N_per_mm and step.interface_stiffness_N_per_mm:
        off = step.interface_stiffness_error_N_per_mm / step.interface_stiffness_N_per_mm
        further.append(f"the stiffness of the interface within {percent(off)}")
    yield f"{text}{share}: {causes}" + "; " * bool(further) + ", ".join(further)


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
    within, causes = _causes_text(step.shear_errors, unit)
    share = f" ({percent(whole / size)})" if size else ""
    known = f"is within {within}{share}" if math.isfinite(whole) else "has no stated error"
    names = "at its shift the shear force", "under its shear force the shift"
    text = f"measured at load step {step.step}: {names[not step.by_shift]} {known}: {causes}"
    yield text if math.isfinite(whole) else Caution(text)
