"""The loads and the patches of a scene on its surface, and their refusal where they do not fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, Literal

import numpy as np

from patchlaw.geometry import Surface
from patchlaw.geometry.zero import Zero
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.stages import BodyLoads, Quantity, states_of
from patchlaw.multiscale.scene.parts import BodyFacts
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import located
from patchlaw.support.arguments import part_of
from patchlaw.support.errors import InputError

Refusal = tuple[str, Any, str, str]
"""A key, its value, why it makes no sense, and what is allowed."""
STEEPEST_PLANE = 0.2
"""Largest slope of a plane: its normal force and that along z then differ by 2 %, 1 − cos 0.2."""


def check_patches(scene: Scene, limits: Mapping[str, Sequence[int]]) -> None:
    """Refuse more patches than there may be.

    Args:
        scene: The scene.
        limits: What limits the numbers of patches along x and y, each with these limits.
    """
    grid = scene.patches.grid
    for what, limit in limits.items():
        if np.any(np.greater(grid, limit)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(grid),
                allowed=f"at most {list(limit)}",
            )


def load_history_on(scene: Scene, surfaces: Sequence[Surface], area: float) -> LoadHistory:
    """Return the load history of a scene, with approaches from first touch and forces.

    Args:
        scene: The scene, whose approaches count from its zero.
        surfaces: Its surface, or samples of it.
        area: Nominal area of the contact face [mm²].

    Raises:
        InputError: When the zero is none of the surface, or the plane does not touch it.
    """
    loading = scene.loading
    with located(scene, "load.zero"):
        depth = Zero(loading.zero).depth(surfaces)
    pulls = [] if scene.body is None else [one.pull for one in body_states(scene, "body")]
    history = loading.on_face(depth, area, pulls)
    points = history.approach
    if points is not None and (not points[0] > 0.0 or min(points) < 0.0):
        raise InputError(
            f"does not touch the surface, or turns before first touch, {depth:.6g} mm above the "
            f"{loading.zero}",
            key="load.approach",
            value=list(loading.approach or ()),
            allowed=f"> {-depth:.6g} mm",
        )
    return history


def body_states(scene: Scene, name: Literal["body", "counter_body"]) -> list[BodyLoads]:
    """Return the states of a body's loads, see `multiscale.loading.stages.states_of`.

    Args:
        scene: The scene.
        name: Section of the body.
    """
    section, stages = getattr(scene, name), scene.loading.stage
    base = BodyLoads(**part_of(section, BodyLoads))
    lasting = [one.cycles is None for one in stages]
    return states_of(base, [getattr(one, name) for one in stages], lasting)


def check_load(
    scene: Scene,
    load_history: LoadHistory,
    surfaces: Sequence[Surface],
    area: float,
    body: BodyFacts | None,
) -> None:
    """Refuse loads lost in the rounding of heights, or that press the body to nothing.

    Numbers of load steps that there will not be are refused, too.

    Args:
        scene: The scene.
        load_history: Its loads, counted from first touch.
        surfaces: Its surface, or samples of it.
        area: Area of the contact face [mm²].
        body: What is known of its body; None of a half-space.
    """
    problems = chain(
        _lost_or_unbearable(scene, load_history, surfaces, area),
        () if body is None else _pressed_to_nothing(scene, load_history, surfaces[0], area, body),
    )
    for key, value, problem, allowed in problems:
        raise InputError(problem, key=key, value=value, allowed=allowed)


def _lost_or_unbearable(
    scene: Scene, load_history: LoadHistory, surfaces: Sequence[Surface], area: float
) -> Iterator[Refusal]:
    """Yield loads that are lost, or that surfaces do not bear, whatever the body."""
    loading, hardness, fields = scene.loading, scene.micro.hardness, scene.output.fields
    count, by_samples = loading.count, scene.law.representative
    if isinstance(fields, list) and loading.force_change is None and max(fields) > count:
        yield "output.fields", fields, "there are fewer load steps", f"numbers up to {count}"
    eps = float(np.finfo(float).eps)
    resolved = 16.0 * eps * max(float(np.abs(one.heights).max()) for one in surfaces)
    if loading.approach is not None and 0.0 < load_history.largest < resolved:
        problem = "is lost in the rounding of the heights"
        allowed = f"at least {resolved:.3g} mm, for heights of this size"
        yield "load.approach", list(loading.approach), problem, allowed
    presses = load_history.largest_controls or (by_samples and scene.loads_bodies)
    if loading.stage and not presses:
        problem = "presses nothing: no stage has a load of the plane"
        allowed = "an approach, a force or a pressure of one of the stages"
        yield "load.stage", [stage.name for stage in loading.stage], problem, allowed
    force = load_history.largest_of("force")
    if hardness is not None and hardness <= (mean := force / area):
        problem = (
            "leaves no equilibrium: even where all of the face touches, the force of "
            f"{force:.6g} N on {area:.6g} mm² needs a mean pressure of {mean:.6g} MPa"
        )
        allowed = f"> {mean:.6g} MPa, or a smaller load.force"
        yield "micro.hardness", f"{hardness:.6g} MPa", problem, allowed
    surface, approach = surfaces[0], load_history.largest_of("approach")
    most = surface.highest - surface.mean_height
    if scene.surface.periodic and not by_samples and hardness is None and approach >= most:
        problem = "leaves no gap on the periodic surface, whose mean displacement counts as none"
        allowed = (
            f"less than {most - load_history.depth:.6g} mm, where the plane reaches the mean "
            "height; beyond it load.force"
        )
        yield *_stated(scene, approach - load_history.depth, "approach"), problem, allowed
    tilt = loading.slopes
    if tilt is not None and max(map(abs, tilt)) > STEEPEST_PLANE:
        problem = "is too steep for the theory of small rotations"
        yield "load.tilt", list(tilt), problem, f"slopes within ±{STEEPEST_PLANE:g}"


def _pressed_to_nothing(
    scene: Scene, load_history: LoadHistory, surface: Surface, area: float, body: BodyFacts
) -> Iterator[Refusal]:
    """Yield loads that press the body, or an edge of it, to nothing."""
    young, tilt = body.materials[0].young_modulus, scene.loading.slopes
    forces = f"E times area, {young * area:.6g} N"
    if scene.loading.pressure is not None:
        forces = f"E, {young:.6g} MPa"
    limits: dict[Quantity, tuple[float, str]] = {
        "approach": (body.depth, f"the body's height, {body.depth:.6g} mm"),
        "force": (young * area, forces),
    }
    for quantity, (most, words) in limits.items():
        largest = load_history.largest_of(quantity)
        if largest > most:
            stated = largest - (load_history.depth if quantity == "approach" else 0.0)
            problem = "presses the body to nothing"
            yield *_stated(scene, stated, quantity), problem, f"at most {words}"
    largest = load_history.largest_of("approach")
    if tilt is None or not largest > 0.0:
        return
    lengths = body.lengths if scene.law.representative else surface.lengths
    lowered = 0.5 * sum(abs(t) * length for t, length in zip(tilt, lengths, strict=True))
    if lowered > 0.0 and largest + lowered > body.depth:
        problem = f"presses an edge of the body to nothing, {lowered:.6g} mm below the middle"
        allowed = f"an edge at most {body.depth - largest:.6g} mm below"
        yield "load.tilt", list(tilt), problem, allowed


def _stated(scene: Scene, value: float, quantity: Quantity) -> tuple[str, Any]:
    """Return the key that states a load, and what stands there.

    Args:
        scene: The scene.
        value: The load, as it is stated but for rounding [mm or N].
        quantity: What it is.
    """
    key, points = scene.loading.stated
    if key != "stage":
        return f"load.{key}", points
    for number, stage in enumerate(scene.loading.stage):
        stated = getattr(stage, quantity)
        if stated is not None and math.isclose(stated, value, rel_tol=1e-9):
            return f"load.stage.{number}.{quantity}", stated
    return "load.stage", value  # of a pressure, or a pull
