"""Laws and sliders as lines: where Newton's method far from the solution linearises them.

Newton's method linearises a law at the closures that its last step led to. Pressures of rough
surfaces grow almost exponentially with closure: closures too large by a roughness give pressures
and stiffnesses too large by orders of magnitude, and the next steps return from there little by
little. The pressure that the linearised law predicted is a better place to go on from where the law
is stiffer than the body, and the closure where it is softer. Between the two lies the point of the
law's curve that the sample reaches from there along the stiffness k of the body,

    p(c') + k c' = p + k c,

with the closure c and the pressure p predicted for it, and the law is linearised there: a proximal
step (Parikh & Boyd 2014, doi 10.1561/2400000003). Circuit simulators limit the voltages of diodes
for the same reason (Nagel 1975, SPICE2, section 4.4). Nothing but the place of linearisation
differs from Newton's method, and near the solution both are the same.

Slip bounds what stiff springs would bear, and Newton's method goes back and forth between sticking
and slipping samples. Sliders are therefore linearised where a sample reaches its curve along the
stiffness k of the body from the slip s and the stress τ that the last lines predicted,

    τ(s') + k s' = τ + k s,

as pressures are. A pad of P2 elements with laws of 1 µm took 8 to 10 steps a load
step, in place of 21 to 25.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from patchlaw.geometry.sliders import SliderResponse
from patchlaw.macro.contact.pressed_plane import PressedPlane
from patchlaw.support.arrays import Array

_FIRST = 1e-3
"""First step from a closure towards a law's curve, relative to the largest closure."""
_DOUBLINGS, _BISECTIONS = 30, 16
_MOST_STEPS = 12
_CLOSE = 1e-4
"""Residual of a sample's shear stress that ends its steps, relative to the largest one."""


class Lines(NamedTuple):
    """Laws linearised at points of their curves.

    Attributes:
        closure: Closures of this rank's samples, shape (n,) [mm].
        pressure: Their pressures [MPa].
        stiffness: Their stiffnesses [MPa/mm].
    """

    closure: Array
    pressure: Array
    stiffness: Array

    def at(self, closure: Array) -> Array:
        """Return the pressures on the lines, shape (n,) [MPa]."""
        return self.pressure + self.stiffness * (closure - self.closure)


def law_lines(
    forces: PressedPlane, closure: Array, pressure: Array, stiffness: float | Array
) -> Lines:
    """Linearise the laws where samples reach their curves along the body's stiffness.

    Args:
        forces: The laws.
        closure: Predicted closures c of this rank's samples, shape (n,) [mm].
        pressure: Predicted pressures p [MPa].
        stiffness: k, one for all or one for each [MPa/mm].

    Note:
        Collective.
    """

    def excess(at: Array) -> Array:
        return forces.pressure(at) - pressure + stiffness * (at - closure)

    comm, beyond = forces.comm, excess(closure)
    aim = -np.sign(beyond)
    near, far = closure.copy(), closure.copy()
    step = _FIRST * comm.allreduce(float(np.abs(closure).max(initial=0.0)), op=MPI.MAX)
    for _ in range(_DOUBLINGS):
        short = aim * excess(far) < 0.0
        if not comm.allreduce(bool(short.any()), op=MPI.LOR):
            break
        near[short] = far[short]
        far[short] += step * aim[short]
        step *= 2.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (near + far)
        short = aim * excess(middle) < 0.0
        near, far = np.where(short, middle, near), np.where(short, far, middle)
    at = np.where(aim > 0.0, near, far)  # the lower of both
    return Lines(at, forces.pressure(at), forces.stiffness(at))


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
