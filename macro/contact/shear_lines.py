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
_CLOSE = 1e-4
"""Residual of a sample's shear stress that ends its steps, relative to the largest one."""


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
        respond: The shear stresses at slips; with ``sticks=True`` those of springs that stick, with
            ``rows`` those of some of the samples.
        slip: Predicted slips of this rank's samples, shape (n, 2) [mm].
        closure: Their closures, shape (n,) [mm].
        stress: Predicted shear stresses, shape (n, 2) [MPa].
        along: Stiffness of the body [MPa/mm].
    """
    stiff = along * np.eye(2)
    found, at, largest = respond(slip, sticks=True), slip.copy(), 0.0
    left, excess, by_slip = np.arange(len(slip)), found.stress - stress, found.by_slip
    for _ in range(_MOST_STEPS):
        at[left] -= np.linalg.solve(by_slip + stiff, excess[:, :, None])[:, :, 0]
        some = respond(at[left], rows=left)
        excess = some.stress - stress[left] + along * (at - slip)[left]
        largest = np.abs(some.stress).max(initial=largest)
        off = (np.abs(excess) > _CLOSE * largest).any(axis=1)
        if not off.any():
            break
        left, excess, by_slip = left[off], excess[off], some.by_slip[off]
    found = respond(at)
    there = found.stress + np.einsum("nij,nj->ni", found.by_slip, slip - at)
    return ShearLines(slip, closure, there, found)
