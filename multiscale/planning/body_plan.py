"""Says what bodies on meshes are, or faces with laws of samples, and what is doubtful of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from multiscale.readable import quantity
from multiscale.setup.mesh_bodies import FaceFacts
from multiscale.setup.problem import ProblemSetup

LOCKING_FROM = 0.45
"""Poisson's ratio above which linear elements lock. Two by two patches on 8 × 8 × 6 trilinear
cells are 1.6 % too stiff there, 6 % at 0.49 and 57 % at 0.4999. As many nodes of quadratic cells
are 0.5, 1.1 and 1.5 % too stiff."""
_MANY_SAMPLES = 4.0
"""Sides of a face over those of its sample below which its law is hardly representative."""
_HALF_SPACE = 0.95
"""Mean displacement of a square of a half-space by a uniform pressure, times E*, over its side."""


def body_statement(setup: ProblemSetup) -> str:
    """Say what the bodies are made of.

    Args:
        setup: The problem, with a body on a mesh or with laws of samples.
    """
    assert setup.face is not None
    text = (
        f"{_mesh(setup.face)}, contact modulus {quantity(setup.materials.contact_modulus, 'MPa')}"
    )
    if setup.counter_face is not None:
        text += f"; counter-body {_mesh(setup.counter_face)}; unknowns of both are one problem"
    return text


def body_term_statement(setup: ProblemSetup) -> str:
    """Say how contact problems of the whole surface see the body, and why.

    Args:
        setup: The problem, with a body on a mesh.
    """
    assert setup.face is not None
    if setup.scene.kind == "isolated":
        return "none: every patch is taken alone on a half-space"
    if setup.face.above:
        return (
            "the compliance of the mesh itself under smooth modes of pressure, as parts of the "
            "body lie above the plane of its contact face, where no half-space is"
        )
    return (
        "the half-space's own near field, and what the body adds to it in smooth modes of the "
        "surface's rectangle, from the mesh: the body lies below the plane of its contact face"
    )


def sample_statement(setup: ProblemSetup) -> str:
    """Say what laws of samples are made from.

    Args:
        setup: The problem, with laws of samples.
    """
    parts = []
    for region in setup.samples:
        x, y = (quantity(side, "mm") for side in region.surfaces[0].lengths)
        count = len(region.surfaces)
        samples = f"{count} periodic samples" if count > 1 else "a periodic sample"
        parts.append(f"{region.name}: {samples} of {x} × {y}")
    return f"representative: {'; '.join(parts)}; the law holds at every point of the face"


def body_warnings(setup: ProblemSetup) -> Iterator[str]:
    """Yield what a user should know about the bodies' meshes and the samples.

    Args:
        setup: The problem, with a body on a mesh or with laws of samples.
    """
    assert setup.face is not None
    for face in filter(None, (setup.face, setup.counter_face)):
        yield from face.notes
        if face.degree == 1 and face.poisson_ratio > LOCKING_FROM:
            yield (
                f"linear elements lock as Poisson's ratio comes near 0.5 (here "
                f"{face.poisson_ratio:g}): the body is too stiff by several per cent or more; take "
                "element = 'quadratic'"
            )
    if setup.samples:
        yield from _sample_warnings(setup, setup.face)


def _sample_warnings(setup: ProblemSetup, face: FaceFacts) -> Iterator[str]:
    side = math.sqrt(face.area)
    for region in setup.samples:
        largest = max(max(surface.lengths) for surface in region.surfaces)
        if side < _MANY_SAMPLES * largest:
            yield (
                f"the sample of {region.name} is {quantity(largest, 'mm')} long and the face about "
                f"{quantity(side, 'mm')}: a sample stands for faces that are much larger"
            )
        if region.mirrored:
            yield (
                f"the heights of {region.name} do not continue periodically: their sample is four "
                "mirror images, twice as long and wide"
            )
    history, second = setup.load_history, setup.materials.second
    if setup.both_give_way and second is not None and history.quantity == "force":
        sunk = _HALF_SPACE * history.largest / face.area * side * second.surface_compliance
        yield (
            "the half-space of the counter-body gives way on the scale of the sample alone; under "
            f"the whole face it would by about {1e3 * sunk:.3g} µm more: give it a mesh where that "
            "matters"
        )


def _mesh(face: FaceFacts) -> str:
    degree = "linear" if face.degree == 1 else "quadratic"
    x, y = face.lengths
    return (
        f"{face.cells} ({degree}), {face.unknowns} unknowns, contact face of {face.area:.6g} mm² "
        f"within {x:.6g} × {y:.6g} mm, {face.depth:.6g} mm of body below it"
    )
