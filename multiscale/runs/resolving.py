"""Chooses the keys that a scene with an ``accuracy`` leaves open, by measured errors.

What the scene states is kept; what it leaves open becomes what `multiscale.runs.refining` finds by
measured errors. Where neither cells nor laws keep the accuracy, and the scene leaves the coupling
open, the roughness is meshed. Neither clocks nor the machine take part: the same scene gets the
same values everywhere, or is refused where their memory is missing.

The rule in words: docs/choosing.md.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.multiscale.bodies.reader import BodyReader, Meshes
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.results.accuracy import Decision
from patchlaw.multiscale.scene.loads import patch_limits
from patchlaw.multiscale.scene.memory import MemoryLacking, check_memory, scene_requests
from patchlaw.multiscale.scene.parts import LAW_BLOCK_CELLS
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.schema import flat, to_dict
from patchlaw.multiscale.scene.surfaces import make_surface
from patchlaw.support import Comm, InputError, NotConverged, checked, located, on_root_alone
from patchlaw.support.readable import ProgressObserver, unobserved

if TYPE_CHECKING:  # what refines is imported only by scenes that leave something open
    from patchlaw.multiscale.runs.refining import Found, Search

SOLUTIONS_OF_LAWS = 84
"""Solutions of the contact problem that a table of laws takes: models of cells took 75 to 105 for
45 to 65 rows."""


@checked
def resolve(
    scene: Scene,
    comm: Comm | None = None,
    *,
    nodes: ClusterNodes | None = None,
    read: Callable[[Scene, Any], Meshes] | None = None,
    mesh_error: Callable[[Any], float] | None = None,
    observe: ProgressObserver | None = None,
) -> Scene:
    """Return the scene that states what a scene leaves to its ``accuracy``.

    It says in `Scene.decision` what was measured for it. It can be saved, run and resumed, and is
    itself where nothing is open.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
        nodes: The nodes of the run; None for this process alone.
        read: Reads the bodies of a scene from their meshes, collective; None reads them anew.
        mesh_error: Measures the relative error of a reference's meshes at the largest load.
        observe: Told of every trial, as a text.

    Raises:
        InputError: When nothing that the scene allows can be made, or the memory is missing.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    opened = scene.open_keys
    if scene.accuracy is None or not opened:
        return scene
    from patchlaw.multiscale.runs.refining import Search, measured_mesh_error

    search = Search(
        accuracy=scene.accuracy,
        opened=opened,
        comm=comm,
        nodes=nodes or ClusterNodes(),
        read=read or BodyReader(),
        mesh_error=mesh_error or measured_mesh_error,
        observe=observe or unobserved,
    )
    unmeasured = {"patches.grid"} if scene.law.representative else {"patches.grid", "block.cells"}
    with located(scene.file):
        start, why = _start(scene, search, measured=not opened <= unmeasured)
        if opened <= unmeasured:
            return start
        found, missed = _found(start, search), None
        if _sum(found) > scene.accuracy and _may_be_meshed(scene, opened):
            meshed = _meshed_instead(found.scene, search)
            if meshed is not None and _sum(meshed) <= _sum(found):
                found, missed, why = meshed, found, ""
    taken = _with_stated(found.scene, opened)
    decision = Decision(
        accuracy=scene.accuracy,
        taken=found.label,
        why=why,
        errors=found.errors,
        missed=missed.errors if missed else {},
        trials=search.tally["trials"],
        keys=chosen_keys(scene, taken),
    )
    return replace(taken, decision=decision)


def chosen_keys(given: Scene, stated: Scene) -> dict[str, Any]:
    """Return what a scene left open, and what that became, by dotted key.

    Args:
        given: The scene as it was given.
        stated: What `resolve` made of it.
    """
    before = dict(flat(given.written))
    return {key: value for key, value in flat(stated.written) if before.get(key) is None}


def _with_stated(scene: Scene, opened: frozenset[str]) -> Scene:
    """Return a scene that states keys which were open, those that stayed as they were as well."""
    values = dict(flat(to_dict(scene)))
    left = {key: values[key] for key in opened & scene.open_keys}
    if "micro.finite_slopes" in left:  # which samples leave out when it is not given
        left["micro.finite_slopes"] = False
    return scene.with_(left)


def _sum(found: Found) -> float:
    return sum(found.errors.values())


