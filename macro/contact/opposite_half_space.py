"""An elastic half-space that a body's face is pressed on: its displacements under the whole face.

Pressures at the samples of the face are spread over a grid of squares, whose displacements are
those of uniform pressures on squares (Love). The displacements of the samples are interpolated by
the same weights, so that the compliance is symmetric. With friction shear stresses are spread
likewise (Cerruti), and pressures and shear stresses see each other.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.signal import fftconvolve
from scipy.sparse import csr_matrix

from geometry.materials import Material
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
        material: Elastic constants of the half-space.

    Attributes:
        forces: Forces on the grid at the latest load step, shape (nx, ny) [N].
        sheared: What shear stresses displaced at the latest load step, see `by_shear` [mm].

    Note:
        Construction and every method are collective, and the grid is the same on every rank.
    """

    def __init__(
        self, sampling: Sampling, lengths: tuple[float, float], material: Material
    ) -> None:
        self._sampling, self._material = sampling, material
        self._comm: Any = sampling.operator.comm.tompi4py()
        weights = np.array([len(sampling.weight), sampling.weight.sum()])
        count, area = self._comm.allreduce(weights)
        self._side = _COARSER * float(np.sqrt(area / count))
        x, y = (int(np.ceil(length / self._side)) + 1 for length in lengths)
        self.forces: Array = np.zeros((x, y))
        self.sheared: Array = np.zeros((3, x, y))

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

    def by_shear(self, stress: Array, pressure: Array | None = None) -> Array:
        """Return what shear stresses displace, and pressures sideways.

        The half-space bears the opposite of the stresses on the body. What is returned is what
        takes slip away from the samples, along the axes of the face, and what widens their gaps.

        Args:
            stress: Shear stresses on the body at this rank's samples, shape (n, 2) [MPa].
            pressure: Pressures there, shape (n,); None leaves out what both do to each other [MPa].

        Returns:
            On the grid, along x, along y and into the half-space, shape (3, nx, ny) [mm].

        Source:
            Johnson, Contact Mechanics (1985), eqs. 3.19 and 3.75.
        """
        along = [self.spread(part) for part in stress.T]
        xx, yy, xy, *cross = self._shear_kernels

        def moved(forces: Array, kernel: Array) -> Array:
            return np.asarray(fftconvolve(forces, kernel, mode="valid"))

        total = np.zeros_like(self.sheared)
        total[0] = moved(along[0], xx) + moved(along[1], xy)
        total[1] = moved(along[0], xy) + moved(along[1], yy)
        if pressure is not None:
            forces = self.spread(pressure)
            for axis, kernel in enumerate(cross):
                total[axis] += moved(forces, kernel)
                total[2] -= moved(along[axis], kernel)
        return total

    def shear(self, remaining: Callable[[Array], Array], what: str) -> None:
        """Find what shear stresses displace where nothing remains, from that at the last load step.

        Args:
            remaining: What displacements differ by from those that they lead to.
            what: What is looked for, for an error.

        Raises:
            NotConverged: When that many iterations do not find it.
        """
        _, found = _accelerated(self._kept(remaining), self.sheared, _TOLERANCE)
        if not found:
            raise _failed(what)

    def moved_along(self, stresses: Callable[[Array], Array]) -> Array:
        """Return the displacements along the face that shear stresses make which depend on them.

        Args:
            stresses: Returns shear stresses of samples that so far give way, (n, 2) [mm] to [MPa].

        Returns:
            At this rank's samples, shape (n, 2) [mm].

        Raises:
            NotConverged: When they are not found.
        """

        def at_samples(moved: Array) -> Array:
            return np.stack([self.at_samples(part) for part in moved[:2]], axis=1)

        def remaining(moved: Array) -> Array:
            return self.by_shear(stresses(at_samples(moved))) - moved

        moved, found = _accelerated(remaining, np.zeros_like(self.sheared), _TOLERANCE)
        if not found:
            raise _failed("the tangential stiffness beside the half-space on the other side")
        return at_samples(moved)

    def _kept(self, remaining: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Return a function that keeps the displacements it was evaluated at last."""

        def evaluated(x: Array) -> Array:
            self.sheared = x
            return remaining(x)

        return evaluated

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
            if not np.isfinite(left):
                break
            if left <= _TOLERANCE * largest:
                self.forces = forces
                return
            on_held, last = on_held and left < _GAINED * last, left
            if on_held:
                try:
                    settled = self._settled(forces, contact, _INNER * _GAINED * min(left, largest))
                except NotConverged:  # the plane, on closures that are out of all proportion
                    settled = None
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
        half = np.concatenate([quarter[:0:-1], quarter])  # alike on both sides to the last digit
        whole = np.concatenate([half[:, :0:-1], half], axis=1)
        return np.asarray(whole * self._material.surface_compliance / (np.pi * self._side))

    @cached_property
    def _shear_kernels(self) -> tuple[Array, ...]:
        """Displacements by unit forces on a square, (2 nx − 1, 2 ny − 1) each [mm/N].

        Along x by forces along x, along y by y, along x by y; and against the pull of pressures,
        along x and y.
        """
        nu = self._material.poisson_ratio
        kappa, beta = nu / (1.0 - nu), (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu))
        along_x, along_y, mixed, pull_x, pull_y = self._over_squares
        xx, yy = self._kernel + kappa * along_x, self._kernel + kappa * along_y
        return xx, yy, kappa * mixed, beta * pull_x, beta * pull_y

    @cached_property
    def _over_squares(self) -> tuple[Array, ...]:
        """Integrals over a square of x²/ρ³, y²/ρ³, x y/ρ³, x/ρ² and y/ρ², times 1/(π E*)."""
        nx, ny = self.forces.shape
        x, y = (np.arange(-n, n) + 0.5 for n in (nx, ny))
        u, v = np.meshgrid(x, y, indexing="ij")
        distance = np.hypot(u, v)
        log = np.log(distance)
        corners = np.stack(
            [
                v * np.arcsinh(u / np.abs(v)),
                u * np.arcsinh(v / np.abs(u)),
                -distance,
                v * log + u * np.arctan(v / u),
                u * log + v * np.arctan(u / v),
            ]
        )
        whole = np.diff(np.diff(corners, axis=1), axis=2)
        return tuple(whole * self._material.surface_compliance / (np.pi * self._side))


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
        if not np.isfinite(residuals[-1]).all():
            break
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
