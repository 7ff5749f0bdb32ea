"""The loads and the patches of a scene on its surface, and their refusal where they do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, Literal, NamedTuple

import numpy as np

from patchlaw.geometry import Surface
from patchlaw.geometry.surface import Zero
from patchlaw.multiscale.loading.load_history import LOADS
from patchlaw.multiscale.loading.path import BodyLoads, Path, Quantity, Step, states_of
from patchlaw.multiscale.scene.parts import BodyFacts, meshed_cells
from patchlaw.multiscale.scene.rules import TURNS_BACK
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support import InputError, located, part_of

Refusal = tuple[str, Any, str, str]
"""A key, its value, why it makes no sense, and what is allowed."""


class LoadsOnFace(NamedTuple):
    """The loads of a scene on its contact face.

    Attributes:
        path: The load steps, counted from first touch.
        zero: Approach from first touch that the scene's approaches count from [mm].
        surfaces: The surface, or samples of it.
        area: Nominal area of the face [mm²].
    """

    path: Path
    zero: float
    surfaces: Sequence[Surface]
    area: float


STEEPEST_PLANE = 0.2
"""Largest slope of a plane: its normal force and that along z then differ by 2 %, 1 − cos 0.2."""


def patch_limits(scene: Scene, surface: Surface) -> dict[str, Sequence[int]]:
    """Return what limits the numbers of patches along x and y, each with these limits.

    Args:
        scene: The scene.
        surface: Its surface.
    """
    limits: dict[str, Sequence[int]] = {"heights of the surface": surface.grid}
    if scene.micro.cells:
        limits["cells of contacts (micro.cells)"] = scene.micro.cells
    if cells := meshed_cells(scene):
        limits["cells of the interface (block.cells)"] = cells[:2]
    return limits


def check_patches(scene: Scene, surface: Surface) -> None:
    """Refuse more patches than there may be.

    Args:
        scene: The scene.
        surface: Its surface.
    """
    grid = scene.patches.grid
    for what, limit in patch_limits(scene, surface).items():
        if np.any(np.greater(grid, limit)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(grid),
                allowed=f"at most {list(limit)}",
            )


def loads_on(scene: Scene, surfaces: Sequence[Surface], area: float) -> LoadsOnFace:
    """Return the loads of a scene.

    Args:
        scene: The scene, whose approaches count from its zero.
        surfaces: Its surface, or samples of it.
        area: Nominal area of the contact face [mm²].

    Raises:
        InputError: When the zero is none of the surface, the plane does not touch it, or the force
            that is left for the contact is negative.
    """
    loading = scene.loading
    with located(scene.file, "load.zero"):
        depth = Zero(loading.zero).depth(surfaces)
    pulls = [0.0] if scene.body is None else [one.pull for one in body_states(scene, "body")]
    path = loading.path(depth, area, pulls)
    untouched = path[0].quantity == "approach" and not loading.stage and not path[0].value > 0.0
    for step in path.turning_points:
        if not (untouched or (step.value < 0.0 and not step.carried)):
            continue
        pull = float(np.interp(step.body_state, np.arange(len(pulls)), pulls))
        problem = f"pulls the plane off the surface with {pull - step.value:.6g} N"
        allowed = f"a force ≥ {0.0 - pull:.6g} N, the pull of the bolts"
        if step.quantity == "approach":
            problem = "does not touch the surface, or turns before first touch, "
            problem += f"{depth:.6g} mm above the {loading.zero}"
            allowed = f"> {-depth:.6g} mm"
        key, value = _stated(scene, step)
        raise InputError(problem, key=key, value=value, allowed=allowed)
    return LoadsOnFace(path, depth, surfaces, area)


def body_states(scene: Scene, name: Literal["body", "counter_body"]) -> list[BodyLoads]:
    """Return the states of a body's loads, see `multiscale.loading.path.states_of`.

    Args:
        scene: The scene.
        name: Section of the body.
    """
    section, stages = getattr(scene, name), scene.loading.stage
    base = BodyLoads(**part_of(section, BodyLoads))
    lasting = [one.cycles is None for one in stages]
    return states_of(base, [getattr(one, name) for one in stages], lasting)


def check_load(scene: Scene, loads: LoadsOnFace, body: BodyFacts | None) -> None:
    """Refuse loads lost in the rounding of heights, or that press the body to nothing.

    Numbers of load steps that there will not be are refused, too.

    Args:
        scene: The scene.
        loads: Its loads.
        body: What is known of its body; None of a half-space.
    """
    crushed = () if body is None else _pressed_to_nothing(scene, loads, body)
    for key, value, problem, allowed in chain(_lost_or_unbearable(scene, loads), crushed):
        raise InputError(problem, key=key, value=value, allowed=allowed)


def _lost_or_unbearable(scene: Scene, loads: LoadsOnFace) -> Iterator[Refusal]:
    """Yield loads that are lost, or that surfaces do not bear, whatever the body."""
    path, zero, surfaces, area = loads
    loading, fields, key = scene.loading, scene.output.fields, scene.hardness_key
    known = [one for one in scene.hardnesses if one is not None]
    hardness = max(known) if len(known) == len(scene.hardnesses) else None
    count, by_samples = loading.count, scene.law.representative
    if isinstance(fields, list) and loading.force_change is None and max(fields) > count:
        yield "output.fields", fields, "there are fewer load steps", f"numbers up to {count}"
    eps = float(np.finfo(float).eps)
    resolved = 16.0 * eps * max(float(np.abs(one.heights).max()) for one in surfaces)
    if loading.approach is not None and 0.0 < path.largest() < resolved:
        problem = "is lost in the rounding of the heights"
        allowed = f"at least {resolved:.3g} mm, for heights of this size"
        points = _with_unit("approach", loading.approach)
        yield "load.approach", points, problem, allowed
    presses = path.largest_controls or (by_samples and scene.loads_bodies)
    if loading.stage and not presses:
        problem = "presses nothing: no stage has a load of the plane"
        allowed = "an approach, a force or a pressure of one of the stages"
        yield "load.stage", [stage.name for stage in loading.stage], problem, allowed
    force = path.largest("force")
    if hardness is not None and hardness <= (mean := force / area):
        problem = (
            "leaves no equilibrium: even where all of the face touches, the force of "
            f"{force:.6g} N on {area:.6g} mm² needs a mean pressure of {mean:.6g} MPa"
        )
        allowed = f"> {mean:.6g} MPa, or a smaller load.force"
        yield key, f"{hardness:.6g} MPa", problem, allowed
    if key and scene.by_laws and loading.unloads_on(area):
        yield key, f"{known[0]:.6g} MPa", *TURNS_BACK
    surface, approach = surfaces[0], path.largest("approach")
    most = surface.highest - surface.mean_height
    if scene.surface.periodic and not by_samples and hardness is None and 0.0 < approach >= most:
        problem = "leaves no gap on the periodic surface, whose mean displacement counts as none"
        allowed = (
            f"less than {most - zero:.6g} mm, where the plane reaches the mean "
            "height; beyond it load.force"
        )
        yield *_stated(scene, path.furthest("approach")), problem, allowed
    tilt = loading.slopes
    if tilt is not None and max(map(abs, tilt)) > STEEPEST_PLANE:
        problem = "is too steep for the theory of small rotations"
        yield "load.tilt", list(tilt), problem, f"slopes within ±{STEEPEST_PLANE:g}"


def _pressed_to_nothing(scene: Scene, loads: LoadsOnFace, body: BodyFacts) -> Iterator[Refusal]:
    """Yield loads that press the body, or an edge of it, to nothing."""
    path, _, surfaces, area = loads
    young, tilt = body.materials[0].young_modulus, scene.loading.slopes
    forces = f"E times area, {young * area:.6g} N"
    if scene.loading.pressure is not None:
        forces = f"E, {young:.6g} MPa"
    limits: dict[Quantity, tuple[float, str]] = {
        "approach": (body.depth, f"the body's height, {body.depth:.6g} mm"),
        "force": (young * area, forces),
    }
    for quantity, (most, words) in limits.items():
        if path.largest(quantity) > most:
            problem = "presses the body to nothing"
            yield *_stated(scene, path.furthest(quantity)), problem, f"at most {words}"
    largest = path.largest("approach")
    if tilt is None or not largest > 0.0:
        return
    lengths = body.lengths if scene.law.representative else surfaces[0].lengths
    lowered = 0.5 * sum(abs(t) * length for t, length in zip(tilt, lengths, strict=True))
    if lowered > 0.0 and largest + lowered > body.depth:
        problem = f"presses an edge of the body to nothing, {lowered:.6g} mm below the middle"
        allowed = f"an edge at most {body.depth - largest:.6g} mm below"
        yield "load.tilt", list(tilt), problem, allowed


def _stated(scene: Scene, step: Step) -> tuple[str, Any]:
    """Return the key that states the load of a step, and what stands there."""
    if points := scene.loading.stated[1]:
        return step.key, _with_unit(step.key, points)
    _, _, number, *quantity = step.key.split(".")  # without one of a pull alone
    value = getattr(scene.loading.stage[int(number)], *quantity) if quantity else None
    return step.key, _with_unit(step.key, value)


def _with_unit(key: str, value: Any) -> Any:
    """Return loads with their units, a single one of a list alone; what is no number as it is."""
    if isinstance(value, list | tuple):
        texts = [_with_unit(key, one) for one in value]
        return texts[0] if len(texts) == 1 else texts
    unit, *_ = LOADS.get(key.rpartition(".")[2], ("",))
    return f"{value:.6g} {unit}" if unit and isinstance(value, float | int) else value
