"""Reads a surface from a file of any known format, and prepares it."""

from __future__ import annotations

import importlib
import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry.files.content import (
    LENGTH_UNITS,
    FileContent,
    check_memory,
    first_line,
    is_simple_field,
    length_unit,
    read_archive,
    read_array,
    read_simple_field,
)
from patchlaw.geometry.files.text import load_text, read_text
from patchlaw.geometry.preparation import Preparation, WorkingMap, prepared_map
from patchlaw.geometry.statistics import LARGEST_MAP, MAPS, STATED, reading_notes
from patchlaw.geometry.surface import Surface
from patchlaw.support import Grid, InputError, Lengths, checked
from patchlaw.support.checks import check_file, reading, real_array

_READ_OF = {".x3p": "; of .x3p it reads ISO 5436-2 in binary form and of one layer"}
"""What the readers know of a format, by how names of its files end."""

_OF_FRINGES = (
    "SurfaceTopography reads .datx whose heights are in nm or another length; those of this one "
    "may be in fringes: save them as lengths, or as .xyz"
)

_TURNED_OVER = {"sur": "inversion", "metropro": "sign"}
"""Flag of a format's header that says that heights were turned over."""

SMALL_POINTS = 0.01
"""Sides below which points are hardly in mm, which no program of an atomic force microscope writes:
optical maps in m that are taken for mm have some 0.1 to 10 µm [mm]."""


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
    library = _library(file, below_words=states_sides)
    try:
        with _silence(), library.open_topography(str(file)) as reader:
            chosen = _channel(reader, channel)
            if states_sides and chosen.physical_sizes is None:
                raise UnknownFormat("the text states no sides that SurfaceTopography knows")
            if reader.format() == "h5" and chosen.name.startswith("Data/Surface/"):
                raise UnknownFormat(_OF_FRINGES)  # as bare numbers of an HDF5 file, transposed
            return _content_of_channel(reader, chosen)
    except InputError:
        raise
    except Exception as error:  # its readers raise errors of many families
        several = len(str(error).splitlines()) > 1  # it tried all its readers in vain
        reason = type(error).__name__ if several else first_line(error)
        known = _READ_OF.get(file.suffix.lower(), "")
        raise UnknownFormat(f"SurfaceTopography cannot read it: {reason}{known}") from None


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


def _content_of_channel(reader: Any, channel: Any) -> FileContent:
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
    flag = _TURNED_OVER.get(reader.format(), "")
    if flag and header[flag]:
        notes.append(
            f"the file says that its heights were turned over ({flag} flag {header[flag]}), and "
            "they are turned over here; some programs leave them: are its summits where they "
            "should be?"
        )
    if reader.format() == "gwy" and (hidden := _below_mask(topography)):
        notes.append(
            f"{hidden} heights lie below a mask of the file, and count as missing: delete the mask "
            "in Gwyddion where it marks what was measured"
        )
    if topography.is_periodic:
        notes.append(
            "the file says that its heights continue periodically; here they do where [surface] "
            "says periodic = true"
        )
    return FileContent(
        heights=np.ma.filled(measured, np.nan),
        lengths=lengths,
        unit=unit,
        channel=channel.name if len(reader.channels) > 1 else "",
        notes=tuple(notes),
    )


def _below_mask(topography: Any) -> int:
    """Return how many measured heights a mask hides. What is not a number is masked too."""
    read = np.ma.asarray(topography.parent_topography.heights())  # scaling replaces masked ones
    return int(np.count_nonzero(np.ma.getmaskarray(read) & np.isfinite(np.ma.getdata(read))))


