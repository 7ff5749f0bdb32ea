"""Makes what a scene describes by itself: the rough surface and the shape of its block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from geometry.errors import InputError
from geometry.files.reading import read_surface
from geometry.meshes.block import BlockShape
from geometry.preparation import prepared
from geometry.surface import Surface
from geometry.synthesis import synthesise
from multiscale.scene.scene import Scene
from multiscale.setup.checks import block_cells


def make_surface(scene: Scene) -> Surface:
    """Make or read the surface of a scene.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    section, path = scene.surface, scene.surface_path
    extent: dict[str, Any] = {"grid": section.grid, "lengths": section.lengths}
    steps = section.preparation
    if section.spectrum is not None:
        spectrum = section.spectrum.spectrum()
        surface = _located(scene, "surface.spectrum", lambda: synthesise(spectrum, **extent))
        surface = _located(scene, "surface", lambda: prepared(surface, steps))
    else:
        extent |= {"height_unit": section.height_unit, "channel": section.channel}
        extent |= {"periodic": section.periodic, **asdict(steps)}
        surface = _located(scene, "surface.file", lambda: read_surface(path or Path(), **extent))
    if section.periodic and not surface.periodic:  # it continues so, whatever was removed of it
        return replace(surface, periodic=True)
    return surface


def make_shape(scene: Scene, surface: Surface) -> BlockShape:
    """Return the shape and cells of a scene's block under its surface.

    Raises:
        InputError: When they do not fit together or the coupling; names file and key.
    """
    block = scene.block
    given: dict[str, Any] = {
        "interface": surface.lengths,
        "height": block.height_under(surface.lengths),
        "cells": block_cells(scene),
        "element": block.element,
        "grading": block.grading,
        "margin": block.margin,
        "margin_cells": block.margin_cells if block.margin else 0,
        "margin_grading": block.margin_grading if block.margin else 1.0,
    }
    shape: BlockShape = _located(scene, "block", lambda: BlockShape(**given))
    return shape


def _located(scene: Scene, key: str, make: Callable[[], Any]) -> Any:
    """Make something; an error gets the scene's file and the key."""
    try:
        return make()
    except InputError as error:
        raise error.located(key=key, file=scene.file) from None
