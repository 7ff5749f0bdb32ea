"""What scenes could name once: micro models and keys that are gone, and what takes their place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from patchlaw.support.errors import InputError

_INSTEAD = "micro.model = 'half-space', on a coarser surface.grid where speed matters"
_MODELS = ("islands", "auto")
_OF_REFERENCES = "reference.fine, the edge length of tetrahedra, or neither"
_KEYS: Mapping[str, Mapping[str, tuple[Any, str]]] = {
    "micro": {
        "curvature": ("summit", _INSTEAD),
        "border": ("ignore", _INSTEAD),
        "tolerance": (None, _INSTEAD),
    },
    "reference": {
        "mesh": ("auto", _OF_REFERENCES),
        "cells": (None, _OF_REFERENCES),
        "mesher": ("bisection", "leave it out; a mesh of your own, by gmsh too, goes into [body]"),
    },
}
"""Keys of sections that are gone, with what they were when not given, and what to write instead."""


def refuse_removed(scene: Any) -> None:
    """Refuse a scene that names what is gone.

    Args:
        scene: The sections as nested dictionaries, unchecked.

    Raises:
        InputError: When it does; says what to write instead.
    """
    if not isinstance(scene, Mapping):
        return
    for section, keys in _KEYS.items():
        content = scene.get(section)
        if not isinstance(content, Mapping):
            continue
        if section == "micro" and content.get("model") in _MODELS:
            raise InputError("is gone", key="micro.model", value=content["model"], allowed=_INSTEAD)
        for name, (default, instead) in keys.items():
            if name in content:
                allowed = "leave it out" if content[name] == default else instead
                key = f"{section}.{name}"
                raise InputError("is gone", key=key, value=content[name], allowed=allowed)


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
    said = dict(scene)
    for section, keys in _KEYS.items():
        content = scene.get(section)
        if isinstance(content, Mapping):
            said[section] = {
                name: value
                for name, value in content.items()
                if name not in keys or value != keys[name][0]
            }
    return said
