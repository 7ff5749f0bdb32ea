"""The command ``patchlaw plan``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from multiscale.cli.execution import scene_and_folder
from multiscale.couplings.coupling import Coupling
from multiscale.couplings.dispatch import load_finite_elements
from multiscale.inputs.memory import shortage_warnings
from multiscale.machine import cluster_nodes, peak_memory
from multiscale.output import terminal
from multiscale.scene.scene import Scene
from multiscale.setup import make_setup
from support.collective import on_root_alone, place_in


def plan_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Say what a run would do and why, its work and memory; write no results.

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
    cost = on_root_alone(comm, lambda: list(coupling.cost_statements(memory, ranks)))
    shortages = list(shortage_warnings(coupling.memory_requests(), cluster_nodes(comm)))
    terminal.show_plan(comm, coupling, cost, shortages)


def planned(scene: Scene, comm: Any) -> Coupling:
    """Make the coupling of a scene, as if these nodes had any memory that it may take.

    Args:
        scene: The scene.
        comm: MPI communicator; None for a process on its own.

    Note:
        Collective.
    """
    return make_setup(scene, comm, nodes=replace(cluster_nodes(comm), extensible=True))
