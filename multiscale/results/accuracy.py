"""Whether load steps keep the accuracy that was asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import Caution, percent


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
    steps: Sequence[LoadStep], accuracy: float | None, unknown: str, history: LoadHistory
) -> AccuracyVerdict | None:
    """Return whether load steps keep an accuracy; None where none was asked for.

    Args:
        steps: The load steps, with the errors that were measured.
        accuracy: Relative error of the force that was asked for, or None.
        unknown: Why errors are not measured; empty where they should have been.
        history: What was prescribed.
    """
    if accuracy is None:
        return None
    loaded = [step for step in steps if step.force_N > 0.0]
    if not loaded:
        return AccuracyVerdict(requested=accuracy, unknown="no load step has a force")
    by_force = history.quantity_in(steps[-1].stage) == "force"
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
        largest = max(self.errors, key=lambda cause: self.errors[cause])
        if self.error == math.inf:
            return (
                f"whether an accuracy of {100 * self.accuracy:.3g} % is kept is not known: the "
                f"error by {largest} could not be measured at the largest load"
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


def _most_of_it(causes: Mapping[str, float]) -> str:
    """Return which cause errs most, and what lessens it where refinement does not."""
    if not causes:
        return ""
    largest = max(causes, key=lambda cause: causes[cause])
    remedy = _REMEDIES.get(largest)
    return f", most of it by {largest}" + (f", {remedy}" if remedy else "")


def _listed(errors: Mapping[str, float]) -> str:
    if not errors:
        return "which is not measured beforehand"
    if math.inf in errors.values():
        largest = max(errors, key=lambda cause: errors[cause])
        return f"which is not known: the error by {largest} could not be measured"
    causes = ", ".join(f"{cause} {100 * error:.2g} %" for cause, error in errors.items())
    return f"measured at the largest load {100 * sum(errors.values()):.2g} % ({causes})"
