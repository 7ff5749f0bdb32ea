"""Shear stresses of sliders as lines, where Newton's method far from the solution linearises them.

Slip bounds what stiff springs would bear, and Newton's method goes back and forth between sticking
and slipping samples. Sliders are therefore linearised where a sample reaches its curve along the
stiffness k of the body from the slip s and the stress τ that the last lines predicted,

    τ(s') + k s' = τ + k s,

as `law_lines` does with pressures. A pad of P2 elements with laws of 1 µm took 8 to 10 steps a load
step, in place of 21 to 25.

Theory: docs/theory.md, sections 11 and 15.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from geometry.sliders import SliderResponse
from support.arrays import Array

_MOST_STEPS = 12
_CLOSE = 1e-3
"""Residual of the slips, relative to the largest shear stress."""


class ShearLines(NamedTuple):
    """Shear stresses linearised in slips and closures.

    Attributes:
        slip: Slips of this rank's samples, shape (n, 2) [mm].
        closure: Their closures, shape (n,) [mm].
        stress: Shear stresses there, shape (n, 2) [MPa].
        response: With the derivatives.
    """

    slip: Array
    closure: Array
    stress: Array
    response: SliderResponse

    def at(self, slip: Array, closure: Array) -> Array:
        """Return the shear stresses on the lines, shape (n, 2) [MPa]."""
        found = self.response
        by_slip = np.einsum("nij,nj->ni", found.by_slip, slip - self.slip)
        return self.stress + by_slip + found.by_closure * (closure - self.closure)[:, None]


def shear_lines(
    respond: Callable[..., SliderResponse],
    slip: Array,
    closure: Array,
    stress: Array,
    along: float,
) -> ShearLines:
    """Linearise sliders where samples reach their curves along the body's stiffness.

    From springs that all stick Newton's method comes to them from one side.

    Args:
        respond: The shear stresses at slips; with ``sticks=True`` those of springs that stick.
        slip: Predicted slips of this rank's samples, shape (n, 2) [mm].
        closure: Their closures, shape (n,) [mm].
        stress: Predicted shear stresses, shape (n, 2) [MPa].
        along: Stiffness of the body [MPa/mm].
    """
    stiff = along * np.eye(2)
    found, at = respond(slip, sticks=True), slip
    for _ in range(_MOST_STEPS):
        excess = found.stress - stress + along * (at - slip)
        at = at - np.linalg.solve(found.by_slip + stiff, excess[:, :, None])[:, :, 0]
        found = respond(at)
        excess = found.stress - stress + along * (at - slip)
        if np.abs(excess).max(initial=0.0) <= _CLOSE * np.abs(found.stress).max(initial=0.0):
            break
    there = found.stress + np.einsum("nij,nj->ni", found.by_slip, slip - at)
    return ShearLines(slip, closure, there, found)
