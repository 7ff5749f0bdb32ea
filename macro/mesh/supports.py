"""Motions of a rigid body that supports leave free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from patchlaw.macro.mesh.facets import facet_nodes
from patchlaw.macro.mesh.tagged import TaggedMesh, check_outer
from patchlaw.support import Array, InputError, Locals

_SHARP = 1e-6
"""Component of a motion's direction that is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Support:
    """A surface whose displacement is prescribed.

    Args:
        tag: Marker of its facets.
        displacement: Displacement along x, y and z [mm]; None for a component that is free.
    """

    tag: int
    displacement: tuple[float | None, float | None, float | None] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Traction:
    """A surface that is loaded.

    Args:
        tag: Marker of its facets.
        stress: Force per area along x, y and z, shape (3,) [MPa].
        pressure: Pressure against the outward normal, beside the stress [MPa].
    """

    tag: int
    stress: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pressure: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Loads:
    """All that loads a body beside its contact and its supports.

    Args:
        tractions: Loaded surfaces.
        pulls: Surfaces that are pulled towards what the body is pressed on, as by bolts; the
            reactions act there, and turn it.
        strain: Free strain by a rise of temperature, equal in all directions, by marker of the
            volumes; the marker None is the whole body.
    """

    tractions: tuple[Traction, ...] = ()
    pulls: tuple[Traction, ...] = ()
    strain: tuple[tuple[int | None, float], ...] = ()

    @property
    def on_surfaces(self) -> tuple[Traction, ...]:
        """All loaded surfaces."""
        return self.tractions + self.pulls


def check_supports(
    tagged: TaggedMesh, supports: Sequence[Support], contact: int | None = None
) -> None:
    """Refuse supports that do not hold the body.

    Args:
        tagged: The mesh.
        supports: Surfaces with prescribed displacements.
        contact: Tag of the contact face.

    Raises:
        InputError: On all ranks, when a surface has no facets or is the contact face, when two
            supports prescribe different displacements of one surface or of nodes that two surfaces
            share, and when a rigid motion is left; the error says which.

    Note:
        Collective.
    """
    for support in supports:
        _check_surface(tagged, support.tag, contact, "held")
    for one, other in combinations(supports, 2):
        for axis, pair in enumerate(zip(one.displacement, other.displacement, strict=True)):
            if None not in pair and pair[0] != pair[1]:
                _check_apart(tagged, (one.tag, other.tag), "xyz"[axis], pair)
    left = free_motions(tagged, supports)
    if left:
        raise InputError(
            f"the supports leave the body free to move: {'; '.join(left)}",
            allowed="supports that hold all rigid motions, without help of the contact",
        )


def check_loads(
    tagged: TaggedMesh,
    supports: Sequence[Support],
    tractions: Sequence[Traction],
    contact: int | None = None,
) -> None:
    """Refuse loads on surfaces that do nothing.

    Args:
        tagged: The mesh.
        supports: Surfaces with prescribed displacements.
        tractions: Loaded surfaces.
        contact: Tag of the contact face.

    Raises:
        InputError: On all ranks, when a surface has no facets, facets inside the body, or is the
            contact face, and when a load acts along what a support holds.

    Note:
        Collective.
    """
    for traction in tractions:
        _check_surface(tagged, traction.tag, contact, "loaded")
        check_outer(tagged, traction.tag, why=", where it cannot be loaded")
        for support in supports:
            if support.tag != traction.tag:
                continue
            if traction.pressure and None not in support.displacement:
                raise InputError(
                    f"the surface {tagged.facet_name(support.tag)!r} is held, where a pressure of "
                    f"{traction.pressure:g} MPa does nothing",
                    allowed="pressures on surfaces that are free in some direction",
                )
            for axis, stress in enumerate(traction.stress):
                on_held = support.displacement[axis] is not None
                if on_held and stress:
                    raise InputError(
                        f"the surface {tagged.facet_name(support.tag)!r} is held along "
                        f"{'xyz'[axis]}, where a traction of {stress:g} MPa does nothing",
                        allowed="tractions along directions that no support holds",
                    )


def _check_surface(tagged: TaggedMesh, tag: int, contact: int | None, how: str) -> None:
    """Refuse surfaces that cannot be held or loaded."""
    name = tagged.facet_name(tag)
    if tag == contact:
        raise InputError(f"the surface {name!r} is the contact face and cannot be {how} too")
    if not any(tagged.comm.allgather(len(tagged.facet_tags.find(tag)))):
        raise InputError(f"the surface {name!r} has no facets that belong to cells")


