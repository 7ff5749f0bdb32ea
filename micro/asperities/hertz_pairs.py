"""How far Hertz contacts press each other's summits down, and what they do to patches.

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

The contact problem. A contact with the indentation t_k moves its own summit by t_k. Contact i moves
every other summit k by U_ki(t_i), the interaction displacement. The total displacement is w_k = t_k
+ Σ_i U_ki(t_i). If the plane lies d_k below the undisplaced summit k, its interference, the contact
conditions are

    w_k ≥ d_k,    t_k ≥ 0,    t_k (w_k − d_k) = 0:

it penetrates no summit, and a summit that is not in contact carries no force.

Newton's method solves the normal map of these conditions. Let z = d − U(z⁺) with z⁺ = max(z, 0).
A positive z_k is the indentation of a contact; a negative one is an open gap. All the conditions
together are the one equation

    G(z) = z + U(z⁺) − d = 0.

Every U_ki starts with the slope 0 at t_i = 0, so G is continuously differentiable. Its Jacobian
I + ∂U/∂t has columns for the active set {z_i > 0} alone.

Sums over patches. Hertz's pressure is a semi-ellipsoid. A contact within one patch belongs to it
whole. The pressure of one that straddles borders is integrated over every patch: along y in closed
form, over a chord of the ellipse that two borders cut; along x by Gauss' rule in the angle, between
the angles at which the rim crosses borders. The shares are good to 4e-7 and add up to one. What
lies outside of all patches counts for the nearest.

By reciprocity the mean displacement of patch i by a contact is the contact's force times the mean
of L_i over its pressure, divided by π E* A_i, with L_i the Love integral of the patch. That mean
is taken with a cubature for the semi-ellipsoidal pressure: 4 radii by 16 angles, exact to degree 8.
Its points have the symmetries of a square, and follow the ellipse without a jump where it becomes a
circle, whose axes have no direction. L_i is smooth except on the patch's border, where its slope is
logarithmic.

So a contact of radius a that lies across a border of a patch of side s misplaces up to 0.005 a/s of
that patch's displacement between the two sides (a point force 0.17). The mean over all patches is
good to 1e-9 for contacts away from the outer border, and to 0.005 a/s, s now the side of the whole,
for one that reaches across it.

Source:
    Waddad et al. 2016, eqs. 10–11 and 23, doi 10.1016/j.triboint.2015.12.023;
    Robinson, Math. Oper. Res. 17 (1992) 691, doi 10.1287/moor.17.3.691 (normal maps).

Theory: docs/theory.md, sections 8 and 9, eqs. 6.1 and 9.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple, Self

import numpy as np
import scipy

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import gauss_rule
from patchlaw.micro.boundary_elements.body_modes import BodyPoints
from patchlaw.micro.closed_forms import (
    ShapeFactors,
    circular_field,
    corner_integral,
    elliptic_field,
)
from patchlaw.support import Array, Indices, InputError, NotConverged, blocks, process_memory


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EllipticContacts:
    """Hertz contacts of a surface.

    Args:
        x: Abscissae of the centres, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
        semi_axes: Semi-axes (a, b), shape (m, 2) [mm].
        force: Forces, shape (m,) [N].
    """

    x: Array
    y: Array
    angle: Array
    semi_axes: Array
    force: Array

    @property
    def area(self) -> Array:
        """Areas π a b, shape (m,) [mm²]."""
        return np.asarray(np.pi * self.semi_axes.prod(axis=1))

    @property
    def position(self) -> Array:
        """Centres (x, y), shape (m, 2) [mm]."""
        return np.stack([self.x, self.y], axis=1)


class Shares(NamedTuple):
    """Sparse table: contact k has a share of its force and of its area in a patch.

    Attributes:
        contact: Indices of contacts, shape (s,).
        patch: Flat indices of patches, shape (s,).
        force: Shares of the force; those of one contact add up to 1, shape (s,).
        area: Shares of the area, shape (s,).
    """

    contact: Indices
    patch: Indices
    force: Array
    area: Array


def patch_loads(patches: PatchGrid, contacts: EllipticContacts) -> tuple[Array, Array]:
    """Return the forces [N] and the contact areas [mm²] of patches, shape (N,) each.

    Args:
        patches: The N patches.
        contacts: The m contacts.
    """
    parts = shares(patches, contacts)
    force = parts.force * contacts.force[parts.contact]
    area = parts.area * contacts.area[parts.contact]
    sums = [np.bincount(parts.patch, part, patches.count) for part in (force, area)]
    return np.asarray(sums[0], float), np.asarray(sums[1], float)


def shares(patches: PatchGrid, contacts: EllipticContacts) -> Shares:
    """Share contacts among patches.

    Args:
        patches: The N patches.
        contacts: The m contacts.
    """
    position, axes = contacts.position, contacts.semi_axes**2
    cos, sin = np.cos(contacts.angle), np.sin(contacts.angle)
    squares = np.stack([cos, sin], axis=1) ** 2
    # The ellipse is that of the matrix [[X², cross], [cross, Y²]], (X, Y) its half extents.
    extent = np.sqrt(np.stack([(axes * squares).sum(1), (axes * squares[:, ::-1]).sum(1)], axis=1))
    cross = cos * sin * (axes[:, 0] - axes[:, 1])
    ticks = patches.borders_x, patches.borders_y
    first, last = (_intervals(ticks, position + side * extent) for side in (-1.0, 1.0))
    spans = last - first + 1
    count = spans.prod(axis=1)
    contact = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(contact)) - np.repeat(np.cumsum(count) - count, count)
    place = first[contact] + np.stack(np.divmod(number, spans[contact, 1]), axis=1)
    parts = np.ones((2, len(contact)))
    cut = np.flatnonzero(count[contact] > 1)
    for block in blocks(len(cut), 4096):  # pairs of 60 points each: blocks bound the memory
        some = cut[block]
        on = contact[some]
        low, high = (_borders(ticks, place[some] + side) - position[on] for side in (0, 1))
        parts[:, some] = _within(low, high, extent[on], cross[on])
    force, area = (part / np.bincount(contact, part)[contact] for part in parts)
    return Shares(contact, place @ np.array([len(ticks[1]) - 1, 1]), force, area)


def _intervals(ticks: tuple[Array, Array], point: Array) -> Indices:
    """Return the grid places (ix, iy) of the patches that hold points, or are nearest to them."""
    pairs = zip(ticks, point.T, strict=True)
    places = [np.searchsorted(borders[1:-1], along, side="right") for borders, along in pairs]
    return np.stack(places, axis=1)


def _borders(ticks: tuple[Array, Array], place: Indices) -> Array:
    """Return the lower borders of grid places, shape (s, 2); the outer ones lie at infinity."""
    lower = []
    for borders, along in zip(ticks, place.T, strict=True):
        lower.append(np.concatenate([[-np.inf], borders[1:-1], [np.inf]])[along])
    return np.stack(lower, axis=1)


def _within(low: Array, high: Array, extent: Array, cross: Array) -> tuple[Array, Array]:
    """Return the shares of contacts between borders, which are counted from their centres."""
    half_x, half_y = extent.T
    # With x = X sin θ the chord at x has the half length h cos θ.
    start, end = (np.arcsin(np.clip(side[:, 0] / half_x, -1.0, 1.0)) for side in (low, high))
    slope = cross / half_x**2
    chord = np.sqrt(np.maximum(half_y**2 - slope * cross, 0.0))
    theta, weight = _rule(
        start, end, _kinks(slope * half_x, chord, np.stack([low[:, 1], high[:, 1]], axis=1))
    )
    middle = (slope * half_x)[:, None] * np.sin(theta)
    half = np.maximum(chord[:, None] * np.cos(theta), np.finfo(float).tiny)
    lower, upper = (np.clip((side[:, 1, None] - middle) / half, -1.0, 1.0) for side in (low, high))
    # The integral of sqrt(1 − t²) over the chord; the pressure at its middle goes as cos θ.
    segment = 0.5 * (_segment(upper) - _segment(lower))
    force = 1.5 / np.pi * np.sum(weight * np.cos(theta) ** 3 * segment, axis=1)
    area = np.sum(weight * np.cos(theta) ** 2 * (upper - lower), axis=1) / np.pi
    return force, area


def _kinks(shear: Array, chord: Array, borders: Array) -> Array:
    """Return the angles where the ellipse crosses two borders along y, shape (m, 4).

    The ellipse's rim is y = shear sin ψ + chord cos ψ; both its halves share θ = asin(sin ψ).
    """
    height = np.hypot(shear, chord)[:, None]
    turn = np.arctan2(shear, chord)[:, None]
    opening = np.arccos(np.clip(borders / height, -1.0, 1.0))
    rim = np.concatenate([turn - opening, turn + opening], axis=1)
    return np.asarray(np.arcsin(np.sin(rim)))


def _rule(start: Array, end: Array, kinks: Array) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss' rule between successive kinks, shape (m, 5 n)."""
    inner = np.clip(kinks, start[:, None], end[:, None])
    ticks = np.sort(np.concatenate([start[:, None], inner, end[:, None]], axis=1), axis=1)
    half = 0.5 * np.diff(ticks, axis=1)[:, :, None]
    points, weights = gauss_rule(12)
    nodes = 0.5 * (ticks[:, 1:] + ticks[:, :-1])[:, :, None] + half * points
    flat = len(start), nodes.shape[1] * nodes.shape[2]
    return nodes.reshape(flat), (half * weights).reshape(flat)


