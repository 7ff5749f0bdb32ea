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
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from patchlaw.geometry.materials import Material
from patchlaw.macro.contact.sampling import Sampling
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotConverged

_COARSER = 1.5
"""Side of a square over the root of a sample's area: nearly every square then has a sample."""
_TOLERANCE = 1e-9
"""Difference of displacements in equilibrium relative to the largest one."""
_ON_HALF_SPACES, _STEP = 1e-9, 1e-4
"""Last step of Newton's method on half-spaces and residual of a step, relative, in energy norms. A
step leaves little more than its residual, so that the forces are far better than the last step."""
_MOST, _MOST_STEPS, _MOST_PRODUCTS = 60, 200, 1000
"""Solutions of the body at most, steps of Newton's method for each, products for each step."""
_OVERSHOT, _MOST_CUTS, _TURN = 0.5, 12, 30
"""Slope of the energy along a step that it may end on, relative to the first one beyond the least
energy; how often the step is cut for it; and steps after which they are left whole, and cut again
after as many. A punch on springs 5·10⁵ times as stiff as the half-space did not end in 200 steps
that were cut, and in 27 whole ones; with a free tilt on springs 10⁵ times as stiff 22 that were cut
were enough, and whole ones went round in circles."""


class Contact(Protocol):
    """The contact of a half-space with a body; every method is collective.

    Displacements of the body are among those that samples are moved by.
    """

    @property
    def directions(self) -> int:
        """3 with friction, 1 without."""
        ...

    def pressures(self, moved: Array, /) -> Array:
        """Return the pressures of the samples in gaps that are wider by so much, (n,) [MPa]."""
        ...

    def changes(self, way: Array, /) -> Array:
        """Return the change of these pressures where samples close in, to first order, (n,)."""
        ...

    def stresses(self, moved: Array, /) -> Array:
        """Return the shear stresses at the latest pressures, (n, 2) [MPa].

        Args:
            moved: What slip is taken away by, shape (n, 2) [mm].
        """
        ...

    def stress_changes(self, way: Array, /) -> Array:
        """Return the change of these stresses where samples slip on, to first order, (n, 2)."""
        ...

    def displacements(self, pressure: Array, stress: Array | None, /) -> Array:
        """Return the displacements of the body at the samples, shape (n, 1 or 3) [mm].

        Into the body, and with shear stresses along the axes of the face.
        """
        ...


class OnFace(NamedTuple):
    """Equilibrium of a half-space and a body.

    Attributes:
        forces: Normal forces on the grid, shape (nx, ny) [N].
        along: Shear forces on the body there, shape (2, nx, ny) [N].
        deviation: What the samples move by beyond half-spaces of both materials under these, each
            direction by itself, shape (n, 1 or 3) [mm].
    """

    forces: Array
    along: Array
    deviation: Array


