"""The commands behind the command line: run, plan, laws, surface, schema."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from geometry.errors import InputError, NotConverged, PatchlawError
from geometry.statistics import roughness
from multiscale.costs.prediction import Cost, predicted_cost
from multiscale.couplings.blocks import load_together
from multiscale.laws.files import write_laws
from multiscale.machine.mpi_job import large_object_comm, refuse_detached_processes
from multiscale.machine.nodes import ClusterNodes, cluster_nodes
from multiscale.output import terminal
from multiscale.output.field_files import write_fields
from multiscale.output.results import write_figure, write_results
from multiscale.planning import plan
from multiscale.planning.block_plan import memory_warnings
from multiscale.resolution.problem_setup import make_setup
from multiscale.restart.folder_lock import locked
from multiscale.restart.interruption import Interruption, Stopped
from multiscale.restart.resuming import CheckpointWriter, is_finished, kept_choices
from multiscale.run import Run
from multiscale.scene.quantities import parse_duration
from multiscale.scene.scene import Scene
from multiscale.setup.problem import ProblemSetup
from multiscale.storage.whole_files import write_whole


def run_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene; write history, laws, figures and report.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    with Interruption(comm, _limit(choice.max_time)) as interruption:
        scene, folder = scene_and_folder(choice, comm)
        kept = on_root(comm, lambda: kept_choices(folder, scene)) if choice.resume else None
        run = Run(scene, comm, kept)
        with locked(folder, comm) as lock:
            keeper = CheckpointWriter(folder, run, lock)
            if not _begun(choice.resume, folder, run, keeper):
                return
            failure = _stepped(run, keeper, interruption)
            if run.steps:
                terminal.show_history(comm, run.history())
                files = write_results(folder, run, options=options)
                if scene.output.fields:
                    files += write_fields(folder, run)
                terminal.show_times(comm, run.seconds)
                terminal.show_files(comm, files)
            if failure is not None:
                raise failure
            on_root(comm, keeper.remove)


def _begun(resume: bool, folder: Path, run: Run, keeper: CheckpointWriter) -> bool:
    """Go on from a checkpoint if asked to, and say what will be done; False if nothing is left."""
    comm, said = run.comm, None
    if resume and keeper.resume():
        said = f"goes on after load step {len(run.steps)}, kept in {folder}"
    elif resume and on_root(comm, lambda: is_finished(folder, run)):
        terminal.say(comm, f"this run is finished; its results are in {folder}")
        return False
    elif resume:
        said = f"nothing to resume in {folder}: begins with the first load step"
    elif on_root(comm, keeper.exists):
        said = f"replaces the interrupted run in {folder} (to go on with it: --resume)"
    terminal.show_plan(comm, run.setup)
    if said:
        terminal.say(comm, said)
    return True


def _stepped(
    run: Run, keeper: CheckpointWriter, interruption: Interruption
) -> PatchlawError | None:
    """Make and keep the load steps; return what ended them early, on all ranks alike."""
    load_history = run.scene.loading.load_history
    with terminal.progress(run.comm, load_history, len(run.steps)) as advance:
        try:
            if run.setup.uses_laws:
                run.make_laws()
            keeper.write()
            interruption.check("before the block was made")
            run.make_coupling()
            interruption.check(f"after load step {len(run.steps)}")
            for step in run.load_steps():
                keeper.keep(step)
                advance(step)
                if not run.finished:
                    interruption.check(f"after load step {step.step}", step.wall_s)
        except Stopped as error:
            keeper.write()
            return error
        except NotConverged as error:  # what was accepted before it is kept
            return error
        except InputError:  # of which nothing is written
            if not run.steps:
                on_root(run.comm, keeper.remove)
            raise
    return None


def _limit(text: str | None) -> float | None:
    """Return the wall time that a run may take [s]."""
    try:
        return None if text is None else parse_duration(text)
    except ValueError as error:
        raise InputError(str(error), key="--max-time", value=text) from None


def plan_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Say what a run would do, and why; run nothing expensive.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, _ = scene_and_folder(choice, comm, writes=False)
    load_together(scene, comm)
    nodes = cluster_nodes(comm)
    setup, made = on_root(large_object_comm(comm), lambda: _planned(scene, nodes))
    terminal.show_plan(comm, setup, made, list(memory_warnings(setup, nodes)))


def _planned(scene: Scene, nodes: ClusterNodes) -> tuple[ProblemSetup, Cost]:
    """Plan a run, on more nodes like those here if it takes them."""
    setup = make_setup(scene, nodes=replace(nodes, extensible=True))
    return setup, predicted_cost(setup)


def tabulate_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Tabulate the patch laws of a scene; write and draw them.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, folder = scene_and_folder(choice, comm)
    with locked(folder, comm):
        run = Run(scene, comm)
        terminal.show_plan(comm, run.setup)
        table = run.make_laws()

        def write() -> list[Path]:
            from multiscale.output.figures import law_figure

            laws = write_whole(folder / "laws.h5", lambda path: write_laws(path, table))
            return [laws, write_figure(folder / "laws.png", law_figure(table))]

        terminal.show_files(comm, on_root(comm, write))
    for note in run.history().notes:
        terminal.say(comm, f"note: {note}")


def describe_surface(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Describe and draw the surface of a scene.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, folder = scene_and_folder(choice, comm)
    nodes = replace(cluster_nodes(comm), extensible=True)  # a surface needs no room for its block
    setup = on_root(large_object_comm(comm), lambda: make_setup(scene, nodes=nodes))
    rough = roughness(setup.surface)
    pairs = [
        ("surface", plan.surface_statement(setup)),
        ("Sa, Sq, Sz", f"{1e3 * rough.sa:.4g}, {1e3 * rough.sq:.4g}, {1e3 * rough.sz:.4g} µm"),
        ("Ssk, Sku, Sdq", f"{rough.ssk:.4g}, {rough.sku:.4g}, {rough.sdq:.4g}"),
        ("m0, m2, m4", f"{rough.m0:.4g} mm², {rough.m2:.4g}, {rough.m4:.4g} 1/mm² (profile)"),
        ("Nayak α", f"{rough.nayak:.3g} (profile), {rough.nayak_radial:.3g} (radial moments)"),
        ("highest point", f"{1e3 * setup.surface.highest:.6g} µm"),
        ("summits", f"{setup.asperities.count}, border maxima {setup.asperities.border_x.size}"),
    ]
    terminal.show_pairs(comm, pairs)

    def write() -> list[Path]:
        from multiscale.output.figures import surface_figure

        figure = surface_figure(setup.surface, setup.asperities, setup.patches)
        return [write_figure(folder / "surface.png", figure)]

    with locked(folder, comm):
        terminal.show_files(comm, on_root(comm, write))


def print_schema(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Print the JSON Schema of scene files.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if terminal.speaks(comm):
        print(json.dumps(Scene.model_json_schema(by_alias=True), indent=2))


def scene_and_folder(
    choice: argparse.Namespace, comm: Any, *, ending: str = "", writes: bool = True
) -> tuple[Scene, Path]:
    """Read the scene on rank 0 and settle where results would go.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator; None for a process on its own.
        ending: What the folder's name has behind the scene's, unless the user names a folder.
        writes: Whether anything will be written to it.

    Raises:
        InputError: When the scene or the folder cannot be used, or this process is one of several
            that should be one MPI job and are not.
    """
    refuse_detached_processes()

    def read() -> tuple[Scene, Path]:
        scene = Scene.load(choice.scene, choice.set)
        folder = choice.out or Path("results") / f"{scene.name}{ending}"
        if writes:
            _check_folder(folder)
        return scene, folder

    return on_root(comm, read)


def _exists(path: Path) -> bool:
    """Tell whether there is such a path; newer Pythons' own takes names that cannot be for none."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _check_folder(folder: Path) -> None:
    """Refuse a folder that could not be written to, before anything is computed."""
    try:
        nearest = next(path for path in (folder, *folder.absolute().parents) if _exists(path))
    except OSError as error:  # a name longer than any
        problem = f"cannot be used: {error.strerror}"
        raise InputError(problem, key="--out", value=str(folder)) from None
    if not nearest.is_dir():
        raise InputError(f"{nearest} is not a folder", key="--out", value=str(folder))
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{nearest} cannot be written to", key="--out", value=str(folder))
