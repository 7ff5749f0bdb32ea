"""The readable report of a run: one HTML page that needs no network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from multiscale.results.history import History, with_error
from multiscale.results.html_page import Section, page_html


def report_html(
    *,
    title: str,
    statements: Iterable[tuple[str, str]],
    warnings: Sequence[str],
    history: History,
    figures: Mapping[str, bytes],
) -> str:
    """Compose the page.

    Args:
        title: Heading.
        statements: Topics and sentences of the plan.
        warnings: Sentences on the validity of the results.
        history: The run.
        figures: PNG images by caption; they become part of the page.

    Returns:
        A complete HTML document.
    """
    times = [(phase, f"{seconds:.2f}") for phase, seconds in history.seconds.items()]
    return page_html(
        title,
        [
            Section(paragraphs=[_headline(history)], warnings=warnings),
            Section(
                heading="What was done",
                table=(("topic", "what"), list(statements)),
                text_columns=(1,),
            ),
            Section(heading="Force–approach curve", table=history.table(), figures=figures),
            Section(heading="What it took", table=(("phase", "wall time [s]"), times)),
            *_errors(history),
            Section(notes=history.notes),
        ],
    )


def _errors(history: History) -> Iterator[Section]:
    """Yield a section with the latest errors that were measured, by cause."""
    measured = [step for step in history if step.errors]
    if not measured:
        return
    step, causes = measured[-1], dict(measured[-1].errors)
    causes["altogether"] = sum(causes.values())
    yield Section(
        heading=f"Error of the force by cause, measured at load step {step.step}",
        table=(
            ("cause", "force [N]", "of the force [%]"),
            [
                (name, f"{error:.2g}", f"{100 * error / step.force_N:.2g}" if step.force_N else "–")
                for name, error in causes.items()
            ],
        ),
    )


def _headline(history: History) -> str:
    if not len(history):
        return "No load step was accepted."
    last, record = history.steps[-1], history.reference
    error = "" if record is None else f" Discretisation error: {record.label}."
    approach = History.approach_mm.text(last)
    force = with_error(last.force_N, last.force_error_N, shown=".5g")
    return (
        f"At an approach of {approach} µm the plane carries {force} N "
        f"({last.mean_pressure_MPa:.4g} MPa) on {last.contacts} contacts covering "
        f"{100 * last.contact_area_fraction:.3g} % of the nominal area.{error}"
    )
