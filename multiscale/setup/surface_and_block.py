"""Makes the surface and the block of a scene, and refuses patches and loads that do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from geometry import (
    BlockShape,
    InputError,
    Surface,
    facing,
    laid_on,
    read_surface,
    synthesise,
    turned_over,
)
from geometry.files.reading import surface_of
from geometry.meshes.block import BlockMeshing
from geometry.preparation import Preparation, prepared
from geometry.zero import Zero
from multiscale.loading.load_history import LoadHistory
from multiscale.scene.bodies import BlockSection
from multiscale.scene.scene import Scene
from multiscale.scene.surface import CounterSurfaceSection, SurfaceSection
from support.fields import part_of

LAW_BLOCK_CELLS, FIELD_CELLS = (40, 40, 25), (20, 20, 12)
"""Cells of a block that carries laws on its mesh, those of Waddad et al. 2016, or contacts, and of
one that is meshed after the load for its fields under the mean pressures of patches."""
_ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Approach over the largest height below which it does not change where the plane is."""
PROVISIONAL_PATCHES = (4, 4)
"""Patches that stand for ``"auto"`` until they are chosen."""


def make_surface(scene: Scene) -> Surface:
    """Return the surface of a scene, with the heights of both sides where both are rough.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    return make_surfaces(scene)[0]


def make_surfaces(scene: Scene) -> tuple[Surface, Surface | None]:
    """Return the surface of a scene, and what of it is the counter-body's, turned over.

    Returns:
        The heights of both sides, and those of the counter-body; None where it is smooth.

    Raises:
        InputError: When one cannot be made or read, or they do not fit; names file and key.
    """
    own = sample_surface(scene, scene.surface, "surface")
    if scene.counter_surface is None:
        return own, None
    counter = laid_counter_surface(scene, scene.counter_surface, own)
    with located(scene, "counter_surface"):
        return facing(own, counter), counter


def laid_counter_surface(scene: Scene, section: CounterSurfaceSection, own: Surface) -> Surface:
    """Return the counter-body's surface as it lies on the first one: turned over, turned and moved.

    Args:
        scene: The scene.
        section: Its section on the counter-body's surface.
        own: The first surface.

    Raises:
        InputError: When it cannot be made or read, or does not cover the first one; names file and
            key.
    """
    counter = turned_over(sample_surface(scene, section, "counter_surface"))
    if not section.is_moved:
        return counter
    key = "rotation" if section.rotation else "shift"
    value: Any = section.rotation if section.rotation else list(section.shift)
    allowed = "a map that continues periodically, or one that is larger by as much"
    try:
        laid = laid_on(own, counter, shift=section.shift, angle=section.rotation)
    except InputError:
        problem = "takes the counter-surface off the surface, which it must cover"
    else:
        if laid.periodic or not section.periodic:
            return laid
        problem = "leaves no counter-surface that continues periodically over these sides"
        allowed = "multiples of 90 deg, of 180 deg on sides that differ"
    raise InputError(
        problem, key=f"counter_surface.{key}", value=value, allowed=allowed, file=scene.file
    )


def sample_surface(scene: Scene, section: SurfaceSection, key: str) -> Surface:
    """Make or read the surface of one section of a scene.

    Args:
        scene: The scene.
        section: The section.
        key: Its dotted name, for errors.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    extent: dict[str, Any] = {"grid": section.grid, "lengths": section.lengths}
    if section.spectrum is not None:
        with located(scene, f"{key}.spectrum"):
            surface = prepared(synthesise(section.spectrum, **extent), section)
    elif section.heights is not None:
        with located(scene, f"{key}.heights"):
            return surface_of(
                section.heights.values,
                lengths=section.lengths or (0.0, 0.0),
                height_unit=section.height_unit or "mm",
                periodic=section.periodic,
                **part_of(section, Preparation),
            )
    else:
        extent |= {"height_unit": section.height_unit, "channel": section.channel}
        extent |= {"periodic": section.periodic, **part_of(section, Preparation)}
        with located(scene, f"{key}.file"):
            surface = read_surface(scene.path_of(section.file) or Path(), **extent)
    if section.periodic and not surface.periodic:  # it continues so, whatever was removed of it
        return replace(surface, periodic=True)
    return surface


def make_shape(scene: Scene, surface: Surface) -> BlockShape:
    """Return the shape and cells of a scene's block under its surface.

    Raises:
        InputError: When they do not fit together or the coupling; names file and key.
    """
    block = block_section(scene)
    lengths = block.lengths or surface.lengths
    with located(scene, "block"):
        return BlockShape(
            interface=lengths,
            height=block.height_under(lengths),
            cells=block_cells(scene),
            **part_of(block, BlockMeshing),
        )


