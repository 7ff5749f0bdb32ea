"""What scenes could name once: micro models and keys that are gone, and what takes their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from patchlaw.support.errors import InputError

_INSTEAD = "micro.model = 'half-space', on a coarser surface.grid where speed matters"
_MODELS = ("islands", "auto")
_KEYS: Mapping[str, tuple[Any, ...] | None] = {
    "micro.curvature": ("summit",),
    "micro.border": ("ignore",),
    "micro.tolerance": (None,),
    "micro.solver": None,
    "coupling.newton": None,
    "coupling.compliance": None,
}
"""Keys that are gone, with the values that can be left out; None: all of them can."""
_AUTO = ("coupling.kind", "patches.grid", "block.cells", "surface.grid", "counter_surface.grid")
"""Keys that could be ``"auto"``."""


def _can_be_left_out(key: str, value: Any) -> bool:
    """Tell whether a key that is gone said nothing, or says what the program chooses now."""
    values = _KEYS[key]
    return values is None or value in values


def refuse_removed(scene: Any) -> None:
    """Refuse a scene that names what is gone.

    Args:
        scene: The sections as nested dictionaries, unchecked.

    Raises:
        InputError: When it does; says what to write instead.
    """
    for key, value in _named(scene):
        if key in _KEYS:
            allowed = "leave it out" if _can_be_left_out(key, value) else _INSTEAD
            raise InputError("is gone", key=key, value=value, allowed=allowed)
        if key in _AUTO and value == "auto":
            allowed = "leave it out, with 'accuracy' beside it, which chooses what is not stated"
            raise InputError("is gone", key=key, value=value, allowed=allowed)
        if key == "micro.model" and value in _MODELS:
            raise InputError("is gone", key=key, value=value, allowed=_INSTEAD)


def _named(scene: Any) -> Iterator[tuple[str, Any]]:
    """Yield the keys of a scene's sections with their values."""
    for name in ("micro", "coupling", "patches", "block", "surface", "counter_surface"):
        section = scene.get(name) if isinstance(scene, Mapping) else None
        for key, value in section.items() if isinstance(section, Mapping) else ():
            yield f"{name}.{key}", value


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
    said = {name: dict(part) for name, part in scene.items() if isinstance(part, Mapping)}
    for key, value in _named(scene):
        if (key in _KEYS and _can_be_left_out(key, value)) or (key in _AUTO and value == "auto"):
            name, _, field = key.partition(".")
            del said[name][field]
    return {**scene, **said}
