"""Choice of the cheapest micro model whose expected error in force is below a tolerance.

Candidates promise a bound of their error from measures of the contacts
(`micro.choice.expected_errors`) and a cost (`micro.choice.candidates`). The cheapest that promises
the tolerance is made, solved at one load and compared with a half-space solution; one that misses
there gives way to the next.

On 60 surfaces that took no part in the calibration (`tests/benchmarks/auto_study.py`; their true
forces known to 0.7 %, half of them to 0.1 %) all promises of 2, 5, 10 and 20 % were kept: 47 of 60
surfaces had a model that promised 2 %, all had one for the others. So were they on 8 surfaces of
512² and 1024² heights and on 16 periodic ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry import PatchGrid, Surface
from geometry.errors import InputError, NotConverged
from micro.choice.candidates import Candidate, Option, grid_of, half_space, options
from micro.choice.expected_errors import ContactMeasures, contact_measures, grid_error
from micro.model import MicroModel

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
    label: str | None = None,
) -> Choice:
    """Choose a micro model of a surface.

    Errors are promised for the largest approach and half of it. The check is made at half, where
    contacts are smallest, against the half-space model on the surface's own grid. It is made on a
    finer grid where the own one is not expected to be three times as good as the tolerance, or is
    the candidate itself. When nothing promises and keeps the tolerance, the model with the least
    expected error is taken. Periodic surfaces get half-space models, with the bounds found for free
    borders.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        approach: Largest approach of the plane [mm].
        tolerance: Largest relative error of the force.
        solutions: Approaches that the model will be solved for.
        patches: Patches that must hold at least 8 cells of a grid along each side.
        periodic: Whether surface and pressures continue periodically; else the border is free.
        label: Label of the only candidate that may be taken, such as an earlier choice.

    Raises:
        InputError: When approach, tolerance or number of solutions is out of range, or a surface
            that is not periodic shall be, or no candidate has the label.
    """
    for what, value, good, allowed in (
        ("largest approach", approach, np.isfinite(approach) and approach > 0.0, "mm, > 0"),
        ("tolerance", tolerance, 0.0 < tolerance < 0.5, "0 to 0.5"),
        ("number of solutions", solutions, solutions >= 1, "≥ 1"),
        ("surface to continue", surface.source, surface.periodic or not periodic, "periodic"),
    ):
        if not good:
            raise InputError(f"the {what} is out of range", value=value, allowed=allowed)
    half, whole = (
        contact_measures(surface, at, periodic=periodic) for at in (0.5 * approach, approach)
    )
    found = list(
        options(
            surface,
            [half, whole],
            approach=approach,
            contact_modulus=contact_modulus,
            solutions=solutions,
            patches=patches,
            periodic=periodic,
        )
    )
    if label is not None:
        labels = [option.candidate.label for option in found]
        found = [option for option in found if option.candidate.label == label]
        if not found:
            raise InputError("is no micro model here", value=label, allowed=", ".join(labels))
    found.sort(key=lambda option: option.candidate.cost)
    check = _Check(surface, contact_modulus, periodic, 0.5 * approach, tolerance, half)
    return _first_good(found, tolerance, check)


def _first_good(found: list[Option], tolerance: float, check: _Check) -> Choice:
    """Return the first that keeps the tolerance, or the one with the least expected error."""
    candidates, failed = [option.candidate for option in found], list[str]()
    left = list(range(len(found)))

    def made(k: int) -> tuple[MicroModel, str]:
        model = found[k].make()
        error, against = check.difference(found[k], model)
        candidates[k] = replace(candidates[k], checked_error=error)
        return model, against

    why = "the cheapest that promises"
    for k, candidate in enumerate(candidates):
        if candidate.expected_error > tolerance:
            continue
        model, against = made(k)
        error = candidates[k].checked_error
        if error is None or error <= tolerance:
            break
        said = "has no solution" if np.isinf(error) else f"differs by {100 * error:.2g} %"
        failed.append(f"{candidate.label} {said} when checked")
        left.remove(k)
    else:
        k = min(left or range(len(found)), key=lambda k: candidates[k].expected_error)
        model, against = made(k)
        why = "the least expected error, for none promises"
        if failed:
            why = "the least expected error of the rest, for none that was checked keeps"
    reasons = [_sentence(candidates[k], check, against, why, tolerance), *failed]
    return Choice(
        model=model,
        taken=candidates[k],
        candidates=tuple(candidates),
        sentence="; ".join(reasons),
    )


def _sentence(taken: Candidate, check: _Check, against: str, why: str, tolerance: float) -> str:
    checked = "not checked, for a finer grid would be too large, at half the largest approach"
    if taken.checked_error is not None:
        checked = f"{100 * taken.checked_error:.2g} % from {against} at half the largest approach"
    at = check.measures
    return (
        f"{taken.label}: {why} the tolerance of {100 * tolerance:.3g} %; expected error "
        f"of the force {100 * taken.expected_error:.2g} %, {checked}, where contacts cover "
        f"about {at.contact_fraction:.2g} of the surface in {at.regions or 'no'} "
        f"region{'s' * (at.regions != 1)} above the plane, with {at.cells_per_radius:.2g} of "
        f"its cells per radius; predicted {taken.cost:.2g} s for all solutions"
    )


class _Check:
    """Compares forces at one load with those of half-space models on grids of the surface.

    Args:
        surface: The surface.
        modulus: E* [MPa].
        periodic: Whether surface and pressures continue periodically.
        approach: Approach of the plane [mm].
        tolerance: Relative error that models shall keep.
        measures: Contacts at this load.
    """

    def __init__(
        self,
        surface: Surface,
        modulus: float,
        periodic: bool,
        approach: float,
        tolerance: float,
        measures: ContactMeasures,
    ) -> None:
        self._surface, self._modulus, self._periodic = surface, modulus, periodic
        self._approach, self.measures = approach, measures
        good = [grid_error(measures, factor) <= tolerance / _SURER for factor in _FINER]
        least = good.index(True) if any(good) else len(good) - 1
        self._grids = [grid_of(surface, factor) for factor in _FINER]
        self._fine_enough = self._grids[least:]
        self._forces: dict[tuple[int, int], float] = {}

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
        enough = [g for g in able if g in self._fine_enough]
        return enough[0] if enough else able[-1] if able else None

    def _force(self, model: MicroModel) -> float:
        whole = PatchGrid(grid=(1, 1), lengths=self._surface.lengths)
        response = model.respond([self._approach], patches=whole, mean_heights=[0.0])
        return float(response.force[0])
