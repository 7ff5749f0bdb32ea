"""An elastic half-space that a body's face is pressed on: its displacements under the whole face.

Pressures at the samples of the face are spread over a grid of squares, whose displacements are
those of uniform pressures on squares (Love). The displacements of the samples are interpolated by
the same weights, so that the compliance is symmetric.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.signal import fftconvolve
from scipy.sparse import csr_matrix

from macro.contact.sampling import Sampling
from support.arrays import Array
from support.errors import NotConverged

_COARSER = 1.5
"""Side of a square over the root of a sample's area: nearly every square then has a sample."""
_TOLERANCE, _ROUGHLY, _NEARLY = 1e-8, 1e-3, 1e-2
"""Relative difference of displacements in equilibrium, of those that lead there, and of the
preconditioner's."""
_INNER = 0.1
"""Relative error of the body's responses over that of the displacements that are solved for."""
_MOST, _MOST_HELD = 60, 15
"""Iterations at most, and of those on a body that is held."""
_GAINED = 0.1
"""Residual after a step on the held body over that before it, with which another one follows."""

_OVERSHOT, _MOST_CUTS = 0.5, 12
"""Slope of the energy along a step that it may end on, relative to the first one beyond the least
energy, and how often the step is cut for it."""


class Contact(Protocol):
    """The contact of a half-space with a body; every method is collective."""

    def pressed(self, moved: Array, /) -> Array:
        """Return the pressures of the samples in gaps that are wider by so much, (n,) [MPa]."""
        ...

    def held(self, moved: Array, /) -> Array:
        """Return the pressures on the body as it is displaced now, (n,) [MPa]."""
        ...

    def closed_in(self, way: Array, tolerance: float, /) -> Array:
        """Return the change of pressures where samples close in, to first order, (n,) [MPa]."""
        ...

    def alone(self, way: Array, /, softer: float = 0.0) -> Array:
        """Return the same on a rigid body, or on a local compliance instead of it [mm/MPa]."""
        ...


