"""The micro models: made by name, and as candidates with what they promise and cost.

Times are for one solution, started from a solution nearby. They are fits to times on one core of an
Intel Xeon (Rocket Lake, 3 GHz), for Set 1 of Waddad et al. 2016 and for bands of 1 to 6 and 2 to 32
waves, 64² to 512² heights, 2 to 20 µm of approach. They hold within a factor of 1.5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import PatchGrid, Surface, find_asperities
from geometry.errors import InputError
from geometry.rigid_plane import RigidPlane
from micro.asperities.contacts import Equilibrium
from micro.asperities.model import MODELS, AsperityModel
from micro.asperities.scaled_model import ScaledModel
from micro.choice.expected_errors import ContactMeasures, contact_error, grid_error
from micro.half_space.model import HalfSpaceModel
from micro.interaction.contact_problem import Solution, checked_pairs
from micro.islands.model import IslandModel
from micro.model import MicroModel

Cells = tuple[int, int]
Maker = Callable[[], MicroModel]

MODEL_NAMES = (*MODELS, "islands", "half-space")
"""Names of all micro models, the cheapest kinds first."""

START_KINDS: tuple[type, ...] = (RigidPlane, Equilibrium, Solution)
"""Records that `Pressed.start` may consist of, besides arrays and tuples."""

FACTORS = (0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Cells of half-space grids along a side, relative to the surface's own."""
_LEAST_CELLS, _FEWEST_CELLS = 8, 16
"""Cells along a patch, and along a side, that a grid needs at least."""
_MOST_CELLS = 2**22
"""Cells of the largest grid that is offered."""
_INTERACTING = {"elliptic", "circular", "scaled"}
_SCALED = "elliptic with curvature at the contact's scale and border summits"
_LOADS = (0.25, 0.5, 0.75, 1.0)
"""Loads relative to the largest; their mean stands for the loads of a run."""


def micro_model(
    name: str,
    surface: Surface,
    *,
    contact_modulus: float,
    solver: str = "active-set",
    curvature: str = "summit",
    border: str = "ignore",
) -> MicroModel:
    """Return the micro model of a surface whose border is free, as that of a block's top is.

    Args:
        name: A name in `MODEL_NAMES`.
        surface: The surface.
        contact_modulus: E* [MPa].
        solver: Solver of the interacting asperity models.
        curvature: Where asperity models take the curvature, a name in `CURVATURES`.
        border: How asperity models treat maxima on the border, a name in `BORDERS`.

    Raises:
        InputError: When there is no such model, option or solver, or the modulus is not positive.
    """
    if name == "half-space":
        return HalfSpaceModel(surface=surface, contact_modulus=contact_modulus)
    if name == "islands":
        return IslandModel(surface=surface, contact_modulus=contact_modulus)
    if name not in MODELS:
        raise InputError("unknown micro model", value=name, allowed=", ".join(MODEL_NAMES))
    if (curvature, border) != ("summit", "ignore"):
        return ScaledModel(
            kind=name,
            surface=surface,
            contact_modulus=contact_modulus,
            curvature=curvature,
            border=border,
            solver=solver,
        )
    asperities = find_asperities(surface, periodic=False)
    return AsperityModel(name, asperities, contact_modulus=contact_modulus, solver=solver)


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


class Option(NamedTuple):
    """A candidate and its model.

    Attributes:
        candidate: What it promises.
        make: Makes the model.
        cells: Cells in x and y of a half-space grid.
    """

    candidate: Candidate
    make: Maker
    cells: Cells | None = None


