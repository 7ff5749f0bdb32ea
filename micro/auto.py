"""Choice of the cheapest micro model whose expected error in force is below a tolerance.

Candidates promise a bound of their error from measures of the contacts (`micro.auto_errors`) and
a cost (`micro.auto_candidates`). The cheapest that promises the tolerance is made, solved at one
load and compared with a half-space solution; one that misses there gives way to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry import PatchGrid, Surface, patch_means
from geometry.errors import InputError, NotConverged
from micro.auto_candidates import Candidate, Option, half_space, options
from micro.auto_errors import grid_error
from micro.auto_measures import ContactMeasures, contact_measures
from micro.models import MicroModel

_FINER = (1.0, 1.5, 2.0, 3.0)
"""Grids that checks are made against, relative to the surface's own."""

_SURER = 3.0
"""How many times smaller than the tolerance the expected error of a check should be."""

_MOST_CHECKED = 2**21
"""Cells of the largest grid, finer than the surface's own, that a check is made on."""


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
        """Difference from the half-space solution checked against, None without a check."""
        return self.taken.checked_error


def choose(
    surface: Surface,
    *,
    contact_modulus: float,
    approach: float,
    tolerance: float = 0.02,
    solutions: int = 40,
    patches: PatchGrid | None = None,
    periodic: bool = False,
) -> Choice:
    """Choose a micro model of a surface.

    Errors are promised for the largest approach and half of it. The check is made at half, where
    contacts are smallest, against the half-space model on the surface's own grid, or on a finer
    one where that is not expected to be three times as good as the tolerance or is the candidate
    itself. When nothing promises and keeps the tolerance, the model with the least expected error
    is taken.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        approach: Largest approach of the plane [mm].
        tolerance: Largest relative error of the force.
        solutions: Approaches that the model will be solved for; set-up is shared among them.
        patches: Patches that must hold at least 8 cells of a grid along each side.
        periodic: Whether surface and pressures continue periodically; else the border is free.

    Raises:
        InputError: When approach, tolerance or number of solutions is out of range, or a surface
            that is not periodic shall be.
    """
    for what, value, good, allowed in (
        ("largest approach", approach, np.isfinite(approach) and approach > 0.0, "mm, > 0"),
        ("tolerance", tolerance, 0.0 < tolerance < 0.5, "0 to 0.5"),
        ("number of solutions", solutions, solutions >= 1, "≥ 1"),
        ("surface to continue", surface.source, surface.periodic or not periodic, "periodic"),
    ):
        if not good:
            raise InputError(f"the {what} is out of range", value=value, allowed=allowed)
    measures = [
        contact_measures(surface, at, periodic=periodic) for at in (0.5 * approach, approach)
    ]
    found = options(
        surface,
        measures,
        contact_modulus=contact_modulus,
        solutions=solutions,
        patches=patches,
        periodic=periodic,
    )
    check = _Check(surface, contact_modulus, 0.5 * approach, tolerance, periodic, measures[0])
    return _Search(sorted(found, key=lambda o: o.candidate.cost), tolerance, check).choice()


