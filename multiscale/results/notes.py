"""What a report says of load steps: their accuracy, yielding and pressures, their energies.

Theory of yielding: docs/theory.md, section 14.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from multiscale.loading.energy import BALANCE, missing_energy
from multiscale.loading.load_step import LoadStep
from multiscale.readable import Caution, number, percent, quantity


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
        largest = max(self.causes, key=lambda cause: self.causes[cause], default="")
        most = f", most of it by {largest}" * bool(largest)
        return Caution(
            f"the {asked} is not kept: measured at load step {self.step}, the force may be off by "
            f"{found}{most}"
        )


def relative_error(step: LoadStep, *, by_force: bool) -> float | None:
    """Return the measured error of a load step relative to its force; None where it has none.

    Args:
        step: The load step, under a force.
        by_force: Whether the force is prescribed. The error of a reference is then that of the
            approach, whose power 3/2 the force grows with.
    """
    if step.errors:
        return sum(error for _, error in step.errors) / step.force_N
    if not by_force:
        return None if step.force_error_N is None else step.force_error_N / step.force_N
    if step.approach_error_mm is None or not step.approach_mm:
        return None
    return 1.5 * step.approach_error_mm / abs(step.approach_mm)


def verdict(
    steps: Sequence[LoadStep], accuracy: float | None, unknown: str, *, by_force: bool
) -> AccuracyVerdict | None:
    """Return whether load steps keep an accuracy; None where none was asked for.

    Args:
        steps: The load steps, with the errors that were measured.
        accuracy: Relative error of the force that was asked for, or None.
        unknown: Why errors are not measured; empty where they should have been.
        by_force: Whether the force is prescribed.
    """
    if accuracy is None:
        return None
    loaded = [step for step in steps if step.force_N > 0.0]
    if not loaded:
        return AccuracyVerdict(requested=accuracy, unknown="no load step has a force")
    decisive = (loaded[-1], max(loaded, key=lambda step: step.force_N))
    found = [(relative_error(step, by_force=by_force), step) for step in decisive]
    known = [(error, step) for error, step in found if error is not None]
    if unknown or not known:
        why = unknown or "the errors of its load steps were not measured"
        return AccuracyVerdict(requested=accuracy, unknown=why)
    error, step = max(known, key=lambda each: each[0])
    causes = {cause: part / step.force_N for cause, part in step.errors}
    if error == math.inf:
        largest = max(causes, key=lambda cause: causes[cause])
        why = f"the error by {largest} could not be measured at load step {step.step}"
        return AccuracyVerdict(requested=accuracy, step=step.step, unknown=why)
    return AccuracyVerdict(requested=accuracy, error=error, step=step.step, causes=causes)


def yielding_notes(steps: Sequence[LoadStep], hardness: float | None) -> Iterator[str]:
    """Yield what has yielded or, of elastic contacts, what would bear their pressures.

    Args:
        steps: The load steps.
        hardness: Largest contact pressure [MPa]; None for elastic contacts.
    """
    if hardness is None:
        yield from _strength_notes(steps)
        return
    known = [step for step in steps if step.plastic_depth_mm is not None]
    if not known:
        yield (
            f"hardness {quantity(hardness, 'MPa')}: the laws are those of rising loads; no plastic "
            "depth stands behind them"
        )
        return
    last = known[-1]
    volume = (last.plastic_work_mJ or 0.0) / hardness
    most = max(known, key=lambda step: step.yielding_area_fraction or 0.0)
    depth = quantity(last.plastic_depth_mm or 0.0, "mm")
    yield (
        f"hardness {quantity(hardness, 'MPa')}: after load step {last.step} a plastic volume of "
        f"{number(1e9 * volume)} µm³ and a depth of up to {depth} are left; at most "
        f"{percent(most.yielding_area_fraction or 0.0, 3)} of the nominal area bears the "
        f"hardness, at load step {most.step}"
    )


def _strength_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the largest and the mean pressure of elastic contacts, and what bears them."""
    known = [step for step in steps if step.peak_pressure_MPa and step.contact_area_fraction]
    if not known:
        return
    step = max(known, key=lambda each: each.peak_pressure_MPa or 0.0)
    peak = step.peak_pressure_MPa or 0.0
    mean = step.mean_pressure_MPa / step.contact_area_fraction
    least, most = 2.8, 3.0  # hardness over yield strength of metals, Tabor 1951, ch. 3
    yield (
        f"elastic contacts: pressures up to {quantity(peak, 'MPa', 3)}, in the mean of the real "
        f"contact area {quantity(mean, 'MPa', 3)}, at load step {step.step}. A hardness above the "
        "first bears them without yielding, that is a yield strength of "
        f"{quantity(peak / most, 'MPa', 3)} to {quantity(peak / least, 'MPa', 3)} (hardness is 2.8 "
        "to 3 times the yield strength: Tabor 1951); for less, state micro.hardness"
    )


def energy_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the energies at the last load step, and a warning where they are not balanced.

    Args:
        steps: The load steps.
    """
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    if not known:
        return
    last, elastic = known[-1], known[-1].elastic_energy_mJ or 0.0
    plastic = (
        f", plastic work {quantity(last.plastic_work_mJ, 'mJ')}" if last.plastic_work_mJ else ""
    )
    work = "" if last.work_mJ is None else f", work of the plane {quantity(last.work_mJ, 'mJ')}"
    yield (
        f"energies at load step {last.step}: elastic {quantity(elastic, 'mJ')}{plastic}"
        f"{work} (trapezoidal rule between load steps)"
    )
    missing = missing_energy(known)
    if missing > BALANCE:
        yield Caution(
            f"warning: energies are not balanced: {percent(missing)} of the largest is missing "
            "between two load steps; finite slopes of steep surfaces may be the cause "
            "(micro.finite_slopes = false leaves them out)"
        )
