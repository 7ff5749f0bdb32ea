"""Contact problems of many asperities: which pairs are summed how, and how far exactly.

Up to 150 summits in the plane's reach every pair is evaluated (`micro.pairs.interaction`), which
costs least there. Up to 2000 pairs beyond 8 semi-axes are summed as multipoles
(`micro.pairs.far_pairs`): the same displacements to 1e-11. Above, the distant pairs go through a
mesh (`micro.pairs.far_mesh`) for memory and time that grow with the number of summits instead of
its square: displacements by neighbours are off by 2e-7 of their mean (root mean square, 1e-5 at
most), forces by less than 1e-5. About a contact whose semi-axis exceeds a tenth of the mesh's
cut-off, half a mean distance of summits, the largest error grows: to 2e-4 at a third of the
cut-off, 2e-3 of the approach at all of it and a tenth at four times that, where the force is 3 %
off. So large are contacts that have long merged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from micro.asperities.displacements import BodyFarField
from micro.complementarity.contact_problem import ContactProblem, Solution, solve
from micro.complementarity.newton_krylov import newton_krylov
from micro.pairs.body_points import BodyPoints
from micro.pairs.close_pairs import ClosePairs
from micro.pairs.far_mesh import FarMesh, Neighbourhood
from micro.pairs.far_pairs import REACH, FarPairs
from micro.pairs.interaction import Interaction
from micro.pairs.split_interaction import SplitInteraction

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

PAIR_SUMS: Mapping[str, int] = MappingProxyType({"direct": 150, "multipole": 2000, "mesh": 10**9})
"""Ways to sum over pairs, with the number of summits up to which each is taken by itself."""

_GROWTH = 1.3
_LEAST_SHARE = 0.2


def pair_sum(count: int) -> str:
    """Return the way to sum over the pairs of so many summits.

    Args:
        count: Number of summits in the plane's reach.
    """
    return next(name for name, most in PAIR_SUMS.items() if count <= most)


@dataclass(frozen=True, kw_only=True, eq=False)
class ManySummits:
    """Contact problems of subsets of n asperities, with the geometry they share.

    Args:
        interaction: The n asperities.
        interacting: Whether contacts displace each other's summits through the half-space.
        body: What a finite body adds between the summits; None on a half-space.
    """

    interaction: Interaction
    interacting: bool = True
    body: BodyPoints | None = None

    def solve(self, way: str, reached: Indices, required: Array, start: Array) -> Solution:
        """Solve for the summits in reach.

        Which pairs are close depends on the sizes of the contacts. They are estimated from the
        start, and the problem is solved again in the rare case that one has grown beyond that.

        Args:
            way: ``"multipole"`` or ``"mesh"``.
            reached: The m summits in reach, ascending.
            required: d_k, shape (m,) [mm]; some are > 0.
            start: First guess of the own indentations, shape (m,) [mm].

        Raises:
            NotConverged: When even small load steps fail.
        """
        among, spent = self.interaction.subset(reached), 0
        # a body can lift summits: their contacts then indent more than the plane requires
        most = required if self.body is None else np.full(len(reached), np.inf)
        bound = np.clip(_GROWTH * start, _LEAST_SHARE * np.maximum(required, 0.0), most)
        while True:
            parts = self._parts(way, reached, among, bound)
            problem = ContactProblem(interaction=parts, required=required)
            found = solve(problem, newton_krylov, start)
            spent += found.iterations
            beyond = found.indentation > bound
            if not beyond.any():
                return found._replace(iterations=spent)
            start = found.indentation
            bound = np.where(beyond, np.minimum(_GROWTH * start, most), bound)

    def lift(self, indentation: Array) -> Array:
        """Return the displacement of all n summits by the other contacts, through the mesh [mm].

        Args:
            indentation: Own indentations, shape (n,) [mm].
        """
        every = np.arange(len(indentation))
        parts = self._parts("mesh", every, self.interaction, indentation)
        return parts.lift(indentation).displacement

    def _parts(
        self, way: str, reached: Indices, among: Interaction, bound: Array
    ) -> SplitInteraction:
        if self.body is None:
            return self._between(way, reached, among, bound)
        body = self.body.among(reached)
        if not self.interacting:
            none = ClosePairs.none(among)
            far = BodyFarField(far=None, body=body)
            return SplitInteraction(interaction=among, close=none, far=far)
        parts = self._between(way, reached, among, bound)
        return replace(parts, far=BodyFarField(far=parts.far, body=body))

    def _between(
        self, way: str, reached: Indices, among: Interaction, bound: Array
    ) -> SplitInteraction:
        semi_major = np.sqrt(among.size * bound)
        if way == "mesh":
            places = self._neighbourhood.among(reached)
            close = ClosePairs.within(among, places.reach(semi_major))
            return SplitInteraction(interaction=among, close=close, far=FarMesh.of(places, close))
        close = ClosePairs.within(among, REACH * semi_major)
        if len(self.interaction.x) <= PAIR_SUMS["multipole"]:
            far = self._all_pairs.among(reached, close.row, close.column)
        else:
            every = np.arange(len(reached))
            far = FarPairs.of(among).among(every, close.row, close.column)
        return SplitInteraction(interaction=among, close=close, far=far)

    @cached_property
    def _all_pairs(self) -> FarPairs:
        return FarPairs.of(self.interaction)

    @cached_property
    def _neighbourhood(self) -> Neighbourhood:
        return Neighbourhood.of(self.interaction)
