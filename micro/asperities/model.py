"""The four discrete models: asperities, elliptic or circular, with or without interaction.

A rigid plane that has approached by δ asks every summit for the displacement
d_k = <δ(x_k) − (z_M − z_k)>. Without interaction each contact makes it alone, w_k = d_k; with
interaction the displacements by all contacts add up to w_k
(`micro.complementarity.contact_problem`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, PatchGrid
from geometry.errors import InputError
from geometry.plane_equilibrium import PlaneResponse
from geometry.rigid_plane import PlaneLevers, RigidPlane
from micro.asperities.contacts import SOLVERS, SummitContacts
from micro.asperities.many_summits import PAIR_SUMS
from micro.asperities.patch_sums import PatchSums
from micro.asperities.state import AsperityState
from micro.checks import checked_approaches, checked_means
from micro.complementarity.contact_problem import Solution
from micro.compliance.body_modes import BodyModes
from micro.plane_on_peaks import Peaks
from micro.response import Pressed, Response

Array = NDArray[np.float64]

_LEVEL = (0.0, 0.0)


class Balanced(NamedTuple):
    """Contacts in equilibrium with a plane.

    Attributes:
        plane: The plane.
        solution: The contacts.
    """

    plane: RigidPlane
    solution: Solution


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


@dataclass(frozen=True, kw_only=True, eq=False)
class AsperityModel:
    """One of the four discrete models on given asperities.

    How the interaction is summed over pairs follows from the number of summits in reach
    (`micro.asperities.many_summits`): exactly up to 2000, through a mesh above. The truncated
    Newton method sums every pair directly; its time and memory grow with the square of their
    number.

    Args:
        asperities: The n summits, with the highest point z_M that the approach counts from.
        contact_modulus: E* [MPa].
        elliptic: Whether contacts are ellipses; circles of radius sqrt(R' R'') otherwise.
        interacting: Whether contacts displace each other's summits.
        solver: Solver of the models with interaction, a name in `SOLVERS`.
        pairs: How to sum over pairs, a name in `PAIR_SUMS`, or ``"auto"`` by their number.
        body: What a finite body with its sides adds to the half-space, between all contacts, also
            those of the models without interaction; a half-space when not given. On thin blocks it
            takes away from the interaction: models without any may then have no solution.

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
    body: BodyModes | None = None

    def __post_init__(self) -> None:
        _known(self.solver, SOLVERS, "solver")
        allowed = ("auto", *PAIR_SUMS) if self.solver == "active-set" else ("auto", "direct")
        _known(self.pairs, allowed, f"sum over pairs with the solver {self.solver}")
        _ = self.contacts.hertz  # checks the modulus

    @property
    def name(self) -> str:
        """Name of the model in `MODELS`."""
        kind = ModelKind(self.elliptic, self.interacting)
        return next(name for name, value in MODELS.items() if value == kind)

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.asperities.highest

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]; infinite without asperities."""
        heights = self.asperities.z
        return float(self.reference_height - heights.max()) if heights.size else np.inf

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`."""
        own = patches.index_of(self.asperities.x, self.asperities.y) == index
        alone = replace(self, asperities=self.asperities.subset(own), body=None)
        return alone, patches.single(index)

    @cached_property
    def contacts(self) -> SummitContacts:
        """The contacts that the summits can make."""
        return SummitContacts(
            asperities=self.asperities,
            contact_modulus=self.contact_modulus,
            elliptic=self.elliptic,
            interacting=self.interacting,
            solver=self.solver,
            pairs=self.pairs,
            body=self.body,
        )

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
        first = np.zeros(len(self.asperities)) if start is None else start.indentation
        return self.state(plane, self.contacts.solution(self.asperities.interference(plane), first))

    def state(self, plane: RigidPlane, solution: Solution) -> AsperityState:
        """Return the contacts of a solution under a plane."""
        own, hertz = solution.indentation, self.contacts.hertz
        return AsperityState(
            approach=plane.approach,
            required=np.maximum(self.asperities.interference(plane), 0.0),
            displacement=own + self.contacts.lift(own),
            indentation=own,
            semi_axes=hertz.semi_axes * np.sqrt(own)[:, None],
            contact_area=hertz.area * own,
            force=hertz.force * own**1.5,
            peak_pressure=hertz.peak_pressure * np.sqrt(own),
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
            found = self.contacts.solution(self.asperities.interference(plane), start)
            own, before = found.indentation, own
            rows[int(index)] = sums.row(plane, found)
        return sums.response(self.name, [rows[index] for index in range(len(given))])

    def press(
        self,
        control: Control,
        *,
        patches: Partition,
        mean_heights: ArrayLike,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        sums = self.sums(patches, mean_heights)
        found = self.equilibrium(control, start)
        response = sums.response(self.name, [sums.row(found.plane, found.solution)])
        return Pressed(response, found.plane, found)

    def equilibrium(self, control: Control, start: Balanced | None = None) -> Balanced:
        """Solve the contacts, and the motions of the plane that are free.

        Without force the plane touches first, under the slopes of the start where they are free.

        Args:
            control: What is prescribed of the plane.
            start: A solution nearby, of these or as many asperities.

        Raises:
            InputError: When the start is of other asperities.
            NotConverged: When the contact conditions cannot be met to 1e-10, or no plane is in
                balance.
        """
        own, spent = np.zeros(len(self.asperities)), 0
        if start is not None:
            own = start.solution.indentation
        if own.shape != (len(self.asperities),):
            raise InputError(
                "the solution to start from is of other asperities",
                value=own.shape,
                allowed=f"({len(self.asperities)},)",
            )
        peaks, first = self._peaks, self.first_plane(control, start)

        def evaluate(motion: Array) -> PlaneResponse[Balanced]:
            nonlocal own, spent
            plane = RigidPlane.moved(self.asperities, motion)
            found = self.contacts.solution(self.asperities.interference(plane), own)
            own, spent = found.indentation, spent + found.iterations
            loads = peaks.levers.loads(self.contacts.hertz.force * own**1.5)
            known = Balanced(plane, found._replace(iterations=spent))
            return PlaneResponse(
                loads=loads,
                stiffness=lambda: self.contacts.stiffness(known.solution.indentation, peaks.lever),
                state=known,
            )

        return peaks.equilibrium(evaluate, control, first.motion)[1]

    def first_plane(self, control: Control, start: Balanced | None = None) -> RigidPlane:
        """Return the plane that an equilibrium is looked for from.

        Args:
            control: What is prescribed of the plane.
            start: A solution nearby; without, contacts that do not see each other tell.

        Raises:
            NotConverged: When no plane can be in balance.
        """
        near = None
        if start is not None and (start.solution.indentation.any() or control.force == 0.0):
            near = start.plane
        return RigidPlane.moved(self.asperities, self._peaks.first_plane(control, near))

    @property
    def _peaks(self) -> Peaks:
        """The summits as the plane sees them; not kept, for models are sent between processes."""
        a, force = self.asperities, self.contacts.hertz.force

        def alone(overlap: Array) -> float:
            return float(force @ np.maximum(overlap, 0.0) ** 1.5)

        levers = PlaneLevers.at(a.x, a.y, a.lengths)
        return Peaks(levers=levers, depth=a.highest - a.z, force=alone)

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
            contact = self.contacts.contact(state.indentation[k], int(k))
            dx, dy = np.asarray(x, float) - a.x[k], np.asarray(y, float) - a.y[k]
            cos, sin = np.cos(a.angle[k]), np.sin(a.angle[k])
            total += contact.displacement(cos * dx + sin * dy, cos * dy - sin * dx)
        return total

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
            mean_heights=checked_means(mean_heights, patches),
            hertz=self.contacts.hertz,
            contact_modulus=self.contact_modulus,
            body=self.contacts.points,
        )


def asperity_model(
    name: str,
    asperities: Asperities,
    *,
    contact_modulus: float,
    solver: str = "active-set",
    pairs: str = "auto",
    body: BodyModes | None = None,
) -> AsperityModel:
    """Return the model of a given name on some asperities.

    Args:
        name: A name in `MODELS`.
        asperities: The summits.
        contact_modulus: E* [MPa].
        solver: A name in `SOLVERS`, for the models with interaction.
        pairs: A name in `PAIR_SUMS` or ``"auto"``, for the models with interaction.
        body: What a finite body adds to the half-space.

    Raises:
        InputError: When a name is unknown or the modulus not positive.
    """
    _known(name, MODELS, "micro model")
    return AsperityModel(
        asperities=asperities,
        contact_modulus=contact_modulus,
        solver=solver,
        pairs=pairs,
        body=body,
        **MODELS[name]._asdict(),
    )


def _known(name: str, table: Collection[str], what: str) -> None:
    if name not in table:
        raise InputError(f"this {what} is unknown", value=name, allowed=", ".join(table))