def options(
    surface: Surface,
    measures: Sequence[ContactMeasures],
    *,
    approach: float,
    contact_modulus: float,
    solutions: int,
    patches: PatchGrid | None,
) -> Iterator[Option]:
    """Yield the models that a surface, its patches and the memory allow.

    Args:
        surface: The surface.
        measures: Its contacts at every load that errors are promised for, the largest last.
        approach: Largest approach of the plane [mm].
        contact_modulus: E* [MPa].
        solutions: Approaches to be solved for.
        patches: Patches that must hold at least 8 cells of a grid along each side.
    """
    box = contact_box_share(surface.heights - (surface.highest - approach))
    # the density of the summits above the plane is the square of crowding over contact radius
    radius = measures[-1].cells_per_radius * max(surface.spacing)
    summits = round(surface.area * (measures[-1].crowding / radius) ** 2)
    parts = patches.grid if patches else (1, 1)

    def option(label: str, kind: str, error: float, make: Maker, cells: Cells | None) -> Option:
        heights = surface.heights.size if cells is None else cells[0] * cells[1]
        cost = solutions * solution_seconds(kind, heights, box=box, summits=summits)
        return Option(Candidate(label=label, expected_error=error, cost=cost), make, cells)

    named = partial(micro_model, surface=surface, contact_modulus=contact_modulus)
    makers = {kind: partial(named, kind) for kind in (*MODELS, "islands")}
    makers["scaled"] = partial(named, "elliptic", curvature="contact", border="include")
    if not _has_memory(summits):
        makers = {kind: makers[kind] for kind in makers if kind not in _INTERACTING}
    if not _fits(surface.grid, parts):
        del makers["islands"]
    for kind, make in makers.items():
        error = max(contact_error(kind, at) for at in measures)
        yield option(_SCALED if kind == "scaled" else kind, kind, error, make, None)
    for factor in FACTORS:
        cells = grid_of(surface, factor)
        small = cells[0] * cells[1] <= _MOST_CELLS
        if factor != 1.0 and not (small and (factor > 1.0 or _fits(cells, parts))):
            continue
        label = f"half-space on {cells[0]} × {cells[1]} cells"
        error = max(grid_error(at, factor) for at in measures)
        finer = partial(half_space, surface, cells, contact_modulus)
        yield option(label, "half-space", error, finer, cells)


def grid_of(surface: Surface, factor: float) -> Cells:
    """Return the cells of a grid so many times as fine as a surface's own."""
    return round(factor * surface.grid[0]), round(factor * surface.grid[1])


def half_space(surface: Surface, cells: Cells, contact_modulus: float) -> HalfSpaceModel:
    """Return the half-space model on a grid, its approach counted from the surface's summit."""
    return HalfSpaceModel(surface, contact_modulus=contact_modulus).resampled(cells)


def _fits(cells: Cells, parts: Cells) -> bool:
    return all(n >= max(_LEAST_CELLS * m, _FEWEST_CELLS) for n, m in zip(cells, parts, strict=True))


def _has_memory(summits: int) -> bool:
    """Return whether the interaction of so many summits fits into the memory."""
    try:
        checked_pairs(summits, summits, "asperities")
    except InputError:
        return False
    return True


def contact_box_share(interference: NDArray[np.float64]) -> float:
    """Return the part of the surface in the bounding box of its contacts, in the mean over loads.

    The half-space is solved on this part of its grid.

    Args:
        interference: How far the undeformed surface lies above the plane at the largest load,
            negative where it lies below, shape (nx, ny) [mm].
    """
    largest, shares = float(interference.max()), []
    for load in _LOADS:
        i, j = np.nonzero(interference > (1.0 - load) * largest)
        touches = i.size and largest > 0.0
        shares.append(float((np.ptp(i) + 1) * (np.ptp(j) + 1)) if touches else 1.0)
    return float(np.mean(shares)) / interference.size


def solution_seconds(kind: str, cells: int, *, box: float, summits: int) -> float:
    """Return the time of one solution of a micro model [s].

    Args:
        kind: Its name; ``scaled`` for asperities with curvatures at the scale of the contact.
        cells: Cells of the half-space's grid; heights of the surface for other models.
        box: Part of the surface in the bounding box of its contacts, see `contact_box_share`.
        summits: Summits in contact; asperities interact each with each.
    """
    if kind == "half-space":
        padded = 4.0 * max(box * cells, 1.0)
        # 20 to 30 iterations of two products by transforms on a box of twice the sides
        return 3.1e-3 + 33e-9 * cells + 15e-9 * padded * float(np.log2(padded))
    if kind == "islands":
        return 15.6e-3 + 44e-9 * cells
    asperities = 1.0e-3 + 13e-6 * summits + 28e-9 * summits**2
    return asperities + (4.7e-3 if kind == "scaled" else 0.0)
