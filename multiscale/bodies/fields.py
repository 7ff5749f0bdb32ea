"""Writes the fields of bodies at chosen load steps.

Where a body was pressed as a mesh, its displacements are kept. Elsewhere a body with a flat top is
meshed after the load, and loaded by the contact pressures: by those of the cells or asperities,
summed over the facets of the mesh, or with laws by the mean pressures of the patches.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import PatchGrid
from multiscale.bodies.bodies import Bodies

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, LoadedFace
    from macro.fields import Pressures

Array = NDArray[np.float64]
Field = tuple[int, Array, "Pressures"]
"""Number of the load step, this rank's displacements [mm], and the pressures [MPa]."""


def write_solved(path: Path, bodies: Bodies, parts: PatchGrid, states: Mapping[int, Array]) -> None:
    """Write the fields of bodies under pressures of parts of their contact face.

    Args:
        path: File to write, ending in ``.xdmf``.
        bodies: The bodies, meshed where they were not yet.
        parts: The N parts.
        states: Pressures by number of the load step, shape (N,) each [MPa].

    Note:
        Collective.
    """
    whole = bodies.contact_face()

    def solved(face: LoadedFace) -> Iterator[Field]:
        for number, pressure in sorted(states.items()):
            solution = face.body.solve(face.load(pressure))
            yield number, solution.x.array[: face.body.owned_dofs].copy(), pressure

    _write(path, whole, solved, parts=parts)


def write_displaced(
    path: Path,
    face: LoadedFace | FacePair,
    states: Mapping[int, Array],
    pressures: Callable[[int, bool], Pressures],
) -> None:
    """Write the fields of bodies whose displacements are known.

    Args:
        path: File to write, ending in ``.xdmf``.
        face: The contact face of the body, or of both.
        states: This rank's displacements by number of the load step [mm].
        pressures: What is shown as pressure, by load step and whether it is on the counter-body.

    Note:
        Collective.
    """
    from macro import FacePair

    def halves(counter: bool) -> Iterator[Field]:
        for number, moved in sorted(states.items()):
            own = face.body.split(moved)[counter] if isinstance(face, FacePair) else moved
            yield number, own, pressures(number, counter)

    _write(path, face, lambda one: halves(one is getattr(face, "second", None)))


def _write(
    path: Path,
    whole: LoadedFace | FacePair,
    fields: Callable[[LoadedFace], Iterator[Field]],
    parts: PatchGrid | None = None,
) -> None:
    import macro

    both: list[Any] = [whole.first, whole.second] if isinstance(whole, macro.FacePair) else [whole]
    for one, name in zip(both, (path.name, f"counter_{path.name}"), strict=False):
        face = one if parts is None else replace(one, patches=parts)
        macro.write_fields(path.with_name(name), face, fields(face))
