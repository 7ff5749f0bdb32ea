"""The command ``patchlaw compare``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from geometry.errors import InputError, NotConverged
from multiscale.cli.command_line import COMPARE_ENDING
from multiscale.cli.inputs import scene_and_folder, wall_time
from multiscale.comparison.compare import compare
from multiscale.comparison.comparison import Comparison
from multiscale.comparison.level import Level
from multiscale.comparison.level_results import LevelResult
from multiscale.comparison.level_runs import check_launchable
from multiscale.comparison.outcomes import AGAINST
from multiscale.comparison.report import bargains, headline, write_comparison
from multiscale.output import terminal
from multiscale.restart.folder_lock import locked
from multiscale.scene.scene import Scene

LEVELS_FOLDER = "levels"
"""Folder of finished levels within the results."""


def compare_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene at every sensible level; draw error against time.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    check_launchable(choice.ranks)
    budget = wall_time(choice.budget, "--budget")
    if choice.against is not None and choice.against not in AGAINST:
        allowed = ", ".join(AGAINST)
        raise InputError(
            "is nothing to compare against", key="--against", value=choice.against, allowed=allowed
        )
    if options:
        raise InputError("levels take no PETSc options", key="--", value=" ".join(options))
    scene, folder = scene_and_folder(choice, comm, ending=COMPARE_ENDING)
    with locked(folder, comm):
        found = _followed(scene, choice, comm, budget, folder / LEVELS_FOLDER)
        for text in (*headline(found), *bargains(found), *found.warnings):
            terminal.say(comm, text)
        terminal.show_files(comm, write_comparison(folder, found))
    if found.measure is None or (choice.against and found.against != choice.against):
        raise NotConverged(
            f"the comparison against {choice.against or 'anything'}",
            reason="LEVEL_NOT_REACHED",
            iterations=0,
            remedy="give more --budget; finished levels are kept",
        )


def _followed(
    scene: Scene, choice: argparse.Namespace, comm: Any, budget: float | None, kept: Path
) -> Comparison:
    """Run all levels and say how each ended; finished ones are kept in a folder."""
    with terminal.following(comm) as (begun, ended):
        try:
            return compare(
                scene,
                comm,
                against=choice.against,
                budget_s=budget,
                folder=kept,
                ranks=choice.ranks,
                begin=lambda level: begun(level.name),
                observe=lambda level, result, known: ended(_line(level, result, known)),
            )
        except KeyboardInterrupt:
            ended(f"interrupted: finished levels are kept in {kept}; the same call goes on")
            raise


def _line(level: Level, result: LevelResult, kept: bool) -> str:
    """Say in a line how a level ended."""
    spent = f"{sum(result.seconds.values()):8.2f} s" if result.seconds else " " * 10
    status = f"{result.status}, kept" if kept else result.status
    why = f": {result.message}" if result.message else ""
    return f"{spent}  {level.name}: {status}{why}"
