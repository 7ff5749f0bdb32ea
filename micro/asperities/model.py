"""The four asperity models: elliptic or circular contacts, with or without interaction.

Theory: docs/theory.md, sections 8 and 9.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, PatchGrid
from geometry.rigid_plane import RigidPlane, normal_stiffness
from micro.asperities.contacts import SOLVERS, AsperityContacts, Equilibrium, ModelKind
from micro.asperities.hertz_pairs import BodyPoints
from micro.asperities.patch_sums import EllipticContacts, patch_displacements, patch_loads
from micro.closed_forms.hertz import checked_modulus
from micro.compliance.body_modes import BodyModes
from micro.contact_detail import ContactDetail
from micro.model import Pressed, Response, Stiffness, checked_approaches, checked_patches
from support.errors import InputError

Array = NDArray[np.float64]

LARGEST_AREA_FRACTION = 0.1
"""Contact area fraction up to which summits count as separate; errors may be large before."""

MODELS: Mapping[str, ModelKind] = MappingProxyType(
    {
        "elliptic": ModelKind(elliptic=True, interacting=True),
        "circular": ModelKind(elliptic=False, interacting=True),
        "elliptic-independent": ModelKind(elliptic=True, interacting=False),
        "circular-independent": ModelKind(elliptic=False, interacting=False),
    }
)
"""The models (1) to (4) of Waddad et al. 2016, section 2.2, by name."""


class ContactState(NamedTuple):
    """Contacts in equilibrium with a plane.

    Attributes:
        start: The solution, which one for a load step nearby may start from.
        contacts: The n contacts that there may be; those without force do not touch.
    """

    start: Equilibrium
    contacts: EllipticContacts

    @property
    def plane(self) -> RigidPlane:
        """The plane."""
        return self.start.plane

    @property
    def iterations(self) -> int:
        """Iterations of the solver."""
        return self.start.solution.iterations

    @property
    def residual(self) -> float:
        """Complementarity error relative to the largest interference."""
        return self.start.solution.residual

    @property
    def touching(self) -> EllipticContacts:
        """The contacts that carry force."""
        return self.contacts.subset(np.flatnonzero(self.contacts.force > 0.0))

    @property
    def peak_pressure(self) -> float:
        """Largest pressure of a contact [MPa]."""
        return float(self.detail.peak_pressure.max(initial=0.0))

    @property
    def detail(self) -> ContactDetail:
        """The contacts as spots, with Hertz's pressures; fields are not known."""
        spots = self.touching
        return ContactDetail(
            place=spots.position,
            area=spots.area,
            force=spots.force,
            peak_pressure=1.5 * spots.force / spots.area,
        )


