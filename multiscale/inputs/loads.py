"""The loads and the patches of a scene on its surface, and their refusal where they do not fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from geometry import InputError, Surface
from geometry.zero import Zero
from multiscale.inputs.bodies import BodyFacts
from multiscale.inputs.surfaces import located
from multiscale.loading.load_history import LoadHistory
from multiscale.scene.scene import Scene

PROVISIONAL_PATCHES = (4, 4)
"""Patches that stand for ``"auto"`` until they are chosen."""


def patch_grid(scene: Scene) -> tuple[int, int]:
    """Return the patches along x and y, or what stands for ``"auto"`` until they are chosen."""
    grid = scene.patches.grid
    return PROVISIONAL_PATCHES if grid == "auto" else grid


def check_patches(scene: Scene, limits: Mapping[str, Sequence[int]]) -> None:
    """Refuse more patches than there may be.

    Args:
        scene: The scene.
        limits: What limits the numbers of patches along x and y, each with these limits.
    """
    grid = patch_grid(scene)
    for what, limit in limits.items():
        if np.any(np.greater(grid, limit)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(grid),
                allowed=f"at most {list(limit)}",
            )


def load_history_on(scene: Scene, surfaces: Sequence[Surface]) -> LoadHistory:
    """Return the load history of a scene, counted from first touch.

    Args:
        scene: The scene, whose approaches count from its zero.
        surfaces: Its surface, or samples of it.

    Raises:
        InputError: When the zero is none of the surface, or the plane does not touch it.
    """
    loading = scene.loading
    with located(scene, "load.zero"):
        depth = Zero(loading.zero).depth(surfaces)
    if loading.approach is None:
        return replace(loading, depth=depth)
    points = tuple(value + depth for value in loading.approach)
    if not points[0] > 0.0 or min(points) < 0.0:
        raise InputError(
            f"does not touch the surface, or turns before first touch, {depth:.6g} mm above the "
            f"{loading.zero}",
            key="load.approach",
            value=list(loading.approach),
            allowed=f"> {-depth:.6g} mm",
        )
    return replace(loading, approach=points, depth=depth)


def check_load(
    scene: Scene, surfaces: Sequence[Surface], area: float, body: BodyFacts | None
) -> None:
    """Refuse loads lost in the rounding of heights, or that press the body to nothing.

    Numbers of load steps that there will not be are refused, too.

    Args:
        scene: The scene.
        surfaces: Its surface, or samples of it.
        area: Area of the contact face [mm²].
        body: What is known of its body; None of a half-space.
    """
    loading, fields = scene.loading, scene.output.fields
    count = loading.count
    if isinstance(fields, list) and loading.force_change is None and max(fields) > count:
        raise InputError(
            "there are fewer load steps",
            key="output.fields",
            value=fields,
            allowed=f"numbers up to {count}",
        )
    eps = float(np.finfo(float).eps)
    resolved = 16.0 * eps * max(float(np.abs(one.heights).max()) for one in surfaces)
    approaches = load_history_on(scene, surfaces).points
    if loading.approach is not None and 0.0 < max(approaches) < resolved:
        raise InputError(
            "is lost in the rounding of the heights",
            key="load.approach",
            value=list(loading.approach),
            allowed=f"at least {resolved:.3g} mm, for heights of this size",
        )
    _check_hardness(scene, area)
    _check_gap(scene, surfaces[0], approaches)
    if body is None:
        return
    if loading.force is not None:
        key, points = "load.force", loading.force
        most, named, unit = body.materials[0].young_modulus * area, "E times area", "N"
    else:
        key, points = "load.approach", approaches
        most, named, unit = body.depth, "the body's height", "mm"
    if max(points) > most:
        raise InputError(
            "presses the body to nothing",
            key=key,
            value=list(points),
            allowed=f"at most {named}, {most:.6g} {unit}",
        )


def _check_hardness(scene: Scene, area: float) -> None:
    """Refuse forces whose mean pressure the hardness does not bear anywhere."""
    force, hardness = scene.loading.force, scene.micro.hardness
    if force is None or hardness is None or hardness > (mean := max(force) / area):
        return
    raise InputError(
        "leaves no equilibrium: even where all of the face touches, the force of "
        f"{max(force):.6g} N on {area:.6g} mm² needs a mean pressure of {mean:.6g} MPa",
        key="micro.hardness",
        value=f"{hardness:.6g} MPa",
        allowed=f"> {mean:.6g} MPa, or a smaller load.force",
    )


def _check_gap(scene: Scene, surface: Surface, approaches: Sequence[float]) -> None:
    """Refuse approaches from first touch that leave a periodic surface no gap, unless it yields."""
    points, most = scene.loading.approach, surface.highest - surface.mean_height
    if points is None or not scene.surface.periodic or scene.law.representative:
        return
    if scene.micro.hardness is None and (deepest := max(approaches)) >= most:
        raise InputError(
            "leaves no gap on the periodic surface, whose mean displacement counts as none",
            key="load.approach",
            value=list(points),
            allowed=f"less than {most - deepest + max(points):.6g} mm, where the plane reaches the "
            "mean height; beyond it load.force",
        )
