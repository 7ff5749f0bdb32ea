"""What was taken for the auto values of a scene, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A way to compute a scene.

    Attributes:
        label: The coupling, and the cells, meshes or micro model that it works on.
        seconds: Predicted time of the run [s].
    """

    label: str
    seconds: float

    @property
    def text(self) -> str:
        """The alternative in words."""
        return f"{self.label}, in about {self.seconds:.2g} s"


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was taken, the errors that were measured for it, and what else there was.

    Attributes:
        accuracy: Relative error of the force that was requested.
        taken: What was taken.
        errors: Measured errors of the force by cause, relative to it, at the load where they are
            worst; empty where they cannot be measured beforehand.
        others: What was predicted to take longer, or could not keep the accuracy.
        missed: Errors by cause of what was tried first and could not keep the accuracy, if any.
    """

    accuracy: float
    taken: Alternative
    errors: Mapping[str, float]
    others: tuple[Alternative, ...] = ()
    missed: Mapping[str, float] = field(default_factory=dict)

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
        """What was taken, what was measured for it, and what else there was."""
        parts = [
            self.taken.text,
            f"an accuracy of {100 * self.accuracy:.3g} % is asked for, {_listed(self.errors)}",
        ]
        if self.missed:
            parts.append(f"without meshing the roughness {_listed(self.missed)}")
        if self.others:
            parts.append(f"instead, {'; '.join(each.text for each in self.others)}")
        return "; ".join(parts)

    @property
    def warning(self) -> str | None:
        """A warning that the accuracy is not kept; None where it is, or is not known beforehand."""
        if self.kept or not self.errors:
            return None
        largest = max(self.errors, key=lambda cause: self.errors[cause])
        return (
            f"an accuracy of {100 * self.accuracy:.3g} % is not kept: measured at the largest "
            f"load, the force may be off by {100 * self.error:.2g} %, most of it by {largest}"
        )


def _listed(errors: Mapping[str, float]) -> str:
    if not errors:
        return "which is not measured beforehand"
    causes = ", ".join(f"{cause} {100 * error:.2g} %" for cause, error in errors.items())
    return f"measured at the largest load {100 * sum(errors.values()):.2g} % ({causes})"