@dataclass(frozen=True, eq=False)
class AsperityModel:
    """One of the four asperity models: a rigid plane touches given summits in separate ellipses.

    Args:
        kind: Name in `MODELS`.
        asperities: The n summits, with the highest point z_M that the approach counts from.
        contact_modulus: E* [MPa].
        solver: Solver of the models with interaction, a name in `SOLVERS`.
        body: What a finite body with its sides adds to the half-space, between all contacts; a
            half-space when not given.

    Raises:
        InputError: When a name is unknown or the modulus not positive.

    Source:
        Waddad et al. 2016, section 1.2, doi 10.1016/j.triboint.2015.12.023.
    """

    kind: str
    asperities: Asperities
    contact_modulus: float = field(kw_only=True)
    solver: str = field(default="active-set", kw_only=True)
    body: BodyModes | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)
        _checked_name(self.kind, MODELS, "micro model")
        _checked_name(self.solver, SOLVERS, "solver")

    @property
    def name(self) -> str:
        """Name of the model in `MODELS`."""
        return self.kind

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.asperities.highest

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]; infinite without asperities."""
        return float(self.reference_height - self.asperities.z.max(initial=-np.inf))

    @cached_property
    def contacts(self) -> AsperityContacts:
        """The contacts of the asperities."""
        return AsperityContacts(
            asperities=self.asperities,
            contact_modulus=self.contact_modulus,
            kind=MODELS[self.kind],
            solver=self.solver,
            body=self.body,
        )

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`."""
        own = patches.index_of(self.asperities.x, self.asperities.y) == index
        alone = replace(self, asperities=self.asperities.subset(own), body=None)
        return alone, patches.single(index)

    def equilibrium(self, control: Control, start: Equilibrium | None = None) -> ContactState:
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
        found = self.contacts.equilibrium(control, start)
        return ContactState(found, self.contacts.ellipses(found.solution.indentation))

    def solve(
        self,
        approach: float,
        *,
        tilt: tuple[float, float] = (0.0, 0.0),
        start: Equilibrium | None = None,
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
        tilt: tuple[float, float] = (0.0, 0.0),
    ) -> Response:
        """Solve along approaches, each from the solutions before it; see `MicroModel.respond`."""
        patches, means = checked_patches(self.asperities, patches, mean_heights)
        given = checked_approaches(approaches)
        rows: list[dict[str, Any]] = [{}] * len(given)
        last = before = None
        for index in np.argsort(given, kind="stable"):
            state = self.solve(float(given[index]), tilt=tilt, start=_extrapolated(last, before))
            last, before = state.start, last
            rows[index] = self._row(state, patches, means)
        return Response.of(rows, self.name, self.contact_modulus, patches)

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Equilibrium | None = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        patches, means = checked_patches(self.asperities, patches, mean_heights)
        state = self.equilibrium(control, start)
        rows = [self._row(state, patches, means)]
        response = Response.of(rows, self.name, self.contact_modulus, patches)
        return Pressed(response, state.plane, state.start, state)

    def stiffness(self, state: ContactState, *, turns: bool) -> Stiffness:
        """Return dF/dδ by the tangent of the contacts; see `MicroModel.stiffness`."""
        indentation = state.start.solution.indentation
        return Stiffness(normal_stiffness(self.contacts.tangent(indentation), turns=turns), 1)

    def _row(self, state: ContactState, patches: Partition, mean_heights: Array) -> dict[str, Any]:
        """Return the fields of a response for one plane.

        By `patch_loads` a contact that straddles borders is shared among patches. As a contact it
        counts for the patch that holds its summit. The paper assigns it whole.
        """
        plane, solution, contacts = state.plane, state.start.solution, state.touching
        force, area = contacts.force, contacts.area.sum()
        displacement = patch_displacements(patches, contacts, self.contact_modulus)
        if self.body is not None:
            points = BodyPoints.at(self.body, contacts.x, contacts.y)
            displacement = displacement + points.patch_means(patches, force)
        below = self.reference_height - plane.means(patches)
        separation = below - mean_heights + displacement
        patch_force, patch_area = patch_loads(patches, contacts)
        owner = patches.index_of(contacts.x, contacts.y)
        return {
            "approach": plane.approach,
            "force": force.sum(),
            "moment": plane.moment(contacts.x, contacts.y, force),
            "contact_area": area,
            "contacts": len(force),
            "mean_separation": np.average(separation, weights=patches.areas),
            "iterations": solution.iterations,
            "residual": solution.residual,
            "overlapping_contacts": solution.overlapping_contacts,
            "patch_force": patch_force,
            "patch_contact_area": patch_area,
            "patch_contacts": np.bincount(owner, minlength=patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": self._warning(state, len(force), float(area / np.prod(patches.sides))),
        }

    def _warning(self, state: ContactState, contacts: int, area_fraction: float) -> str:
        """Return why contacts are too large to count as separate; empty while they are not."""
        # A single contact, in a small patch say, is Hertz's at any area.
        single = contacts + state.start.solution.overlapping_contacts <= 1
        if area_fraction <= LARGEST_AREA_FRACTION or single:
            return ""
        return (
            f"at an approach of {state.plane.approach:.4g} mm the contacts cover"
            f" {area_fraction:.1%} of the surface: the model {self.name} of separate summits stands"
            f" for up to {LARGEST_AREA_FRACTION:.0%}"
        )


def _extrapolated(last: Equilibrium | None, before: Equilibrium | None) -> Equilibrium | None:
    """Return what to start from; with equal steps it is right to second order."""
    if last is None:
        return None
    own = last.solution.indentation
    gained = own if before is None else own - before.solution.indentation
    ahead = np.maximum(own + gained, 0.0)
    return last._replace(solution=last.solution._replace(indentation=ahead))


def _checked_name(name: str, table: Collection[str], what: str) -> None:
    if name not in table:
        raise InputError(f"this {what} is unknown", value=name, allowed=", ".join(table))