class OppositeHalfSpace:
    """A half-space under the pressures of a face.

    Args:
        sampling: Samples of this rank.
        lengths: Sides of the rectangle around the face, from the origin of its frame [mm].
        material: Elastic constants of the half-space.
        body: Compliance of the body's surface, (1 − ν²)/E [1/MPa].

    Note:
        Construction and every method are collective, and the grid is the same on every rank.
    """

    def __init__(
        self, sampling: Sampling, lengths: tuple[float, float], material: Material, body: float
    ) -> None:
        self._sampling, self._material = sampling, material
        self._comm: Any = sampling.operator.comm.tompi4py()
        weights = np.array([len(sampling.weight), sampling.weight.sum()])
        count, area = self._comm.allreduce(weights)
        self._side = _COARSER * float(np.sqrt(area / count))
        x, y = (int(np.ceil(length / self._side)) + 1 for length in lengths)
        self._softer = body / material.surface_compliance
        self._shape = (x, y)
        self._latest: OnFace | None = None

    def spread(self, values: Array) -> Array:
        """Return the forces on the grid by stresses of this rank's samples [N].

        Args:
            values: Shape (n,) or (n, k) [MPa].

        Returns:
            Shape (nx, ny) or (k, nx, ny).
        """
        forces = self._spread.T @ (values.T * self._sampling.weight).T
        return np.asarray(self._comm.allreduce(forces.T.reshape(*values.shape[1:], *self._shape)))

    def moved(self, forces: Array) -> Array:
        """Return the displacements of the grid under forces on it, shape (nx, ny) [mm]."""
        return self._convolved(forces, self._transforms[0])

    def moved_along(self, along: Array) -> Array:
        """Return what shear forces on the body take away of slip, shapes (2, nx, ny) [N] to [mm].

        The half-space bears their opposite.
        """
        xx, yy, xy = self._transforms[1:4]
        return self._convolved(along, np.array([[xx, xy], [xy, yy]]))

    def across(self, forces: Array, along: Array) -> Array:
        """Return what pressures and shear stresses do to each other, shape (3, nx, ny) [mm].

        Args:
            forces: Normal forces on the grid, shape (nx, ny) [N].
            along: Shear forces on the body, shape (2, nx, ny) [N].

        Returns:
            What shear forces widen gaps by; what pressures take away of slip along x and y.

        Source:
            Johnson, Contact Mechanics (1985), eqs. 3.19 and 3.75.
        """
        pulls = self._transforms[4:]
        wider = -self._convolved(along, pulls[None])
        return np.concatenate([wider, self._convolved(forces[None], pulls[:, None])])

    def _convolved(self, forces: Array, transforms: NDArray[np.complex128]) -> Array:
        """Return displacements by forces, of k directions where there are (l, k) kernels.

        Args:
            forces: Shape (nx, ny) or (k, nx, ny).
            transforms: Transforms of kernels, one for each pair of directions.
        """
        by_wave = transforms * scipy.fft.rfft2(forces, self._periods)
        if forces.ndim > 2:
            by_wave = by_wave.sum(axis=1)
        (nx, ny), moved = self._shape, scipy.fft.irfft2(by_wave, self._periods)
        return np.asarray(moved[..., nx - 1 : 2 * nx - 1, ny - 1 : 2 * ny - 1])

    def at_samples(self, moved: Array) -> Array:
        """Return displacements of the grid at this rank's samples [mm].

        Args:
            moved: Shape (nx, ny) or (k, nx, ny).

        Returns:
            Shape (n,) or (n, k).
        """
        columns = moved.reshape(-1, self._shape[0] * self._shape[1]).T
        return np.asarray(self._spread @ columns).reshape(-1, *moved.shape[:-2])

    def follow(self, contact: Contact, what: str) -> OnFace:
        """Bring the half-space into equilibrium with a contact, from the latest load step on.

        Args:
            contact: The contact on the other body.
            what: What is looked for, for an error.

        Raises:
            NotConverged: When that many iterations do not find it; the latest load step stays.
        """
        self._latest = self.equilibrium(contact, what, self._latest)
        return self._latest

    def equilibrium(self, contact: Contact, what: str, first: OnFace | None = None) -> OnFace:
        """Return the equilibrium of the half-space with a contact.

        The body is taken for a half-space, on which Newton's method finds pressures and stresses
        without a solution of the body. What the body deviates by is smooth but for the borders of
        the face. It is found by Anderson's acceleration, with one solution of the body under known
        pressures an iteration, about as many whatever the moduli: the flexibility 1/D + H + H′,
        with laws D and half-spaces H and H′ of both materials, preconditions 1/D + H + C with the
        body C.

        Args:
            contact: The contact on the other body.
            what: What is looked for, for an error.
            first: A first guess.

        Raises:
            NotConverged: When that many iterations do not find it.
        """
        if first is None:
            nothing = np.zeros((len(self._sampling.weight), contact.directions))
            first = OnFace(np.zeros(self._shape), np.zeros((2, *self._shape)), nothing)
        forces, along, _ = first
        largest = np.zeros(1)

        def remaining(deviation: Array) -> Array:
            nonlocal forces, along
            forces = self._on_half_spaces(
                lambda moved: contact.pressures(deviation[:, 0] + moved),
                contact.changes,
                self.moved,
                forces,
                what,
            )
            moved = self.moved(forces)[None]
            pressure = contact.pressures(deviation[:, 0] + self._on_both(moved[0]))
            if contact.directions == 1:
                beyond = contact.displacements(pressure, None)
            else:
                along = self._on_half_spaces(
                    lambda moved: contact.stresses(deviation[:, 1:] + moved),
                    contact.stress_changes,
                    self.moved_along,
                    along,
                    what,
                )
                moved = np.concatenate([moved, self.moved_along(along)])
                stress = contact.stresses(deviation[:, 1:] + self._on_both(moved[1:]))
                beyond = contact.displacements(pressure, stress)
                beyond = beyond + self.at_samples(self.across(forces, along))
            largest[0] = np.abs(deviation + self._on_both(moved)).max(initial=0.0)
            return beyond - self._softer * self.at_samples(moved) - deviation

        deviation, found = _accelerated(remaining, first.deviation, largest, self._comm)
        if not found:
            raise _failed(what, _MOST)
        return OnFace(forces, along, deviation)

    def at_both(self, along: Array) -> Array:
        """Return what shear forces take away of slip where the body is a half-space too, (n, 2)."""
        return self._on_both(self.moved_along(along))

    def _on_both(self, moved: Array) -> Array:
        """Return the displacements of samples where the body is a half-space as well [mm]."""
        return (1.0 + self._softer) * self.at_samples(moved)

    def _on_half_spaces(
        self,
        stresses: Callable[[Array], Array],
        changes: Callable[[Array], Array],
        moved: Callable[[Array], Array],
        forces: Array,
        what: str,
    ) -> Array:
        """Return the forces on the grid where the body is a half-space, by Newton's method.

        Their energy is convex. A step that goes beyond its least value is taken back to near it.
        Where such steps end again and again as a sample leaves contact, whole ones find which
        samples are in contact, as an active set does. Between sticking and sliding they go round in
        circles: springs 10⁴ times as stiff as the half-space did not end in 200 steps.

        Args:
            stresses: Returns the stresses of samples that half-spaces move by so much.
            changes: Returns their changes to first order where samples move the other way.
            moved: The compliance of the half-space.
            forces: The forces to start from.
            what: What is looked for, for an error.

        Raises:
            NotConverged: When steps do not find it, or products do not find a step.
        """

        def found_at(forces: Array) -> Array:
            return self.spread(stresses(self._on_both(moved(forces))))

        found = found_at(forces)
        for number in range(_MOST_STEPS):
            if not np.isfinite(found).all():
                break
            rest = found - forces
            change, share = self._newton_step(changes, moved, rest, what), 1.0
            by_change = moved(change)
            start = float(np.vdot(rest, by_change))
            cuts = _MOST_CUTS if forces.ndim == 3 or number // _TURN % 2 == 0 else 0
            while True:
                found = found_at(forces + share * change)
                left = float(np.vdot(found - forces - share * change, by_change))
                if cuts == 0 or not 0.0 < start * _OVERSHOT < -left:
                    break
                share, cuts = share * start / (start - left), cuts - 1
            forces = forces + share * change
            size = share**2 * float(np.vdot(change, by_change))
            if size <= _ON_HALF_SPACES**2 * float(np.vdot(forces, moved(forces))):
                return forces
        raise _failed(what, _MOST_STEPS)

    def _newton_step(
        self,
        changes: Callable[[Array], Array],
        moved: Callable[[Array], Array],
        rest: Array,
        what: str,
    ) -> Array:
        """Solve (1 + S H) f = r with the stiffness S of the contact and the half-spaces H.

        Conjugate gradients in the inner product of H, in which the operator is symmetric: forces
        need no inverse of laws, which have none where there is no contact.

        Args:
            changes: S, see `_on_half_spaces`.
            moved: The compliance of the half-space.
            rest: r, on the grid [N].
            what: What is looked for, for an error.

        Raises:
            NotConverged: When that many products do not find it.
        """
        forces, way, by_way = np.zeros_like(rest), rest, moved(rest)
        square = first = float(np.vdot(rest, by_way))
        for _ in range(_MOST_PRODUCTS):
            if not square > _STEP**2 * first:
                return forces
            product = way + self.spread(changes(self._on_both(by_way)))
            share = square / float(np.vdot(by_way, product))
            forces, rest = forces + share * way, rest - share * product
            by_rest, last = moved(rest), square
            square = float(np.vdot(rest, by_rest))
            way, by_way = rest + square / last * way, by_rest + square / last * by_way
        raise _failed(what, _MOST_PRODUCTS, "DIVERGED_LINEAR_SOLVE (DIVERGED_MAX_IT)")

    @cached_property
    def _spread(self) -> csr_matrix:
        """Bilinear weights of the grid's points at the samples, shape (n, nx ny)."""
        (nx, ny), sampling = self._shape, self._sampling
        place = np.stack([sampling.x, sampling.y]) / self._side
        first = np.clip(np.floor(place), 0.0, [[nx - 2.0], [ny - 2.0]])
        x, y = place - first
        weights = np.stack([(1 - x) * (1 - y), (1 - x) * y, x * (1 - y), x * y], axis=1)
        corner = (first[0] * ny + first[1]).astype(np.intp)
        columns = corner[:, None] + np.array([0, 1, ny, ny + 1])
        starts = np.arange(len(corner) + 1) * 4
        return csr_matrix((weights.ravel(), columns.ravel(), starts), shape=(len(corner), nx * ny))

    @property
    def _periods(self) -> tuple[int, int]:
        nx, ny = (scipy.fft.next_fast_len(2 * n - 1, real=True) for n in self._shape)
        return nx, ny

    @cached_property
    def _transforms(self) -> NDArray[np.complex128]:
        """Transforms of the kernel of normal forces and of those of `_shear_kernels`."""
        kernels = np.stack([self._kernel, *self._shear_kernels])
        return np.asarray(scipy.fft.rfft2(kernels, self._periods))

    @cached_property
    def _kernel(self) -> Array:
        """Displacements by a unit force on a square, (2 nx − 1, 2 ny − 1) [mm/N].

        Source:
            Love, Phil. Trans. R. Soc. A 228 (1929), 377; Johnson, Contact Mechanics (1985), eq.
            3.25.
        """
        nx, ny = self._shape
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
        nx, ny = self._shape
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
    remaining: Callable[[Array], Array], x: Array, largest: Array, comm: Any
) -> tuple[Array, bool]:
    """Find x where nothing remains, by Anderson's acceleration; tell whether it was found.

    Args:
        remaining: A residual that is nearly the error of −x, on this rank's part of x.
        x: The first x.
        largest: What the residual is compared with on this rank, which it writes, shape (1,).
        comm: The ranks.

    Source:
        Walker and Ni, SIAM J. Numer. Anal. 49 (2011), 1715, doi 10.1137/10078356X; of a linear
        equation it is GMRES.
    """
    points, residuals, of_all = list[Array](), list[Array](), list[Array]()
    for _ in range(_MOST):
        points.append(x)
        residuals.append(remaining(x))
        every = comm.allgather((residuals[-1].ravel(), largest[0]))
        of_all.append(np.concatenate([left for left, _ in every]))
        if not np.isfinite(of_all[-1]).all():
            break
        if np.abs(of_all[-1]).max() <= _TOLERANCE * max(size for _, size in every):
            return x, True
        x = x + residuals[-1]
        if len(points) > 1:
            share = np.linalg.lstsq(np.diff(of_all, axis=0).T, of_all[-1], rcond=None)[0]
            steps = np.diff(points, axis=0) + np.diff(residuals, axis=0)
            x = x - np.tensordot(share, steps, axes=1)
    return x, False


def _failed(what: str, iterations: int, reason: str = "DIVERGED_MAX_IT") -> NotConverged:
    remedy = "take smaller load steps (load.steps), or give the counter-body a mesh"
    return NotConverged(what, reason=reason, iterations=iterations, remedy=remedy)
