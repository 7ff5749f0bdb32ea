"""The commands on one scene or its results: run, plan, laws, surface, view."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from patchlaw.geometry.statistics import roughness
from patchlaw.multiscale import console
from patchlaw.multiscale.bodies.reader import BodyReader
from patchlaw.multiscale.cli.execution import refuse_other_kind, scene_and_folder
from patchlaw.multiscale.cli.interruption import Interruption, Stopped, watching
from patchlaw.multiscale.console import following, run_progress
from patchlaw.multiscale.machine import cluster_nodes, peak_memory
from patchlaw.multiscale.models import describe
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.setup import make_setup
from patchlaw.multiscale.results.files import write_files
from patchlaw.multiscale.runs.output.figures import (
    RunFigures,
    law_drawing,
    pictures_of,
    surface_drawing,
)
from patchlaw.multiscale.runs.output.results import FILES, write_fields, write_results
from patchlaw.multiscale.runs.output.results_folder import (
    FILE_NAME,
    CheckpointWriter,
    find_checkpoint,
    is_finished,
    locked,
    refuse_other_results,
)
from patchlaw.multiscale.runs.resolving import resolve
from patchlaw.multiscale.runs.scene_run import Checkpoint, Run
from patchlaw.multiscale.scene.memory import shortage_warnings
from patchlaw.multiscale.scene.scene import Scene, identity, read_files
from patchlaw.support.errors import InputError, NotConverged, NotInstalled, PatchlawError
from patchlaw.support.files import OwnFiles
from patchlaw.support.packages import optional_packages
from patchlaw.support.parallel import on_root, on_root_alone, place_in
from patchlaw.support.readable import ProgressObserver, unobserved


def run_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene; write history, laws, figures and report.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    with watching(comm, choice.max_time) as interruption:
        scene, folder = scene_and_folder(choice, comm)
        if scene.output.views:
            from patchlaw.multiscale.runs.output.view import load_viewer

            on_root(comm, load_viewer)  # what is missing is told before hours of a run
        with locked(folder, comm) as lock:
            kept, notice = on_root(comm, lambda: _earlier(choice, folder, scene))
            if choice.resume and kept is None and _is_finished(folder, scene, comm):
                console.say(comm, f"this run is finished; its results are in {folder}")
                if choice.open:
                    console.open_page(comm, sorted(folder.glob("report.html")))
                return
            with RunFigures(scene, comm) as figures:
                stated = scene.with_(kept.resolved) if kept else None
                with following(comm) as (at, _):
                    run = Run(scene, comm, stated, at)
                if kept is not None:
                    run.resume(kept)
                console.show_plan(comm, run.coupling)
                if notice:
                    console.say(comm, notice)
                with CheckpointWriter(folder, run, lock.hold) as checkpoints:
                    failure = _make_load_steps(run, checkpoints, figures, interruption)
                    if run.steps:
                        checkpoints.finish()  # writing results may fail
                    files = _write(folder, run, figures, failure, options)
                    if failure is not None:
                        raise failure
                    checkpoints.remove()
            if choice.open:
                console.open_page(comm, files)


_NOTHING = "nothing to resume in {}: begins with the first load step"


def _earlier(
    choice: argparse.Namespace, folder: Path, scene: Scene
) -> tuple[Checkpoint | None, str]:
    """Return the interrupted run of the same scene in a folder, and what to say of what is there.

    Nothing that another scene left there is replaced unless the user says so.
    """
    if not any(folder.iterdir()):
        return None, _NOTHING.format(folder) * choice.resume
    anew = choice.overwrite and not choice.resume
    OwnFiles(folder).refuse_others(FILES, read_files(scene), overwrite=anew)
    kept = None if anew else find_checkpoint(folder, scene)
    if kept is not None:
        how = "" if choice.resume else " (to begin anew: --overwrite)"
        return kept, f"goes on after load step {len(kept.steps)}, kept in {folder}{how}"
    if not choice.overwrite:
        refuse_other_results(folder, identity(scene))
        refuse_other_kind(folder, cases=False)
    if choice.resume:
        return None, _NOTHING.format(folder)
    interrupted = (folder / FILE_NAME).exists()
    return None, f"replaces the interrupted run in {folder}" * interrupted


def _is_finished(folder: Path, scene: Scene, comm: Any) -> bool:
    """Tell whether the results in a folder are those of a finished run of a scene, on all ranks."""
    return on_root(comm, lambda: is_finished(folder, identity(scene)))


def _make_load_steps(
    run: Run, checkpoints: CheckpointWriter, figures: RunFigures, interruption: Interruption
) -> PatchlawError | None:
    """Make the load steps with their checkpoints; return what ended them early, on all ranks."""
    load_history = run.scene.loading
    with run_progress(run.comm, load_history, len(run.steps)) as (advance, run.clock.observe):
        try:
            if run.coupling.scene.by_laws:
                run.make_laws()
            checkpoints.accept()
            figures.begin(run)
            interruption.check("before the block was made")
            with optional_packages():
                _ = run.coupling.model  # made here, before the time is checked again
            interruption.check(f"after load step {len(run.steps)}")
            for step in run.load_steps():
                checkpoints.accept(step)
                advance(step)
                if not run.finished:
                    interruption.check(f"after load step {step.step}", step.wall_s)
        except Stopped as error:  # the load steps before it are written
            return error
        except NotConverged as error:
            folder = checkpoints.path.parent
            return error.advised(
                f"a changed scene needs --overwrite, or another folder than {folder}"
            )
        except (InputError, NotInstalled):
            if not run.steps:  # wrong input leaves nothing behind
                checkpoints.remove()
            raise
    return None


def _write(
    folder: Path, run: Run, figures: RunFigures, failure: PatchlawError | None, options: list[str]
) -> list[Path]:
    """Write and show the results, also of a run that ended early; return their files."""
    comm, files = run.comm, list[Path]()
    if failure is not None and _is_finished(folder, run.given, comm):
        console.say(comm, f"the results of an earlier run to the end stay in {folder}")
    elif run.steps:
        run.finish()
        files = write_results(folder, run, options=options, figures=figures)
        if run.scene.output.fields:
            files += write_fields(folder, run)
        if run.scene.output.views:
            files += on_root(comm, partial(_write_views, folder))
        console.show_history(comm, run.history())
        console.show_times(comm, run.clock.times)
        console.show_files(comm, files)
    return files


def _write_views(folder: Path) -> list[Path]:
    """Write the pages of results; where there is nothing to show, say so."""
    from patchlaw.multiscale.runs.output.view import write_views

    try:
        return write_views(folder)
    except InputError as error:
        console.say(None, f"note: {error}")
        return []


_OF_LAWS = ("laws.h5", "laws.png", "laws.svg")
_OF_SURFACE = ("surface.png", "surface.svg")
"""Files of the results of the commands, without what laws are exported to."""


def plan_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Say what a run would do and why, and its memory; write no results.

    Keys without a value, as beside an accuracy, are chosen by errors of contact problems that are
    solved for it, as a run does first. Nothing else is solved.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, _ = scene_and_folder(choice, comm)
    memory, (_, ranks) = peak_memory(), place_in(comm)
    with following(comm) as (at, _):
        coupling = planned(scene, comm, at)
    needed = on_root_alone(comm, lambda: coupling.about.memory_statement(memory, ranks))
    shortages = list(shortage_warnings(coupling.about.memory_requests(), cluster_nodes(comm)))
    console.show_plan(comm, coupling, needed, shortages)


def planned(scene: Scene, comm: Any, observe: ProgressObserver = unobserved) -> Coupling:
    """Make the coupling of a scene, as if these nodes had any memory that it may take.

    Args:
        scene: The scene.
        comm: MPI communicator; None for a process on its own.
        observe: Told of the trials that an accuracy is chosen by.

    Note:
        Collective.
    """
    nodes, read = replace(cluster_nodes(comm), extensible=True), BodyReader()
    stated = resolve(scene, comm, nodes=nodes, read=read, observe=observe)
    return make_setup(stated, comm, nodes=nodes, read=read)


def tabulate_laws(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Tabulate the patch laws of a scene; write and draw them, and export them when asked to.

    Exports of earlier laws in the folder are removed.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    from patchlaw.multiscale.laws import export  # a run does without
    from patchlaw.multiscale.laws.law_table import law_bytes
    from patchlaw.multiscale.observers.interface import conducts_of

    export.check_name(choice.name)
    exported = partial(export.export_names, formats=choice.export)
    with _own_folder(choice, comm, _OF_LAWS, exported) as (scene, folder):
        scene.check_has_laws()
        with following(comm) as (at, _):
            run = Run(scene, comm, observe=at)
        console.show_plan(comm, run.coupling)
        with following(comm) as (run.clock.observe, _):
            run.make_laws()
        table = run.laws
        assert table is not None

        def write() -> list[Path]:
            conducts = conducts_of(run.coupling)
            exports: dict[str, str] = {}
            friction = run.scene.coefficients or None
            for name in choice.export:
                exports |= export.export_texts(
                    table, name, conducts=conducts, friction=friction, name=choice.name
                )
            export.remove_exports(folder)
            drawn = pictures_of(law_drawing(table, run.scene))
            run.remark(filter(None, [drawn.problem]))
            files = {"laws.h5": law_bytes(table), **drawn.files}
            write_files(folder, [*files.items(), *exports.items()], [*_OF_LAWS, *exports])
            names = dict.fromkeys([*files, *(Path(path).parts[0] for path in exports)])
            return [folder / name for name in names]

        console.show_files(comm, on_root(comm, write))
    console.show_notes(comm, run.history().notes)


def describe_surface(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Describe and draw the surface of a scene.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    with _own_folder(choice, comm, _OF_SURFACE) as (scene, folder):
        coupling = planned(scene, comm)
        console.show_pairs(comm, _surface_facts(coupling), coupling.parts.surface.notes)

        def write() -> list[Path]:
            drawn = pictures_of(surface_drawing(coupling))
            if drawn.problem:
                console.say(None, drawn.problem)
            return write_files(folder, drawn.files.items(), _OF_SURFACE)

        console.show_files(comm, on_root(comm, write))


@contextmanager
def _own_folder(
    choice: argparse.Namespace,
    comm: Any,
    names: Sequence[str],
    further: Callable[[Path], list[str]] = lambda folder: [],
) -> Iterator[tuple[Scene, Path]]:
    """Yield the scene and the locked folder of its results, which holds none of another scene.

    What is there of these names, and of those that a function finds, is patchlaw's.
    """
    scene, folder = scene_and_folder(choice, comm)

    def check() -> None:
        every, inputs = [*names, *further(folder)], read_files(scene)
        OwnFiles(folder).refuse_others(every, inputs, overwrite=choice.overwrite)
        if not choice.overwrite:
            refuse_other_results(folder, identity(scene))

    with locked(folder, comm):
        on_root(comm, check)
        yield scene, folder


def _surface_facts(coupling: Coupling) -> list[tuple[str, str]]:
    """Return statistics of a surface, each with its topic."""
    rough, summits = roughness(coupling.parts.surface), coupling.parts.asperities
    differences, iso = rough.sdq_differences, ""
    if abs(differences - rough.sdq) > 0.05 * rough.sdq:
        iso = f" (first differences, as usual for ISO 25178-2: {differences:.4g})"
    return [
        ("surface", describe.surface(coupling.parts)),
        ("Sa, Sq, Sz", f"{1e3 * rough.sa:.4g}, {1e3 * rough.sq:.4g}, {1e3 * rough.sz:.4g} µm"),
        ("Ssk, Sku, Sdq", f"{rough.ssk:.4g}, {rough.sku:.4g}, {rough.sdq:.4g}{iso}"),
        ("m0, m2, m4", f"{rough.m0:.4g} mm², {rough.m2:.4g}, {rough.m4:.4g} 1/mm² (profile)"),
        ("Nayak α", f"{rough.nayak:.3g} (profile), {rough.nayak_radial:.3g} (radial moments)"),
        ("highest point", f"{1e3 * coupling.parts.surface.highest:.6g} µm"),
        ("summits", f"{summits.count}, border maxima {summits.border_x.size}"),
    ]


def view_results(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Write pages that show results in three dimensions, or open windows one after the other.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user; without effect.
        comm: MPI communicator; None for a process on its own.
    """
    from patchlaw.multiscale.runs.output.view import view, write_views  # a run does without

    folder, which = choice.results, {"step": choice.step, "mode": choice.mode}
    if not folder.is_dir():
        allowed = "a folder that patchlaw run wrote"
        raise InputError("is not a folder", key="RESULTS", value=str(folder), allowed=allowed)
    if choice.window:

        def show() -> None:
            if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
                problem, pages = "there is no display to open a window on", "pages, without it"
                raise InputError(problem, key="--window", allowed=pages)
            for name in choice.show or ("",):
                view(folder, name, **which).show()

        on_root_alone(comm, show)
        return
    with locked(folder, comm):
        write = partial(write_views, folder, choice.show or (), **which)
        files = on_root_alone(comm, write)
    console.show_files(comm, files)
    if choice.open:
        console.open_page(comm, files)
