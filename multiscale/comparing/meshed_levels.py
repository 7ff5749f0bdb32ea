"""The levels at which a scene's roughness itself is meshed: how many meshes, how fine."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from geometry.typical_contact import suggested_fine
from multiscale.comparing.level import Content
from multiscale.ingredients import make_surface
from multiscale.scene import Scene

STEP = 2.0**0.5
"""Ratio of the finest edges of neighbouring levels."""

_STATED = tuple((meshes, 1.0) for meshes in (1, 2, 3))
_FAMILY = ((1, STEP * STEP), (1, 1.0), (2, 1.0), (3, 1.0), (3, 1.0 / STEP))


class MeshedLevel(NamedTuple):
    """What makes a scene a level with meshed roughness.

    Attributes:
        name: Name of the level.
        changes: Sections of the scene in place of its own.
        small_slopes_too: Whether it tells the effect of slopes, beside itself with small ones.
    """

    name: str
    changes: Content
    small_slopes_too: bool


def meshed(scene: Scene, base: Content, block: Content) -> Iterator[MeshedLevel]:
    """Return the levels with meshed roughness.

    Args:
        scene: The scene.
        base: Its content.
        block: Its block without cells, which only hexahedra ask for.
    """
    stated = base["reference"]
    if stated["mesh"] == "hexahedra":
        fine, block = None, base["block"]
    else:
        stated = stated | {"mesh": "tetrahedra"}
        fine = stated.get("fine") or _finest_edge(scene)
    for meshes, factor in _FAMILY if fine else _STATED:
        section = stated | {"meshes": meshes}
        name = f"reference, {meshes} mesh{'es' * (meshes > 1)}"
        if fine:
            section["fine"] = float(f"{factor * fine:.4g}")
        if "fine" in section:
            name += f", {1e3 * section['fine']:.3g} µm"
        changes = {"coupling": {"kind": "reference"}, "reference": section, "block": block}
        yield MeshedLevel(name, changes, bool(fine) and (meshes, factor) == (1, 1.0))


def _finest_edge(scene: Scene) -> float | None:
    """Return the edge of tetrahedra that fits the contacts; None where they are unknown."""
    programme = scene.loading.programme
    if programme.quantity == "force" or programme.tilt is None:
        return None
    surface = make_surface(scene)
    return suggested_fine(surface, programme.largest, tilt=programme.tilt)
