"""The command ``patchlaw run``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from multiscale.cli.execution import scene_and_folder
from multiscale.output import terminal
from multiscale.output.field_files import write_fields
from multiscale.output.results import write_results
from multiscale.restart.checkpoint import Checkpoint, CheckpointWriter
from multiscale.restart.interruption import Interruption, Stopped
from multiscale.restart.results_folder import (
    find_checkpoint,
    is_finished,
    locked,
    refuse_other_results,
)
from multiscale.run import Run
from multiscale.scene.identity import identity
from multiscale.scene.scene import Scene
from support.collective import on_root
from support.errors import InputError, NotConverged, NotInstalled, PatchlawError
from support.packages import optional_packages


def run_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene; write history, laws, figures and report.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    with Interruption(comm, choice.max_time) as interruption:
        scene, folder = scene_and_folder(choice, comm)
        with locked(folder, comm) as lock:
            found = on_root(comm, lambda: _earlier(choice, folder, scene))
            with terminal.following(comm) as (begun, _):
                begun("setting up the problem")
                run = Run(scene, comm, None if found is None else found.resolved)
            with CheckpointWriter(folder, run, lock.hold) as checkpoints:
                if _announce(choice.resume, found, run, checkpoints):
                    _run(run, checkpoints, interruption, options)


def _earlier(choice: argparse.Namespace, folder: Path, scene: Scene) -> Checkpoint | None:
    """Return the interrupted run of the same scene in a folder, which this one goes on from.

    Nothing that another scene left there is replaced unless the user says so.
    """
    anew = choice.overwrite and not choice.resume
    found = None if anew else find_checkpoint(folder, scene)
    if found is None and not choice.overwrite:
        refuse_other_results(folder, identity(scene))
    return found


def _announce(
    resume: bool, found: Checkpoint | None, run: Run, checkpoints: CheckpointWriter
) -> bool:
    """Say what will be done, and resume if asked to; return False if nothing is left to do."""
    comm, folder, notice = run.comm, checkpoints.path.parent, None
    if found is not None:
        run.resume(found.steps, found.position, found.state, found.laws, found.contacts)
        anew = "" if resume else " (to begin anew: --overwrite)"
        notice = f"goes on after load step {len(run.steps)}, kept in {folder}{anew}"
    elif resume and on_root(comm, lambda: is_finished(folder, run.identity)):
        terminal.say(comm, f"this run is finished; its results are in {folder}")
        return False
    elif resume:
        notice = f"nothing to resume in {folder}: begins with the first load step"
    elif on_root(comm, checkpoints.path.exists):
        notice = f"replaces the interrupted run in {folder}"
    terminal.show_plan(comm, run.coupling)
    if notice:
        terminal.say(comm, notice)
    return True


def _run(
    run: Run, checkpoints: CheckpointWriter, interruption: Interruption, options: list[str]
) -> None:
    """Make the load steps and write the results, also of a run that ends early."""
    comm, folder = run.comm, checkpoints.path.parent
    failure = _make_load_steps(run, checkpoints, interruption)
    if run.steps:
        checkpoints.write_pending()  # writing results may fail
    if failure is not None and on_root(comm, lambda: is_finished(folder, run.identity)):
        terminal.say(comm, f"the results of an earlier run to the end stay in {folder}")
    elif run.steps:
        run.finish()
        files = write_results(folder, run, options=options)
        if run.scene.output.fields:
            files += write_fields(folder, run)
        terminal.show_history(comm, run.history())
        terminal.show_times(comm, run.clock.times)
        terminal.show_files(comm, files)
    if isinstance(failure, NotConverged):
        raise failure.advised(f"a changed scene needs --overwrite, or another folder than {folder}")
    if failure is not None:
        raise failure
    checkpoints.remove()


def _make_load_steps(
    run: Run, checkpoints: CheckpointWriter, interruption: Interruption
) -> PatchlawError | None:
    """Make the load steps with their checkpoints; return what ended them early, on all ranks."""
    load_history = run.scene.loading.load_history
    with terminal.progress(run.comm, load_history, len(run.steps)) as (advance, run.clock.observe):
        try:
            if run.coupling.has_laws:
                run.make_laws()
            checkpoints.write()
            interruption.check("before the block was made")
            with optional_packages():
                run.prepare()
            interruption.check(f"after load step {len(run.steps)}")
            for step in run.load_steps():
                checkpoints.accept()
                advance(step)
                if not run.finished:
                    interruption.check(f"after load step {step.step}", step.wall_s)
        except (Stopped, NotConverged) as error:  # the load steps before it are written
            return error
        except (InputError, NotInstalled):
            if not run.steps:  # wrong input leaves nothing behind
                checkpoints.remove()
            raise
    return None
