"""Choice of the cheapest micro model whose expected error in force is below a tolerance.

The error of a grid follows from its cells per contact radius. Islands and asperities have no
resolution to refine, so a bound for each kind stands for them. The constants were set on 62
surfaces (Hurst exponent 0.4 to 0.9, isotropic and anisotropic bands, 64² to 128² heights, rms
gradients 0.05 to 0.2) against half-space solutions on twice as many cells a side. On 247 such
surfaces the bounds held in 96 % or more of the cases for asperities and islands, in 99 % for the
surface's own grid, 93 % for half of it and 52 % for a quarter of it (82 % where 10 % are promised):
the check catches what the bounds of coarse grids miss.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import label

from geometry import PatchGrid, Surface, patch_means
from geometry.errors import InputError
from micro.half_space import HalfSpaceModel
from micro.models import MicroModel, micro_model

_GRID_ERROR, _GRID_ORDER = 0.15, 1.6
"""Error of the force at one cell per radius, and the power of the cells it falls with."""

_LEAST_CELLS = 8
"""Cells along a patch that a grid needs at least."""

_PLAIN = {"expected_error": 0.55, "cost": 1.5e-3}
_SCALED = {"expected_error": 0.06, "cost": 0.06}
_ISLANDS = {"expected_error": 0.05, "cost": 0.06}
"""Bounds and seconds per approach; the latter mostly set-up."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A model that could be taken.

    Attributes:
        label: Name of the model with its options or its grid.
        expected_error: Upper end of the relative error of the force between half the largest
            approach and all of it.
        cost: Predicted time per approach [s].
        checked_error: Force relative to the half-space model on the surface's own grid, minus 1,
            in absolute value; None where it was not computed.
    """

    label: str
    expected_error: float
    cost: float
    checked_error: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """The model taken, and why.

    Attributes:
        model: The micro model.
        taken: Its entry among the candidates.
        candidates: All candidates, the cheapest first.
        sentence: Which model and why, in words.
    """

    model: MicroModel
    taken: Candidate
    candidates: tuple[Candidate, ...]
    sentence: str

    @property
    def checked_error(self) -> float | None:
        """Error of the model at half the largest approach, by the surface's own grid."""
        return self.taken.checked_error


@dataclass(frozen=True)
class _Option:
    candidate: Candidate
    make: Callable[[], MicroModel]


def choose(
    surface: Surface,
    *,
    contact_modulus: float,
    approach: float,
    tolerance: float = 0.02,
    patches: PatchGrid | None = None,
) -> Choice:
    """Choose a micro model of a surface with a free border.

    Every model taken is solved at half the largest approach, where contacts are smallest, and
    compared with the half-space model on the surface's own grid; one that misses the tolerance
    there gives way to the next. When nothing promises the tolerance, the most accurate is taken.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        approach: Largest approach of the plane [mm].
        tolerance: Largest relative error of the force.
        patches: Patches that must hold at least 8 cells of a grid along each side.

    Raises:
        InputError: When approach or tolerance is out of range.
    """
    if not (np.isfinite(approach) and approach > 0.0):
        raise InputError("the largest approach must be positive", value=approach, allowed="mm")
    if not 0.0 < tolerance < 0.5:
        raise InputError("the tolerance is out of range", value=tolerance, allowed="0 to 0.5")
    radius = cells_per_radius(surface, 0.5 * approach)
    options = sorted(
        _options(surface, contact_modulus, radius, patches), key=lambda o: o.candidate.cost
    )
    candidates = [option.candidate for option in options]
    good = [k for k, item in enumerate(candidates) if item.expected_error <= tolerance]
    best = int(np.argmin([item.expected_error for item in candidates]))
    own = HalfSpaceModel(surface=surface, contact_modulus=contact_modulus)
    truth = _force(own, surface, 0.5 * approach)
    failed: list[str] = []
    for k in good or [best]:
        model = options[k].make()
        error = abs(_force(model, surface, 0.5 * approach) / truth - 1.0) if truth else 0.0
        candidates[k] = replace(candidates[k], checked_error=error)
        finer = isinstance(model, HalfSpaceModel) and min(model.surface.grid) >= min(surface.grid)
        if error <= tolerance or finer:
            break
        failed.append(f"{candidates[k].label} missed it by its check ({error:.2%})")
    else:
        k, model = best, options[best].make()
    taken = candidates[k]
    return Choice(
        model=model,
        taken=taken,
        candidates=tuple(candidates),
        sentence=_sentence(taken, radius, tolerance, failed),
    )


def cells_per_radius(surface: Surface, approach: float) -> float:
    """Return the cells of the grid per radius of the regions above the plane, their mean square.

    Args:
        surface: The surface.
        approach: Approach of the undeformed plane [mm].
    """
    above = surface.heights > surface.highest - approach
    regions = label(above, np.ones((3, 3)))[1]
    return float(np.sqrt(above.sum() / (np.pi * max(regions, 1))))


def _options(
    surface: Surface, modulus: float, radius: float, patches: PatchGrid | None
) -> Iterator[_Option]:
    def named(name: str, **options: str) -> Callable[[], MicroModel]:
        return lambda: micro_model(name, surface, contact_modulus=modulus, **options)

    for name in ("elliptic", "circular", "elliptic-independent", "circular-independent"):
        yield _Option(Candidate(label=name, **_PLAIN), named(name))
    scaled = named("elliptic", curvature="contact", border="include")
    label_ = "elliptic with curvature at the contact's scale and border summits"
    yield _Option(Candidate(label=label_, **_SCALED), scaled)
    parts = patches.grid if patches else (1, 1)
    if _fits(surface.grid, parts):
        yield _Option(Candidate(label="islands", **_ISLANDS), named("islands"))
    for factor in (0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0):
        grid = (round(factor * surface.grid[0]), round(factor * surface.grid[1]))
        if factor < 1.0 and not _fits(grid, parts):
            continue
        error = _GRID_ERROR * max(factor * radius, 0.3) ** -_GRID_ORDER
        cost = 2e-3 + 4e-7 * grid[0] * grid[1]
        yield _Option(
            Candidate(
                label=f"half-space on {grid[0]} × {grid[1]} cells", expected_error=error, cost=cost
            ),
            lambda grid=grid: HalfSpaceModel(  # type: ignore[misc]
                surface=resampled(surface, grid), contact_modulus=modulus
            ),
        )


def resampled(surface: Surface, grid: tuple[int, int]) -> Surface:
    """Return the interpolant of a surface at the centres of other cells.

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


def _fits(grid: tuple[int, int], parts: tuple[int, int]) -> bool:
    return all(n >= max(_LEAST_CELLS * m, 16) for n, m in zip(grid, parts, strict=True))


def _force(model: MicroModel, surface: Surface, approach: float) -> float:
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    heights = patch_means(surface, whole)
    return float(model.respond([approach], patches=whole, mean_heights=heights).force[0])


def _sentence(taken: Candidate, radius: float, tolerance: float, failed: list[str]) -> str:
    promise = "below" if taken.expected_error <= tolerance else "the least there is, above"
    before = "; ".join(failed)
    checked = "" if taken.checked_error is None else f", {taken.checked_error:.2%} from its"
    check = f"{checked} half-space solution when checked" if checked else ""
    return (
        f"{taken.label}: expected error of the force {taken.expected_error:.1%}, {promise} the "
        f"tolerance {tolerance:.1%} (the surface's grid has {radius:.2g} cells per contact radius"
        f"{check}), predicted "
        f"{1e3 * taken.cost:.2g} ms per approach" + (f"; before it, {before}" if before else "")
    )
