"""The command ``patchlaw compare``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from geometry.errors import InputError, NotConverged
from multiscale.cli.command_line import COMPARE_ENDING
from multiscale.cli.inputs import scene_and_folder
from multiscale.comparison.compare import compare
from multiscale.comparison.comparison import Comparison
from multiscale.comparison.launching import Launch, check_launchable
from multiscale.comparison.report import frontier_lines, headline, write_comparison
from multiscale.comparison.run_result import RunResult
from multiscale.output import terminal
from multiscale.restart.results_folder import locked
from multiscale.scene.scene import Scene

RESULTS = "configurations"
"""Folder of the results of all configurations, within the folder of the comparison."""


def compare_scene(
    choice: argparse.Namespace, options: list[str], comm: Any, launch: Launch | None = None
) -> None:
    """Run a scene in every sensible configuration; draw error against time.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
        launch: Runs one configuration; by default in a process of its own.
    """
    check_launchable(choice.ranks)
    if options:
        raise InputError("configurations take no PETSc options", key="--", value=" ".join(options))
    scene, folder = scene_and_folder(choice, comm, ending=COMPARE_ENDING)
    with locked(folder, comm):
        found = _followed(scene, choice, comm, folder / RESULTS, launch)
        for text in (*headline(found), *frontier_lines(found), *found.warnings):
            terminal.say(comm, text)
        terminal.show_files(comm, write_comparison(folder, found))
    if found.measure is None or (choice.against and found.against != choice.against):
        raise NotConverged(
            f"the comparison against {choice.against or 'anything'}",
            reason="MEASURE_NOT_REACHED",
            iterations=0,
            remedy="give more --budget; finished configurations are not run again",
        )


def _followed(
    scene: Scene, choice: argparse.Namespace, comm: Any, folder: Path, launch: Launch | None
) -> Comparison:
    """Run all configurations, and print a line on each."""
    with terminal.following(comm) as (begun, ended):

        def observe(result: RunResult, stored: bool) -> None:
            spent = f"{sum(result.seconds.values()):8.2f} s" if result.seconds else " " * 10
            status = result.status + ", from an earlier call" * stored
            why = f": {result.message}" if result.message else ""
            ended(f"{spent}  {result.configuration.name}: {status}{why}")

        try:
            return compare(
                scene,
                comm,
                against=choice.against,
                budget_s=choice.budget,
                folder=folder,
                ranks=choice.ranks,
                launch=launch,
                begin=lambda configuration: begun(configuration.name),
                observe=observe,
            )
        except KeyboardInterrupt:
            ended(f"interrupted: finished configurations are in {folder}; the same call goes on")
            raise
