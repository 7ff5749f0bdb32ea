"""Compares all ways to compute a scene: error against time."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry.errors import InputError
from multiscale.comparison.comparison import Comparison
from multiscale.comparison.level import Level
from multiscale.comparison.level_results import LevelResult
from multiscale.comparison.level_runs import Launch, check_launchable, run_levels
from multiscale.comparison.levels import levels
from multiscale.comparison.outcomes import AGAINST, Against, Outcome
from multiscale.comparison.rows import compared
from multiscale.resolution.auto_keys import auto_keys, provisional, resolved_keys, with_resolved
from multiscale.resolution.problem_setup import make_setup
from multiscale.scene.scene import Scene
from multiscale.storage.whole_files import write_json

SETTLED = "settled.json"
"""File beside finished levels, of what the plan took for the keys that the scene leaves open."""


def compare(
    scene: Scene,
    comm: Any = None,
    *,
    against: Against | None = None,
    budget_s: float | None = None,
    folder: Path | None = None,
    ranks: int = 1,
    launch: Launch | None = None,
    begin: Callable[[Level], None] | None = None,
    observe: Callable[[Level, LevelResult, bool], None] | None = None,
) -> Comparison:
    """Run a scene at every sensible level, cheapest first, each in a clean process of its own.

    What the scene leaves open is what the plan takes for it, the same for all levels.

    Args:
        scene: The scene.
        comm: MPI communicator; levels cannot be launched from an MPI job of several processes.
        against: What to compare with; by default the best level reached, of an explicit
            reference, the concurrent coupling and the half-space.
        budget_s: Wall time for all levels that are run now [s]; one that exceeds what is left is
            ended. None for any.
        folder: Where finished levels are kept, so that the next call goes on from them; None
            forgets them.
        ranks: Processes for levels that can use more than one, under ``mpirun``.
        launch: Runs one level; by default `level_runs.launch_process`.
        begin: Called with every level that is about to be run.
        observe: Called with every level and its result; the last argument tells whether that was
            kept from an earlier call.

    Returns:
        The comparison, with a row for every level, run or not.

    Raises:
        InputError: When the scene, an argument or the MPI job does not allow it.
    """
    if comm is not None and comm.size > 1:
        raise InputError(
            "levels are launched each on its own, which is not possible inside an MPI job",
            key="comm",
            value=comm.size,
            allowed="compare(scene, ranks=N) from a process on its own",
        )
    if against is not None and against not in AGAINST:
        allowed = ", ".join(AGAINST)
        raise InputError("is nothing to compare against", value=against, allowed=allowed)
    if budget_s is not None and not budget_s > 0.0:
        raise InputError("is no budget", value=budget_s, allowed="more than 0 s")
    if launch is None:
        check_launchable(ranks)
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="patchlaw-compare-") as aside:
        place = Path(aside) if folder is None else folder
        scene = resolved_scene(scene, place)
        for level, result, kept in run_levels(
            levels(scene, ranks),
            folder=place,
            budget_s=budget_s,
            launch=launch,
            begin=begin,
        ):
            if observe is not None:
                observe(level, result, kept)
            outcomes.append(Outcome(level, result))
    return compared(scene, outcomes, against)


def resolved_scene(scene: Scene, folder: Path) -> Scene:
    """Return a scene whose open keys, but for the micro model, are what the plan takes for them.

    They are kept: another call may find the machine in another mood, and levels of other patches.

    Args:
        scene: The scene.
        folder: Where finished levels are kept.
    """
    free = auto_keys(scene)
    if free <= {"micro.model"}:
        return scene
    path, given = folder / SETTLED, scene.model_dump(by_alias=True, mode="json")
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        known = kept["settled"] if kept["scene"] == given else None
    except (OSError, ValueError, KeyError, TypeError):
        known = None
    if known is None:
        known = resolved_keys(make_setup(scene), scene)
        write_json(path, {"scene": given, "settled": known})
    return provisional(with_resolved(scene, known), free & {"micro.model"})
