"""Checks packages: their versions, and which shadow those that compiled parts were built with."""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

_OLDEST = {
    "numpy": (1, 24),
    "scipy": (1, 10),
    "dolfinx": (0, 5),
    "petsc4py": (3, 18),
    "mpi4py": (3, 1),
    "h5py": (3, 7),
    "gmsh": (4, 8),
    "pydantic": (2, 7),
    "jinja2": (3, 1),
    "matplotlib": (3, 6),
}
"""The oldest release of every package that patchlaw is tested with."""

_SHARED = ("numpy", "scipy", "h5py", "mpi4py", "petsc4py")
"""Packages that dolfinx and each other's compiled parts share."""

_TOGETHER = ("numpy", "scipy.special", "h5py")
_RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")


@dataclass(frozen=True, slots=True)
class Shadow:
    """A package that stands before the distribution's.

    Args:
        name: Its name.
        place: Folder that holds it.
        below: Folder that holds the distribution's.
    """

    name: str
    place: Path
    below: Path

    def __str__(self) -> str:
        here, there = (_version(self.name, place) for place in (self.place, self.below))
        return (
            f"{self.name}{here} in {self.place} shadows the distribution's{there} in {self.below}, "
            "which dolfinx and others are built against"
        )


def versions(load: Callable[[str], Any] = import_module) -> tuple[list[str], dict[str, str]]:
    """Import every package and compare its version with the oldest that is tested.

    Args:
        load: Imports a package by its name.

    Returns:
        The packages with their versions; and by name what is wrong with those that are missing or
        too old.
    """
    found, wrong = [], {}
    for name, oldest in _OLDEST.items():
        try:
            version = str(getattr(load(name), "__version__", "?"))
        except ImportError as error:
            wrong[name] = f"{name}: {error}"
            continue
        found.append(f"{name} {version}")
        numbers = re.match(r"(\d+)\.(\d+)", version)
        if numbers and tuple(map(int, numbers.groups())) < oldest:
            wrong[name] = f"{name} {version} is older than {'.'.join(map(str, oldest))}"
    return found, wrong


def shadows(path: Sequence[str] | None = None) -> list[Shadow]:
    """Return packages that shadow the distribution's; looks at folders alone, in microseconds.

    Args:
        path: Folders that Python looks for packages in, in their order; by default `sys.path`.
    """
    found = []
    folders = [Path(entry) for entry in (sys.path if path is None else path) if entry]
    for name in _SHARED:
        places = [place for place in folders if os.path.isfile(place / name / "__init__.py")]
        if len(places) > 1 and places[-1].name == "dist-packages":
            found.append(Shadow(name, places[0], places[-1]))
    return found


def removal(found: Iterable[Shadow]) -> str:
    """Return the command that removes packages.

    Args:
        found: What shadows.
    """
    return f"remove with: {sys.executable} -m pip uninstall {' '.join(one.name for one in found)}"


def works_together() -> bool:
    """Say on standard error what shadows the distribution; return False where that cannot work.

    Only where something shadows is anything imported. Under mpirun rank 0 speaks.
    """
    found = shadows()
    if not found:
        return True
    problem = ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions that do not fit: that is said below
            for name in _TOGETHER:
                import_module(name)
    except Exception as error:  # of any family: ABI, attributes, libraries
        problem = f"; together they fail: {(str(error).splitlines() or ['?'])[0]}"
    if all(os.environ.get(rank, "0") == "0" for rank in _RANKS):
        text = "; ".join(map(str, found))
        print(f"patchlaw: {text}{problem}; {removal(found)}", file=sys.stderr)
    return not problem


def _version(name: str, place: Path) -> str:
    """Return the version of a package behind a space; nothing where it is not stated."""
    for found in place.glob(f"{name}-*-info"):
        return " " + found.name.removeprefix(f"{name}-").rpartition(".")[0]
    return ""
