"""The four asperity models: elliptic or circular contacts, with or without interaction.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Self

import numpy as np

from geometry import Asperities, Control, PatchGrid
from geometry.errors import InputError
from geometry.rigid_plane import normal_stiffness
from micro.asperities.contacts import SOLVERS, AsperityContacts, Equilibrium, ModelKind
from micro.interaction.contact_model import ContactModel, ContactState
from micro.interaction.patch_sums import EllipticContacts
from micro.model import Stiffness

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


@dataclass(frozen=True, kw_only=True, eq=False)
class SummitModel(ContactModel):
    """Any of the four asperity models; see `ContactModel` for further fields.

    Args:
        kind: Name in `MODELS`.
        solver: Solver of the models with interaction, a name in `SOLVERS`.

    Raises:
        InputError: When a name is unknown or the modulus not positive.
    """

    kind: str
    solver: str = "active-set"

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_name(self.kind, MODELS, "micro model")
        checked_name(self.solver, SOLVERS, "solver")

    def contacts_of(self, asperities: Asperities) -> AsperityContacts:
        """Return the contacts of some asperities."""
        return AsperityContacts(
            asperities=asperities,
            contact_modulus=self.contact_modulus,
            kind=MODELS[self.kind],
            solver=self.solver,
            body=self.body,
        )

    def touch_of(self, asperities: Asperities) -> float:
        """Return the approach of a level plane at first contact with asperities [mm]."""
        return float(self.reference_height - asperities.z.max(initial=-np.inf))

    def state_of(
        self, contacts: AsperityContacts, found: Equilibrium, summits: Asperities
    ) -> ContactState:
        """Return the contacts of a solution.

        Args:
            contacts: The contacts of n asperities.
            found: Their solution.
            summits: The asperities whose places decide which patch a contact counts for.
        """
        a, hertz, solution = contacts.asperities, contacts.hertz, found.solution
        semi_axes = np.stack([hertz.semi_major, hertz.semi_minor], axis=1)
        ellipses = EllipticContacts(
            x=a.x,
            y=a.y,
            angle=a.angle,
            semi_axes=semi_axes * np.sqrt(solution.indentation)[:, None],
            force=hertz.force * solution.indentation**1.5,
        )
        return ContactState(
            plane=found.plane,
            contacts=ellipses,
            summits=np.stack([summits.x, summits.y], axis=1),
            iterations=solution.iterations,
            residual=solution.residual,
            overlapping_contacts=solution.overlapping_contacts,
            start=found,
        )

    def warning(self, state: ContactState, area_fraction: float) -> str:
        """Return why contacts are too large to count as separate; see `ContactModel.warning`."""
        # A single contact, in a small patch say, is Hertz's at any area.
        single = len(state.contacts.force) + state.overlapping_contacts <= 1
        if area_fraction <= LARGEST_AREA_FRACTION or single:
            return ""
        return (
            f"at an approach of {state.plane.approach:.4g} mm the contacts cover"
            f" {area_fraction:.1%} of the surface: the model {self.name} of separate summits stands"
            f" for up to {LARGEST_AREA_FRACTION:.0%}"
        )


@dataclass(frozen=True, eq=False)
class AsperityModel(SummitModel):
    """One of the four asperity models on given asperities; see `SummitModel` for further fields.

    Args:
        kind: Name in `MODELS`.
        asperities: The n summits, with the highest point z_M that the approach counts from.

    Source:
        Waddad et al. 2016, section 1.2, doi 10.1016/j.triboint.2015.12.023.
    """

    kind: str = field(kw_only=False)
    asperities: Asperities = field(kw_only=False)

    @property
    def name(self) -> str:
        """Name of the model in `MODELS`."""
        return self.kind

    @property
    def rough(self) -> Asperities:
        """The asperities."""
        return self.asperities

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]; infinite without asperities."""
        return self.touch_of(self.asperities)

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`."""
        own = patches.index_of(self.asperities.x, self.asperities.y) == index
        alone = replace(self, asperities=self.asperities.subset(own), body=None)
        return alone, patches.single(index)

    @cached_property
    def contacts(self) -> AsperityContacts:
        """The contacts of the asperities."""
        return self.contacts_of(self.asperities)

    def equilibrium(self, control: Control, start: Equilibrium | None = None) -> ContactState:
        """Solve for contacts and plane; see `ContactModel.equilibrium`."""
        found = self.contacts.equilibrium(control, start)
        return self.state_of(self.contacts, found, self.asperities)

    def stiffness(self, state: ContactState, *, turns: bool) -> Stiffness:
        """Return dF/dδ by the tangent of the contacts; see `MicroModel.stiffness`."""
        indentation = state.start.solution.indentation
        return Stiffness(normal_stiffness(self.contacts.tangent(indentation), turns=turns), 1)

    def extrapolated(
        self, last: Equilibrium | None, before: Equilibrium | None
    ) -> Equilibrium | None:
        """Return what to start from; with equal steps it is right to second order."""
        if last is None:
            return None
        own = last.solution.indentation
        gained = own if before is None else own - before.solution.indentation
        ahead = np.maximum(own + gained, 0.0)
        return last._replace(solution=last.solution._replace(indentation=ahead))


def checked_name(name: str, table: Collection[str], what: str) -> None:
    """Refuse a name that is not in a table.

    Raises:
        InputError: When it is not.
    """
    if name not in table:
        raise InputError(f"this {what} is unknown", value=name, allowed=", ".join(table))
