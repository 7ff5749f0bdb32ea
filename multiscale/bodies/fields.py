"""Fields of the bodies of a scene.

They are those of a body that was pressed as a mesh, whose displacements are kept. Elsewhere a body
with a flat top is meshed after the load, and loaded by the contact pressures: by those of the cells
or asperities, summed over the facets of the mesh, or with laws by the means of the patches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry import PatchGrid
from multiscale.bodies.bodies import Bodies
from support.arrays import Array

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, FieldStep, LoadedFace
    from macro.fields import Pressures


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
    from macro import FieldStep

    whole = bodies.contact_face()

    def solved(face: LoadedFace) -> Iterator[FieldStep]:
        for number, pressure in sorted(states.items()):
            solution = face.body.solve(face.load(pressure))
            yield FieldStep(number, solution.x.array[: face.body.owned_dofs].copy(), pressure)

    _write(path, whole, solved, parts=parts)


def write_displaced(
    path: Path,
    face: LoadedFace | FacePair,
    states: Mapping[int, tuple[Array, float]],
    pressures: Callable[[int, bool], Pressures],
    further: Callable[[int], Sequence[Any]] = lambda number: (),
) -> None:
    """Write the fields of bodies whose displacements are known.

    Args:
        path: File to write, ending in ``.xdmf``.
        face: The contact face of the body, or of both.
        states: By number of the load step this rank's displacements [mm], and the position among
            the states of the bodies' loads.
        pressures: What is shown as pressure, by load step and whether it is on the counter-body.
        further: Other functions on the mesh of the first body, by load step.

    Note:
        Collective.
    """
    from macro import FieldStep

    both = len(face.sides) > 1

    def halves(counter: bool) -> Iterator[FieldStep]:
        for number, (moved, loads) in sorted(states.items()):
            own = face.body.split(moved)[counter] if both else moved
            more = () if counter else further(number)
            yield FieldStep(number, own, pressures(number, counter), loads, more)

    _write(path, face, lambda one: halves(both and one is face.sides[1]))


def _write(
    path: Path,
    whole: LoadedFace | FacePair,
    fields: Callable[[LoadedFace], Iterator[FieldStep]],
    parts: PatchGrid | None = None,
) -> None:
    import macro

    for one, name in zip(whole.sides, (path.name, f"counter_{path.name}"), strict=False):
        face = one if parts is None else replace(one, patches=parts)
        macro.write_fields(path.with_name(name), face, fields(face))
