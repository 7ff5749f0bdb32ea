"""What the patches and regions of laws are called in files for other programs: plain ASCII."""

from __future__ import annotations

import re
from dataclasses import dataclass

from geometry import Regions
from multiscale.laws.law_table import LawTable

_LONGEST = 40  # characters of a region's name; keyword programs take 80 with what stands before


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a law holds.

    Attributes:
        kind: ``"patch"`` or ``"region"``.
        label: What names of files and interactions end with: letters, digits and underscores.
        subject: The patch or region, as prose.
        extent: The rectangle of a patch; a region, which may be of any outline, has none.
    """

    kind: str
    label: str
    subject: str
    extent: str


def places(table: LawTable) -> list[Place]:
    """Return the places of the laws, in their order.

    Regions keep their names where these make different labels, and are numbered otherwise.

    Args:
        table: The laws.
    """
    if isinstance(table.patches, Regions):
        names = table.patches.names
        labels = [re.sub(r"\W+", "_", plain(name).replace("?", " ")).strip("_") for name in names]
        short = [label[:_LONGEST].lower() for label in labels]
        if not all(short) or len(set(short)) < len(short):
            short = [str(index) for index in range(len(names))]
        return [
            Place(kind="region", label=label, subject=f"region '{plain(name)}'", extent="")
            for name, label in zip(names, short, strict=True)
        ]
    found = []
    for index in range(table.patches.count):
        (ix, iy), (x, y) = table.patches.unravel(index), table.patches.bounds(index)
        extent = f"{x[0]:.9g} < x < {x[1]:.9g}, {y[0]:.9g} < y < {y[1]:.9g} [mm]"
        subject = f"patch ({ix}, {iy})"
        found.append(Place(kind="patch", label=f"{ix}_{iy}", subject=subject, extent=extent))
    return found


def made_by(table: LawTable) -> str:
    """Return how laws were made, on one line."""
    return plain(", ".join(f"{name} {value}" for name, value in table.made_by.items()))


def zero_text(table: LawTable) -> str:
    """Return what the closures of laws count from, as prose."""
    named = {
        "first touch": "the highest point of the roughness",
        "mean plane": "the mean of the heights of the roughness",
    }
    return named.get(table.zero, f"the {table.zero} of the heights of the roughness")


def plain(text: str) -> str:
    """Return a text that can stand in comments and docstrings: ASCII on one line, no quotes."""
    ascii_text = text.encode("ascii", "replace").decode().replace("\\", "/").replace('"', "'")
    return " ".join(ascii_text.split())
