"""Heights from instruments' formats, through the optional package SurfaceTopography."""

from __future__ import annotations

import importlib
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.geometry.files.content import (
    LENGTH_UNITS,
    FileContent,
    check_memory,
    first_line,
    length_unit,
)
from patchlaw.geometry.plausibility import LARGEST_MAP
from patchlaw.support.errors import InputError


class UnknownFormat(InputError):
    """No reader knows what is in a file."""


def read_instrument(
    file: Path, channel: str | int | None = None, *, states_sides: bool = False
) -> FileContent:
    """Read a channel of an instrument's file, whichever of its readers knows the content.

    Args:
        file: The file.
        channel: Name or number of the channel, counted from 0; when not given, the reader's
            default if it holds heights, or else the first that does.
        states_sides: Whether a file without sides counts as one that no reader knows.

    Raises:
        UnknownFormat: When SurfaceTopography cannot read the file.
        InputError: When SurfaceTopography is not installed, the file is too large, the channel
            unknown or none of heights, or when it is a profile.
    """
    # readers and the surface take roughly 20 bytes per byte of a file; a height takes 2 to 8
    check_memory(file.stat().st_size * 20)
    library = _library(file)
    try:
        with _silence(), library.open_topography(str(file)) as reader:
            chosen = _channel(reader, channel)
            if states_sides and chosen.physical_sizes is None:
                raise UnknownFormat("the text states no sides that SurfaceTopography knows")
            return _content(reader, chosen)
    except InputError:
        raise
    except Exception as error:  # its readers raise errors of many families
        several = len(str(error).splitlines()) > 1  # it tried all its readers in vain
        reason = type(error).__name__ if several else first_line(error)
        raise UnknownFormat(f"SurfaceTopography cannot read it: {reason}") from None


@contextmanager
def _silence() -> Iterator[None]:
    """Keep back what readers say of metadata, and of files that they do not know."""
    disabled = logging.root.manager.disable
    logging.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)


def _content(reader: Any, channel: Any) -> FileContent:
    """Return what a channel holds, in memory of its own."""
    # sizes that a file lacks must be given; what is made up here is not used
    sizes = {} if channel.physical_sizes is not None else {"physical_sizes": (1.0, 1.0)}
    topography = channel.topography(**sizes)
    measured = np.ma.array(topography.heights(), dtype=np.float64, copy=True)
    unit, lengths, notes = topography.unit and length_unit(topography.unit), None, []
    if not sizes and unit:
        length_x, length_y = (float(side) * LENGTH_UNITS[unit] for side in channel.physical_sizes)
        if reader.format() == "nms" and max(length_x, length_y) > 0.1 * LARGEST_MAP:
            # SurfaceTopography takes them for mm
            length_x, length_y = 1e-6 * length_x, 1e-6 * length_y
            notes.append("the distances of points in the header of this .nms are taken in nm")
        lengths = length_x, length_y
    header = topography.info.get("raw_metadata", {})
    if reader.format() == "sur" and header["inversion"]:
        notes.append(
            "the file says that its heights were turned over (inversion flag "
            f"{header['inversion']}), and they are turned over here; some programs leave them: "
            "are its summits where they should be?"
        )
    return FileContent(
        heights=np.ma.filled(measured, np.nan),
        lengths=lengths,
        unit=unit,
        channel=channel.name if len(reader.channels) > 1 else "",
        notes=tuple(notes),
    )


def _library(file: Path) -> Any:
    """Return SurfaceTopography."""
    try:
        return importlib.import_module("SurfaceTopography")
    except ImportError:
        raise InputError(
            f"the content of this {file.suffix or 'file'} is not known here; ./setup.sh "
            "--instruments installs the readers of instruments' formats",
            allowed=".npy; text of numbers, as .txt, .csv or .xyz, under words or comments after #",
        ) from None


def _channel(reader: Any, wanted: str | int | None) -> Any:
    """Return the channel of a name or number, or the first of heights.

    Raises:
        InputError: When there is none such, or it is none of heights on an area.
    """
    channels = reader.channels
    if not channels:
        raise InputError("SurfaceTopography knows no channel of this file")
    if wanted is None:
        maps = [one for one in channels if one.is_height_channel and one.dim == 2]
        default = reader.default_channel
        chosen = default if default in maps or not maps else maps[0]
    else:
        named: dict[str | int, Any] = {one.name: one for one in reversed(channels)}
        named |= enumerate(channels)
        if wanted not in named:
            names = ", ".join(f"{number} {one.name!r}" for number, one in enumerate(channels))
            raise InputError("there is no such channel", value=wanted, allowed=names)
        chosen = named[wanted]
    if chosen.dim != 2:
        raise InputError("the file holds a profile, not a surface", allowed="areal measurements")
    if not chosen.is_height_channel:
        raise InputError(f"the channel {chosen.name!r} holds {chosen.data_kind.value}, no heights")
    return chosen
