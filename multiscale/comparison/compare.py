"""Compares all sensible ways to compute a scene, each in a process of its own."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from multiscale.auto.keys import auto_keys, is_measured, resolved_sections, with_resolved
from multiscale.comparison import AGAINST
from multiscale.comparison.catalogue import configurations
from multiscale.comparison.comparison import Comparison, compared
from multiscale.comparison.configuration import Configuration, RunResult, read_result, write_result
from multiscale.comparison.launch import check_launchable, launch_process
from multiscale.readable import duration
from multiscale.scene.identity import identity
from multiscale.scene.scene import Scene
from multiscale.setup import make_setup
from support.checked_store import read_record, write_record
from support.errors import InputError

Launch: TypeAlias = Callable[[Configuration, float | None], RunResult]
"""Runs a configuration, and stops it after so many seconds if they are not None."""

AUTO_VALUES = "auto_values"
"""File of the values that were chosen for the scene's keys that are ``auto``."""

REFERENCE_SHARE, REFERENCE_LIMIT = 0.6, 0.8
"""Shares of a budget: what a reference may be predicted to take to be run before all others, and
what it may take in fact; the rest is enough for the quick ways."""

REPEATABLE = ("done", "refused", "not converged")
"""How runs end that would end in the same way again."""


def compare(
    scene: Scene,
    comm: Any = None,
    *,
    against: str | None = None,
    budget_s: float | None = None,
    folder: Path | None = None,
    ranks: int = 1,
    launch: Launch | None = None,
    begin: Callable[[Configuration], None] | None = None,
    observe: Callable[[RunResult, bool], None] | None = None,
) -> Comparison:
    """Run a scene in every sensible configuration, each in a process of its own.

    The values for keys that are ``auto`` are the same in all configurations.

    Args:
        scene: The scene.
        comm: MPI communicator; processes cannot be launched from an MPI job of several processes.
        against: Kind of the measure that configurations are compared against. By default the best
            that is reached, of an explicit reference, the concurrent coupling and the half-space.
        budget_s: Wall time for all configurations that are run now [s]; one that exceeds the rest
            is ended. None for any.
        folder: Folder where results are stored, so that the next call goes on from them; None
            stores nothing.
        ranks: Number of processes of configurations that can use more than one, under ``mpirun``.
        launch: Runs one configuration; by default `launch_process`.
        begin: Called with every configuration that is about to be run.
        observe: Called with every result, and whether it is from an earlier call.

    Returns:
        The comparison, with a row for every configuration, run or not.

    Raises:
        InputError: When the scene, an argument or the MPI job does not allow it.
    """
    counter = scene.counter_surface
    if scene.surface.heights is not None or (counter and counter.heights is not None):
        raise InputError(
            "heights in memory cannot be handed to the processes of a comparison",
            key="surface.heights",
            allowed="surface.file: save them, as by numpy.save",
        )
    if scene.body is not None:
        raise InputError("is a mesh, and a comparison makes its own", key="body", allowed="[block]")
    if against is not None and against not in AGAINST:
        allowed = ", ".join(AGAINST)
        raise InputError("is nothing to compare against", value=against, allowed=allowed)
    if budget_s is not None and not budget_s > 0.0:
        raise InputError("is no budget", value=budget_s, allowed="more than 0 s")
    if launch is None or comm is not None:
        check_launchable(ranks, comm)
    results = []
    with tempfile.TemporaryDirectory(prefix="patchlaw-compare-") as temporary:
        place = Path(temporary) if folder is None else folder
        scene = resolved_scene(scene, place)
        ways = configurations(scene, ranks)
        first = (
            None if against in ("concurrent", "half-space") else reference_within(ways, budget_s)
        )
        for result, is_stored in run_all(
            ways,
            place,
            budget_s=budget_s,
            launch=launch or launch_process,
            begin=begin,
            first=first,
        ):
            if observe is not None:
                observe(result, is_stored)
            results.append(result)
        order = [one.key for one in ways]
        results.sort(key=lambda result: order.index(result.configuration.key))
    return compared(scene, results, against)


def resolved_scene(scene: Scene, folder: Path) -> Scene:
    """Return a scene with values for all keys that are ``auto``.

    The values are stored, so that another call need not measure errors again.

    Args:
        scene: The scene.
        folder: Folder of the results.
    """
    sized = scene.kind != "reference" or not is_measured(scene)
    if auto_keys(scene) <= {"micro.model"} and sized:
        return scene
    path, given, values = folder / AUTO_VALUES, identity(scene), None
    with suppress(OSError, InputError):
        then, stored = read_record(path.read_bytes())
        values = stored if then == given else None
    if values is None:
        values = resolved_sections(make_setup(scene), scene)
        write_record(path, (given, values))
    return with_resolved(scene, values)


def reference_within(
    configurations: Sequence[Configuration], budget_s: float | None
) -> Configuration | None:
    """Return the reference with an error bar that a budget is spent on first.

    It is the finest that leaves time for others, or else the cheapest.

    Args:
        configurations: The configurations.
        budget_s: Wall time for all of them [s]; None for any.

    Returns:
        The reference; None where there is no budget, or none within it.
    """
    if budget_s is None:
        return None
    fitting = [
        one
        for one in configurations
        if one.kind == "reference"
        and one.content["reference"]["meshes"] > 1
        and one.scale == 1.0
        and not one.refusal
        and one.cost <= REFERENCE_LIMIT * budget_s
    ]
    leaving = [one for one in fitting if one.cost <= REFERENCE_SHARE * budget_s]
    if leaving:
        return max(leaving, key=lambda one: one.cost)
    return min(fitting, key=lambda one: one.cost, default=None)


def run_all(
    configurations: Sequence[Configuration],
    folder: Path,
    *,
    launch: Launch,
    budget_s: float | None = None,
    begin: Callable[[Configuration], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
    first: Configuration | None = None,
) -> Iterator[tuple[RunResult, bool]]:
    """Run configurations in their order, and yield the result of each when it ends.

    Results are stored, one file each, and a configuration that has a result is not run again.
    Configurations that are predicted to take more time than the budget leaves, or more memory than
    there is, are left out.

    Args:
        configurations: The configurations.
        folder: Folder of the results.
        budget_s: Wall time for all that is run now [s]; None for any.
        launch: Runs one configuration.
        begin: Called with every configuration that is about to be run.
        clock: Returns the time [s].
        first: The configuration that is run before all others, in `REFERENCE_LIMIT` of the budget.

    Yields:
        The result, and whether it is from an earlier call.
    """
    end = None if budget_s is None else clock() + budget_s
    ahead = [] if first is None else [first]
    for one in [*ahead, *(one for one in configurations if one is not first)]:
        path = folder / f"{one.key}.result"
        stored = read_result(path)
        left = None if end is None else end - clock()
        if stored is not None and stored.status in REPEATABLE:
            yield replace(stored, configuration=one), True
        elif one.refusal:
            yield RunResult(configuration=one, status="refused", message=one.refusal), False
        elif left is not None and one.cost > left:
            rest = duration(left) if left > 0.0 else "nothing"
            why = f"it is predicted to take {duration(one.cost)}, and the budget leaves {rest}"
            yield RunResult(configuration=one, status="not started", message=why), False
        else:
            if begin is not None:
                begin(one)
            share = REFERENCE_LIMIT if one is first else 1.0
            result = launch(one, None if left is None else share * left)
            write_result(path, result)
            yield result, False