def _segment(t: Array) -> Array:
    return t * np.sqrt(1.0 - t * t) + np.arcsin(t)


def patch_displacements(
    patches: PatchGrid, contacts: EllipticContacts, contact_modulus: float
) -> Array:
    """Return the mean normal displacement of every patch of a half-space [mm], shape (N,).

    Args:
        patches: The N patches.
        contacts: The m contacts.
        contact_modulus: E* [MPa].
    """
    point, weight = _cubature(contacts)
    load = (contacts.force[:, None] * weight).ravel()
    ticks_x, ticks_y = patches.borders_x, patches.borders_y
    corners = np.zeros((len(ticks_x), len(ticks_y)))
    for some in blocks(len(load), 2**20 // corners.size):  # blocks bound the memory
        to_x, to_y = ticks_x - point[some, 0, None], ticks_y - point[some, 1, None]
        integrals = corner_integral(to_x[:, :, None], to_y[:, None, :])
        corners += np.tensordot(load[some], integrals, axes=1)
    love = np.diff(np.diff(corners, axis=0), axis=1)
    return np.asarray(love.ravel() / (np.pi * contact_modulus * patches.areas))


def _cubature(contacts: EllipticContacts) -> tuple[Array, Array]:
    """Return points, shape (64 m, 2), and the 64 weights of every contact's mean."""
    u, v, weight = _on_unit_disk()
    # the symmetric matrix that turns the unit circle into the ellipse
    cos, sin = np.cos(contacts.angle), np.sin(contacts.angle)
    major, minor = contacts.semi_axes.T
    xx, yy = cos**2 * major + sin**2 * minor, sin**2 * major + cos**2 * minor
    xy = cos * sin * (major - minor)
    x = contacts.x[:, None] + np.outer(xx, u) + np.outer(xy, v)
    y = contacts.y[:, None] + np.outer(xy, u) + np.outer(yy, v)
    return np.stack([x.ravel(), y.ravel()], axis=1), weight


@cache
def _on_unit_disk() -> tuple[Array, Array, Array]:
    """Return abscissae, ordinates and weights of the 64 points of the mean over a unit disk."""
    places, weights = scipy.special.roots_jacobi(4, 0.5, 0.0)  # t = r² weighs as (1 − t)^½
    radius, angles = np.sqrt(0.5 * (1.0 + places))[:, None], 16
    around = 2.0 * np.pi / angles * (np.arange(angles) + 0.5)
    weight = np.repeat(weights / (weights.sum() * angles), angles)
    return (radius * np.cos(around)).ravel(), (radius * np.sin(around)).ravel(), weight


TOLERANCE = 1e-10
"""Largest complementarity error, relative to the largest interference."""

BYTES_PER_PAIR = 48.0
"""Memory for a pair of summits while a problem is solved [B].

With 2,500 asperities, 1,800 of them in contact, 27 B were measured on a half-space and 31 B on a
finite body.
"""

_NEWTON = "Newton's method on the active set"
_MOST_STEPS = 40
"""Newton steps that may be taken; ordinary problems take 4 to 7."""


class InteractionDisplacement(NamedTuple):
    """Displacements of n summits by the m active contacts, except by each contact's own field.

    Attributes:
        active: Indices of the contacts with a positive indentation, shape (m,).
        displacement: Displacements of the summits, shape (n,) [mm].
        derivative: Derivatives of the displacements by the active indentations, shape (n, m).
        overlapping_contacts: Number of ordered pairs (k, i) in which contact i has grown so close
            to summit k that its kernel is continued linearly.
    """

    active: Indices
    displacement: Array
    derivative: Array
    overlapping_contacts: int = 0


Interaction = Callable[[Array], InteractionDisplacement]
"""Returns the displacements by given indentations, shape (n,) [mm]; negative ones count as 0."""


class Solution(NamedTuple):
    """A solved contact problem.

    Attributes:
        indentation: Indentations t ≥ 0, shape (n,) [mm].
        iterations: Linear systems solved on the way.
        residual: Complementarity error relative to the largest interference.
        overlapping_contacts: See `InteractionDisplacement`.
    """

    indentation: Array
    iterations: int
    residual: float
    overlapping_contacts: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SummitProblem:
    """Summits that a rigid plane could touch.

    Args:
        interaction: How the n contacts displace each other's summits.
        interference: Depth d_k of the plane below each undisplaced summit, shape (n,) [mm]; some
            are positive.
    """

    interaction: Interaction
    interference: Array

    @property
    def scale(self) -> float:
        """Largest interference [mm]."""
        return float(self.interference.max())

    def residual(self, indentation: Array, displacement: Array) -> float:
        """Return max |min(t_k, w_k − d_k)| relative to the largest d_k.

        Args:
            indentation: Indentations t, shape (n,) [mm]; negative ones count as 0.
            displacement: The interaction displacements that they cause, shape (n,) [mm].
        """
        own = np.maximum(indentation, 0.0)
        gap = own + displacement - self.interference
        return float(np.abs(np.minimum(own, gap)).max()) / self.scale

    def solution(
        self, indentation: Array, caused: InteractionDisplacement, iterations: int
    ) -> Solution:
        """Return the solution with given indentations.

        Args:
            indentation: The indentations, shape (n,) [mm]; negative ones become 0.
            caused: The interaction displacements that they cause.
            iterations: Linear systems solved on the way.
        """
        own = np.maximum(indentation, 0.0)
        return Solution(
            indentation=own,
            iterations=iterations,
            residual=self.residual(own, caused.displacement),
            overlapping_contacts=caused.overlapping_contacts,
        )


def check_pairs(count: int) -> None:
    """Refuse a number of asperities whose dense matrices do not fit into the memory.

    Args:
        count: Number of asperities that interact.

    Raises:
        InputError: When the matrices need more than the memory of this process.
    """
    needed, available = BYTES_PER_PAIR * count**2, process_memory()
    if needed > available:
        raise InputError(
            f"the interaction of {count} asperities needs {needed / 1e9:.3g} GB of memory"
            f" and {available / 1e9:.3g} GB are there",
            allowed="half-space, circular-independent or elliptic-independent",
            key="micro.model",
        )


def solve(problem: SummitProblem, start: Array) -> Solution:
    """Solve from a start or, where this fails, along a growing interference.

    The interference is then scaled from 0 to 1. The load step is halved after a failure and
    doubled after a success.

    Args:
        problem: The contact problem.
        start: First guess of the indentations, shape (n,) [mm].

    Raises:
        NotConverged: When even small load steps fail.
    """
    try:
        return active_set(problem, start)
    except NotConverged as failure:
        spent = failure.iterations
    load, step, indentation = 0.0, 0.5, np.zeros_like(problem.interference)
    while True:
        trial = min(load + step, 1.0)
        try:
            part = replace(problem, interference=trial * problem.interference)
            solution = active_set(part, indentation)
        except NotConverged as failure:
            spent, step = spent + failure.iterations, 0.5 * step
            if step < 1.0 / 256.0:
                raise NotConverged(
                    f"the contact of {len(indentation)} interacting asperities"
                    f" (largest interference {problem.scale:.4g} mm, reached {load:.1%} of it)",
                    reason=failure.reason,
                    iterations=spent,
                    remedy="lower load.approach, or choose a model without interaction in"
                    " micro.model",
                ) from failure
            continue
        spent += solution.iterations
        if trial == 1.0:
            return solution._replace(iterations=spent)
        load, step, indentation = trial, 2.0 * step, solution.indentation


def active_set(problem: SummitProblem, start: Array) -> Solution:
    """Solve a contact problem by damped Newton steps on its normal map.

    Args:
        problem: The contact problem.
        start: First guess of the indentations, shape (n,) [mm].

    Raises:
        NotConverged: When no step lowers the error, or the iterations are used up.
    """

    def evaluate(z: Array) -> tuple[InteractionDisplacement, Array]:
        caused = problem.interaction(z)
        return caused, z + caused.displacement - problem.interference

    z = start
    caused, error = evaluate(z)
    for iteration in range(_MOST_STEPS):
        if problem.residual(z, caused.displacement) <= TOLERANCE:
            return problem.solution(z, caused, iteration)
        z, caused, error = damped_step(evaluate, z, _newton_step(caused, error), error)
    raise failure(_NEWTON, "MAX_ITERATIONS", _MOST_STEPS)


def _newton_step(caused: InteractionDisplacement, error: Array) -> Array:
    """Solve (I + ∂U/∂t) step = −error; rows outside the active set follow from those in it."""
    active, derivative = caused.active, caused.derivative
    matrix = derivative[active]
    matrix[np.diag_indices(len(active))] += 1.0
    try:
        inside = np.linalg.solve(matrix, -error[active])
    except np.linalg.LinAlgError:
        raise failure(_NEWTON, "SINGULAR_JACOBIAN", 1) from None
    step = -error - derivative @ inside
    step[active] = inside
    return np.asarray(step)


def failure(what: str, reason: str, iterations: int) -> NotConverged:
    """Return the error of an iteration.

    Args:
        what: Which iteration.
        reason: The name of the reason.
        iterations: Iterations spent.
    """
    return NotConverged(what, reason=reason, iterations=iterations, remedy="lower load.approach")


def damped_step(
    evaluate: Callable[[Array], tuple[InteractionDisplacement, Array]],
    point: Array,
    step: Array,
    error: Array,
) -> tuple[Array, InteractionDisplacement, Array]:
    """Return the first of point + step, point + step/2, … whose error is smaller.

    Args:
        evaluate: Takes the indentations; returns the interaction displacements that they cause
            and the error to bring to 0.
        point: Where the step starts, shape (n,).
        step: The full Newton step, shape (n,).
        error: The error at ``point``.

    Returns:
        The new point, its interaction displacements and its error.

    Raises:
        NotConverged: When no step down to 1/1024 lowers the Euclidean norm of the error.
    """
    norm, length = np.linalg.norm(error), 1.0
    while length >= 2.0**-10:
        trial = point + length * step
        caused, left = evaluate(trial)
        if np.linalg.norm(left) <= (1.0 - 1e-4 * length) * norm:
            return trial, caused, left
        length *= 0.5
    raise failure("a damped Newton step", "LINE_SEARCH", 1)


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