class OppositeHalfSpace:
    """A half-space under the pressures of a face.

    Args:
        sampling: Samples of this rank.
        lengths: Sides of the rectangle around the face, from the origin of its frame [mm].
        compliance: (1 − ν²) / E of the half-space [1/MPa].

    Attributes:
        forces: Forces on the grid at the latest load step, shape (nx, ny) [N].

    Note:
        Construction and every method are collective, and the grid is the same on every rank.
    """

    def __init__(self, sampling: Sampling, lengths: tuple[float, float], compliance: float) -> None:
        self._sampling, self._compliance = sampling, compliance
        self._comm: Any = sampling.operator.comm.tompi4py()
        weights = np.array([len(sampling.weight), sampling.weight.sum()])
        count, area = self._comm.allreduce(weights)
        self._side = _COARSER * float(np.sqrt(area / count))
        x, y = (int(np.ceil(length / self._side)) + 1 for length in lengths)
        self.forces: Array = np.zeros((x, y))

    def spread(self, pressure: Array) -> Array:
        """Return the forces on the grid by pressures of this rank's samples, shape (nx, ny) [N].

        Args:
            pressure: Shape (n,) [MPa].
        """
        forces = self._spread.T @ (self._sampling.weight * pressure)
        return np.asarray(self._comm.allreduce(forces).reshape(self.forces.shape))

    def moved(self, forces: Array) -> Array:
        """Return the displacements of the grid under forces on it, shape (nx, ny) [mm]."""
        return np.asarray(fftconvolve(forces, self._kernel, mode="valid"))

    def under(self, pressure: Array) -> Array:
        """Return the displacements of the grid under pressures of this rank's samples [mm]."""
        return self.moved(self.spread(pressure))

    def at_samples(self, moved: Array) -> Array:
        """Return displacements of the grid at this rank's samples, shape (n,) [mm]."""
        return np.asarray(self._spread @ moved.ravel())

    def follow(self, contact: Contact, what: str) -> None:
        """Bring the half-space into equilibrium with a contact.

        First the half-space settles on the body as it is displaced, which takes no solution of the
        body, again and again while that brings both together; on a stiff body that is nearly all.
        The rest is left to Newton's method. The energy of both is convex in the forces between
        them. A step that goes beyond its least value along the step is taken back to near it.

        Args:
            contact: The contact on the other body.
            what: What is looked for, for an error.

        Raises:
            NotConverged: When that many iterations do not find it.
        """
        forces, on_held, last = self.forces, True, np.inf
        found = self.spread(contact.pressed(self.at_samples(self.moved(forces))))
        for _ in range(_MOST):
            rest = found - forces
            apart, largest = self.moved(rest), np.abs(self.moved(found)).max()
            left = np.abs(apart).max()
            if left <= _TOLERANCE * largest:
                self.forces = forces
                return
            on_held, last = on_held and left < _GAINED * last, left
            if on_held:
                settled = self._settled(forces, contact, _INNER * _GAINED * min(left, largest))
                change = rest if settled is None else settled - forces
                on_held = settled is not None and float(np.vdot(apart, change)) > 0.0
            if not on_held:
                step = self.followed(apart, contact, _ROUGHLY)
                closed_in = contact.closed_in(-self.at_samples(step), _INNER * _ROUGHLY)
                change = rest + self.spread(closed_in)
            forces, found = self._along(forces, rest, change, contact.pressed)
        raise _failed(what)

    def _settled(self, forces: Array, contact: Contact, tolerance: float) -> Array | None:
        """Return the forces of the half-space on the body as it is displaced, by Newton's method.

        None where few iterations do not find them.

        Args:
            forces: The forces to start from.
            contact: The contact.
            tolerance: Difference of displacements that is allowed [mm].
        """
        found = self.spread(contact.held(self.at_samples(self.moved(forces))))
        for _ in range(_MOST_HELD):
            rest = found - forces
            apart = self.moved(rest)
            if np.abs(apart).max() <= tolerance:
                return forces
            step = _accelerated(self._remaining(apart, contact), apart, _NEARLY)[0]
            change = rest + self.spread(contact.alone(-self.at_samples(step)))
            forces, found = self._along(forces, rest, change, contact.held)
        return None

    def _along(
        self, forces: Array, rest: Array, change: Array, pressed: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
        """Return forces after a step, and those that the contact has then.

        Args:
            forces: The forces before it.
            rest: What they are less than those of the contact.
            change: The whole step.
            pressed: Returns the pressures in gaps that are wider by so much.
        """
        moved, before, share = self.moved(change), self.moved(forces), 1.0
        start = float(np.vdot(rest, moved))
        for _ in range(_MOST_CUTS):
            found = self.spread(pressed(self.at_samples(before + share * moved)))
            left = float(np.vdot(found - forces - share * change, moved))
            if not 0.0 < start * _OVERSHOT < -left:
                break
            share *= start / (start - left)
        return forces + share * change, found

    def _remaining(
        self, rest: Array, contact: Contact, softer: float = 0.0
    ) -> Callable[[Array], Array]:
        """Return the residual of (1 + H P') x = r with the response P' without the mesh."""
        return lambda x: rest - x + self.under(contact.alone(-self.at_samples(x), softer))

    def followed(self, rest: Array, contact: Contact, tolerance: float) -> Array:
        """Solve (1 + H P') x = r with the half-space H and the response P' of the contact.

        The same equation without the mesh is the preconditioner, with a local compliance for it
        that is right for r.

        Args:
            rest: r, displacements of the grid [mm].
            contact: The contact on the other body.
            tolerance: Largest error of x that is allowed, relative to its largest value.
        """
        way = self.at_samples(rest)
        own = (
            self._work(way, way),
            self._work(way, contact.closed_in(way, _INNER * _NEARLY)),
            self._work(way, contact.alone(way)),
        )
        if not min(own) > 0.0:
            return rest
        softer = max(own[0] / own[1] - own[0] / own[2], 0.0)

        def nearly(left: Array) -> Array:
            return _accelerated(self._remaining(left, contact, softer), left, _NEARLY)[0]

        def remaining(x: Array) -> Array:
            closed_in = contact.closed_in(-self.at_samples(x), _INNER * tolerance)
            return nearly(rest - x + self.under(closed_in))

        x, found = _accelerated(remaining, nearly(rest), tolerance)
        if not found:
            raise _failed("the response of the half-space on the other side")
        return x

    def _work(self, one: Array, other: Array) -> float:
        """Return the integral of a product over the face."""
        return float(self._comm.allreduce(float(self._sampling.weight @ (one * other))))

    @cached_property
    def _spread(self) -> csr_matrix:
        """Bilinear weights of the grid's points at the samples, shape (n, nx ny)."""
        (nx, ny), sampling = self.forces.shape, self._sampling
        place = np.stack([sampling.x, sampling.y]) / self._side
        first = np.clip(np.floor(place), 0.0, [[nx - 2.0], [ny - 2.0]])
        x, y = place - first
        weights = np.stack([(1 - x) * (1 - y), (1 - x) * y, x * (1 - y), x * y], axis=1)
        corner = (first[0] * ny + first[1]).astype(np.intp)
        columns = corner[:, None] + np.array([0, 1, ny, ny + 1])
        starts = np.arange(len(corner) + 1) * 4
        return csr_matrix((weights.ravel(), columns.ravel(), starts), shape=(len(corner), nx * ny))

    @cached_property
    def _kernel(self) -> Array:
        """Displacements by a unit force on a square, (2 nx − 1, 2 ny − 1) [mm/N].

        Source:
            Love, Phil. Trans. R. Soc. A 228 (1929), 377; Johnson, Contact Mechanics (1985), eq.
            3.25.
        """
        nx, ny = self.forces.shape
        x, y = (np.arange(n + 1.0) - 0.5 for n in (nx, ny))
        u, v = np.meshgrid(x, y, indexing="ij")
        corners = u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v))
        quarter = np.diff(np.diff(corners, axis=0), axis=1)
        half = np.concatenate([quarter[:0:-1], quarter])
        whole = np.concatenate([half[:, :0:-1], half], axis=1)
        return np.asarray(whole * self._compliance / (np.pi * self._side))


