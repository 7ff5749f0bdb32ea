"""What scenes could name once: values and keys that are gone, and what takes their place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from geometry.errors import InputError

_MODELS = ("islands", "auto")
_KEYS: Mapping[str, Any] = {"curvature": "summit", "border": "ignore", "tolerance": None}
"""Keys of ``[micro]`` that are gone, with what they were when not given; so is all that is left."""
_HALF_SPACE = "micro.model = 'half-space', on a coarser surface.grid where speed matters"


def refuse_removed(scene: Any) -> None:
    """Refuse a scene that names what is gone.

    Args:
        scene: The sections as nested dictionaries, unchecked.

    Raises:
        InputError: When it does; says what to write instead.
    """
    micro = scene.get("micro") if isinstance(scene, Mapping) else None
    if not isinstance(micro, Mapping):
        return
    for name in ("model", *_KEYS):
        value = micro.get(name)
        if name == "model" and value not in _MODELS:
            continue
        if name in micro:
            allowed = _HALF_SPACE if value != _KEYS.get(name) else "leave it out"
            raise InputError("is gone", key=f"micro.{name}", value=value, allowed=allowed)


def without_removed(scene: dict[str, Any]) -> dict[str, Any]:
    """Return a scene that an earlier version recorded, without keys that said nothing there.

    Args:
        scene: The sections as nested dictionaries, with every key.
    """
    micro = scene.get("micro")
    if not isinstance(micro, Mapping):
        return scene
    kept = {
        name: value for name, value in micro.items() if name not in _KEYS or value != _KEYS[name]
    }
    return {**scene, "micro": kept}
