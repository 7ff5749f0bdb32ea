"""How far Hertz contacts press each other's summits down, pair by pair.

The unknowns are the indentations t_i = κ_i K_i s_i, the part of a summit's displacement that its
own contact causes; they are linear in s_i = a_i². Contact i displaces summit k by U_ki(t_i), a
convex, increasing function that starts as t^(3/2). Its slope is c_ki = RF(1+v, β+v, v)/K(e_i).

Merging. The slope c_ki grows to 1 when the contact i reaches summit k (a_i ≥ r_ik). Two equal
merged asperities would then be one unknown too many: the system would be singular and the solution
would jump. So the kernel is exact only up to c* = 2^(2/3) − 1 ≈ 0.587, for circles up to
a_i = 0.797 r_ik. Beyond, it is continued with the constant slope c*, once continuously
differentiable. With this c* two coincident equal asperities carry together exactly the force of
one, as they should: t (1 + c*) = d and 2 t^(3/2) = d^(3/2). More than two at one place carry too
little: n equal ones n (1 + (n − 1) c*)^(−3/2) of one, 0.94 for 3 and 0.82 for 5. Pairs beyond c*
count as overlapping contacts, so that a result can be judged.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprf

from geometry import Asperities
from micro.closed_forms.ellipse import ShapeFactors
from micro.closed_forms.hertz_field import circular_field, elliptic_field
from micro.interaction.body_points import BodyPoints
from micro.interaction.contact_problem import InteractionDisplacement

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MERGING_SLOPE = 2.0 ** (2.0 / 3.0) - 1.0
"""Largest relative stiffness c* of one contact at another's summit."""

SINE_MERGED = float(np.sin(0.5 * np.pi * MERGING_SLOPE))
"""a/r of a circular contact whose slope at distance r is c*."""

_ARRAYS = ("x", "y", "angle", "beta", "integral", "size", "v_merged")
_NEWTON_STEPS = 30

_PAIRS_AT_ONCE = 2**16
"""Pairs whose fields are evaluated at once. 2,000 elliptic contacts took 141 ms of one core in such
blocks and 283 ms in one piece, whose arrays leave the cache."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HertzPairs:
    """Asperities that displace each other's summits; all arrays have the shape (n,).

    Args:
        x: Abscissae of the summits [mm].
        y: Ordinates [mm].
        angle: Directions of the major semi-axes from the x axis [rad]; unused for circles.
        beta: b²/a².
        integral: K(e).
        size: s_i/t_i = R (2 K F1/π)² [mm].
        v_merged: Confocal parameter v* at which the slope is c*.
        circular: Whether all contacts are circles, which have a kernel in closed form.
        half_space: Whether contacts displace each other's summits through the half-space.
        body: What a finite body adds to the displacements of all summits, the loaded one
            included; None leaves the half-space alone.
    """

    x: Array
    y: Array
    angle: Array
    beta: Array
    integral: Array
    size: Array
    v_merged: Array
    circular: bool
    half_space: bool = True
    body: BodyPoints | None = None

    @classmethod
    def among(
        cls,
        asperities: Asperities,
        shape: ShapeFactors,
        *,
        circular: bool,
        half_space: bool = True,
        body: BodyPoints | None = None,
    ) -> Self:
        """Collect what the interaction needs of asperities.

        Args:
            asperities: The n asperities.
            shape: Their shape factors, arrays of shape (n,).
            circular: Whether the shape factors are those of circles.
            half_space: Whether contacts displace each other's summits through the half-space.
            body: What a finite body adds, at the summits.
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
            half_space=half_space,
            body=body,
        )

    def subset(self, index: Indices) -> Self:
        """Return the interaction among some of the asperities."""
        body = None if self.body is None else self.body.among(index)
        arrays = {name: getattr(self, name)[index] for name in _ARRAYS}
        return replace(self, **arrays, body=body)

    def scaled_force(self, indentation: Array) -> Array:
        """Return P/(π E*) of indentations t ≥ 0 of all contacts, shape (n,) [mm²].

        P/(π E*) = 2/3 s^(3/2)/(s/t · K).
        """
        s = self.size * indentation
        return np.asarray(2.0 / 3.0 * s**1.5 / (self.size * self.integral))

    def evaluate(self, indentation: Array) -> InteractionDisplacement:
        """Return the displacement of every summit by the other contacts, with its slopes.

        A finite body adds the displacement by a contact's own force, too.

        Args:
            indentation: Indentations t, shape (n,) [mm]; only positive ones act.
        """
        active, count = np.flatnonzero(indentation > 0.0), len(indentation)
        displacement, slope = np.zeros(count), np.zeros((count, len(active)))
        overlapping = 0
        if self.half_space:
            for rows in self._blocks(len(active)):
                displacement[rows], slope[rows] = self._by_contacts(rows, active, indentation)
                merged = slope[rows] >= MERGING_SLOPE * (1.0 - 1e-12)
                overlapping += int(np.count_nonzero(merged))
        if self.body is not None:
            force = self.scaled_force(np.maximum(indentation, 0.0))[active]
            between = self.body.by(self.body.among(active))
            displacement += between @ force
            between *= 1.5 * force / indentation[active]
            slope += between
        return InteractionDisplacement(active, displacement, slope, overlapping)

    def displacement(self, indentation: Array) -> Array:
        """Return the displacements that `evaluate` returns, without the memory for their slopes.

        Args:
            indentation: Indentations t ≥ 0, shape (n,) [mm].
        """
        active, found = np.flatnonzero(indentation > 0.0), np.zeros(len(indentation))
        if self.half_space:
            for rows in self._blocks(len(active)):
                found[rows] = self._by_contacts(rows, active, indentation)[0]
        if self.body is not None:
            found += self.body.displacement(self.scaled_force(indentation))
        return found

    def _blocks(self, columns: int) -> list[slice]:
        """Return slices of the displaced summits, so that the fields of a block fit the cache."""
        rows = max(1, _PAIRS_AT_ONCE // max(columns, 1))
        return [slice(first, first + rows) for first in range(0, len(self.x), rows)]

    def _by_contacts(self, rows: slice, active: Indices, own: Array) -> tuple[Array, Array]:
        """Return displacements of some summits by the others' contacts, and slopes c_ki."""
        x, y = self.x[rows, None] - self.x[active], self.y[rows, None] - self.y[active]
        size, integral = self.size[active], self.integral[active]
        s = size * own[active]
        if self.circular:
            field, slope = circular_field(x**2 + y**2, s, SINE_MERGED)
        else:
            cos, sin = np.cos(self.angle[active]), np.sin(self.angle[active])
            along, across = cos * x + sin * y, cos * y - sin * x
            field, slope = elliptic_field(
                along**2, across**2, s, self.beta[active], self.v_merged[active]
            )
        slope /= integral
        itself = np.arange(len(self.x))[rows, None] == active
        field[itself] = slope[itself] = 0.0
        return field @ (1.0 / (size * integral)), slope


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
