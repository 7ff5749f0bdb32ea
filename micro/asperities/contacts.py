"""Hertz contacts of all asperities of a surface at a given interference, and their stiffness.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities
from geometry.errors import InputError
from micro.closed_forms.hertz import HertzContact
from micro.compliance.body_modes import BodyModes
from micro.interaction.body_points import BodyPoints
from micro.interaction.contact_problem import (
    BYTES_PER_PAIR,
    ContactProblem,
    Method,
    Solution,
    active_set,
    checked_pairs,
    solve,
)
from micro.interaction.hertz_pairs import MERGING_SLOPE, HertzPairs
from micro.interaction.truncated_newton import truncated_newton
from micro.plane_on_peaks import contact_stiffness

Array = NDArray[np.float64]

SOLVERS: Mapping[str, Method] = MappingProxyType(
    {"active-set": active_set, "truncated-newton": truncated_newton}
)
"""Solvers of the models with interaction, by name."""


class HertzCoefficients(NamedTuple):
    """Hertz's results of n asperities at an indentation t of 1 mm.

    Attributes:
        force: P, which grows as t^(3/2), shape (n,) [N].
        area: π a b, which grows as t, shape (n,) [mm²].
        semi_axes: (a, b), which grow as t^(1/2), shape (n, 2) [mm].
        peak_pressure: p0, which grows as t^(1/2), shape (n,) [MPa].
    """

    force: Array
    area: Array
    semi_axes: Array
    peak_pressure: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class AsperityContacts:
    """The contacts of n asperities.

    The interaction is summed over all pairs of summits above the plane. Time and memory grow with
    the square of their number; more than the memory holds are refused.

    Args:
        asperities: The n summits, with the highest point z_M that the approach counts from.
        contact_modulus: E* [MPa].
        elliptic: Whether contacts are ellipses; circles of radius sqrt(R' R'') otherwise.
        interacting: Whether contacts displace each other's summits through the half-space.
        solver: Solver of the models with interaction, a name in `SOLVERS`.
        body: What a finite body with its sides adds to the half-space, between all contacts, also
            those of the models without interaction; a half-space when not given. On thin blocks it
            takes away from the interaction: models without any may then have no solution.

    Raises:
        InputError: When the modulus is not positive or the solver unknown.
    """

    asperities: Asperities
    contact_modulus: float
    elliptic: bool
    interacting: bool
    solver: str = "active-set"
    body: BodyModes | None = None

    def __post_init__(self) -> None:
        checked_name(self.solver, SOLVERS, "solver")
        _ = self.hertz  # checks the modulus

    def contact(self, indentation: ArrayLike, index: int | slice = slice(None)) -> HertzContact:
        """Return the Hertz contacts of some asperities.

        Args:
            indentation: Their indentations [mm].
            index: Which asperities.
        """
        a = self.asperities
        return HertzContact(
            contact_modulus=self.contact_modulus,
            radius_major=(a.radius_major if self.elliptic else a.radius)[index],
            radius_minor=(a.radius_minor if self.elliptic else a.radius)[index],
            indentation=indentation,
        )

    @cached_property
    def hertz(self) -> HertzCoefficients:
        """Hertz's results at an indentation of 1 mm."""
        unit = self.contact(1.0)
        axes = np.stack([unit.semi_major, unit.semi_minor], axis=-1)
        return HertzCoefficients(unit.force, unit.area, axes, unit.peak_pressure)

    @cached_property
    def pairs(self) -> HertzPairs:
        """How the contacts displace each other's summits."""
        a, body = self.asperities, None
        if self.body is not None:
            body = BodyPoints.at(self.body, a.x, a.y, self.contact_modulus)
        return HertzPairs.among(
            a,
            self.contact(0.0).factors,
            circular=not self.elliptic,
            half_space=self.interacting,
            body=body,
        )

    def displacement(self, indentation: Array) -> Array:
        """Return the total displacements of the summits, shape (n,) [mm].

        Args:
            indentation: Indentations of the contacts, shape (n,) [mm].
        """
        if not self.interacting and self.body is None:
            return indentation
        return indentation + self.pairs.displacement(indentation)

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
        if not self.interacting and self.body is None:
            alone = np.maximum(interference, 0.0)
            return Solution(alone, alone, 0, 0.0, 0)
        above = np.flatnonzero(interference > 0.0)
        own, displacement, spent = np.zeros_like(interference), np.zeros_like(interference), 0
        if above.size == 0:
            return Solution(own, displacement, 0, 0.0, 0)
        size = BYTES_PER_PAIR * (2.0 if self.solver == "truncated-newton" else 1.0)
        while True:
            checked_pairs(len(above), len(above), "asperities", bytes_per_pair=size)
            pairs = self.pairs.subset(above)
            problem = ContactProblem(interaction=pairs, interference=interference[above])
            found = solve(problem, SOLVERS[self.solver], start[above])
            own[above], displacement[above] = found.indentation, found.displacement
            spent += found.iterations
            if self.pairs.body is None:
                break
            # Through the half-space contacts only press summits down; a body can raise them.
            raised = interference - self.pairs.body.displacement(self.pairs.scaled_force(own)) > 0.0
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
        if self.interacting:
            x, y = self.asperities.x[active], self.asperities.y[active]
            apart = np.hypot(x[:, None] - x, y[:, None] - y)
            np.fill_diagonal(apart, np.inf)
            coupling += share / np.maximum(apart, share / MERGING_SLOPE)
        if self.body is not None and self.pairs.body is not None:
            among = self.pairs.body.among(active)
            coupling += among.by(among) * share
        return contact_stiffness(lever[active], rate, coupling)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AsperityState:
    """Contact of all n asperities at one approach.

    Args:
        approach: Rigid approach δ at the centre [mm].
        interference: Depth d_k ≥ 0 of the plane below each undisplaced summit, shape (n,) [mm].
        displacement: Displacements w_k of the summits by all contacts, shape (n,) [mm].
        indentation: Part of w_k by the summit's own contact, shape (n,) [mm].
        semi_axes: Semi-axes (a, b) of the contacts, shape (n, 2) [mm].
        contact_area: Areas π a b, shape (n,) [mm²].
        force: Forces P_k, shape (n,) [N].
        peak_pressure: Pressures at the centres of the contacts, shape (n,) [MPa].
        overlapping_contacts: Number of ordered pairs (k, i) in which contact i has come so close
            to summit k that `micro.interaction.hertz_pairs` limits its kernel.
        iterations: Linear systems solved; 0 for the models without interaction.
        residual: Largest complementarity error relative to the largest d_k.
    """

    approach: float
    interference: Array
    displacement: Array
    indentation: Array
    semi_axes: Array
    contact_area: Array
    force: Array
    peak_pressure: Array
    overlapping_contacts: int
    iterations: int
    residual: float

    @property
    def in_contact(self) -> NDArray[np.bool_]:
        """Which asperities carry a force, shape (n,)."""
        return self.indentation > 0.0


def checked_name(name: str, table: Collection[str], what: str) -> None:
    """Refuse a name that is not in a table.

    Raises:
        InputError: When it is not.
    """
    if name not in table:
        raise InputError(f"this {what} is unknown", value=name, allowed=", ".join(table))