def block_section(scene: Scene) -> BlockSection:
    """Return the section on the block of a scene that has one.

    Raises:
        ValueError: When its body is a mesh.
    """
    if scene.block is None:
        raise ValueError("a scene with a body of its own has no block")
    return scene.block


def block_cells(scene: Scene) -> tuple[int, int, int]:
    """Return the cells of the flat block's mesh: those of the scene, or as many as its use needs.

    Laws need a fine mesh under every patch, and contacts are to be seen in fields; the mean
    pressures of patches need less.
    """
    cells = block_section(scene).cells
    if cells is None or cells == "auto":
        fine = scene.on_mesh or scene.kind == "concurrent"
        return LAW_BLOCK_CELLS if fine else FIELD_CELLS
    return cells


def meshes_block(scene: Scene) -> bool:
    """Tell whether the flat block is meshed: under laws, or for fields after the load."""
    flat = scene.kind not in ("analytic", "reference")
    return scene.on_mesh or (flat and bool(scene.output.fields))


def patch_grid(scene: Scene) -> tuple[int, int]:
    """Return the patches along x and y, or what stands for ``"auto"`` until they are chosen."""
    grid = scene.patches.grid
    return PROVISIONAL_PATCHES if grid == "auto" else grid


class Bulk(NamedTuple):
    """What is compared with loads of a body.

    Attributes:
        area: Area of its contact face [mm²].
        height: Its extent below the contact face [mm].
        young_modulus: Young's modulus at the contact face [MPa].
    """

    area: float
    height: float
    young_modulus: float


def patch_limits(scene: Scene, surface: Surface) -> dict[str, Sequence[int]]:
    """Return what limits the numbers of patches along x and y, each with these limits.

    Args:
        scene: The scene.
        surface: Its surface.
    """
    limits: dict[str, Sequence[int]] = {"heights of the surface": surface.grid}
    if scene.block is not None and meshes_block(scene):
        limits["cells of the interface (block.cells)"] = block_cells(scene)[:2]
    return limits


def check_patches(scene: Scene, surface: Surface) -> None:
    """Refuse more patches than heights of the surface or cells of the interface."""
    grid = patch_grid(scene)
    for what, limit in patch_limits(scene, surface).items():
        if np.any(np.greater(grid, limit)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(grid),
                allowed=f"at most {list(limit)}",
                file=scene.file,
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
            file=scene.file,
        )
    return replace(loading, approach=points, depth=depth)


def check_load(scene: Scene, surfaces: Sequence[Surface], body: Bulk) -> None:
    """Refuse loads lost in the rounding of heights, or that press the body to nothing.

    Numbers of load steps that there will not be are refused, too.

    Args:
        scene: The scene.
        surfaces: Its surface, or samples of it.
        body: Size and stiffness of its body.
    """
    loading, fields = scene.loading, scene.output.fields
    count = loading.count
    if isinstance(fields, list) and loading.force_change is None and max(fields) > count:
        raise InputError(
            "there are fewer load steps",
            key="output.fields",
            value=fields,
            allowed=f"numbers up to {count}",
            file=scene.file,
        )
    resolved = _ROUNDING * max(float(np.abs(one.heights).max()) for one in surfaces)
    approaches = load_history_on(scene, surfaces).points
    if loading.approach is not None and 0.0 < max(approaches) < resolved:
        raise InputError(
            "is lost in the rounding of the heights",
            key="load.approach",
            value=list(loading.approach),
            allowed=f"at least {resolved:.3g} mm, for heights of this size",
            file=scene.file,
        )
    _check_hardness(scene, body.area)
    _check_gap(scene, surfaces[0], approaches)
    if scene.kind == "analytic":
        return
    if loading.force is not None:
        key, points = "load.force", loading.force
        most, named, unit = body.young_modulus * body.area, "E times area", "N"
    else:
        key, points = "load.approach", approaches
        most, named, unit = body.height, "the body's height", "mm"
    if max(points) > most:
        raise InputError(
            "presses the body to nothing",
            key=key,
            value=list(points),
            allowed=f"at most {named}, {most:.6g} {unit}",
            file=scene.file,
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
        file=scene.file,
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
            file=scene.file,
        )


@contextmanager
def located(scene: Scene, key: str) -> Iterator[None]:
    """Give errors of the input that occur within the scene's file and a key.

    Args:
        scene: The scene.
        key: The key.
    """
    try:
        yield
    except InputError as error:
        raise error.located(key=key, file=scene.file) from None
