"""Models of separate contacts under a rigid plane: what asperities and islands have in common.

Each contact is an ellipse with Hertz's pressure. A model finds the contacts and the plane; what
follows from them, the loads of the plane and the sums over patches, is the same for all models.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, Surface
from geometry.rigid_plane import RigidPlane
from micro.closed_forms.hertz import checked_modulus
from micro.compliance.body_modes import BodyModes
from micro.contact_detail import ContactDetail
from micro.interaction.hertz_pairs import BodyPoints
from micro.interaction.patch_sums import EllipticContacts, patch_displacements, patch_loads
from micro.model import Pressed, Response, Stiffness, checked_approaches, checked_patches

Array = NDArray[np.float64]

LEVEL = (0.0, 0.0)
"""Slopes of a level plane."""


class ContactState(NamedTuple):
    """Contacts in equilibrium with a plane.

    Attributes:
        plane: The plane.
        contacts: The m contacts that there may be; those without force do not touch.
        summits: Points (x, y) where a contact counts for a patch, shape (m, 2) [mm].
        iterations: Iterations of the solver.
        residual: Complementarity error relative to the largest interference.
        overlapping_contacts: Number of pairs of contacts that have grown into each other.
        start: Initial guess of the same model for a load step nearby.
        shape: What only the model that found the contacts knows about their shape.
    """

    plane: RigidPlane
    contacts: EllipticContacts
    summits: Array
    iterations: int
    residual: float
    overlapping_contacts: int
    start: Any
    shape: Any = None

    @property
    def touching(self) -> ContactState:
        """The same without the contacts that carry no force."""
        index = np.flatnonzero(self.contacts.force > 0.0)
        return self._replace(contacts=self.contacts.subset(index), summits=self.summits[index])

    @property
    def peak_pressure(self) -> float:
        """Largest pressure of a contact [MPa]."""
        return float(self.detail.peak_pressure.max(initial=0.0))

    @property
    def detail(self) -> ContactDetail:
        """The contacts as spots, with Hertz's pressures; fields are not known."""
        spots = self.touching.contacts
        return ContactDetail(
            place=spots.position,
            area=spots.area,
            force=spots.force,
            peak_pressure=1.5 * spots.force / spots.area,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactModel(ABC):
    """A rough surface that a rigid plane touches in separate ellipses.

    Args:
        contact_modulus: E* [MPa].
        body: What a finite body with its sides adds to the half-space, between all contacts; a
            half-space when not given.

    Raises:
        InputError: When the modulus is not positive.
    """

    contact_modulus: float
    body: BodyModes | None = None

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the model."""

    @property
    @abstractmethod
    def rough(self) -> Surface | Asperities:
        """The surface or its asperities."""

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.rough.highest

    @abstractmethod
    def equilibrium(self, control: Control, start: Any = None) -> ContactState:
        """Solve for the contacts, and the motions of the plane that are free.

        Args:
            control: What is prescribed of the plane.
            start: `ContactState.start` of a solution nearby; without it the solution starts from
                no contact.

        Raises:
            InputError: When the start does not fit, or the interaction of all contacts does not
                fit into the memory.
            NotConverged: When the contact conditions cannot be met, or no plane is in equilibrium.
        """

    @abstractmethod
    def warning(self, state: ContactState, area_fraction: float) -> str:
        """Return why a result lies outside the model's range of validity; empty within it.

        Args:
            state: The contacts.
            area_fraction: Real over nominal contact area.
        """

    def patch_loads(self, state: ContactState, patches: Partition) -> tuple[Array, Array]:
        """Return the forces [N] and contact areas [mm²] of N patches, shape (N,) each.

        Args:
            state: The contacts; those across a border are shared.
            patches: The patches.
        """
        return patch_loads(patches, state.contacts)

    def solve(
        self, approach: float, *, tilt: tuple[float, float] = LEVEL, start: Any = None
    ) -> ContactState:
        """Solve for the contacts at one approach of the plane; see `equilibrium`.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).
            start: `ContactState.start` of a solution nearby.
        """
        return self.equilibrium(Control(approach=approach, tilt=tilt), start)

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = LEVEL,
    ) -> Response:
        """Solve along approaches, each from the solutions before it; see `MicroModel.respond`."""
        patches, means = checked_patches(self.rough, patches, mean_heights)
        given = checked_approaches(approaches)
        rows: list[dict[str, Any]] = [{}] * len(given)
        last = before = None
        for index in np.argsort(given, kind="stable"):
            control = Control(approach=float(given[index]), tilt=tilt)
            state = self.equilibrium(control, self.extrapolated(last, before))
            last, before = state.start, last
            rows[index] = self._row(state, patches, means)
        return Response.of(rows, self.name, self.contact_modulus, patches)

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        patches, means = checked_patches(self.rough, patches, mean_heights)
        state = self.equilibrium(control, start)
        rows = [self._row(state, patches, means)]
        response = Response.of(rows, self.name, self.contact_modulus, patches)
        return Pressed(response, state.plane, state.start, state)

    def stiffness(self, state: ContactState, *, turns: bool) -> Stiffness:
        """Return dF/dδ, which is not known here; see `MicroModel.stiffness`.

        The shapes of contacts that are fitted to the load change with it, too.
        """
        return Stiffness(None, 0)

    def extrapolated(self, last: Any, before: Any) -> Any:
        """Return what to start from after the last solution and the one before it.

        Args:
            last: `ContactState.start` of the last solution; None where there is none.
            before: That of the solution before, for an equally smaller approach.
        """
        return last

    def _row(self, state: ContactState, patches: Partition, mean_heights: Array) -> dict[str, Any]:
        """Return the fields of a response for one plane.

        By `patch_loads` a contact that straddles borders is shared among patches. As a contact it
        counts for the patch that holds its summit. The paper assigns it whole.
        """
        state = state.touching
        plane, contacts, force = state.plane, state.contacts, state.contacts.force
        displacement = patch_displacements(patches, contacts, self.contact_modulus)
        if self.body is not None:
            points = BodyPoints.at(self.body, contacts.x, contacts.y)
            displacement = displacement + points.patch_means(patches, force)
        below = self.reference_height - plane.means(patches)
        separation = below - mean_heights + displacement
        patch_force, patch_area = self.patch_loads(state, patches)
        owner = patches.index_of(*state.summits.T)
        area = contacts.area.sum()
        return {
            "approach": plane.approach,
            "force": force.sum(),
            "moment": plane.moment(contacts.x, contacts.y, force),
            "contact_area": area,
            "contacts": len(force),
            "mean_separation": np.average(separation, weights=patches.areas),
            "iterations": state.iterations,
            "residual": state.residual,
            "overlapping_contacts": state.overlapping_contacts,
            "patch_force": patch_force,
            "patch_contact_area": patch_area,
            "patch_contacts": np.bincount(owner, minlength=patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": self.warning(state, float(area / np.prod(patches.sides))),
        }


def first_guess(
    rough: Surface, control: Control, near: RigidPlane | None, *, approach: float
) -> RigidPlane:
    """Return a plane with the prescribed motions, and for the free ones those of a plane nearby.

    Args:
        rough: The surface under the plane.
        control: What is prescribed.
        near: A plane in equilibrium nearby.
        approach: Approach to take where neither says one [mm].
    """
    if near is not None:
        approach = near.approach
    if control.approach is not None:
        approach = control.approach
    tilt = control.tilt or (LEVEL if near is None else near.tilt)
    return RigidPlane.above(rough, approach, tilt)
