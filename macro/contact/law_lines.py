"""Laws as lines: where Newton's method far from the solution linearises them.

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

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from macro.contact.contact_forces import ContactForces

Array = NDArray[np.float64]

_FIRST = 1e-3
"""First step from a closure towards a law's curve, relative to the largest closure."""
_DOUBLINGS, _BISECTIONS = 30, 16


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
    forces: ContactForces, closure: Array, pressure: Array, stiffness: float | Array
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