class _Check:
    """Compares forces at one load with those of half-space models on grids of the surface."""

    def __init__(
        self,
        surface: Surface,
        modulus: float,
        approach: float,
        tolerance: float,
        periodic: bool,
        measures: ContactMeasures,
    ) -> None:
        self._surface, self._modulus, self._approach = surface, modulus, approach
        self._periodic, self.measures = periodic, measures
        grids = [self._cells(f) for f in _FINER]
        good = [grid_error(measures, f) <= tolerance / _SURER for f in _FINER]
        self._least = good.index(True) if any(good) else len(good) - 1
        self._grids, self._forces = grids, dict[tuple[int, int], float]()

    def difference(self, option: Option, model: MicroModel) -> tuple[float | None, str]:
        """Return the relative difference of a model's force, and what it differs from."""
        cells = self._grid(option.cells)
        if cells is None:
            return None, ""
        if cells not in self._forces:
            fine = half_space(self._surface, cells, self._modulus, self._periodic)
            self._forces[cells] = self._force(fine)
        truth = self._forces[cells]
        try:
            force = self._force(model)
        except NotConverged:
            force = np.inf
        error = abs(force / truth - 1.0) if truth else float(force > 0.0)
        return float(error), f"the half-space solution on {cells[0]} × {cells[1]} cells"

    def _grid(self, taken: tuple[int, int] | None) -> tuple[int, int] | None:
        """Return the coarsest grid that is fine enough, finer than the one taken, if any."""
        finer = [g for g in self._grids if taken is None or min(g) > min(taken)]
        able = [g for g in finer if g == self._surface.grid or np.prod(g) <= _MOST_CHECKED]
        enough = [g for g in able if g in self._grids[self._least :]]
        return enough[0] if enough else able[-1] if able else None

    def _force(self, model: MicroModel) -> float:
        whole = self._whole
        response = model.respond([self._approach], patches=whole[0], mean_heights=whole[1])
        return float(response.force[0])

    @cached_property
    def _whole(self) -> tuple[PatchGrid, np.ndarray]:
        whole = PatchGrid(grid=(1, 1), lengths=self._surface.lengths)
        return whole, patch_means(self._surface, whole)

    def _cells(self, factor: float) -> tuple[int, int]:
        return round(factor * self._surface.grid[0]), round(factor * self._surface.grid[1])


class _Search:
    """Goes through the candidates, the cheapest first."""

    def __init__(self, found: list[Option], tolerance: float, check: _Check) -> None:
        self._options, self._tolerance, self._check = found, tolerance, check
        self._candidates = [option.candidate for option in found]
        self._failed: list[str] = []

    def choice(self) -> Choice:
        """Return the first that keeps the tolerance, or the one with the least expected error."""
        left = dict(enumerate(self._candidates))
        for k, candidate in enumerate(self._candidates):
            if candidate.expected_error > self._tolerance:
                continue
            model, against = self._made(k)
            error = self._candidates[k].checked_error
            if error is None or error <= self._tolerance:
                return self._chosen(k, model, against, "the cheapest that promises")
            said = "has no solution" if np.isinf(error) else f"differs by {error:.2%}"
            self._failed.append(f"{candidate.label} {said} when checked")
            del left[k]
        best = min(left or dict(enumerate(self._candidates)), key=self._expected)
        why = "the least expected error, for none promises"
        if self._failed:
            why = "the least expected error of the rest, for none that was checked keeps"
        return self._chosen(best, *self._made(best), why)

    def _expected(self, k: int) -> float:
        return self._candidates[k].expected_error

    def _made(self, k: int) -> tuple[MicroModel, str]:
        model = self._options[k].make()
        error, against = self._check.difference(self._options[k], model)
        self._candidates[k] = replace(self._candidates[k], checked_error=error)
        return model, against

    def _chosen(self, k: int, model: MicroModel, against: str, why: str) -> Choice:
        taken = self._candidates[k]
        checked = "not checked, for a finer grid would be too large, at half the largest approach"
        if taken.checked_error is not None:
            checked = f"{taken.checked_error:.2%} from {against} at half the largest approach"
        at = self._check.measures
        sentence = (
            f"{taken.label}: {why} the tolerance of {100 * self._tolerance:.3g} %; expected error "
            f"of the force {taken.expected_error:.1%}, {checked}, where contacts cover about "
            f"{at.contact_fraction:.2g} of the surface in {at.regions or 'no'} "
            f"region{'s' * (at.regions != 1)} above the plane, with {at.cells_per_radius:.2g} of "
            f"its cells per radius; predicted {taken.cost:.2g} s for all solutions"
        )
        return Choice(
            model=model,
            taken=taken,
            candidates=tuple(self._candidates),
            sentence="; ".join([sentence, *self._failed]),
        )