def _check_apart(tagged: TaggedMesh, tags: tuple[int, int], axis: str, values: Any) -> None:
    """Refuse different displacements of one surface, or of an edge between two."""
    one, two = (repr(tagged.facet_name(tag)) for tag in tags)
    if tags[0] == tags[1]:
        raise InputError(
            f"the surface {one} is held twice along {axis}, with displacements {values[0]:g} and "
            f"{values[1]:g} mm"
        )
    first, second = (_nodes(tagged, tag) for tag in tags)
    names = np.asarray(tagged.mesh.geometry.input_global_indices)
    parts = tagged.comm.allgather([names[nodes].tolist() for nodes in (first, second)])
    if set().union(*(part[0] for part in parts)) & set().union(*(part[1] for part in parts)):
        raise InputError(
            f"the surfaces {one} and {two} share nodes and are held at different displacements "
            f"along {axis}, {values[0]:g} and {values[1]:g} mm"
        )


def _nodes(tagged: TaggedMesh, tag: int) -> Locals:
    """Return the rows of ``mesh.geometry.x`` of this rank's facets with a tag."""
    return np.unique(facet_nodes(tagged.mesh, tagged.facet_tags.find(tag)).corners)


def free_motions(tagged: TaggedMesh, supports: Sequence[Support]) -> list[str]:
    """Return in words which rigid motions the supports leave free.

    A motion t + ω × r is free when it moves no node of a support along a direction that is held.

    Args:
        tagged: The mesh.
        supports: Surfaces with prescribed displacements.

    Note:
        Collective.
    """
    lower, upper = tagged.bounding_box()
    centre, size = 0.5 * (lower + upper), float(np.linalg.norm(upper - lower))
    square = np.zeros((6, 6))
    for support in supports:
        arms = (tagged.mesh.geometry.x[_nodes(tagged, support.tag)] - centre) / size
        for axis, value in enumerate(support.displacement):
            if value is not None:
                along = np.eye(3)[axis]
                rows = np.concatenate([np.tile(along, (len(arms), 1)), np.cross(arms, along)], 1)
                square += rows.T @ rows
    values, vectors = np.linalg.eigh(tagged.comm.allreduce(square))
    # supports over a part in 10⁶ of the body's length still hold rotations
    free = vectors[:, values <= 1e-12 * max(float(values[-1]), 1.0)].T
    return _in_words(free, centre, size)


def _in_words(free: Array, centre: Array, size: float) -> list[str]:
    """Describe a space of motions (m, 6): translations, then rotations in units of 1/size."""
    if not len(free):
        return []
    mixed, turning, _ = np.linalg.svd(free[:, 3:])
    turns = int((turning > _SHARP).sum())
    apart = mixed.T @ free
    slides = _reduced(apart[turns:, :3])
    words = [f"translation along {_direction(slide)}" for slide in slides]
    for motion in _reduced(np.roll(apart[:turns], 3, axis=1)):
        turn, slide = motion[:3], motion[3:]
        if len(slides):
            words.append(f"rotation about {_direction(turn)}")
            continue
        through = centre + size * np.cross(turn, slide) / (turn @ turn)
        shift = "" if abs(turn @ slide) < _SHARP else ", with a shift along it"
        line = f"the line along {_direction(turn)} through {_place(through)}"
        words.append(f"rotation about {line}{shift}")
    return words


def _reduced(rows: Array) -> Array:
    """Return the same space spanned by rows whose first three columns are in echelon form."""
    rows = np.array(rows)
    done = 0
    for column in range(3):
        below = np.abs(rows[done:, column])
        if not len(below) or below.max() < _SHARP:
            continue
        pivot = done + int(np.argmax(below))
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        done += 1
    return rows


def _direction(vector: Array) -> str:
    """Return the name of an axis, or the components of a direction."""
    unit = vector / np.linalg.norm(vector)
    axis = int(np.argmax(np.abs(unit)))
    if abs(unit[axis]) > 1.0 - _SHARP**2:
        return "xyz"[axis]
    return "(" + ", ".join(f"{part + 0.0:.3g}" for part in np.round(unit, 6)) + ")"


def _place(point: Array) -> str:
    return "(" + ", ".join(f"{value + 0.0:.4g}" for value in np.round(point, 9)) + ") mm"
