"""What a run needs to go on where it was interrupted, as a checksummed HDF5 file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from geometry.errors import InputError
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.loading.stepper import LoadPosition
from multiscale.storage.checksummed_hdf5 import checksummed, verified
from multiscale.storage.serialisation import (
    Arrays,
    as_text,
    packed,
    part,
    prefixed,
    stored_numbers,
    text_array,
    unpacked,
)
from multiscale.storage.whole_files import write_bytes

FORMAT = "patchlaw checkpoint 2"
_PATCH = "patches."


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A run between two load steps. Nothing in it depends on the number of ranks.

    Attributes:
        run: Random name of the run, which its journal bears too.
        scene: The scene as it was given, as nested dictionaries.
        settled: What its open keys became.
        heights: SHA-256 of the surface's heights.
        laws: The law file's bytes; empty without laws.
        steps: The accepted load steps.
        position: Where the load programme has come to.
        state: What the coupling's next load step starts from.
    """

    run: str
    scene: dict[str, Any]
    settled: dict[str, Any]
    heights: str
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: LoadPosition
    state: Arrays


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> Path:
    """Write a checkpoint whole, or leave the earlier one.

    Args:
        path: File to write.
        checkpoint: Its content.

    Raises:
        NotWritten: When the file cannot be written.
    """
    arrays = _arrays(checkpoint)

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
    if not path.is_file():  # a pipe would be waited for
        raise _refused(path, "is no file")
    try:
        with h5py.File(verified(path), "r") as file:
            form = str(file.attrs.get("format", ""))
            if form != FORMAT:
                raise InputError("is not a checkpoint of this patchlaw", value=form, allowed=FORMAT)
            arrays: Arrays = {}

            def read(name: str, item: Any) -> None:
                if isinstance(item, h5py.Dataset):
                    arrays[name] = stored_numbers(item)

            file.visititems(read)
        return _checkpoint(arrays)
    except InputError as error:
        raise _refused(path, error.problem, error) from None
    except OSError as error:
        raise _refused(path, f"cannot be read: {error}") from None
    except Exception as error:  # a sound checksum over what this version cannot understand
        raise _refused(path, f"is not understood: {error!r}") from None


def _refused(path: Path, problem: str, cause: InputError | None = None) -> InputError:
    told: dict[str, Any] = {} if cause is None else {"value": cause.value, "allowed": cause.allowed}
    return InputError(
        f"{problem}; remove it, or run without --resume to begin anew", file=str(path), **told
    )


def _arrays(checkpoint: Checkpoint) -> Arrays:
    facts = {name: getattr(checkpoint, name) for name in ("run", "scene", "settled", "heights")}
    return {
        "facts": text_array(json.dumps(facts)),
        "laws": np.frombuffer(checkpoint.laws, np.uint8),
        **prefixed("steps/", _columns(checkpoint.steps)),
        **prefixed("position/", packed(checkpoint.position)),
        **prefixed("state/", checkpoint.state),
    }


def _checkpoint(arrays: Arrays) -> Checkpoint:
    return Checkpoint(
        **json.loads(as_text(arrays["facts"])),
        laws=arrays["laws"].tobytes(),
        steps=_steps(part(arrays, "steps/")),
        position=unpacked(part(arrays, "position/"), (LoadPosition,)),
        state=part(arrays, "state/"),
    )


def _columns(steps: Sequence[LoadStep]) -> Arrays:
    """Return the fields of load steps as columns: numbers as arrays, all else as JSON."""
    columns: Arrays = {}
    for field in fields(LoadStep):
        values = [getattr(step, field.name) for step in steps]
        if field.name == "patches":
            for column in fields(PatchState):
                stacked = [getattr(value, column.name) for value in values]
                columns[_PATCH + column.name] = np.array(stacked)
        elif values and all(type(value) in (int, float) for value in values):
            columns[field.name] = np.array(values)
        else:
            columns[field.name] = text_array(json.dumps(values))
    return columns


def _steps(columns: Arrays) -> tuple[LoadStep, ...]:
    listed: dict[str, Any] = {
        name: _tuples(json.loads(as_text(column))) if column.dtype == np.uint8 else column.tolist()
        for name, column in columns.items()
        if not name.startswith(_PATCH)
    }
    patches = part(columns, _PATCH)
    return tuple(
        LoadStep(
            **{name: values[row] for name, values in listed.items()},
            patches=PatchState(**{name: array[row] for name, array in patches.items()}),
        )
        for row in range(len(listed["step"]))
    )


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
