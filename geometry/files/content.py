"""What a file of heights holds, the units that files state, and numpy's own files."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from patchlaw.support import Array, InputError, did_you_mean, process_memory, real_array

LENGTH_UNITS = {
    "m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "pm": 1e-9, "Å": 1e-7, "in": 25.4,
}  # fmt: skip
"""Units of heights and what they are in mm."""

_SPELLINGS = {
    "µm": "um", "μm": "um", "Âµm": "um", "\u212b": "Å", "A": "Å", "inch": "in", '"': "in"
}  # fmt: skip
"""Other ways in which files write them; UTF-8 that was taken for Latin-1 is one."""

BYTES_PER_HEIGHT = 100
"""Memory that surface, spline and spectrum take per height, roughly [B]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileContent:
    """Heights as a file has them.

    Args:
        heights: Heights, shape (nx, ny), in the unit of the file; not a number where missing or
            masked.
        lengths: Sides (Lx, Ly) [mm]; None where the file does not say.
        unit: Unit of the heights, a name in `LENGTH_UNITS`; None where the file does not say.
        channel: Name of the channel that was read; empty where a file has only one.
        remarks: How the file was understood, where it could be read in another way.
        notes: What a user should know of how it was read.
        of_points: Whether they are a list of points in an unknown unit, which the lengths are in.
    """

    heights: Array
    lengths: tuple[float, float] | None = None
    unit: str | None = None
    channel: str = ""
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    of_points: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "heights", real_array(self.heights))

    def swapped(self) -> FileContent:
        """Return the content with x and y exchanged."""
        lengths = None if self.lengths is None else self.lengths[::-1]
        remarks = (*self.remarks, "x and y swapped")
        return replace(self, heights=self.heights.T, lengths=lengths, remarks=remarks)


def length_unit(text: str) -> str:
    """Return the usual spelling of a unit of length.

    Args:
        text: A unit such as ``µm``.

    Raises:
        InputError: When it is no unit of length.
    """
    unit = _SPELLINGS.get(text.strip(), text.strip())
    if unit not in LENGTH_UNITS:
        hint = did_you_mean(unit, LENGTH_UNITS, cutoff=1.0)
        problem, allowed = f"is no unit of heights{hint}", ", ".join(LENGTH_UNITS)
        raise InputError(problem, value=text, allowed=allowed)
    return unit


def check_memory(needed: float) -> None:
    """Refuse heights that do not fit into the memory of this process.

    Args:
        needed: Memory that they need [B].

    Raises:
        InputError: Says how much is needed and how much there is.
    """
    memory = process_memory()
    if needed > memory:
        raise InputError(
            f"the heights need about {needed / 1e9:.3g} GB of memory",
            allowed=f"what fits into {memory / 1e9:.3g} GB",
        )


def read_array(file: Path) -> FileContent:
    """Read the array of a ``.npy`` file, index [ix, iy]; pickled objects are never loaded.

    Args:
        file: The file.

    Raises:
        InputError: When the file is no whole array of real numbers, or too large.
    """
    try:
        mapped = np.lib.format.open_memmap(file, mode="r")
    except OSError:
        raise
    except Exception as error:  # whatever the parser of the header meets, or less than it promises
        raise InputError(f"not a whole, readable numpy array: {first_line(error)}") from None
    if mapped.ndim != 2:
        raise InputError("not a two-dimensional array", value=mapped.shape, allowed="(nx, ny)")
    check_memory(mapped.size * BYTES_PER_HEIGHT)
    return FileContent(heights=np.array(mapped))


def read_archive(file: Path) -> FileContent:
    """Read the only array of an ``.npz`` file, index [ix, iy]; pickled objects are never loaded.

    Args:
        file: The file.

    Raises:
        InputError: When it holds none or several, or `read_array` would refuse it.
    """
    try:
        with np.load(file, allow_pickle=False) as archive:
            names = archive.files
            if len(names) == 1:
                check_memory(archive.zip.infolist()[0].file_size * BYTES_PER_HEIGHT / 8)
                array = archive[names[0]]
    except (OSError, InputError):
        raise
    except Exception as error:
        raise InputError(f"not a whole, readable numpy archive: {first_line(error)}") from None
    if len(names) != 1:
        raise InputError(
            f"an .npz of {len(names)} arrays: {', '.join(names)}",
            allowed="one array, as of numpy.savez(file, heights)",
        )
    if array.ndim != 2:
        raise InputError("not a two-dimensional array", value=array.shape, allowed="(nx, ny)")
    return FileContent(heights=array)


_SIMPLE_FIELD = b"Gwyddion Simple Field 1."
"""What a simple field of Gwyddion begins with."""


def is_simple_field(file: Path) -> bool:
    """Tell whether a file is a simple field of Gwyddion, as ``.gsf`` are."""
    with file.open("rb") as opened:
        return opened.read(len(_SIMPLE_FIELD)) == _SIMPLE_FIELD


def read_simple_field(file: Path) -> FileContent:
    """Read a simple field of Gwyddion: lines ``name = value``, 1 to 4 zeros, rows along x.

    Sides without a unit, and heights without one, are none that the file states.

    Args:
        file: The file.

    Raises:
        InputError: When it is not whole, too large, or holds no heights.

    Source: Gwyddion user guide, "Simple Field Files".
    """
    check_memory(file.stat().st_size * BYTES_PER_HEIGHT / 4)
    content = file.read_bytes()
    head = content.partition(b"\0")[0]
    lines = (line.partition("=") for line in head.decode("utf-8", "replace").split("\n"))
    stated = {name.strip(): value.strip() for name, _, value in lines}
    counts = [stated.get(name, "") for name in ("XRes", "YRes")]
    if not all(re.fullmatch(r"0*[1-9][0-9]{0,8}", one) for one in counts):
        problem = "the header of the simple field states no numbers of heights"
        raise InputError(problem, value=counts, allowed="XRes and YRes, whole and positive")
    nx, ny = map(int, counts)
    values = content[4 * (len(head) // 4 + 1) :]
    if len(values) != 4 * nx * ny:
        problem = f"{len(values)} bytes follow the header of the simple field"
        raise InputError(problem, allowed=f"{4 * nx * ny}, of {nx} × {ny} heights")
    unit = stated.get("ZUnits")
    try:
        sides = [float(stated[name]) for name in ("XReal", "YReal")]
        size = LENGTH_UNITS[length_unit(stated["XYUnits"])]
    except KeyError:
        sides, size = [], 1.0
    except ValueError:
        keys = "XReal", "YReal", "XYUnits"
        problem, value = "the header of the simple field states no sides", [*map(stated.get, keys)]
        raise InputError(problem, value=value, allowed="numbers, and a unit of length") from None
    with np.errstate(invalid="ignore"):  # of what is not a number
        heights = np.frombuffer(values, "<f4").reshape(ny, nx).T.astype(float)
    return FileContent(
        heights=heights,
        lengths=(size * sides[0], size * sides[1]) if sides else None,
        unit=length_unit(unit) if unit else None,
    )


def first_line(error: Exception) -> str:
    """Return the first line of an error's text, or its name where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
