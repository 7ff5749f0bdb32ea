"""The micro models that can be chosen from: what they promise, what they cost, how to make them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from geometry import PatchGrid, Surface
from micro.asperities.model import MODELS
from micro.choice.cost import contact_box_share, solution_seconds
from micro.choice.expected_errors import ContactMeasures, contact_error, grid_error
from micro.factory import micro_model
from micro.half_space.model import HalfSpaceModel
from micro.model import MicroModel

FACTORS = (0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Cells of half-space grids along a side, relative to the surface's own."""
_LEAST_CELLS, _FEWEST_CELLS = 8, 16
"""Cells along a patch, and along a side, that a grid needs at least."""
_MOST_CELLS = 2**22
"""Cells of the largest grid that is offered."""
_SCALED = "elliptic with curvature at the contact's scale and border summits"


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A model that could be taken.

    Attributes:
        label: Name of the model with its options or its grid.
        expected_error: Bound of the relative error of the force at the largest approach and at
            half of it, which 95 of 100 surfaces keep.
        cost: Predicted time for all solutions [s].
        checked_error: Difference of the force at half the largest approach from a half-space
            solution, relative to it; None where it was not computed.
    """

    label: str
    expected_error: float
    cost: float
    checked_error: float | None = None


@dataclass(frozen=True, kw_only=True)
class Option:
    """A candidate and its model.

    Attributes:
        candidate: What it promises.
        make: Makes the model.
        cells: Cells in x and y of a half-space grid.
    """

    candidate: Candidate
    make: Callable[[], MicroModel]
    cells: tuple[int, int] | None = None


def options(
    surface: Surface,
    measures: Sequence[ContactMeasures],
    *,
    approach: float,
    contact_modulus: float,
    solutions: int,
    patches: PatchGrid | None,
    periodic: bool,
) -> Iterator[Option]:
    """Yield the models that a surface and its patches allow.

    Args:
        surface: The surface.
        measures: Its contacts at every load that errors are promised for, the largest last.
        approach: Largest approach of the plane [mm].
        contact_modulus: E* [MPa].
        solutions: Approaches to be solved for.
        patches: Patches that must hold at least 8 cells of a grid along each side.
        periodic: Whether only periodic models are wanted.
    """
    box = contact_box_share(surface.heights - (surface.highest - approach))
    # the density of the summits above the plane is the square of crowding over contact radius
    radius = measures[-1].cells_per_radius * max(surface.spacing)
    summits = round(surface.area * (measures[-1].crowding / radius) ** 2)

    def seconds(kind: str, cells: int) -> float:
        return solutions * solution_seconds(kind, cells, box=box, summits=summits)

    parts = patches.grid if patches else (1, 1)
    named = partial(micro_model, surface=surface, contact_modulus=contact_modulus)
    by_contacts: list[tuple[str, str, Callable[[], MicroModel]]] = []
    if not periodic:
        scaled = partial(named, "elliptic", curvature="contact", border="include")
        by_contacts = [(kind, kind, partial(named, kind)) for kind in MODELS]
        by_contacts.append(("scaled", _SCALED, scaled))
        if _fits(surface.grid, parts):
            by_contacts.append(("islands", "islands", partial(named, "islands")))
    for kind, label, make in by_contacts:
        error = max(contact_error(kind, at) for at in measures)
        spent = seconds(kind, surface.heights.size)
        yield Option(candidate=Candidate(label=label, expected_error=error, cost=spent), make=make)
    for factor in FACTORS:
        cells = grid_of(surface, factor)
        small = cells[0] * cells[1] <= _MOST_CELLS
        if factor != 1.0 and not (small and (factor > 1.0 or _fits(cells, parts))):
            continue
        yield Option(
            candidate=Candidate(
                label=f"half-space on {cells[0]} × {cells[1]} cells",
                expected_error=max(grid_error(at, factor) for at in measures),
                cost=seconds("half-space", cells[0] * cells[1]),
            ),
            make=partial(half_space, surface, cells, contact_modulus, periodic),
            cells=cells,
        )


def grid_of(surface: Surface, factor: float) -> tuple[int, int]:
    """Return the cells of a grid so many times as fine as a surface's own."""
    return round(factor * surface.grid[0]), round(factor * surface.grid[1])


def half_space(
    surface: Surface, cells: tuple[int, int], contact_modulus: float, periodic: bool
) -> HalfSpaceModel:
    """Return the half-space model on a grid, its approach counted from the surface's summit."""
    return HalfSpaceModel(
        resampled(surface, cells),
        contact_modulus=contact_modulus,
        periodic=periodic,
        highest=surface.highest,
    )


def resampled(surface: Surface, grid: tuple[int, int]) -> Surface:
    """Return the interpolant of a surface at the centres of other cells.

    Its own highest point differs a little: models that are to be compared get the `highest` of
    the original.

    Args:
        surface: The surface.
        grid: Cells in x and y.
    """
    if grid == surface.grid:
        return surface
    x, y = (
        (np.arange(n) + 0.5) * (size / n) for n, size in zip(grid, surface.lengths, strict=True)
    )
    points = np.meshgrid(x, y, indexing="ij")
    return replace(surface, heights=surface.height_at(*points))


def _fits(cells: tuple[int, int], parts: tuple[int, int]) -> bool:
    return all(n >= max(_LEAST_CELLS * m, _FEWEST_CELLS) for n, m in zip(cells, parts, strict=True))
