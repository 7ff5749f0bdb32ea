"""What a counter-body on a mesh adds to the compliance of two half-spaces, in modes.

Theory: demos/theory.md, sections 3 and 6.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.face_frame import FaceFrame
from micro import BodyModes, FreeSides, influence_matrix
from multiscale.couplings.mesh_body import MeshTerms
from multiscale.setup.mesh_bodies import SceneBody
from multiscale.setup.problem import ProblemSetup

Array = NDArray[np.float64]


class CounterTerm(NamedTuple):
    """What a counter-body on a mesh adds to a half-space.

    Attributes:
        modes: In modes of the surface's rectangle.
        same_sides: Whether its free sides are those of the first body, and no part of the modes.
    """

    modes: BodyModes
    same_sides: bool = False


def counter_term(
    setup: ProblemSetup, comm: Any, sides: FreeSides | None = None
) -> CounterTerm | None:
    """Return what a counter-body on a mesh adds to a half-space; None without such a body.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.
        sides: Free sides of the first body that are a term of their own. Where the counter-body has
            the same, that term stands for both.

    Note:
        Collective.
    """
    if setup.bodies.counter is None:
        return None
    lengths, seen = setup.surface.lengths, _seen_from_outside(setup)
    terms = MeshTerms.of(seen, lengths, side_term=sides is not None)
    same_sides = sides is not None and _alike(sides, terms.side_term)
    if terms.side_term is not None and not same_sides:
        terms = replace(terms, side_term=None)
    found = terms.term(terms.face(comm))
    # seen from the first body y runs the other way, and odd modes along it change their sign
    signs = np.tile((-1.0) ** np.arange(found.count), found.count)
    return CounterTerm(BodyModes(lengths, signs[:, None] * found.matrix * signs), same_sides)


def _alike(first: FreeSides, counter: FreeSides | None) -> bool:
    """Tell whether the free sides of a counter-body lie on those of the first body."""
    if counter is None:
        return False
    low_x, high_x, low_y, high_y = counter.present
    one, other = (
        (*each.lengths, each.poisson_ratio, each.decay_length) for each in (first, counter)
    )
    present = (low_x, high_x, high_y, low_y)
    return first.present == present and bool(np.allclose(one, other, rtol=1e-9, atol=0.0))


def with_counter_term(first: BodyModes, term: CounterTerm | None) -> BodyModes:
    """Return the sum of what two bodies add to their half-spaces.

    Args:
        first: Of the body.
        term: Of the counter-body, on the surface's rectangle; None for none.

    Raises:
        InputError: When the first body is wider than the surface.
    """
    if term is None:
        return first
    counter = term.modes
    if not np.allclose(first.lengths, counter.lengths) or any(first.origin):
        raise InputError(
            "does not go with a counter-body on a mesh", key="block.margin", allowed="0"
        )
    count = max(first.count, counter.count)
    total = np.zeros((count, count, count, count))
    for part in (first, counter):
        k = part.count
        total[:k, :k, :k, :k] += part.matrix.reshape(4 * (k,))
    return BodyModes(first.lengths, total.reshape(count**2, count**2))


def counter_compliance(setup: ProblemSetup, comm: Any) -> Array:
    """Return the compliance of the counter-body under the patches, shape (N, N) [mm/MPa].

    Args:
        setup: The problem set up from the scene, with an elastic counter-body.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    second, patches = setup.materials.second, setup.patches
    assert second is not None
    found = influence_matrix(patches) * second.surface_compliance / np.pi
    term = counter_term(setup, comm)
    return np.asarray(found if term is None else found + term.modes.patch_compliance(patches))


def _seen_from_outside(setup: ProblemSetup) -> SceneBody:
    """Return the counter-body with its face in a frame of its own, whose normal points out of it.

    Its y axis is turned, and counts from the other side of the surface's rectangle.
    """
    counter, width = setup.bodies.counter, setup.surface.lengths[1]
    assert counter is not None
    turn = np.array([1.0, -1.0, -1.0])
    old = counter.frame
    frame = FaceFrame(origin=old.in_space([[0.0, width]])[0], axes=turn[:, None] * old.axes)

    def turned(part: Any) -> Any:
        corners = np.array([0.0, width]) + turn[:2] * part.corners
        return replace(part, frame=frame, corners=corners)

    return replace(counter, frame=frame, facets=tuple(map(turned, counter.facets)))
