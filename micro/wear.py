"""Wear of a rough surface that slides: how its contact runs in.

Archard's law takes off the depth k p ds while the surface slides by ds under the pressure p. In
implicit Euler steps of Δs the depth k Δs p of the pressures at the end is taken off, which is a
compliance k Δs of each cell by itself: the contact problem stays what it is, convex, and no length
of the steps makes it unstable. The volume that wears off is k F Δs, whatever their length.

Steps are of first order. The surface wears twice: in whole steps, and in two halves of each. What
both differ by at the end is the error of the halves, to first order. Where pressures change by too
much from half to half the step is begun anew, shorter. Surfaces run in: contacts grow ever more
slowly, and steps become ever longer.

Sources: Archard 1953, J. Appl. Phys. 24, 981-988, doi 10.1063/1.1721448. Increments of this kind
with a half-space: Andersson, Almqvist & Larsson 2011, Wear 271, 2863-2870.

Theory: docs/theory.md, section 18.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from patchlaw.geometry import Control
from patchlaw.geometry.contact_state import ContactState, Start
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.support.errors import NotConverged

_CHANGE = 0.1
"""Force that changes places between the halves of a step, over the largest of all steps."""
_SAFE = 1.5
"""Error over what whole steps and their halves differ by, which is the error to first order."""
_SHORTEST = 1e-9
"""Length of a step over all that is slid."""
_LONGER, _SHORTER, _SAFETY = 5.0, 0.1, 0.8
"""Largest and smallest ratio of a step to the one before, and what keeps it from being too long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Worn:
    """A contact at the end of some slid distance.

    Args:
        state: The contact.
        steps: Steps that led there.
        errors: Errors by the length of the steps of force [N], approach [mm], contact area fraction
            and mean separation [mm].
    """

    state: ContactState
    steps: int
    errors: tuple[float, ...]


def slide(
    model: HalfSpaceModel, control: Control, start: Start, wear: float, **options: Any
) -> Worn:
    """Return the contact after a surface has slid under one load.

    Args:
        model: The surface as it was made, with finite slopes of what it is now.
        control: What is prescribed of the plane meanwhile.
        start: The contact before.
        wear: Coefficient of wear times slid distance, > 0 [mm/MPa].
        **options: Others of `HalfSpaceModel.press`.

    Raises:
        NotConverged: When steps would have to be too short, or a contact is not found.
    """
    left, step, count, used, coarse = 1.0, 1.0, 0, 0, start
    most = float(start.values.sum())  # under an approach the force falls without end
    while left > 0.0:
        now = model if start.worn_depth is None else model.worn(start.worn_depth)
        share = left if step > 0.99 * left else step
        whole = replace(now, wear=wear * share, few=None, sums_alone=False)
        half = replace(whole, wear=0.5 * wear * share)
        middle = half.press(control, start=start, **options)
        twice = half.press(control, start=middle.start, **options)
        used += middle.iterations + twice.iterations
        moved = float(np.abs(twice.pressures - middle.pressures).sum())
        most = max(most, float(twice.pressures.sum()))
        ratio = 2.0 * _CHANGE / max(moved / most, 1e-12) if moved else _LONGER
        step = share * min(max(_SAFETY * ratio, _SHORTER), _LONGER)
        if ratio < 1.0:
            if step < _SHORTEST:
                raise NotConverged(
                    f"wear (steps of {step:.1e} of the slid distance still differ)",
                    reason="the contact changes at once",
                    iterations=used,
                    remedy="slide less far in a load step, or take a smaller coefficient of wear",
                )
            continue
        once = whole.press(control, start=coarse, **options)
        used += once.iterations
        start, coarse, left, count = twice.start, once.start, left - share, count + 1
    errors = _SAFE * np.abs(np.subtract(_read_off(twice), _read_off(once)))
    return Worn(state=replace(twice, iterations=used), steps=count, errors=tuple(errors))


def _read_off(state: ContactState) -> tuple[float, ...]:
    return state.force, state.approach, state.contact_area_fraction, state.mean_separation
