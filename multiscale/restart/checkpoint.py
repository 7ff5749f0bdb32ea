"""What a run needs to go on where it was interrupted, as an HDF5 file with a checksum."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from geometry.errors import InputError
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.loading.stepper import LoadPosition
from multiscale.run import Run
from multiscale.scene.scene import Scene
from multiscale.storage.serialisation import (
    Arrays,
    as_text,
    checksummed,
    packed,
    part,
    prefixed,
    stored_numbers,
    text_array,
    unpacked,
    verified,
)
from multiscale.storage.whole_files import write_bytes

FORMAT = "patchlaw checkpoint 4"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A run between two load steps. Nothing in it depends on the number of ranks.

    Attributes:
        scene: The scene as it was given, as nested dictionaries.
        resolved: Values of the scene's keys that are "auto" or not stated, by dotted key.
        heights: SHA-256 of the surface's heights.
        laws: Bytes of the law file; empty without laws.
        steps: The accepted load steps.
        position: Where the load history has come to.
        state: What the coupling's next load step starts from.
    """

    scene: dict[str, Any]
    resolved: dict[str, Any]
    heights: str
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: LoadPosition
    state: Arrays


def checkpoint_of(run: Run, state: Arrays) -> Checkpoint:
    """Return all that is needed to go on with a run from here.

    Args:
        run: The run.
        state: What `Run.state` returned.
    """
    return Checkpoint(
        scene=given_keys(run.given),
        resolved=run.resolved,
        heights=run.heights,
        laws=run.law_bytes,
        steps=tuple(run.steps),
        position=run.position,
        state=state,
    )


def given_keys(scene: Scene) -> dict[str, Any]:
    """Return a scene as it was given, as nested dictionaries.

    Args:
        scene: The scene.
    """
    return scene.model_dump(by_alias=True, mode="json")


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> Path:
    """Write a checkpoint whole, or leave the earlier one.

    Args:
        path: File to write.
        checkpoint: Its content.

    Raises:
        NotWritten: When the file cannot be written.
    """
    facts = {name: getattr(checkpoint, name) for name in ("scene", "resolved", "heights")}
    columns = [field.name for field in fields(LoadStep) if field.name != "patches"]
    rows = [[getattr(step, name) for name in columns] for step in checkpoint.steps]
    patches = {
        field.name: np.array([getattr(step.patches, field.name) for step in checkpoint.steps])
        for field in fields(PatchState)
    }
    arrays = {
        "facts": text_array(json.dumps(facts)),
        "laws": np.frombuffer(checkpoint.laws, np.uint8),
        "steps": text_array(json.dumps([columns, rows], default=np.generic.item)),
        **prefixed("position/", packed(checkpoint.position)),
        **prefixed("patches/", patches),
        **prefixed("state/", checkpoint.state),
    }

    def fill(file: Any) -> None:
        file.attrs["format"] = FORMAT
        for name, array in arrays.items():
            file.create_dataset(name, data=array)

    return write_bytes(path, checksummed(fill))


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: The file.

    Raises:
        InputError: When it is none, is of another format or damaged.
    """
    try:
        if not path.is_file():  # a pipe would be waited for
            raise InputError("is no file")
        return _read(path)
    except InputError as error:
        found = error
    except OSError as error:
        found = InputError(f"cannot be read: {error}")
    except Exception as error:  # the checksum fits content that this version does not know
        found = InputError(f"is not understood: {error!r}")
    raise InputError(
        f"{found.problem}; remove it, or run without --resume to begin anew",
        file=str(path),
        value=found.value,
        allowed=found.allowed,
    )


def _read(path: Path) -> Checkpoint:
    arrays: Arrays = {}

    def read(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            arrays[name] = stored_numbers(item)

    with h5py.File(verified(path), "r") as file:
        form = str(file.attrs.get("format", ""))
        if form != FORMAT:
            raise InputError("was written by another patchlaw", value=form, allowed=FORMAT)
        file.visititems(read)
    columns, rows = json.loads(as_text(arrays["steps"]))
    patches = part(arrays, "patches/")
    return Checkpoint(
        **json.loads(as_text(arrays["facts"])),
        laws=arrays["laws"].tobytes(),
        steps=tuple(
            LoadStep(
                **dict(zip(columns, map(_tuples, row), strict=True)),
                patches=PatchState(**{name: array[number] for name, array in patches.items()}),
            )
            for number, row in enumerate(rows)
        ),
        position=unpacked(part(arrays, "position/"), (LoadPosition,)),
        state=part(arrays, "state/"),
    )


def _tuples(value: Any) -> Any:
    """Return a value read from JSON with its lists as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