def _accelerated(
    remaining: Callable[[Array], Array], x: Array, tolerance: float
) -> tuple[Array, bool]:
    """Find x where nothing remains, by Anderson's acceleration; tell whether it was found.

    Args:
        remaining: A residual that is nearly the error of −x.
        x: The first x.
        tolerance: Largest residual, relative to the largest value of x.

    Source:
        Walker and Ni, SIAM J. Numer. Anal. 49 (2011), 1715, doi 10.1137/10078356X; of a linear
        equation it is GMRES.
    """
    points, residuals = list[Array](), list[Array]()
    for _ in range(_MOST):
        points.append(x)
        residuals.append(remaining(x))
        if np.abs(residuals[-1]).max() <= tolerance * np.abs(x).max():
            return x + residuals[-1], True
        x = x + residuals[-1]
        if len(points) > 1:
            steps, changes = (
                np.diff(np.array(one).reshape(len(one), -1), axis=0).T
                for one in (points, residuals)
            )
            share = np.linalg.lstsq(changes, residuals[-1].ravel(), rcond=None)[0]
            x = x - ((steps + changes) @ share).reshape(x.shape)
    return x, False


def _failed(what: str) -> NotConverged:
    remedy = "take smaller load steps (load.steps), or give the counter-body a mesh"
    return NotConverged(what, reason="DIVERGED_MAX_IT", iterations=_MOST, remedy=remedy)
