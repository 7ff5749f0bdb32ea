"""The commands that plan a run, or make a part of it: plan, laws, surface."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from patchlaw.geometry.statistics import roughness
from patchlaw.multiscale import console
from patchlaw.multiscale.cli.execution import scene_and_folder
from patchlaw.multiscale.couplings import describe
from patchlaw.multiscale.couplings.coupling import Coupling
from patchlaw.multiscale.couplings.dispatch import coupling_class, load_finite_elements
from patchlaw.multiscale.exports.export import export_names, export_texts, remove_exports
from patchlaw.multiscale.figures.files import Drawing, file_kinds, write_figure
from patchlaw.multiscale.inputs.cost import shortage_warnings
from patchlaw.multiscale.laws.law_table import write_laws
from patchlaw.multiscale.machine import cluster_nodes, peak_memory
from patchlaw.multiscale.observers.conductance import conducts_of
from patchlaw.multiscale.output.results_folder import locked, refuse_other_results
from patchlaw.multiscale.output.run_figures import surface_drawing
from patchlaw.multiscale.progress import counting, following
from patchlaw.multiscale.scene.scene import Scene, identity, read_files
from patchlaw.multiscale.scene_run import Run
from patchlaw.multiscale.setup import make_setup
from patchlaw.support.collective import on_root, on_root_alone, place_in
from patchlaw.support.own_files import OwnFiles
from patchlaw.support.whole_files import write_text

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
    load_finite_elements(scene, comm)
    coupling = planned(scene, comm)
    needed = on_root_alone(comm, lambda: coupling.memory_statement(memory, ranks))
    shortages = list(shortage_warnings(coupling.memory_requests(), cluster_nodes(comm)))
    console.show_plan(comm, coupling, needed, shortages)


def planned(scene: Scene, comm: Any) -> Coupling:
    """Make the coupling of a scene, as if these nodes had any memory that it may take.

    Args:
        scene: The scene.
        comm: MPI communicator; None for a process on its own.

    Note:
        Collective.
    """
    return make_setup(scene, comm, nodes=replace(cluster_nodes(comm), extensible=True))


def tabulate_laws(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Tabulate the patch laws of a scene; write and draw them, and export them when asked to.

    Exports of earlier laws in the folder are removed.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    exported = partial(export_names, formats=choice.export)
    with _own_folder(choice, comm, _OF_LAWS, exported) as (scene, folder):
        coupling_class(scene).check_has_laws(scene)
        run = Run(scene, comm)
        console.show_plan(comm, run.coupling)
        with following(comm) as (begun, _):
            run.clock.observe = counting(begun)
            run.make_laws()
        table = run.laws
        assert table is not None

        def write() -> list[Path]:
            conducts = conducts_of(run.coupling)
            exports: dict[str, str] = {}
            section = run.scene.friction
            friction = None if section is None else section.coefficient
            for name in choice.export:
                exports |= export_texts(table, name, conducts=conducts, friction=friction)
            remove_exports(folder)
            with OwnFiles(folder).writing([*_OF_LAWS, *exports]):
                files = [write_laws(folder / "laws.h5", table)]
                kinds = file_kinds(run.scene.output.figures)
                drawing = Drawing("laws", "figures.curves.law_figure", (table,), kinds)
                files += write_figure(folder, drawing, lambda problem: run.remark([problem]))
                for name, text in exports.items():
                    write_text(folder / name, text)
            return files + [folder / name for name in {Path(path).parts[0]: 0 for path in exports}]

        console.show_files(comm, on_root(comm, write))
    for note in run.history().notes:
        console.say(comm, f"note: {note}")


def describe_surface(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Describe and draw the surface of a scene.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    with _own_folder(choice, comm, _OF_SURFACE) as (scene, folder):
        coupling = planned(scene, comm)
        console.show_pairs(comm, _surface_facts(coupling), coupling.surface.notes)
        drawing, tell = surface_drawing(coupling), partial(console.say, None)

        def write() -> list[Path]:
            with OwnFiles(folder).writing(_OF_SURFACE):
                return write_figure(folder, drawing, tell)

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
    rough, summits = roughness(coupling.surface), coupling.asperities
    differences, iso = rough.sdq_differences, ""
    if abs(differences - rough.sdq) > 0.05 * rough.sdq:
        iso = f" (first differences, as usual for ISO 25178-2: {differences:.4g})"
    return [
        ("surface", describe.surface(coupling)),
        ("Sa, Sq, Sz", f"{1e3 * rough.sa:.4g}, {1e3 * rough.sq:.4g}, {1e3 * rough.sz:.4g} µm"),
        ("Ssk, Sku, Sdq", f"{rough.ssk:.4g}, {rough.sku:.4g}, {rough.sdq:.4g}{iso}"),
        ("m0, m2, m4", f"{rough.m0:.4g} mm², {rough.m2:.4g}, {rough.m4:.4g} 1/mm² (profile)"),
        ("Nayak α", f"{rough.nayak:.3g} (profile), {rough.nayak_radial:.3g} (radial moments)"),
        ("highest point", f"{1e3 * coupling.surface.highest:.6g} µm"),
        ("summits", f"{summits.count}, border maxima {summits.border_x.size}"),
    ]