def _library(file: Path, *, below_words: bool) -> Any:
    """Return SurfaceTopography, which may know what the words above a matrix of numbers mean."""
    try:
        return importlib.import_module("SurfaceTopography")
    except ImportError:
        what, marked = f"the content of this {file.suffix or 'file'} is not known here", ""
        if below_words:
            what = "numbers stand below words with numbers, which an instrument may have written"
            marked = "; a sign # before each line of words, where only heights stand below them"
        raise InputError(
            f"{what}; ./setup.sh --instruments installs the readers of instruments' formats, or "
            'pip install "patchlaw[instruments]" where patchlaw comes from pip',
            allowed=".npy; text of numbers, as .txt, .csv or .xyz, under words or comments after #"
            + marked,
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


@checked
def read_surface(
    path: str | os.PathLike[str],
    *,
    lengths: Lengths | None = None,
    grid: Grid | None = None,
    height_unit: str | None = None,
    xy_unit: str | None = None,
    channel: str | int | None = None,
    periodic: bool = False,
    **steps: Any,
) -> Surface:
    """Read heights at cell centres from a file.

    * ``.npy``, and ``.npz`` of one array: index [ix, iy];
    * text: numbers in rows, see `geometry.files.text.read_text`;
    * ``.xyz``, or three columns: x, y, z of the points of a regular grid in any order;
    * ``.gsf``, the simple field of Gwyddion;
    * any other, and text under words with numbers: an instrument's format, recognised by its
      content, through the optional package SurfaceTopography.

    Args:
        path: The file.
        lengths: Sides (Lx, Ly) of the whole map [mm]. Needed where the file does not state them;
            overrides what it states.
        grid: Numbers of heights (nx, ny) that the file must have; any when not given.
        height_unit: Unit of the heights where the file does not state one, such as ``um``; mm when
            not given.
        xy_unit: Unit of x and y of a list of points, such as ``m``; mm when not given.
        channel: Name or number of the channel of an instrument's file, counted from 0.
        periodic: Whether the heights continue periodically.
        steps: What is done to the map, the arguments of `Preparation`, such as
            ``missing="fill", detrend="plane"``; nothing when not given.

    Returns:
        The surface, with heights in mm. Its source says what was done to the map, its notes what a
        user should know of it.

    Raises:
        InputError: When the file is missing, unreadable or does not fit, naming the file.
    """
    file, preparation = Path(path), Preparation(**steps)
    try:
        check_file(file)
        with reading(file):
            read = _in_unit(_content(file, channel), xy_unit, noted=lengths is None)
        content, sides = _laid_out(read, lengths, grid, preparation)
        unit = _unit(content, height_unit)
        advice = _advice(unit, of_file=content.unit is not None)
        return _surface(str(file), content, sides, unit, preparation, periodic, advice)
    except InputError as error:
        raise error.of_content(str(file)) from None


def surface_of(
    heights: ArrayLike,
    *,
    lengths: tuple[float, float],
    height_unit: str = "mm",
    periodic: bool = False,
    **steps: Any,
) -> Surface:
    """Return the surface of measured heights in memory, as `read_surface` does of a file.

    Args:
        heights: Heights at cell centres, shape (nx, ny); not a number, or masked, where missing.
        lengths: Sides (Lx, Ly) of the map [mm].
        height_unit: Unit of the heights, such as ``um``.
        periodic: Whether the heights continue periodically.
        steps: What is done to the map, the arguments of `Preparation`.

    Raises:
        InputError: When the heights are no surface.
    """
    preparation = Preparation(**steps)
    unit = length_unit(height_unit)
    content = FileContent(heights=real_array(heights), unit=unit)
    content, sides = _laid_out(content, lengths, None, preparation)
    advice = _advice(unit, of_file=False)
    return _surface("heights", content, sides, unit, preparation, periodic, advice)


def _advice(unit: str, *, of_file: bool) -> str:
    """Say what may be wrong with too steep heights in a unit that their file or user states."""
    if unit == "mm" and not of_file:
        return MAPS
    return STATED.format("the file states its heights" if of_file else "heights are given", unit)


def _in_unit(content: FileContent, xy_unit: str | None, *, noted: bool) -> FileContent:
    """Return points with x and y in mm, and a note where they were hardly in what they are in."""
    if not content.of_points or content.lengths is None:
        if xy_unit is not None:
            problem = "is for lists of points x, y, z that do not state theirs"
            raise InputError(problem, key="xy_unit", value=xy_unit)
        return content
    factor = LENGTH_UNITS[length_unit(xy_unit or "mm")]
    x, y = (factor * side for side in content.lengths)
    notes = content.notes
    if noted and xy_unit is None and max(x, y) < SMALL_POINTS:
        notes += (
            f"x and y are taken in mm, on sides of {1e3 * x:.3g} × {1e3 * y:.3g} µm: are they in "
            "m? Then say xy_unit = 'm', and height_unit = 'm' if heights are too",
        )
    return replace(content, lengths=(x, y), notes=notes)


def _laid_out(
    content: FileContent,
    lengths: tuple[float, float] | None,
    grid: tuple[int, int] | None,
    steps: Preparation,
) -> tuple[FileContent, tuple[float, float]]:
    """Return heights with x and y as they are wanted, and the sides of the map [mm]."""
    content = content.swapped() if steps.swap_xy else content
    sides = lengths if lengths is not None else content.lengths
    if sides is None:
        raise InputError(
            "the file states no sides in a unit of length, they must be given",
            allowed="lengths, the sides (Lx, Ly) of the whole map",
        )
    if lengths is None and max(sides) > LARGEST_MAP:
        raise InputError(
            "the file states a map of {:.4g} × {:.4g} m: no instrument measures so much".format(
                *(1e-3 * side for side in sides)
            ),
            allowed=f"sides up to {1e-3 * LARGEST_MAP:g} m; lengths (Lx, Ly), where they are "
            "given, override those of the file",
        )
    shape = content.heights.shape
    if grid is not None and shape != grid:
        hint = "; swap_xy = true exchanges x and y" if shape == grid[::-1] else ""
        raise InputError(
            f"the file's number of heights differs from the grid that was asked for{hint}",
            value=shape,
            allowed=f"{grid}",
        )
    stated = content.lengths
    if stated and not content.of_points and not np.allclose(sides, stated, rtol=0.05, atol=0.0):
        note = (
            "the file states sides of {:.4g} × {:.4g} mm, and lengths of {:.4g} × {:.4g} mm are "
            "taken instead: where the file is right, leave them out"
        ).format(*stated, *sides)
        content = replace(content, notes=(*content.notes, note))
    return content, sides


@checked
def _surface(
    name: str,
    content: FileContent,
    sides: Lengths,
    unit: str,
    steps: Preparation,
    periodic: bool,
    advice: str,
) -> Surface:
    """Return the surface of what a file or an array holds."""
    said = [name, *([f"channel {content.channel!r}"] if content.channel else []), *content.remarks]
    if content.unit is None:  # a factor of 1000 is not to go unnoticed
        said.append(f"heights taken in {unit.replace('um', 'µm')}")
    heights, notes = content.heights, list(content.notes)
    if heights.ndim == 2 and heights.size and content.lengths is None:
        notes += reading_notes((heights.shape[0], heights.shape[1]), sides)
    with np.errstate(over="ignore"):
        heights = heights * LENGTH_UNITS[unit]
    work = WorkingMap(heights, sides, periodic, said)
    return prepared_map(work, steps, notes, advice)


def _content(file: Path, channel: str | int | None) -> FileContent:
    """Read a file by the reader that its suffix, or else its content, asks for.

    Where a text states its sides in words that an instrument's reader knows it is an image, whose
    rows run along x. Any other text is a matrix with the row index ix.
    """
    text, suffix, simple = None, file.suffix.lower(), is_simple_field(file)
    if suffix not in (".npy", ".npz") and not simple:
        text = load_text(file)
        matrix = text is not None and bool(text.rows)
        if text is None or text.may_be_foreign:
            try:
                content = read_instrument(file, channel, states_sides=matrix)
            except UnknownFormat:
                # heights of its second edition would be counts of an increment
                if not matrix or (text and text.heading and text.heading[0].startswith("aISO-")):
                    raise
            else:
                if text is not None:
                    text.check_rows(content.heights.shape)
                return content
    if channel is not None:
        raise InputError(
            "the file is read as numbers without words, which have one channel only",
            value=channel,
            allowed="leave out the channel",
        )
    if simple:
        return read_simple_field(file)
    if text is None:
        return read_archive(file) if suffix == ".npz" else read_array(file)
    return read_text(text, as_points=suffix == ".xyz")


def _unit(content: FileContent, given: str | None) -> str:
    """Return the unit of the heights: the file's, or else the one that is given, or mm."""
    unit = None if given is None else length_unit(given)
    if unit and content.unit and unit != content.unit:
        raise InputError(
            f"the file states its heights in {content.unit}, height_unit says {unit}",
            allowed=f"leave out height_unit, or {content.unit}",
        )
    return content.unit or unit or "mm"
