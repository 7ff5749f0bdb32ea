"""How far Hertz contacts press each other's summits down, through the half-space and a finite body.

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

A finite body adds smooth displacements, in modes. Contacts are small against the waves of these.
So forces act and displacements are taken at the centres of the contacts, and a contact's own force
counts as well.

Theory: docs/theory.md, section 9, eq. 6.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy

from patchlaw.micro.asperities.hertz_pairs import InteractionDisplacement
from patchlaw.micro.asperities.patch_sums import EllipticContacts
from patchlaw.micro.boundary_elements.body_modes import BodyPoints
from patchlaw.micro.closed_forms.hertz import ShapeFactors, circular_field, elliptic_field
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.parallel import blocks

MERGING_SLOPE = 2.0 ** (2.0 / 3.0) - 1.0
"""Largest relative stiffness c* of one contact at another's summit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HertzPairs:
    """Asperities that displace each other's summits.

    Args:
        x: Abscissae of the n summits, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (n,) [rad].
        radius: Equivalent radii R, shape (n,) [mm].
        shape: Shape factors of the contacts, arrays of shape (n,).
        circular: Whether the shape factors are those of circles, which have a kernel in closed
            form.
        half_space: Whether contacts displace each other's summits through the half-space.
        body: What a finite body adds to the displacements of all summits, the loaded one
            included; None leaves the half-space alone.
        contact_modulus: E* [MPa], by which the forces on a body grow.
    """

    x: Array
    y: Array
    angle: Array
    radius: Array
    shape: ShapeFactors
    circular: bool
    half_space: bool = True
    body: BodyPoints | None = None
    contact_modulus: float = 1.0

    @cached_property
    def size(self) -> Array:
        """The ratios s_i/t_i = R (2 K F1/π)², shape (n,) [mm]."""
        return self.radius * self.shape.axis**2

    @cached_property
    def v_merged(self) -> Array:
        """Confocal parameters v* at which the slope is c*, shape (n,)."""
        return merging_parameter(self.shape.axis_ratio_squared, self.shape.integral)

    @property
    def interact(self) -> bool:
        """Whether contacts displace each other's summits, through the half-space or a body."""
        return self.half_space or self.body is not None

    def ellipses(self, indentation: Array) -> EllipticContacts:
        """Return the n contacts with given indentations t ≥ 0, shape (n,) [mm]."""
        major = np.sqrt(self.size * indentation)
        return EllipticContacts(
            x=self.x,
            y=self.y,
            angle=self.angle,
            semi_axes=np.stack([major, major * self.shape.axis_ratio], axis=1),
            force=self.force(indentation),
        )

    def subset(self, index: Indices) -> Self:
        """Return the interaction among some of the asperities."""
        return replace(
            self,
            x=self.x[index],
            y=self.y[index],
            angle=self.angle[index],
            radius=self.radius[index],
            shape=ShapeFactors(*(factor[index] for factor in self.shape)),
            body=None if self.body is None else self.body.among(index),
        )

    def force(self, indentation: Array) -> Array:
        """Return the forces of indentations t ≥ 0, P = 2/3 π E* s^(3/2)/(s/t · K), (n,) [N]."""
        s = self.size * indentation
        unit = 2.0 / 3.0 * np.pi * self.contact_modulus
        return np.asarray(unit * s**1.5 / (self.size * self.shape.integral))

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
            # fields of a block fit the cache: 2,000 elliptic contacts took 141 ms of one core in
            # such blocks and 283 ms in one piece
            for rows in blocks(count, 2**16 // max(len(active), 1)):
                displacement[rows], slope[rows] = self._by_contacts(rows, active, indentation)
                merged = slope[rows] >= MERGING_SLOPE * (1.0 - 1e-12)
                overlapping += int(np.count_nonzero(merged))
        if self.body is not None:
            force = self.force(np.maximum(indentation, 0.0))[active]
            between = self.body.by(self.body.among(active))
            displacement += between @ force
            between *= 1.5 * force / indentation[active]
            slope += between
        return InteractionDisplacement(active, displacement, slope, overlapping)

    def _by_contacts(self, rows: slice, active: Indices, own: Array) -> tuple[Array, Array]:
        """Return displacements of some summits by the others' contacts, and slopes c_ki."""
        x, y = self.x[rows, None] - self.x[active], self.y[rows, None] - self.y[active]
        size, integral = self.size[active], self.shape.integral[active]
        s = size * own[active]
        if self.circular:
            merged = float(np.sin(0.5 * np.pi * MERGING_SLOPE))  # a/r where the slope is c*
            field, slope = circular_field(x**2 + y**2, s, merged)
        else:
            cos, sin = np.cos(self.angle[active]), np.sin(self.angle[active])
            along, across = cos * x + sin * y, cos * y - sin * x
            beta, least = self.shape.axis_ratio_squared[active], self.v_merged[active]
            field, slope = elliptic_field(along**2, across**2, s, beta, least)
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
    for _ in range(30):
        excess = scipy.special.elliprf(1.0 + v, beta + v, v) - MERGING_SLOPE * integral
        step = 2.0 * excess * np.sqrt((1.0 + v) * (beta + v) / v)
        v = v * np.exp(np.clip(step, -2.0, 2.0))
        if np.all(np.abs(step) < 1e-14):
            break
    return v
