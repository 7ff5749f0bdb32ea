"""The four discrete models: asperities, elliptic or circular, with or without interaction.

A rigid plane that has approached by δ asks every summit for the displacement
d_k = <δ(x_k) − (z_M − z_k)>. Without interaction each contact makes it alone, w_k = d_k; with
interaction the displacements by all contacts add up to w_k (`micro.summits.contact_problem`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Partition, PatchGrid
from geometry.errors import InputError
from micro.curve import PatchSums, checked_approaches
from micro.hertz import HertzContact
from micro.pairs.interaction import Interaction
from micro.plane import RigidPlane
from micro.response import Pressed, Response
from micro.summits.active_set import active_set
from micro.summits.asperity_state import AsperityState, HertzCoefficients
from micro.summits.contact_problem import ContactProblem, Method, Solution, solve
from micro.summits.many_summits import PAIR_SUMS, ManySummits, pair_sum
from micro.summits.truncated_newton import truncated_newton

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_LEVEL = (0.0, 0.0)


class ModelKind(NamedTuple):
    """What distinguishes the four models.

    Attributes:
        elliptic: Whether contacts are ellipses; circles of radius sqrt(R' R'') otherwise.
        interacting: Whether contacts displace each other's summits.
    """

    elliptic: bool
    interacting: bool


MODELS: Mapping[str, ModelKind] = MappingProxyType(
    {
        "elliptic": ModelKind(elliptic=True, interacting=True),
        "circular": ModelKind(elliptic=False, interacting=True),
        "elliptic-independent": ModelKind(elliptic=True, interacting=False),
        "circular-independent": ModelKind(elliptic=False, interacting=False),
    }
)
"""The models (1) to (4) of Waddad et al. 2016, section 2.2, by name."""

SOLVERS: Mapping[str, Method] = MappingProxyType(
    {"active-set": active_set, "truncated-newton": truncated_newton}
)
"""Solvers of the models with interaction, by name."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AsperityModel:
    """One of the four discrete models on given asperities.

    How the interaction is summed over pairs follows from the number of summits in reach
    (`micro.summits.many_summits`): exactly up to 2000, through a mesh above. The truncated Newton
    method sums every pair directly; its time and memory grow with the square of their number.

    Args:
        asperities: The n summits, with the highest point z_M that the approach counts from.
        contact_modulus: E* [MPa].
        elliptic: Whether contacts are ellipses; circles of radius sqrt(R' R'') otherwise.
        interacting: Whether contacts displace each other's summits.
        solver: Solver of the models with interaction, a name in `SOLVERS`.
        pairs: How to sum over pairs, a name in `PAIR_SUMS`, or ``"auto"`` by their number.

    Raises:
        InputError: When the modulus is not positive, the solver or the sum unknown, or the
            truncated Newton method shall use another sum than the direct one.

    Source:
        Waddad et al. 2016, section 1.2, doi 10.1016/j.triboint.2015.12.023.
    """

    asperities: Asperities
    contact_modulus: float
    elliptic: bool
    interacting: bool
    solver: str = "active-set"
    pairs: str = "auto"

    def __post_init__(self) -> None:
        _known(self.solver, SOLVERS, "solver")
        allowed = ("auto", *PAIR_SUMS) if self.solver == "active-set" else ("auto", "direct")
        _known(self.pairs, allowed, f"sum over pairs with the solver {self.solver}")
        _ = self._hertz  # checks the modulus

    @property
    def name(self) -> str:
        """Name of the model in `MODELS`."""
        kind = ModelKind(self.elliptic, self.interacting)
        return next(name for name, value in MODELS.items() if value == kind)

    @property
    def datum(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.asperities.highest

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]; infinite without asperities."""
        heights = self.asperities.z
        return float(self.datum - heights.max()) if heights.size else np.inf

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`."""
        own = patches.index_of(self.asperities.x, self.asperities.y) == index
        return replace(self, asperities=self.asperities.subset(own)), patches.single(index)

    def solve(
        self,
        approach: float,
        *,
        tilt: tuple[float, float] = _LEVEL,
        start: AsperityState | None = None,
    ) -> AsperityState:
        """Solve the contact at one approach of the plane.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).
            start: A solution nearby to start from.

        Raises:
            InputError: When the approach or the tilt is not finite.
            NotConverged: When the contact conditions cannot be met to 1e-10.
        """
        plane = RigidPlane.above(self.asperities, approach, tilt)
        required = plane.required(self.asperities)
        first = np.zeros(len(required)) if start is None else start.indentation
        return self.state(plane, self.solution(required, first))

    def state(self, plane: RigidPlane, solution: Solution) -> AsperityState:
        """Return the contacts of a solution under a plane."""
        own = solution.indentation
        return AsperityState(
            approach=plane.approach,
            required=plane.required(self.asperities),
            displacement=own + self._lift(own),
            indentation=own,
            semi_axes=self._hertz.semi_axes * np.sqrt(own)[:, None],
            contact_area=self._hertz.area * own,
            force=self._hertz.force * own**1.5,
            peak_pressure=self._hertz.peak_pressure * np.sqrt(own),
            engulfed=solution.engulfed,
            iterations=solution.iterations,
            residual=solution.residual,
        )

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        tilt: tuple[float, float] = _LEVEL,
    ) -> Response:
        """Solve along approaches, each from the solution before it; see `MicroModel.respond`."""
        given = checked_approaches(approaches)
        sums = self.sums(patches, mean_heights)
        rows: dict[int, dict[str, Any]] = {}
        own: Array = np.zeros(len(self.asperities))
        before = own
        for index in np.argsort(given, kind="stable"):
            plane = RigidPlane.above(self.asperities, given[index], tilt)
            # Going on as before is right to second order when the steps are equal.
            start = np.maximum(2.0 * own - before, 0.0)
            found = self.solution(plane.required(self.asperities), start)
            own, before = found.indentation, own
            rows[int(index)] = sums.row(plane, found)
        return sums.response(self.name, [rows[index] for index in range(len(given))])

    def press(
        self,
        plane: RigidPlane,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve under one plane; see `MicroModel.press`."""
        first = np.zeros(len(self.asperities)) if start is None else start
        if np.shape(first) != (len(self.asperities),):
            raise InputError(
                "the solution to start from is of other asperities",
                value=np.shape(first),
                allowed=f"({len(self.asperities)},)",
            )
        found = self.solution(plane.required(self.asperities), first)
        sums = self.sums(patches, mean_heights)
        rows = [sums.row(plane, found)]
        return Pressed(sums.response(self.name, rows), found.indentation)

    def surface_displacement(self, state: AsperityState, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the normal displacement of the surface at points, by all contacts [mm].

        The field of every contact is Hertz's, also where contacts merge.

        Args:
            state: A solution of this model.
            x: Abscissae [mm]; broadcast against ``y``.
            y: Ordinates [mm].
        """
        total = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
        a = self.asperities
        for k in np.flatnonzero(state.in_contact):  # one field at a time bounds the memory
            contact = self._contact(state.indentation[k], int(k))
            dx, dy = np.asarray(x, float) - a.x[k], np.asarray(y, float) - a.y[k]
            cos, sin = np.cos(a.angle[k]), np.sin(a.angle[k])
            total += contact.displacement(cos * dx + sin * dy, cos * dy - sin * dx)
        return total

    def _contact(self, indentation: ArrayLike, index: int | slice = slice(None)) -> HertzContact:
        a = self.asperities
        return HertzContact(
            contact_modulus=self.contact_modulus,
            radius_major=(a.radius_major if self.elliptic else a.radius)[index],
            radius_minor=(a.radius_minor if self.elliptic else a.radius)[index],
            indentation=indentation,
        )

    @cached_property
    def _hertz(self) -> HertzCoefficients:
        return HertzCoefficients.of(self._contact(1.0))

    @cached_property
    def _interaction(self) -> Interaction:
        shape = self._contact(0.0).factors
        return Interaction.among(self.asperities, shape, circular=not self.elliptic)

    def _lift(self, own: Array) -> Array | float:
        if not self.interacting:
            return 0.0
        if pair_sum(len(own)) == "mesh":
            return self._many.lift(own)
        return self._interaction.lift(own).displacement

    def sums(
        self, patches: Partition, mean_heights: ArrayLike, home: Asperities | None = None
    ) -> PatchSums:
        """Return what sums the results of this model over patches.

        Args:
            patches: Patches; every asperity lies in one.
            mean_heights: Mean heights of the surface on the patches, shape (N,) [mm].
            home: The summits, where they are not the centres of the contacts.

        Raises:
            InputError: When a summit lies outside the patches, or the mean heights do not fit.
        """
        return PatchSums(
            asperities=self.asperities,
            home=self.asperities if home is None else home,
            patches=patches,
            mean_heights=np.asarray(mean_heights, float),
            hertz=self._hertz,
            contact_modulus=self.contact_modulus,
        )

    def solution(self, required: Array, start: Array) -> Solution:
        """Solve for the summits in reach; the displacement of the others is left at 0.

        Args:
            required: Displacements d_k that the plane requires, shape (n,) [mm].
            start: First guess of the own indentations, shape (n,) [mm].

        Raises:
            NotConverged: When the contact conditions cannot be met to 1e-10.
        """
        if not self.interacting:
            return Solution(required, required, 0, 0.0, 0)
        reached = np.flatnonzero(required > 0.0)
        own, displacement = np.zeros_like(required), np.zeros_like(required)
        if reached.size == 0:
            return Solution(own, displacement, 0, 0.0, 0)
        found = self._solution_among(reached, required[reached], start[reached])
        own[reached], displacement[reached] = found.indentation, found.displacement
        return found._replace(indentation=own, displacement=displacement)

    def _solution_among(self, reached: Indices, required: Array, start: Array) -> Solution:
        way = pair_sum(len(reached)) if self.pairs == "auto" else self.pairs
        if way == "direct" or self.solver != "active-set":
            problem = ContactProblem(
                interaction=self._interaction.subset(reached), required=required
            )
            return solve(problem, SOLVERS[self.solver], start)
        return self._many.solve(way, reached, required, start)

    @cached_property
    def _many(self) -> ManySummits:
        return ManySummits(interaction=self._interaction)


def asperity_model(
    name: str,
    asperities: Asperities,
    *,
    contact_modulus: float,
    solver: str = "active-set",
    pairs: str = "auto",
) -> AsperityModel:
    """Return the model of a given name on some asperities.

    Args:
        name: A name in `MODELS`.
        asperities: The summits.
        contact_modulus: E* [MPa].
        solver: A name in `SOLVERS`, for the models with interaction.
        pairs: A name in `PAIR_SUMS` or ``"auto"``, for the models with interaction.

    Raises:
        InputError: When a name is unknown or the modulus not positive.
    """
    _known(name, MODELS, "micro model")
    return AsperityModel(
        asperities=asperities,
        contact_modulus=contact_modulus,
        solver=solver,
        pairs=pairs,
        **MODELS[name]._asdict(),
    )


def _known(name: str, table: Collection[str], what: str) -> None:
    if name not in table:
        raise InputError(f"this {what} is unknown", value=name, allowed=", ".join(table))
