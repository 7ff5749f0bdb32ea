"""What a run is predicted to take and to err by, and how that compares with what came out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from multiscale.planning.costs import peak_memory, predicted_cost
from multiscale.planning.decision import ALL, bound_text
from multiscale.planning.expected_errors import expected_errors, slope_effect
from multiscale.planning.machine import this_machine
from multiscale.stage import Stage


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """Predictions of a run, made before anything expensive.

    Attributes:
        seconds: Time of each phase on one core [s].
        memory: Largest memory of a process [B].
        errors: Bounds of the relative error of the force by cause.
        slopes: Part of the force that finite slopes take, an estimate, outside of the errors; 0
            in a reference, which has them.
        accuracy: Relative error of the force that the scene asks for; None when it does not.
    """

    seconds: Mapping[str, float]
    memory: float
    errors: Mapping[str, float]
    slopes: float
    accuracy: float | None

    @property
    def error(self) -> float:
        """Bound of the relative error of the force."""
        return sum(self.errors.values())

    @property
    def total(self) -> float:
        """Time of all phases [s]."""
        return sum(self.seconds.values())

    @property
    def broken_promise(self) -> str | None:
        """Say that the accuracy cannot be promised; None where it can, or none is asked for."""
        if self.accuracy is None or self.error <= self.accuracy:
            return None
        largest = max(self.errors, key=lambda cause: self.errors[cause])
        off = "as much as it is" if self.error >= ALL else bound_text(self.error)
        return (
            f"an accuracy of {100 * self.accuracy:.3g} % cannot be promised: the force may be off "
            f"by {off}, most of it by the {largest}"
        )


def forecast(stage: Stage) -> Forecast:
    """Predict what a run takes and errs by.

    Args:
        stage: The scene's ingredients.
    """
    cost = predicted_cost(stage, this_machine())
    accuracy = stage.scene.accuracy
    if accuracy is None and stage.decision is not None:
        accuracy = stage.decision.accuracy
    return Forecast(
        seconds=cost.seconds,
        memory=cost.memory,
        errors=expected_errors(stage),
        slopes=0.0 if stage.meshes else slope_effect(stage.surface),
        accuracy=accuracy,
    )


def forecast_statements(made: Forecast) -> Iterator[tuple[str, str]]:
    """Yield topics and sentences of a forecast.

    Args:
        made: The forecast.
    """
    phases = ", ".join(f"{phase} {seconds:.2g}" for phase, seconds in made.seconds.items())
    yield (
        "cost",
        f"about {made.total:.2g} s on one core ({phases}) and {made.memory / 1e6:.0f} MB",
    )
    causes = ", ".join(f"{cause} {bound_text(error)}" for cause, error in made.errors.items())
    limit = " of the small-slope limit" if made.slopes else ""
    text = f"the force, at a given approach, within {bound_text(made.error)}{limit} ({causes})"
    if made.error >= ALL:
        text = f"no accuracy can be told: the force may be off by as much as it is ({causes})"
    if made.slopes:
        text += f"; finite slopes, which stay outside, take about {100 * made.slopes:.2g} %"
    yield "error", text


def comparison(made: Forecast, seconds: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Return rows of what, predicted and real: times of the phases, their sum, memory.

    Args:
        made: The forecast.
        seconds: Real wall time of the phases [s].
    """
    names = [*made.seconds, *(phase for phase in seconds if phase not in made.seconds)]
    rows = [
        (f"{name} [s]", _number(made.seconds.get(name)), _number(seconds.get(name)))
        for name in names
    ]
    real = sum(seconds.get(name, 0.0) for name in made.seconds)
    rows.append(("what was predicted [s]", f"{made.total:.2f}", f"{real:.2f}"))
    rows.append(("memory [MB]", f"{made.memory / 1e6:.0f}", f"{peak_memory() / 1e6:.0f}"))
    return rows


def _number(seconds: float | None) -> str:
    return "–" if seconds is None else f"{seconds:.2f}"