def _start(scene: Scene, search: Search, *, measured: bool) -> tuple[Scene, str]:
    """Return a scene with values to start from, and why its coupling was chosen, if it was."""
    opened, changes, why = search.opened, dict[str, Any](), ""
    if "coupling.kind" in opened:
        changes["coupling.kind"], why = chosen_coupling(scene)
    if "micro.model" in opened:
        changes["micro.model"] = "half-space"
    if "block.cells" in opened:
        first = 4 if scene.law.representative else 1  # which are refined
        changes["block.cells"] = [count // first for count in LAW_BLOCK_CELLS]
    scene = scene.with_(changes)
    if "surface.grid" in opened:
        on_cells = scene.micro.model == "half-space" and not scene.meshes_roughness
        # heights along the shortest wave: what is tried first, and enough for summits and meshes
        scene = search.on_waves(scene, 8 if on_cells else 16)
    on_body = scene.by_laws and not scene.patches_alone
    if measured and on_body and scene.coupling.table_tolerance is None:
        scene = scene.with_({"coupling.table_tolerance": search.accuracy / 10.0})
    if "patches.grid" in opened:
        grid = on_root_alone(search.comm, lambda: _patches(scene, search.nodes))
        scene = scene.with_({"patches.grid": grid})
    return scene, why


def chosen_coupling(scene: Scene) -> tuple[str, str]:
    """Return the kind of coupling that is chosen beside what a scene states, and why.

    It is concurrent, which has neither laws nor their error, unless the scene has more load steps
    than consistent laws take solutions, or states what belongs to laws.

    Args:
        scene: The scene as it was given, whose coupling is open.
    """
    steps, fitting = scene.loading.expected_count, []
    for kind in ("concurrent", "consistent"):
        with suppress(InputError):  # another key does not go with it
            fitting.append(scene.with_({"coupling.kind": kind}).kind)
    if len(fitting) < 2:
        return fitting[0], "what the scene states goes with no other"
    solutions = f"about {SOLUTIONS_OF_LAWS} contact problems"
    if steps > SOLUTIONS_OF_LAWS:
        return "consistent", f"laws take {solutions}, fewer than {steps} load steps"
    return "concurrent", f"no laws, which take {solutions} for {steps} load steps"


def _patches(scene: Scene, nodes: ClusterNodes) -> list[int]:
    """Return nearly square patches that make a map, no more than heights or elements below.

    There are 8 along the shorter side.
    """
    check_memory(nodes, scene_requests(scene))
    surface = make_surface(scene)
    most = np.min(list(patch_limits(scene, surface).values()), axis=0)
    shorter = min(surface.lengths)
    return [
        min(max(round(8 * length / shorter), 1), int(limit))
        for length, limit in zip(surface.lengths, most, strict=True)
    ]


def _found(start: Scene, search: Search) -> Found:
    """Return what is taken of the coupling that the scene has; collective."""
    if start.law.representative:
        return search.by_samples(start)
    if start.meshes_roughness:
        return search.meshed(search.first_meshes(start))
    return search.on_cells(start)


def _may_be_meshed(given: Scene, opened: frozenset[str]) -> bool:
    """Tell whether a scene leaves it open that its roughness be meshed."""
    if given.micro.hardness is not None or given.conductance is not None:
        return False  # meshes are elastic, and do not know the stiffness of the interface alone
    others = (given.body, given.counter_body, given.counter_surface)
    if any(one is not None for one in others):
        return False  # it is the block whose roughness is meshed, under a rigid plane
    stated = given.stated("coupling") - {"kind"}
    return {"coupling.kind", "micro.model"} <= opened and not stated


def _meshed_instead(scene: Scene, search: Search) -> Found | None:
    """Return a reference instead of a scene on cells; None where it has none that may be tried.

    Raises:
        MemoryLacking: When its meshes do not fit into the memory.
    """
    scene = scene.with_({"coupling": {"kind": "reference"}, "micro": {"model": "half-space"}})
    search = replace(search, opened=search.opened | scene.open_keys)
    try:
        first = search.first_meshes(scene)
        return search.meshed(first) if search.is_small(first) else None
    except MemoryLacking:  # another machine would take the reference
        raise
    except (InputError, NotConverged):  # the block has no such meshes
        return None
