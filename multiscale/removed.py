"""What scenes could name once: micro models and keys that are gone, and what takes their place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from patchlaw.support.errors import InputError

_INSTEAD = "micro.model = 'half-space', on a coarser surface.grid where speed matters"
_MODELS = ("islands", "auto")
_KEYS: Mapping[str, Any] = {"curvature": "summit", "border": "ignore", "tolerance": None}
"""Keys of ``[micro]`` that are gone, with what they were when not given."""


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
    if micro.get("model") in _MODELS:
        raise InputError("is gone", key="micro.model", value=micro["model"], allowed=_INSTEAD)
    for name, default in _KEYS.items():
        if name in micro:
            allowed = "leave it out" if micro[name] == default else _INSTEAD
            raise InputError("is gone", key=f"micro.{name}", value=micro[name], allowed=allowed)


def refuse_removed_results(scene: Mapping[str, Any]) -> None:
    """Refuse what was computed with something that is gone.

    Args:
        scene: The scene that was recorded with it, with every key.

    Raises:
        InputError: When the scene is refused now.
    """
    try:
        refuse_removed(without_removed(scene))
    except InputError as error:
        raise InputError(
            "is gone, and so is what was computed with it",
            key=error.key,
            value=error.value,
            allowed=error.allowed,
        ) from None


def refuse_removed_laws(model: str) -> None:
    """Refuse laws of a micro model that is gone.

    Args:
        model: The name of the model that made them.

    Raises:
        InputError: When it is gone.
    """
    if model in _MODELS or ", curvature " in model:
        problem = "is the micro model of these laws, and is gone"
        raise InputError(problem, value=model, allowed=f"laws made anew with {_INSTEAD}")


def without_removed(scene: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene that an earlier version recorded, without keys that said nothing there.

    Args:
        scene: The sections as nested dictionaries, with every key.
    """
    micro = scene.get("micro")
    if not isinstance(micro, Mapping):
        return dict(scene)
    said = {name: micro[name] for name in micro if name not in _KEYS or micro[name] != _KEYS[name]}
    return {**scene, "micro": said}
