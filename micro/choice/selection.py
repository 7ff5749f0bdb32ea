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
from geometry.errors import InputError
from micro.choice.candidates import Candidate, Option, options
from micro.choice.check import Check
from micro.choice.measures import contact_measures
from micro.model import MicroModel


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
    contacts are smallest, against the half-space model on the surface's own grid, or on a finer
    one where that is not expected to be three times as good as the tolerance or is the candidate
    itself. When nothing promises and keeps the tolerance, the model with the least expected error
    is taken. Periodic surfaces get half-space models, with the bounds found for free borders.

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
    _refuse(surface, approach, tolerance, solutions, periodic)
    check = Check(
        surface,
        contact_modulus=contact_modulus,
        approach=0.5 * approach,
        tolerance=tolerance,
        periodic=periodic,
    )
    found = list(
        options(
            surface,
            [check.measures, contact_measures(surface, approach, periodic=periodic)],
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
    return _Search(sorted(found, key=lambda o: o.candidate.cost), tolerance, check).choice()


def _refuse(
    surface: Surface, approach: float, tolerance: float, solutions: int, periodic: bool
) -> None:
    for what, value, good, allowed in (
        ("largest approach", approach, np.isfinite(approach) and approach > 0.0, "mm, > 0"),
        ("tolerance", tolerance, 0.0 < tolerance < 0.5, "0 to 0.5"),
        ("number of solutions", solutions, solutions >= 1, "≥ 1"),
        ("surface to continue", surface.source, surface.periodic or not periodic, "periodic"),
    ):
        if not good:
            raise InputError(f"the {what} is out of range", value=value, allowed=allowed)


class _Search:
    """Goes through the candidates, the cheapest first."""

    def __init__(self, found: list[Option], tolerance: float, check: Check) -> None:
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
            said = "has no solution" if np.isinf(error) else f"differs by {100 * error:.2g} %"
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
            checked = (
                f"{100 * taken.checked_error:.2g} % from {against} at half the largest approach"
            )
        at = self._check.measures
        sentence = (
            f"{taken.label}: {why} the tolerance of {100 * self._tolerance:.3g} %; expected error "
            f"of the force {100 * taken.expected_error:.2g} %, {checked}, where contacts cover "
            f"about {at.contact_fraction:.2g} of the surface in {at.regions or 'no'} "
            f"region{'s' * (at.regions != 1)} above the plane, with {at.cells_per_radius:.2g} of "
            f"its cells per radius; predicted {taken.cost:.2g} s for all solutions"
        )
        return Choice(
            model=model,
            taken=taken,
            candidates=tuple(self._candidates),
            sentence="; ".join([sentence, *self._failed]),
        )
