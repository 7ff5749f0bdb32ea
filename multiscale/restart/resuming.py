"""Lets a run go on from the checkpoint that an earlier run of the same scene left."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from geometry.errors import InputError
from multiscale.restart.checkpoint import FILE_NAME, Checkpoint, read_checkpoint
from multiscale.run import Run
from multiscale.scene.scene import Scene


def find_checkpoint(folder: Path, scene: Scene) -> Checkpoint | None:
    """Return what an interrupted run of a scene left in its results folder; None without it.

    Args:
        folder: The folder.
        scene: The present scene.

    Raises:
        InputError: When the checkpoint is damaged, or a key of the scene has changed.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    found = read_checkpoint(path)
    _refuse_changed_keys(folder, scene, found.scene)
    return found


def go_on(run: Run, found: Checkpoint, folder: Path) -> None:
    """Let a run go on from a checkpoint of the same scene.

    Args:
        run: The run, made with the resolved values of the checkpoint; nothing of it made yet.
        found: The checkpoint.
        folder: Folder of the results, for messages.

    Raises:
        InputError: When the heights have changed.
    """
    _refuse_changed_heights(folder, run, found.heights)
    run.resume(found.steps, found.position, found.state, found.laws)


def is_finished(folder: Path, run: Run) -> bool:
    """Tell whether the results in a folder are those of a finished run of the same scene.

    Args:
        folder: The folder.
        run: A run of the scene.
    """
    try:
        facts = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))
        _refuse_changed_keys(folder, run.given, facts["scene_given"])
        _refuse_changed_heights(folder, run, facts["surface"]["heights_sha256"])
        return bool(facts["finished"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False  # InputError is a ValueError


def _refuse_changed_heights(folder: Path, run: Run, heights: str) -> None:
    """Refuse to go on with heights other than those that a run began with."""
    if heights != run.heights:
        raise InputError(
            f"the heights are not those that the run in {folder} began with; restore them, or "
            "run without --resume to begin anew",
            key="surface.file",
            value=run.given.surface.file,
        )


def _refuse_changed_keys(folder: Path, now: Scene, then: dict[str, Any]) -> None:
    """Refuse to go on with a scene in which a key has changed that can matter."""
    old, new = dict(_dotted(then)), dict(_dotted(now.model_dump(by_alias=True, mode="json")))
    for key in dict.fromkeys((*new, *old)):
        if not key.startswith("output.") and old.get(key) != new.get(key):
            raise InputError(
                f"is not what the run in {folder} began with; restore it, or run without "
                "--resume to begin anew",
                key=key,
                value=new.get(key),
                allowed=repr(old.get(key)),
            )


def _dotted(scene: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys of nested dictionaries, dotted, with their values."""
    for name, value in scene.items():
        if isinstance(value, dict):
            yield from _dotted(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
