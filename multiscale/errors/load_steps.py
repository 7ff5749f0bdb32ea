"""Measures the errors of load steps as they are accepted, and says what they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from geometry.collective import on_root
from micro import HalfSpaceModel
from multiscale.couplings.blocks import SLOPES, OnBody
from multiscale.errors.measured import ErrorProbe, MeasuredErrors
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import LoadHistory
from multiscale.setup.problem import ProblemSetup


def error_probe(setup: ProblemSetup, body: OnBody) -> ErrorProbe:
    """Return what measures the errors of a scene's load steps.

    Args:
        setup: The scene's ingredients, with a half-space model.
        body: Puts this model on the scene's body, see `on_body`.
    """
    assert isinstance(setup.model, HalfSpaceModel)
    return ErrorProbe(
        model=setup.model,
        on_body=body,
        order=SLOPES if setup.finite_slopes else 0,
        by_laws=setup.uses_laws,
    )


def checked(step: LoadStep, probe: ErrorProbe, load_history: LoadHistory, comm: Any) -> LoadStep:
    """Return a load step with its errors measured; rank 0 solves for all.

    Args:
        step: The load step.
        probe: What measures.
        load_history: What is prescribed of the plane.
        comm: MPI communicator; None for this process alone.

    Raises:
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    by_force = load_history.quantity == "force"

    def measure() -> MeasuredErrors:
        return probe.measure(
            step.force_N,
            step.approach_mm,
            step.tilt,
            turns=load_history.tilt is None,
            stiffness=by_force,
        )

    found = on_root(comm, measure)
    return replace(
        step,
        force_error_N=0.0 if by_force else found.force,
        approach_error_mm=found.approach if by_force else 0.0,
        errors=tuple(found.parts.items()),
    )


def error_notes(steps: list[LoadStep], accuracy: float | None) -> Iterator[str]:
    """Yield what the errors of the last load step that has any are, and whether they are too large.

    Args:
        steps: The load steps.
        accuracy: Relative error of the force that was asked for; None when it was not.
    """
    measured = [step for step in steps if step.errors]
    if not measured:
        return
    step = measured[-1]
    whole = sum(error for _, error in step.errors)
    share = f" ({100 * whole / step.force_N:.2g} %)" if step.force_N else ""
    causes = ", ".join(f"{cause} {error:.2g} N" for cause, error in step.errors)
    text = f"measured at load step {step.step}: at its approach the force is within {whole:.2g} N"
    if step.approach_error_mm:
        text += f", and under its force the approach within {1e3 * step.approach_error_mm:.2g} µm"
    yield f"{text}{share}: {causes}"
    if accuracy is not None and whole > accuracy * step.force_N:
        largest = max(step.errors, key=lambda each: each[1])[0]
        yield (
            f"an accuracy of {100 * accuracy:.3g} % was asked for, and the last load step keeps "
            f"{100 * whole / step.force_N:.2g} %, most of it by {largest}"
        )
