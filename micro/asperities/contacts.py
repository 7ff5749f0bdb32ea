"""Hertz contacts of the asperities of a surface, and the plane that rests on them.

A rigid plane that has approached by δ interferes with every summit by d_k = <δ(x_k) − (z_M − z_k)>.
Without interaction each contact makes this displacement alone, w_k = d_k. With interaction the
displacements by all contacts add up to w_k (`micro.asperities.contact_problem`).

Theory: docs/theory.md, sections 8 and 9.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Asperities, Control
from geometry.plane_equilibrium import PlaneResponse
from geometry.rigid_plane import PlaneLevers, RigidPlane
from micro.asperities.contact_problem import (
    BYTES_PER_PAIR,
    ContactProblem,
    Method,
    Solution,
    active_set,
    check_pairs,
    solve,
)
from micro.asperities.hertz_pairs import MERGING_SLOPE, BodyPoints, HertzPairs
from micro.asperities.patch_sums import EllipticContacts
from micro.asperities.plane_on_peaks import Peaks, contact_stiffness
from micro.asperities.truncated_newton import truncated_newton
from micro.closed_forms.hertz import HertzContact
from micro.compliance.body_modes import BodyModes
from support.errors import InputError

Array = NDArray[np.float64]

SOLVERS: Mapping[str, Method] = MappingProxyType(
    {"active-set": active_set, "truncated-newton": truncated_newton}
)
"""Solvers of the models with interaction, by name."""


class ModelKind(NamedTuple):
    """What distinguishes the four models.

    Attributes:
        elliptic: Whether contacts are ellipses; circles of radius sqrt(R' R'') otherwise.
        interacting: Whether contacts displace each other's summits through the half-space.
    """

    elliptic: bool
    interacting: bool


class Equilibrium(NamedTuple):
    """Contacts in equilibrium with a plane.

    Attributes:
        plane: The plane.
        solution: The contacts.
    """

    plane: RigidPlane
    solution: Solution


@dataclass(frozen=True, kw_only=True, eq=False)
class AsperityContacts:
    """The contacts of n asperities.

    The interaction is summed over all pairs of summits above the plane. Time and memory grow with
    the square of their number; more than the memory holds are refused.

    Args:
        asperities: The n summits, with the highest point z_M that the approach counts from.
        contact_modulus: E* [MPa].
        kind: Shape of the contacts, and whether they interact.
        solver: Solver of the models with interaction, a name in `SOLVERS`.
        body: What a finite body with its sides adds to the half-space, between all contacts, also
            those of the models without interaction; a half-space when not given. On thin blocks it
            takes away from the interaction: models without any may then have no solution.
    """

    asperities: Asperities
    contact_modulus: float
    kind: ModelKind
    solver: str
    body: BodyModes | None

    @cached_property
    def hertz(self) -> HertzContact:
        """The contacts at an indentation t of 1 mm.

        Force, area and semi-axes grow as t^(3/2), t and t^(1/2).
        """
        a, elliptic = self.asperities, self.kind.elliptic
        return HertzContact(
            contact_modulus=self.contact_modulus,
            radius_major=a.radius_major if elliptic else a.radius,
            radius_minor=a.radius_minor if elliptic else a.radius,
            indentation=1.0,
        )

    @cached_property
    def pairs(self) -> HertzPairs:
        """How the contacts displace each other's summits."""
        a, body = self.asperities, self.body
        return HertzPairs(
            x=a.x,
            y=a.y,
            angle=a.angle,
            radius=a.radius,
            shape=self.hertz.factors,
            circular=not self.kind.elliptic,
            half_space=self.kind.interacting,
            body=None if body is None else BodyPoints.at(body, a.x, a.y),
            contact_modulus=self.contact_modulus,
        )

    def ellipses(self, indentation: Array) -> EllipticContacts:
        """Return the n contacts with given indentations.

        Args:
            indentation: Indentations t ≥ 0, shape (n,) [mm].
        """
        a, hertz = self.asperities, self.hertz
        semi_axes = np.stack([hertz.semi_major, hertz.semi_minor], axis=1)
        return EllipticContacts(
            x=a.x,
            y=a.y,
            angle=a.angle,
            semi_axes=semi_axes * np.sqrt(indentation)[:, None],
            force=hertz.force * indentation**1.5,
        )

    def solution(self, interference: Array, start: Array) -> Solution:
        """Solve for the summits above the plane.

        These are the undisplaced summits above it, and those that the body raises above it. The
        displacements of all others stay 0.

        Args:
            interference: Depth of the plane below each undisplaced summit, negative for summits
                below the plane, shape (n,) [mm].
            start: First guess of the indentations, shape (n,) [mm].

        Raises:
            InputError: When the interaction of so many summits does not fit into the memory.
            NotConverged: When the contact conditions cannot be met to 1e-10.
        """
        if not self.kind.interacting and self.body is None:
            alone = np.maximum(interference, 0.0)
            return Solution(alone, alone, 0, 0.0, 0)
        above = np.flatnonzero(interference > 0.0)
        own, displacement, spent = np.zeros_like(interference), np.zeros_like(interference), 0
        if above.size == 0:
            return Solution(own, displacement, 0, 0.0, 0)
        size = BYTES_PER_PAIR * (2.0 if self.solver == "truncated-newton" else 1.0)
        while True:
            check_pairs(len(above), size)
            pairs = self.pairs.subset(above)
            problem = ContactProblem(interaction=pairs.evaluate, interference=interference[above])
            found = solve(problem, SOLVERS[self.solver], start[above])
            own[above], displacement[above] = found.indentation, found.displacement
            spent += found.iterations
            if self.pairs.body is None:
                break
            # Through the half-space contacts only press summits down; a body can raise them.
            raised = interference - self.pairs.body.displacement(self.pairs.force(own)) > 0.0
            raised[above] = False
            if not raised.any():
                break
            above, start = np.sort(np.append(above, np.flatnonzero(raised))), own
        return found._replace(indentation=own, displacement=displacement, iterations=spent)

    def stiffness(self, indentation: Array, lever: Array) -> Array:
        """Return nearly the derivative of the loads on a rigid plane by its motions, (k, k).

        The contacts act as point forces here, whatever their distance.

        Args:
            indentation: Indentations of the contacts, shape (n,) [mm].
            lever: Displacements of the summits by unit motions, shape (n, k).
        """
        active = np.flatnonzero(indentation > 0.0)
        rate = 1.5 * self.hertz.force[active] * np.sqrt(indentation[active])
        coupling = np.zeros(2 * (len(active),))
        share = rate / (np.pi * self.contact_modulus)
        if self.kind.interacting:
            x, y = self.asperities.x[active], self.asperities.y[active]
            apart = np.hypot(x[:, None] - x, y[:, None] - y)
            np.fill_diagonal(apart, np.inf)
            coupling += share / np.maximum(apart, share / MERGING_SLOPE)
        if self.pairs.body is not None:
            among = self.pairs.body.among(active)
            coupling += among.by(among) * rate
        return contact_stiffness(lever[active], rate, coupling)

    def tangent(self, indentation: Array) -> Array:
        """Return the derivative of the loads on a rigid plane by its motions, shape (3, 3).

        Args:
            indentation: Indentations of the contacts in equilibrium, shape (n,) [mm].
        """
        active = np.flatnonzero(indentation > 0.0)
        lever = self._peaks.lever[active]
        rate = 1.5 * self.hertz.force[active] * np.sqrt(indentation[active])
        if not self.kind.interacting and self.body is None:
            return np.asarray(lever.T @ (rate[:, None] * lever))
        caused = self.pairs.subset(active).evaluate(indentation[active])
        own = np.linalg.solve(np.eye(len(active)) + caused.derivative, lever)
        return np.asarray(lever.T @ (rate[:, None] * own))

    def equilibrium(self, control: Control, start: Equilibrium | None = None) -> Equilibrium:
        """Solve the contacts, and the motions of the plane that are free.

        Without force the plane is that of first touch; where its slopes are free they are those
        of the start.

        Args:
            control: What is prescribed of the plane.
            start: A solution nearby, of these or as many asperities.

        Raises:
            InputError: When the start is of other asperities.
            NotConverged: When the contact conditions cannot be met to 1e-10, or no plane is in
                equilibrium.
        """
        own = np.zeros(len(self.asperities)) if start is None else start.solution.indentation
        if own.shape != (len(self.asperities),):
            raise InputError(
                "the solution to start from is of other asperities",
                value=own.shape,
                allowed=f"({len(self.asperities)},)",
            )
        if control.approach is not None and control.tilt is not None:
            plane = RigidPlane.above(self.asperities, control.approach, control.tilt)
            return Equilibrium(plane, self.solution(self.asperities.interference(plane), own))
        peaks, first, spent = self._peaks, self.first_plane(control, start), 0

        def respond(motion: Array) -> PlaneResponse[Equilibrium]:
            nonlocal own, spent
            plane = RigidPlane.moved(self.asperities, motion)
            found = self.solution(self.asperities.interference(plane), own)
            own, spent = found.indentation, spent + found.iterations
            known = Equilibrium(plane, found._replace(iterations=spent))
            return PlaneResponse(
                loads=peaks.levers.loads(self.hertz.force * own**1.5),
                stiffness=lambda: self.stiffness(known.solution.indentation, peaks.lever),
                state=known,
            )

        return peaks.equilibrium(respond, control, first.motion)[1]

    def first_plane(self, control: Control, start: Equilibrium | None = None) -> RigidPlane:
        """Return the plane that the search for an equilibrium starts from.

        Args:
            control: What is prescribed of the plane.
            start: A solution nearby; without it the plane is that of contacts that do not
                displace each other's summits.

        Raises:
            NotConverged: When no plane can be in equilibrium.
        """
        near = None
        if start is not None and (start.solution.indentation.any() or control.force == 0.0):
            near = start.plane
        return RigidPlane.moved(self.asperities, self._peaks.first_plane(control, near))

    @property
    def _peaks(self) -> Peaks:
        """The summits under the plane; not cached, because models are sent between processes."""
        a, force = self.asperities, self.hertz.force
        return Peaks(
            levers=PlaneLevers.at(a.x, a.y, a.lengths),
            depth=a.highest - a.z,
            force=lambda interference: float(force @ np.maximum(interference, 0.0) ** 1.5),
        )
