"""How far contacting asperities press their neighbours' summits down, with the slopes.

Unknowns are the own indentations t_i = κ_i K_i s_i: the part of a summit's displacement that its
own contact causes, linear in s_i = a_i². Contact i displaces summit k by U_ki(t_i), a convex,
increasing function that starts as t^(3/2), with slope c_ki = RF(1+v, β+v, v)/K(e_i).

Merging. The slope c_ki grows to 1 when the contact i reaches summit k (a_i ≥ r_ik): two equal
merged asperities would then be one unknown too many, the system singular, the solution would
jump. The kernel is therefore exact only up to c* = 2^(2/3) − 1 ≈ 0.587 (for circles a_i ≤ 0.797
r_ik) and continued with the constant slope c* beyond, once continuously differentiable. With this
c* two coincident equal asperities carry together exactly the force of one, as they should:
t (1 + c*) = d and 2 t^(3/2) = d^(3/2). More than two at one place carry too little: n equal ones
n (1 + (n − 1) c*)^(−3/2) of one, 0.94 for 3 and 0.82 for 5. Pairs beyond c* count as overlapping
contacts, so that a result can be judged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprf

from geometry import Asperities
from micro.closed_forms.ellipse import ShapeFactors
from micro.closed_forms.hertz_field import circular_field, elliptic_field

Array = NDArray[np.float64]

MERGING_SLOPE = 2.0 ** (2.0 / 3.0) - 1.0
"""Largest relative stiffness c* of one contact at another's summit."""

SINE_MERGED = float(np.sin(0.5 * np.pi * MERGING_SLOPE))
"""a/r of a circular contact whose slope at distance r is c*."""

_ARRAYS = ("x", "y", "angle", "beta", "integral", "size", "v_merged")
_NEWTON_STEPS = 30


class Lift(NamedTuple):
    """Displacement of n summits by the contacts of the others.

    Attributes:
        active: Indices of the m asperities with positive indentation, shape (m,).
        displacement: Displacement of every summit by the others, shape (n,) [mm].
        slope: c_ki = dU_ki/dt_i ≤ c*, 0 for k = i, shape (n, m).
        body: What a finite body adds to the slopes, k = i included, shape (n, m); None on a
            half-space.
    """

    active: NDArray[np.intp]
    displacement: Array
    slope: Array
    body: Array | None = None

    @property
    def derivative(self) -> Array:
        """Derivative of the displacements by the indentations of the active, shape (n, m)."""
        return self.slope if self.body is None else self.slope + self.body

    def product(self, change: Array) -> Array:
        """Return the change of the displacements by one of the indentations, shape (n,) [mm]."""
        return np.asarray(self.derivative @ change[self.active])

    @property
    def overlapping_contacts(self) -> int:
        """Number of ordered pairs (k, i) whose slope has reached c*."""
        return int(np.count_nonzero(self.slope >= MERGING_SLOPE * (1.0 - 1e-12)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Interaction:
    """Asperities as they see each other, all arrays of shape (n,).

    Args:
        x: Abscissae of the summits [mm].
        y: Ordinates [mm].
        angle: Directions of the major semi-axes from the x axis [rad]; unused for circles.
        beta: b²/a².
        integral: K(e).
        size: s_i/t_i = R (2 K F1/π)² [mm].
        v_merged: Confocal parameter v* at which the slope is c*.
        circular: Whether all contacts are circles, which have a kernel in closed form.
    """

    x: Array
    y: Array
    angle: Array
    beta: Array
    integral: Array
    size: Array
    v_merged: Array
    circular: bool

    @classmethod
    def among(cls, asperities: Asperities, shape: ShapeFactors, *, circular: bool) -> Self:
        """Collect what the interaction needs of asperities.

        Args:
            asperities: The n asperities.
            shape: Their shape factors, arrays of shape (n,).
            circular: Whether the shape factors are those of circles.
        """
        return cls(
            x=asperities.x,
            y=asperities.y,
            angle=asperities.angle,
            beta=shape.axis_ratio_squared,
            integral=shape.integral,
            size=asperities.radius * shape.axis**2,
            v_merged=merging_parameter(shape.axis_ratio_squared, shape.integral),
            circular=circular,
        )

    def subset(self, index: NDArray[np.intp]) -> Self:
        """Return the interaction among some of the asperities."""
        return replace(self, **{name: getattr(self, name)[index] for name in _ARRAYS})

    def lift(self, indentation: Array) -> Lift:
        """Return the displacement of every summit by the other contacts, and its slopes.

        Args:
            indentation: Own indentations t, shape (n,) [mm]; only positive ones act.
        """
        active = np.flatnonzero(indentation > 0.0)
        field, slope = self._fields(active, self.size[active] * indentation[active])
        own = (active, np.arange(len(active)))
        field[own] = 0.0
        slope /= self.integral[active]
        slope[own] = 0.0
        return Lift(active, field @ (1.0 / (self.size * self.integral)[active]), slope)

    def local(
        self, dx: Array, dy: Array, index: NDArray[np.integer[Any]] | slice
    ) -> tuple[Array, Array]:
        """Return differences of position along and across the axes of contacts [mm].

        Args:
            dx: Differences along x; those to one contact in the last axis [mm].
            dy: Differences along y [mm].
            index: The contacts.
        """
        if self.circular:
            return dx, dy
        cos, sin = np.cos(self.angle[index]), np.sin(self.angle[index])
        return cos * dx + sin * dy, cos * dy - sin * dx

    @cached_property
    def _squared_distances(self) -> tuple[Array, Array]:
        """Squared distances along and across the axes of contact i (column) [mm²]."""
        dx, dy = self.x[:, None] - self.x, self.y[:, None] - self.y
        along, across = self.local(dx, dy, slice(None))
        return along**2, across**2

    def _fields(self, active: NDArray[np.intp], s: Array) -> tuple[Array, Array]:
        x_squared, y_squared = (part[:, active] for part in self._squared_distances)
        if self.circular:
            return circular_field(x_squared + y_squared, s, SINE_MERGED)
        return elliptic_field(x_squared, y_squared, s, self.beta[active], self.v_merged[active])


def merging_parameter(beta: Array, integral: Array) -> Array:
    """Return v* with RF(1+v*, β+v*, v*) = c* K(e), by Newton's method in ln v.

    The left side is nearly linear in ln v for slender ellipses; its derivative is
    −½ sqrt(v / ((1+v)(β+v))). For circles 1 + v* = 1/sin²(π c*/2).

    Args:
        beta: b²/a² of the contacts, shape (n,).
        integral: K(e), shape (n,).
    """
    v = beta**MERGING_SLOPE / np.tan(0.5 * np.pi * MERGING_SLOPE) ** 2
    for _ in range(_NEWTON_STEPS):
        excess = elliprf(1.0 + v, beta + v, v) - MERGING_SLOPE * integral
        step = 2.0 * excess * np.sqrt((1.0 + v) * (beta + v) / v)
        v = v * np.exp(np.clip(step, -2.0, 2.0))
        if np.all(np.abs(step) < 1e-14):
            break
    return v
