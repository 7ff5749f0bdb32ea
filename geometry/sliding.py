"""Steps of a slid distance, short enough for what wears meanwhile.

Implicit Euler steps of wear are stable and of first order, whatever their length. What slides does
so twice: in whole steps, and in two halves of each. What both differ by at the end is the error of
the halves, to first order. Where forces change places by too much from half to half, or fall so
fast that the worn volume would be wrong, the step is begun anew, shorter. Surfaces run in: contacts
change ever more slowly, and steps become longer.

Theory: docs/theory.md, section 18.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from patchlaw.support import NotConverged

_CHANGE = 0.1
"""Force that changes places between the halves of a step, over the largest of all steps."""
_OF_VOLUME = 0.02
"""What a step may err by in the worn volume, ∫ F ds by trapezia, over what all have worn so far. At
a held approach, where the force falls with the depth as a line, as powers of 1.5 and 3 or as an
exponential, over distances of five decades, volumes are then at most 2.7 % too small."""
SAFE = 1.5
"""Error over what whole steps and their halves differ by, which is the error to first order."""
_SHORTEST = 1e-12
"""Length of a step over all that is slid."""
_LONGER, _SHORTER, _SAFETY = 5.0, 0.1, 0.8
"""Largest and smallest ratio of a step to the one before, and what keeps it from being too long."""


class Solution(Protocol):
    """A contact, and the iterations that it took."""

    @property
    def iterations(self) -> int:
        """Iterations of its solution."""
        ...


Contact = TypeVar("Contact", bound=Solution)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidContact(Generic[Contact]):
    """A contact at the end of a slid distance.

    Args:
        state: The contact, after the halves of all steps.
        once: The same after whole steps.
        steps: Number of steps.
        iterations: Iterations of all contacts on the way.
    """

    state: Contact
    once: Contact
    steps: int
    iterations: int


def slide_in_steps(
    press: Callable[[float, Any, Any], Contact],
    start: Any,
    moved: Callable[[Contact, Contact], tuple[float, float, float]],
    force: float,
) -> SlidContact[Contact]:
    """Slide a distance in steps that are short enough.

    Args:
        press: Returns the contact after a share of the distance, from an earlier contact on; the
            last argument is that which the step, or the whole one, begins from.
        start: The contact before.
        moved: Returns the force that changes places from one contact to another, and those of both
            [N]; pressures of equal areas will do.
        force: That of the start.

    Raises:
        NotConverged: When steps would have to be too short, or a contact is not found.
    """
    left, step, count, used = 1.0, 1.0, 0, 0
    coarse, most, worn = start, force, 0.0  # under an approach the force falls without end
    while left > 0.0:
        share = left if step > 0.99 * left else step
        middle = press(0.5 * share, start, start)
        twice = press(0.5 * share, middle, start)
        used += middle.iterations + twice.iterations
        changed, half, force = moved(middle, twice)
        most, own = max(most, force), 0.5 * share * (half + force)
        ratio = 2.0 * _CHANGE / max(changed / most, 1e-12) if changed else _LONGER
        if (off := 0.5 * share * abs(half - force)) > 0.0:
            ratio = min(ratio, _OF_VOLUME * (worn + own) / off)
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
        once = press(share, coarse, start)
        used += once.iterations
        start, coarse, left, count, worn = twice, once, left - share, count + 1, worn + own
    return SlidContact(state=twice, once=once, steps=count, iterations=used)
