"""The four asperity models: elliptic or circular contacts, with or without interaction.

A rigid plane that has approached by δ interferes with every summit by d_k = <δ(x_k) − (z_M − z_k)>.
Without interaction each contact makes this displacement alone, w_k = d_k. With interaction the
displacements by all contacts add up to w_k (`micro.interaction.contact_problem`).

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, PatchGrid
from geometry.errors import InputError
from geometry.plane_equilibrium import PlaneResponse
from geometry.rigid_plane import PlaneLevers, RigidPlane
from micro.asperities.contacts import AsperityContacts, AsperityState, checked_name
from micro.asperities.patch_shares import shares
from micro.compliance.body_modes import BodyModes
from micro.interaction.contact_problem import Solution
from micro.model import checked_approaches, checked_patches
from micro.patch_sums import EllipticContacts, PatchSums
from micro.plane_on_peaks import Peaks
from micro.response import Pressed, Response

Array = NDArray[np.float64]

LARGEST_AREA_FRACTION = 0.1
"""Contact area fraction up to which summits count as separate; errors may be large before."""

_LEVEL = (0.0, 0.0)


class Equilibrium(NamedTuple):
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
class AsperityModel(AsperityContacts):
    """One of the four asperity models on given asperities; see `AsperityContacts` for its fields.

    Source:
        Waddad et al. 2016, section 1.2, doi 10.1016/j.triboint.2015.12.023.
    """

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
            InputError: When the approach or the tilt is not finite, or the interaction of all
                contacts does not fit into the memory.
            NotConverged: When the contact conditions cannot be met to 1e-10.
        """
        plane = RigidPlane.above(self.asperities, approach, tilt)
        first = np.zeros(len(self.asperities)) if start is None else start.indentation
        return self.state(plane, self.solution(self.asperities.interference(plane), first))

    def state(self, plane: RigidPlane, solution: Solution) -> AsperityState:
        """Return the contacts of a solution under a plane."""
        own, hertz = solution.indentation, self.hertz
        return AsperityState(
            approach=plane.approach,
            interference=np.maximum(self.asperities.interference(plane), 0.0),
            displacement=self.displacement(own),
            indentation=own,
            semi_axes=hertz.semi_axes * np.sqrt(own)[:, None],
            contact_area=hertz.area * own,
            force=hertz.force * own**1.5,
            peak_pressure=hertz.peak_pressure * np.sqrt(own),
            overlapping_contacts=solution.overlapping_contacts,
            iterations=solution.iterations,
            residual=solution.residual,
        )

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = _LEVEL,
    ) -> Response:
        """Solve along approaches, each from the solution before it; see `MicroModel.respond`."""
        given = checked_approaches(approaches)
        sums = PatchSums(self, *checked_patches(self.asperities, patches, mean_heights))
        owner = sums.patches.index_of(self.asperities.x, self.asperities.y)
        rows: dict[int, dict[str, Any]] = {}
        own: Array = np.zeros(len(self.asperities))
        before = own
        for index in np.argsort(given, kind="stable"):
            plane = RigidPlane.above(self.asperities, given[index], tilt)
            # With equal steps, linear extrapolation is right to second order.
            start = np.maximum(2.0 * own - before, 0.0)
            solution = self.solution(self.asperities.interference(plane), start)
            own, before = solution.indentation, own
            rows[int(index)] = self.row(Equilibrium(plane, solution), sums, owner)
        return sums.response([rows[index] for index in range(len(given))])

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        sums = PatchSums(self, *checked_patches(self.asperities, patches, mean_heights))
        owner = sums.patches.index_of(self.asperities.x, self.asperities.y)
        found = self.equilibrium(control, start)
        response = sums.response([self.row(found, sums, owner)])
        return Pressed(response, found.plane, found)

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
            contact = self.contact(state.indentation[k], int(k))
            dx, dy = np.asarray(x, float) - a.x[k], np.asarray(y, float) - a.y[k]
            cos, sin = np.cos(a.angle[k]), np.sin(a.angle[k])
            total += contact.displacement(cos * dx + sin * dy, cos * dy - sin * dx)
        return total

    def row(
        self,
        found: Equilibrium,
        sums: PatchSums,
        owner: NDArray[np.intp],
    ) -> dict[str, Any]:
        """Return the fields of a response for one plane.

        A contact that straddles borders is shared among patches by the integral of its pressure
        (`micro.asperities.patch_shares`); as a contact it counts for the patch that holds its
        summit. The paper assigns it whole.

        Args:
            found: The plane and the contacts under it.
            sums: The sums over patches, of this model or of one that fits its asperities anew.
            owner: Flat index of the patch that holds each summit, shape (n,).
        """
        (plane, solution), a, hertz = found, self.asperities, self.hertz
        on = np.flatnonzero(solution.indentation > 0.0)
        t = solution.indentation[on]
        contacts = EllipticContacts(
            position=np.stack([a.x[on], a.y[on]], axis=1),
            angle=a.angle[on],
            semi_axes=hertz.semi_axes[on] * np.sqrt(t)[:, None],
            area=hertz.area[on] * t,
            force=hertz.force[on] * t**1.5,
        )
        share = shares(sums.patches, contacts.position, contacts.semi_axes, contacts.angle)
        fraction = contacts.area.sum() / np.prod(sums.patches.sides)
        warning = ""
        # A single contact, in a small patch say, is Hertz's at any area.
        if fraction > LARGEST_AREA_FRACTION and len(on) + solution.overlapping_contacts > 1:
            warning = (
                f"at an approach of {plane.approach:.4g} mm the contacts cover {fraction:.1%} of"
                f" the surface: the model {sums.model.name} of separate summits stands for up to"
                f" {LARGEST_AREA_FRACTION:.0%}"
            )
        return sums.row(
            plane,
            contacts,
            owner[on],
            patch_force=share.sums(share.force, contacts.force, sums.patches),
            patch_contact_area=share.sums(share.area, contacts.area, sums.patches),
            iterations=solution.iterations,
            residual=solution.residual,
            overlapping_contacts=solution.overlapping_contacts,
            warning=warning,
        )


def asperity_model(
    name: str,
    asperities: Asperities,
    *,
    contact_modulus: float,
    solver: str = "active-set",
    body: BodyModes | None = None,
) -> AsperityModel:
    """Return the model of a given name on some asperities.

    Args:
        name: A name in `MODELS`.
        asperities: The summits.
        contact_modulus: E* [MPa].
        solver: A name in `SOLVERS`, for the models with interaction.
        body: What a finite body adds to the half-space.

    Raises:
        InputError: When a name is unknown or the modulus not positive.
    """
    checked_name(name, MODELS, "micro model")
    return AsperityModel(
        asperities=asperities,
        contact_modulus=contact_modulus,
        solver=solver,
        body=body,
        **MODELS[name]._asdict(),
    )
