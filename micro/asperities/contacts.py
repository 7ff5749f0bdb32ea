"""Contacts of all summits of a surface under a given plane, and how stiff they hold it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities
from micro.asperities.displacements import BodyInteraction
from micro.asperities.many_summits import PAIR_SUMS, ManySummits, pair_sum
from micro.asperities.state import HertzCoefficients
from micro.closed_forms.hertz import HertzContact
from micro.complementarity.active_set import active_set
from micro.complementarity.contact_problem import ContactProblem, Method, Solution, solve
from micro.complementarity.truncated_newton import truncated_newton
from micro.compliance.body_modes import BodyModes
from micro.pairs.body_points import BodyPoints
from micro.pairs.interaction import MERGING_SLOPE, Interaction
from micro.pairs.multipoles import moments
from micro.plane_on_peaks import contact_stiffness

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SOLVERS: Mapping[str, Method] = MappingProxyType(
    {"active-set": active_set, "truncated-newton": truncated_newton}
)
"""Solvers of the models with interaction, by name."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SummitContacts:
    """The n asperities of one of the discrete models; see `micro.AsperityModel` for the fields.

    Args:
        asperities: The summits.
        contact_modulus: E* [MPa].
        elliptic: Whether contacts are ellipses.
        interacting: Whether contacts displace each other's summits through the half-space.
        solver: A name in `SOLVERS`.
        pairs: A name in `PAIR_SUMS`, or ``"auto"``.
        body: What a finite body adds to the half-space; None leaves the half-space alone.
    """

    asperities: Asperities
    contact_modulus: float
    elliptic: bool
    interacting: bool
    solver: str
    pairs: str
    body: BodyModes | None

    def contact(self, indentation: ArrayLike, index: int | slice = slice(None)) -> HertzContact:
        """Return Hertz's contacts of given own indentations [mm]."""
        a = self.asperities
        return HertzContact(
            contact_modulus=self.contact_modulus,
            radius_major=(a.radius_major if self.elliptic else a.radius)[index],
            radius_minor=(a.radius_minor if self.elliptic else a.radius)[index],
            indentation=indentation,
        )

    @cached_property
    def hertz(self) -> HertzCoefficients:
        """What an indentation of 1 mm gives."""
        return HertzCoefficients.of(self.contact(1.0))

    @cached_property
    def interaction(self) -> Interaction:
        """The asperities as they see each other."""
        shape = self.contact(0.0).factors
        return Interaction.among(self.asperities, shape, circular=not self.elliptic)

    @cached_property
    def points(self) -> BodyPoints | None:
        """Compliance of the body between the summits; None on a half-space."""
        if self.body is None:
            return None
        a = self.asperities
        return BodyPoints.at(self.body, a.x, a.y, self.contact_modulus)

    def moment(self, own: Array) -> Array:
        """Return P/(π E*) of own indentations, shape (n,) [mm²]."""
        return np.asarray(moments(own, self.interaction.size, self.interaction.integral, 1)[0])

    def lift(self, own: Array) -> Array:
        """Return the displacements of the summits but those by their own contacts' half-space.

        Args:
            own: Own indentations, shape (n,) [mm].
        """
        if not self.interacting:
            none = np.zeros_like(own)
            return none if self.points is None else self.points.displacement(self.moment(own))
        if pair_sum(len(own)) == "mesh":
            return self._many.lift(own)
        return self._among(np.arange(len(own))).lift(own).displacement

    def solution(self, overlap: Array, start: Array) -> Solution:
        """Solve for the summits in reach; the displacement of the others is left at 0.

        Those are in reach that the plane overlaps, and those that the body lifts so far.

        Args:
            overlap: How far the undisplaced summits would penetrate the plane, negative for those
                below it, shape (n,) [mm].
            start: First guess of the own indentations, shape (n,) [mm].

        Raises:
            NotConverged: When the contact conditions cannot be met to 1e-10.
        """
        if not self.interacting and self.points is None:
            required = np.maximum(overlap, 0.0)
            return Solution(required, required, 0, 0.0, 0)
        reached = np.flatnonzero(overlap > 0.0)
        own, displacement, spent = np.zeros_like(overlap), np.zeros_like(overlap), 0
        if reached.size == 0:
            return Solution(own, displacement, 0, 0.0, 0)
        while True:
            found = self._solution_among(reached, overlap[reached], start[reached])
            own[reached], displacement[reached] = found.indentation, found.displacement
            spent += found.iterations
            if self.points is None:
                break
            # contacts through the half-space only press down
            lifted = overlap - self.points.displacement(self.moment(own)) > 0.0
            lifted[reached] = False
            if not lifted.any():
                break
            reached, start = np.sort(np.append(reached, np.flatnonzero(lifted))), own
        return found._replace(indentation=own, displacement=displacement, iterations=spent)

    def stiffness(self, own: Array, lever: Array) -> Array:
        """Return nearly the derivative of the loads on a rigid plane by its motions, (k, k).

        Distant and near contacts act as point forces here.

        Args:
            own: Own indentations, shape (n,) [mm].
            lever: Displacements of the summits by unit motions, shape (n, k).
        """
        active = np.flatnonzero(own > 0.0)
        rate = 1.5 * self.hertz.force[active] * np.sqrt(own[active])
        if len(active) > PAIR_SUMS["multipole"]:  # balanced all the same, in more steps
            return contact_stiffness(lever[active], rate)
        coupling = np.zeros(2 * (len(active),))
        share = rate / (np.pi * self.contact_modulus)
        if self.interacting:
            x, y = self.asperities.x[active], self.asperities.y[active]
            apart = np.hypot(x[:, None] - x, y[:, None] - y)
            np.fill_diagonal(apart, np.inf)
            nearest = share / MERGING_SLOPE
            coupling += share / np.maximum(apart, nearest)
        if self.points is not None:
            among = self.points.among(active)
            coupling += among.by(among) * share
        return contact_stiffness(lever[active], rate, coupling)

    def _solution_among(self, reached: Indices, required: Array, start: Array) -> Solution:
        way = pair_sum(len(reached)) if self.pairs == "auto" else self.pairs
        if way == "direct" or self.solver != "active-set":
            problem = ContactProblem(interaction=self._among(reached), required=required)
            return solve(problem, SOLVERS[self.solver], start)
        return self._many.solve(way, reached, required, start)

    def _among(self, reached: Indices) -> Interaction | BodyInteraction:
        among = self.interaction.subset(reached)
        if self.points is None:
            return among
        body = self.points.among(reached)
        return BodyInteraction(interaction=among, interacting=self.interacting, body=body)

    @cached_property
    def _many(self) -> ManySummits:
        return ManySummits(
            interaction=self.interaction, interacting=self.interacting, body=self.points
        )
