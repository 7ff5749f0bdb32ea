"""The command ``patchlaw run``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from patchlaw.multiscale import console
from patchlaw.multiscale.cli.execution import refuse_other_kind, scene_and_folder
from patchlaw.multiscale.cli.interruption import Interruption, Stopped, watching
from patchlaw.multiscale.console import following, run_progress
from patchlaw.multiscale.output.checkpoint import FILE_NAME, Checkpoint, CheckpointWriter
from patchlaw.multiscale.output.fields import write_fields
from patchlaw.multiscale.output.figures import RunFigures
from patchlaw.multiscale.output.results import FILES, write_results
from patchlaw.multiscale.output.results_folder import (
    find_checkpoint,
    is_finished,
    locked,
    refuse_other_results,
)
from patchlaw.multiscale.scene.scene import Scene, identity, read_files
from patchlaw.multiscale.scene_run import Run
from patchlaw.support.collective import on_root
from patchlaw.support.errors import InputError, NotConverged, NotInstalled, PatchlawError
from patchlaw.support.own_files import OwnFiles
from patchlaw.support.packages import optional_packages


def run_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene; write history, laws, figures and report.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    with watching(comm, choice.max_time) as interruption:
        scene, folder = scene_and_folder(choice, comm)
        with locked(folder, comm) as lock:
            kept, notice = on_root(comm, lambda: _earlier(choice, folder, scene))
            if choice.resume and kept is None and _is_finished(folder, scene, comm):
                console.say(comm, f"this run is finished; its results are in {folder}")
                if choice.open:
                    console.open_page(comm, sorted(folder.glob("report.html")))
                return
            with RunFigures(scene, comm) as figures:
                with following(comm) as (begun, _):
                    begun("setting up the problem")
                    run = Run(scene, comm, None if kept is None else kept.resolved)
                if kept is not None:
                    past = kept.steps, kept.position, kept.state, kept.table, kept.contacts
                    run.resume(*past, kept.fields)
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


def _earlier(
    choice: argparse.Namespace, folder: Path, scene: Scene
) -> tuple[Checkpoint | None, str]:
    """Return the interrupted run of the same scene in a folder, and what to say of what is there.

    Nothing that another scene left there is replaced unless the user says so.
    """
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
        return None, f"nothing to resume in {folder}: begins with the first load step"
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
            if run.coupling.has_laws:
                run.make_laws()
            checkpoints.accept()
            figures.begin(run)
            interruption.check("before the block was made")
            with optional_packages():
                _ = run.coupling.solver  # made here, before the time is checked again
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
    folder: Path,
    run: Run,
    figures: RunFigures,
    failure: PatchlawError | None,
    options: list[str],
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
        console.show_history(comm, run.history())
        console.show_times(comm, run.clock.times)
        console.show_files(comm, files)
    return files
