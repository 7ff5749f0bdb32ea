"""Makes the surface and the block of a scene, and refuses patches and loads that do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from geometry import BlockShape, InputError, Material, Surface, read_surface, synthesise
from geometry.files.reading import surface_of
from geometry.preparation import prepared
from multiscale.scene.scene import Scene

LAW_BLOCK_CELLS, FIELD_CELLS = (40, 40, 25), (20, 20, 12)
"""Cells of a block that carries laws on its mesh, those of Waddad et al. 2016, and of one that is
meshed after the load for its fields alone."""
_ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Approach over the largest height below which it does not change where the plane is."""
PROVISIONAL_PATCHES = (4, 4)
"""Patches that stand for ``"auto"`` until they are chosen."""


def make_surface(scene: Scene) -> Surface:
    """Make or read the surface of a scene.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    section = scene.surface
    extent: dict[str, Any] = {"grid": section.grid, "lengths": section.lengths}
    if section.spectrum is not None:
        with located(scene, "surface.spectrum"):
            surface = synthesise(section.spectrum.spectrum(), **extent)
        with located(scene, "surface"):
            surface = prepared(surface, section.preparation)
    elif section.heights is not None:
        with located(scene, "surface.heights"):
            return surface_of(
                section.heights.values,
                lengths=section.lengths or (0.0, 0.0),
                height_unit=section.height_unit or "mm",
                periodic=section.periodic,
                **asdict(section.preparation),
            )
    else:
        extent |= {"height_unit": section.height_unit, "channel": section.channel}
        extent |= {"periodic": section.periodic, **asdict(section.preparation)}
        with located(scene, "surface.file"):
            surface = read_surface(scene.surface_path or Path(), **extent)
    if section.periodic and not surface.periodic:  # it continues so, whatever was removed of it
        return replace(surface, periodic=True)
    return surface


def make_shape(scene: Scene, surface: Surface) -> BlockShape:
    """Return the shape and cells of a scene's block under its surface.

    Raises:
        InputError: When they do not fit together or the coupling; names file and key.
    """
    block = scene.block
    with located(scene, "block"):
        return BlockShape(
            interface=surface.lengths,
            height=block.height_under(surface.lengths),
            cells=block_cells(scene),
            element=block.element,
            grading=block.grading,
            margin=block.margin,
            margin_cells=block.margin_cells if block.margin else 0,
            margin_grading=block.margin_grading if block.margin else 1.0,
        )


def block_material(scene: Scene) -> Material:
    """Return the elastic constants of a scene's block."""
    block = scene.block
    return Material(young_modulus=block.young_modulus, poisson_ratio=block.poisson_ratio)


def block_cells(scene: Scene) -> tuple[int, int, int]:
    """Return the cells of the flat block's mesh: those of the scene, or as many as its use needs.

    Laws need a fine mesh under every patch; fields do not.
    """
    cells = scene.block.cells
    if cells is None or cells == "auto":
        return LAW_BLOCK_CELLS if scene.coupling.on_mesh else FIELD_CELLS
    return cells


def meshes_block(scene: Scene) -> bool:
    """Tell whether the flat block is meshed: under laws, or for fields after the load."""
    return scene.coupling.on_mesh or (
        scene.output.fields and scene.coupling.kind not in ("analytic", "reference")
    )


def patch_grid(scene: Scene) -> tuple[int, int]:
    """Return the patches along x and y, or what stands for ``"auto"`` until they are chosen."""
    grid = scene.patches.grid
    return PROVISIONAL_PATCHES if grid == "auto" else grid


def check_patches(scene: Scene, surface: Surface) -> None:
    """Refuse more patches than heights of the surface or cells of the interface."""
    limits: dict[str, Sequence[int]] = {"heights of the surface": surface.grid}
    if meshes_block(scene):
        limits["cells of the interface (block.cells)"] = block_cells(scene)[:2]
    grid = patch_grid(scene)
    for what, limit in limits.items():
        if np.any(np.greater(grid, limit)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(grid),
                allowed=f"at most {list(limit)}",
                file=scene.file,
            )


def check_load(scene: Scene, surface: Surface) -> None:
    """Refuse loads lost in the rounding of heights, or that press the block to nothing."""
    block, loading = scene.block, scene.loading
    resolved = _ROUNDING * float(np.abs(surface.heights).max())
    if loading.approach is not None and 0.0 < max(loading.approach) < resolved:
        raise InputError(
            "is lost in the rounding of the heights",
            key="load.approach",
            value=list(loading.approach),
            allowed=f"at least {resolved:.3g} mm, for heights of this size",
            file=scene.file,
        )
    if scene.coupling.kind == "analytic":
        return
    if loading.force is not None:
        key, points = "load.force", loading.force
        most, named, unit = block.young_modulus * surface.area, "E times area", "N"
    else:
        key, points = "load.approach", loading.approach or ()
        most, named, unit = block.height_under(surface.lengths), "the block's height", "mm"
    if max(points) > most:
        raise InputError(
            "presses the block to nothing",
            key=key,
            value=list(points),
            allowed=f"at most {named}, {most:.6g} {unit}",
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
