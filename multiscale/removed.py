"""Keys of scenes that are gone, and what to do instead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from patchlaw.support.errors import InputError

_HALF_SPACE = "micro.model = 'half-space', on a coarser surface.grid where speed matters"
_AUTO = "coupling.kind", "patches.grid", "block.cells", "surface.grid", "counter_surface.grid"
_BY_ACCURACY = "leave it out, with 'accuracy' beside it, which chooses what is not stated"
_EDGES = "reference.fine states the edge length of tetrahedra"
GONE: Mapping[str, str] = {
    "micro.model = 'islands'": _HALF_SPACE,
    "micro.model = 'auto'": _HALF_SPACE,
    "micro.curvature": f"leave it out, for that of the summit; or {_HALF_SPACE}",
    "micro.border": f"leave it out: summits on the border carry no load; or {_HALF_SPACE}",
    **{f"{key} = 'auto'": _BY_ACCURACY for key in _AUTO},
    "coupling.compliance": "leave it out: the program chooses",
    "coupling.newton": "leave it out: the program chooses",
    "micro.solver": "leave it out: Newton's method on the active set",
    "micro.tolerance": f"leave it out; or {_HALF_SPACE}",
    "reference.mesh": f"leave it out: all meshes are of tetrahedra; {_EDGES}",
    "reference.cells": f"{_EDGES}, or leave it out",
    "reference.mesher": "leave it out; a mesh of your own, by gmsh too, goes into [body]",
}
"""What to do instead, by key, or by key and value where other values stay."""


def refuse_removed(scene: Any) -> None:
    """Refuse a scene that names what is gone.

    Args:
        scene: The sections as nested dictionaries, unchecked.

    Raises:
        InputError: When it does; says what to write instead.
    """
    for name, section in scene.items() if isinstance(scene, Mapping) else ():
        for field, value in section.items() if isinstance(section, Mapping) else ():
            key = f"{name}.{field}"
            if instead := GONE.get(key) or GONE.get(f"{key} = {value!r}"):
                raise InputError("is gone", key=key, value=value, allowed=instead)
