"""Wear of a rough surface that slides: how its contact runs in.

Archard's law takes off the depth k p ds while the surface slides by ds under the pressure p. In
implicit Euler steps of Δs the depth k Δs p of the pressures at the end is taken off, which is a
compliance k Δs of each cell by itself: the contact problem stays what it is, convex, and no length
of the steps makes it unstable. The volume that wears off is k F Δs, whatever their length.

Steps are as long as `geometry.sliding` finds right.

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
from patchlaw.geometry.sliding import SAFE, slide_in_steps
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.support import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Worn:
    """A contact at the end of some slid distance.

    Args:
        state: The contact.
        steps: Steps that led there.
        errors: Errors by the length of the steps of force [N], approach [mm], contact area
            fraction, mean separation, mean and largest worn depth [mm].
        apart: What the worn depths of the cells err by, shape (nx, ny) [mm].
    """

    state: ContactState
    steps: int
    errors: tuple[float, ...]
    apart: Array


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
    known: list[Any] = [None, model]  # the depth that finite slopes were made for last

    def press(share: float, before: Any, began: Any) -> ContactState:
        depth = _start(began).worn_depth
        if depth is not known[0]:
            known[:] = depth, model if depth is None else model.worn(depth)
        worn = replace(known[1], wear=wear * share, few=None, sums_alone=False)
        return worn.press(control, start=_start(before), **options)

    def moved(middle: ContactState, twice: ContactState) -> tuple[float, float, float]:
        change = np.abs(twice.pressures - middle.pressures).sum()
        return float(change), float(middle.pressures.sum()), float(twice.pressures.sum())

    slid = slide_in_steps(press, start, moved, float(start.values.sum()))
    errors = SAFE * np.abs(np.subtract(_read_off(slid.state), _read_off(slid.once)))
    assert slid.state.worn_depth is not None and slid.once.worn_depth is not None
    apart = SAFE * (slid.state.worn_depth - slid.once.worn_depth)
    state = replace(slid.state, iterations=slid.iterations)
    return Worn(state=state, steps=slid.steps, errors=tuple(errors), apart=apart)


def _start(contact: ContactState | Start) -> Start:
    return contact.start if isinstance(contact, ContactState) else contact


def _read_off(state: ContactState) -> tuple[float, ...]:
    normal = state.force, state.approach, state.contact_area_fraction, state.mean_separation
    return *normal, *worn_depths(state)


def worn_depths(state: ContactState) -> tuple[float, float]:
    """Return the mean and the largest depth that has worn off [mm].

    Args:
        state: A contact of cells.
    """
    depth = state.worn_depth
    return (0.0, 0.0) if depth is None else (float(depth.mean()), float(depth.max()))
