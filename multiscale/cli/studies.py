"""The commands on several runs, sweep and compare, and the files that studies write."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from patchlaw.multiscale import console
from patchlaw.multiscale.cli.command_line import COMPARE_ENDING, SWEEP_ENDING
from patchlaw.multiscale.cli.execution import refuse_other_kind, scene_and_folder
from patchlaw.multiscale.console import following
from patchlaw.multiscale.results.files import table_files, write_files
from patchlaw.multiscale.runs import comparison as comparisons
from patchlaw.multiscale.runs.cases import CaseResult, Journal
from patchlaw.multiscale.runs.comparison import Comparison, compare
from patchlaw.multiscale.runs.configurations import Configuration
from patchlaw.multiscale.runs.difference import Difference, difference
from patchlaw.multiscale.runs.output.figures import Drawing, file_kinds, pictures_of
from patchlaw.multiscale.runs.output.report import filled
from patchlaw.multiscale.runs.output.results_folder import locked
from patchlaw.multiscale.runs.sweep import (
    Statistics,
    SweepResults,
    sweep,
    sweep_cases,
    values_from_text,
)
from patchlaw.multiscale.scene.scene import read_files
from patchlaw.support import InputError, NotConverged, on_root, place_in
from patchlaw.support.files import OwnFiles, remove
from patchlaw.support.readable import counted, duration, percent
from patchlaw.support.readable import number as readable_number

_OF_SWEEPS = ("cases.csv", "history.csv", "statistics.csv", "sweep.png", "sweep.svg")
_OF_DIFF = ("diff.csv", "diff.png", "over_pressure.png", "diff.html")
_OF_COMPARE = ("compare.csv", "pareto.png", "pareto.svg", "report.html")
"""Files of the results of the commands."""
_ELSEWHERE = "another folder, or the file moved away"


def sweep_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene for many values of its keys; write all load steps and their statistics.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, folder = scene_and_folder(choice, comm, ending=SWEEP_ENDING)
    vary = dict(values_from_text(text) for text in choice.vary)
    part = choice.part or slurm_part()
    # --overwrite removes the cases of all parts, of which none may be running
    with locked(folder, comm, shared=not choice.overwrite) as lock:
        # values may be files that cases read
        given = {scene.path_of(one) for of in vary.values() for one in of if isinstance(one, str)}
        inputs = [*read_files(scene), *filter(None, given)]
        refuse = partial(OwnFiles(folder).refuse_others, _OF_SWEEPS, inputs)
        on_root(comm, lambda: refuse(overwrite=choice.overwrite))
        if choice.overwrite:
            on_root(comm, lambda: _remove_results(folder))
            on_root(comm, lock.share)
        else:
            on_root(comm, lambda: refuse_other_kind(folder, cases=True))
        cases = on_root(comm, lambda: len(sweep_cases(scene, vary)))
        ranks = part[1] * place_in(comm)[1]
        console.say(comm, f"{counted(cases, 'case')} on {counted(ranks, 'rank')}")
        done = sweep(scene, vary, comm, folder=folder, part=part, progress=True)
        known = None
        # a part that ended meanwhile may have written its tables before these, which lack its cases
        while known is None or known.unfinished > done.unfinished:
            known = done
            files = on_root(comm, partial(_write_sweep, folder, done, scene.output.figures))
            if done.unfinished:
                done = sweep(scene, vary, comm, folder=folder, part=part)
    for text in _summary(done):
        console.say(comm, text)
    console.show_notes(comm, done.warnings)
    console.show_files(comm, files)
    if done.unfinished:
        console.say(comm, f"{done.unfinished} of {len(done)} cases are left to other parts")
    if failures := done.failures:
        name, reason = next(iter(failures.items()))
        raise NotConverged(
            f"{len(failures)} of {len(done)} cases, the first with {name}: {reason}",
            reason="CASES_FAILED",
            iterations=0,
            remedy="cases.csv has the reason of each",
        )


def slurm_part() -> tuple[int, int]:
    """Return the part of the sweep that a task of a Slurm array runs; the whole outside of one.

    Raises:
        InputError: When the variables are no whole numbers, or the array is not evenly spaced, of
            which Slurm says too little.
    """
    names = [f"SLURM_ARRAY_TASK_{name}" for name in ("ID", "MIN", "COUNT", "MAX", "STEP")]
    stated = {name: os.environ[name].strip() for name in names if name in os.environ}
    if not set(names[:3]) <= stated.keys():
        return 1, 1
    for name, text in stated.items():
        if not (text.isascii() and text.isdecimal() and len(text) < 10):
            raise InputError("is no whole number", key=name, value=text, allowed="what Slurm sets")
    task, first, count, *_ = (int(stated[name]) for name in names[:3])
    step = int(stated.get(names[4], 1))
    last = int(stated.get(names[3], first + (count - 1) * step))
    tasks = range(first, last + 1, max(step, 1))
    if step < 1 or len(tasks) != count or task not in tasks:
        raise InputError(
            "is no task of an evenly spaced array",
            key=names[0],
            value=", ".join(f"{name} {text}" for name, text in stated.items()),
            allowed="an array such as 1-8; or --part K/N",
        )
    return tasks.index(task) + 1, count


def _remove_results(folder: Path) -> None:
    for path in Journal(folder, {}).files():
        remove(path)
    OwnFiles(folder).remove(_OF_SWEEPS)


def _write_sweep(folder: Path, done: SweepResults, figures: bool | str) -> list[Path]:
    """Write the tables and the figure of the cases that are done."""
    statistics = done.statistics_records() if _statistics(done) else []
    tables = {"cases": done.case_records(), "history": done.records(), "statistics": statistics}
    drawing = Drawing("sweep", "figures.studies.sweep_figure", (done,), file_kinds(figures))
    return write_study(folder, tables, [drawing] if figures and statistics else [])


def _summary(done: SweepResults) -> Iterator[str]:
    """Yield a line on the last load step of each ensemble."""
    yield f"{len(done) - done.unfinished} of {len(done)} cases are done"
    for values, part in _statistics(done)[:20]:  # the files hold all of them
        said = "".join(f"{key} = {value}, " for key, value in values.items())
        force, approach = _spread(part, "force_N"), _spread(part, "approach_mm", 1e3)
        yield f"{said}at last: force {force} N, approach {approach} µm"


def _spread(part: Statistics, column: str, scale: float = 1.0) -> str:
    """Return a mean and, where the cases of an ensemble differ, the band about it."""
    low, middle, high = (scale * part.of(column, name)[-1] for name in ("low", "mean", "high"))
    same = high - low <= 1e-6 * abs(middle)
    return f"{middle:.4g}" if same else f"{middle:.4g} (5 to 95 %: {low:.4g} … {high:.4g})"


def _statistics(done: SweepResults) -> list[tuple[dict[str, Any], Statistics]]:
    """Return the statistics of ensembles; none before all are done, or where steps were halved."""
    try:
        return [] if done.unfinished else [one for one in done.statistics if len(one[1].values)]
    except InputError:
        return []


def compare_any(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene in every sensible configuration, or set the results of two runs side by side.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if options:
        raise InputError("comparisons take no PETSc options", key="--", value=" ".join(options))
    two = choice.other is not None
    for name, of_two in (("against", False), ("set", False), ("at", True)):
        if (value := getattr(choice, name)) and of_two != two:
            allowed = "patchlaw compare RESULTS RESULTS" if of_two else "patchlaw compare SCENE"
            raise InputError("does not go with that", key=f"--{name}", value=value, allowed=allowed)
    (compare_results if two else compare_scene)(choice, comm)


def compare_results(choice: argparse.Namespace, comm: Any) -> None:
    """Set the results of two runs side by side; write curves, ratios and a page.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator; None for a process on its own.
    """
    both = on_root(comm, lambda: difference(choice.scene, choice.other, at=choice.at))
    joined = "-".join(name.replace("/", "-") for name in both.names)
    folder = choice.out or Path("results") / f"{joined}{COMPARE_ENDING}"
    with locked(folder, comm):
        on_root(comm, lambda: OwnFiles(folder).refuse_others(_OF_DIFF, allowed=_ELSEWHERE))
        files = on_root(comm, lambda: _write_difference(folder, both))
    console.show_table(comm, both.table())
    if len(both.loads) > 1:
        console.say(comm, f"ratios, {both.names[1]} over {both.names[0]}:")
        console.show_table(comm, both.load_table(most=12))
    console.show_notes(comm, both.notes)
    show_study(choice, comm, files)


def _write_difference(folder: Path, both: Difference) -> list[Path]:
    """Write ``diff.csv``, ``diff.png``, ``over_pressure.png`` and ``diff.html``."""
    drawings = [Drawing("diff", "figures.studies.difference_figure", (both,))]
    if (at_pressures := both.over_pressure) is not None:
        what = "figures.studies.difference_over_pressure_figure"
        drawings.append(Drawing("over_pressure", what, (at_pressures,)))
    title = f"patchlaw compare: {both.names[0]}, {both.names[1]}"

    def page(pictures: Mapping[str, bytes]) -> str:
        return filled("runs/difference.jinja", title=title, both=both, pictures=pictures)

    return write_study(folder, {"diff": both.records()}, drawings, "diff", page)


def write_study(
    folder: Path,
    tables: Mapping[str, Iterable[Mapping[str, Any]]],
    drawings: Sequence[Drawing],
    name: str = "",
    page: Callable[[Mapping[str, bytes]], str] | None = None,
) -> list[Path]:
    """Write tables, figures, and a page that shows them.

    Args:
        folder: Folder of the results; made when missing.
        tables: Rows of the tables by name.
        drawings: The figures.
        name: Name of the page.
        page: Makes the page from the files of the figures; None for no page.

    Returns:
        The files written.
    """
    drawn = [pictures_of(one) for one in drawings]
    for problem in dict.fromkeys(one.problem for one in drawn if one.problem):
        console.say(None, problem)
    pictures = dict(chain.from_iterable(one.files.items() for one in drawn))
    files: list[tuple[str, str | bytes]] = [*table_files(tables), *pictures.items()]
    if page is not None:
        files.append((f"{name}.html", page(pictures)))
    return write_files(folder, files, [one for one, _ in files])


def show_study(choice: argparse.Namespace, comm: Any, files: list[Path]) -> None:
    """Print where results are, and open the page where that is asked for.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator, or None.
        files: The files written.
    """
    console.show_files(comm, files)
    if choice.open:
        console.open_page(comm, files)


def compare_scene(choice: argparse.Namespace, comm: Any) -> None:
    """Run a scene in every sensible configuration; draw error against time.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator; None for a process on its own.
    """
    scene, folder = scene_and_folder(choice, comm, ending=COMPARE_ENDING)
    with locked(folder, comm) as lock:
        refuse = partial(OwnFiles(folder).refuse_others, _OF_COMPARE, read_files(scene))
        on_root(comm, lambda: refuse(allowed=_ELSEWHERE))
        on_root(comm, lambda: refuse_other_kind(folder, cases=True))
        on_root(comm, lock.share)  # with what `compare` takes
        with following(comm) as (at, ended):

            def observe(one: Configuration, result: CaseResult) -> None:
                spent = duration(result.measured["seconds"]) if result.measured else ""
                why = f": {result.failure}" if result.failure else ""
                ended(f"{spent:>12}  {one.name}: {result.status}{why}")

            done = compare(
                scene, comm, against=choice.against, folder=folder, observe=observe,
                begun=lambda one: at(one.name),
            )  # fmt: skip
        files = on_root(comm, lambda: write_comparison(folder, done, scene.output.figures))
        for text in (*headline(done), *frontier_lines(done), *done.warnings):
            console.say(comm, text)
        show_study(choice, comm, files)
    if done.measure is None or (choice.against and done.against != choice.against):
        raise NotConverged(
            f"the comparison against {choice.against or 'anything'}",
            reason="MEASURE_NOT_REACHED",
            iterations=0,
            remedy="the table says why each configuration has no result",
        )


def write_comparison(
    folder: Path, comparison: Comparison, figures: bool | str = True
) -> list[Path]:
    """Write ``compare.csv``, the figure and ``report.html``.

    Args:
        folder: Folder of the results; made when missing.
        comparison: The comparison.
        figures: The scene's `output.figures`, "svg" for a figure in this form too.

    Returns:
        The files written.
    """
    drawings: list[Drawing] = []
    if comparison.measure is not None:
        what = "figures.studies.comparison_figure"
        drawings = [Drawing("pareto", what, (comparison,), file_kinds(figures))]
    tables = {"compare": comparison.records()}
    return write_study(
        folder, tables, drawings, "report", lambda drawn: comparison_html(comparison, drawn)
    )


def comparison_html(comparison: Comparison, pictures: Mapping[str, bytes]) -> str:
    """Return the report: a complete HTML document that needs no network.

    Args:
        comparison: The comparison.
        pictures: Files of the figure by name, ``pareto.png``.
    """
    return filled(
        "runs/comparison.jinja",
        title=f"patchlaw compare: {comparison.scene}",
        comparison=comparison,
        records=comparison.records(),
        numbers={row.name: number for number, row in enumerate(comparison.rows, 1)},
        frontier_names=[row.name for row in comparison.frontier()],
        headline=headline(comparison),
        frontier_lines=list(frontier_lines(comparison)),
        pictures=pictures,
        number=readable_number,
        percent=percent,
        definitions=(comparisons.__doc__ or "").strip(),
    )


def headline(comparison: Comparison) -> Iterator[str]:
    """Yield sentences on the number of configurations that were run, and on the measure.

    Args:
        comparison: The comparison.
    """
    done = sum(row.status == "done" for row in comparison.rows)
    yield f"{done} of {len(comparison)} configurations were run to the end of the load."
    if comparison.measure is None:
        return
    bars = {
        f"{comparison.response}_max": f"of the {comparison.response}",
        "area_max": "of the contact area",
        "distribution": "of the mean pressure in the distribution of pressures",
    }
    own = comparison.uncertainty
    known = ", ".join(f"{percent(own[bar])} {of}" for bar, of in bars.items() if own[bar] > 0)
    yield (
        f"They are compared with “{comparison.measure}”, whose own uncertainty is "
        f"{known or 'not known'}."
    )


def frontier_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line on each configuration of the frontier: its time and its error.

    Args:
        comparison: The comparison.
    """
    bar = comparison.uncertainty[f"{comparison.response}_max"]
    for row in comparison.frontier():
        size = comparison.error(row)
        less = "no more than the uncertainty of the measure, " if size <= bar else ""
        yield f"{duration(row.seconds)}: error {less}{percent(size)}: {row.name}"
