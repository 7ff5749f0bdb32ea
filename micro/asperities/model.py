"""The four asperity models: elliptic or circular contacts, with or without interaction.

Theory: docs/theory.md, sections 8 and 9.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry import Asperities, Control, PatchGrid
from patchlaw.geometry.contact_state import ContactState, Spots, Start
from patchlaw.geometry.rigid_plane import PlaneLevers, PlaneResponse, RigidPlane, way_of_approach
from patchlaw.micro.asperities.hertz_pairs import HertzPairs, Solution
from patchlaw.micro.asperities.model import Peaks, plane_stiffness, solve_summits
from patchlaw.micro.asperities.patch_sums import patch_displacements, patch_loads
from patchlaw.micro.boundary_elements.body_modes import BodyModes, BodyPoints
from patchlaw.micro.closed_forms.hertz import checked_modulus, shape_factors
from patchlaw.micro.model import NormalStiffness, checked_patches
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError

MODELS = ("elliptic", "circular", "elliptic-independent", "circular-independent")
"""The models (1) to (4) of Waddad et al. 2016, section 2.2: contacts are ellipses, or circles of
radius sqrt(R' R''), and displace each other's summits through the half-space or not."""


@dataclass(frozen=True, eq=False)
class AsperityModel:
    """One of the four asperity models: a rigid plane touches given summits in separate ellipses.

    Args:
        kind: Name in `MODELS`.
        asperities: The n summits, with the highest point z_M that the approach counts from.
        contact_modulus: E* [MPa].
        body: What a finite body with its sides adds to the half-space, between all contacts, also
            those of the models without interaction; a half-space when not given. On thin blocks it
            takes away from the interaction: models without any may then have no solution.

    Raises:
        InputError: When a name is unknown or the modulus not positive.

    Source:
        Waddad et al. 2016, section 1.2, doi 10.1016/j.triboint.2015.12.023.
    """

    kind: str
    asperities: Asperities
    contact_modulus: float = field(kw_only=True)
    body: BodyModes | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)
        if self.kind not in MODELS:
            allowed = ", ".join(MODELS)
            raise InputError("this micro model is unknown", value=self.kind, allowed=allowed)

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
    def pairs(self) -> HertzPairs:
        """The contacts of the asperities, and how they displace each other's summits."""
        a, elliptic = self.asperities, self.kind.startswith("elliptic")
        radii = (a.radius_major, a.radius_minor) if elliptic else (a.radius, a.radius)
        return HertzPairs(
            x=a.x,
            y=a.y,
            angle=a.angle,
            radius=a.radius,
            shape=shape_factors(*radii),
            circular=not elliptic,
            half_space=not self.kind.endswith("-independent"),
            body=None if self.body is None else BodyPoints.at(self.body, a.x, a.y),
            contact_modulus=self.contact_modulus,
        )

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`.

        Args:
            patches: Patches of the surface.
            index: Flat index of the patch.
        """
        own = patches.index_of(self.asperities.x, self.asperities.y) == index
        alone = replace(self, asperities=self.asperities.subset(own), body=None)
        return alone, patches.single(index)

    def quick_up_to(
        self, control: Control, error: float = 0.0, *, sums_alone: bool = False
    ) -> None:
        """Return that a solution may take long; see `MicroModel.quick_up_to`."""

    def press(
        self,
        control: Control,
        *,
        patches: PatchGrid | None = None,
        mean_heights: ArrayLike | None = None,
        start: Start | None = None,
    ) -> ContactState:
        """Solve the contacts and the free motions of the plane; see `MicroModel.press`.

        By `patch_loads` a contact that straddles borders is shared among patches. As a contact it
        counts for the patch that holds its summit. The paper assigns it whole.

        Args:
            control: What is prescribed of the plane.
            patches: N patches that results are summed over.
            mean_heights: Mean heights of the surface on the patches, which they need, (N,) [mm].
            start: A solution at another load to start from.

        Raises:
            InputError: Also when the interaction of all contacts does not fit into the memory.
        """
        patches, means = checked_patches(self.asperities, patches, mean_heights)
        plane, solution = self._equilibrium(control, start)
        touching = np.flatnonzero(solution.indentation > 0.0)
        contacts = self.pairs.subset(touching).ellipses(solution.indentation[touching])
        force, area = float(contacts.force.sum()), float(contacts.area.sum())
        displacement = patch_displacements(patches, contacts, self.contact_modulus)
        if self.body is not None:
            points = BodyPoints.at(self.body, contacts.x, contacts.y)
            displacement = displacement + points.patch_means(patches, contacts.force)
        separation = self.reference_height - plane.means(patches) - means + displacement
        patch_force, patch_area = patch_loads(patches, contacts)
        spots = Spots(
            place=contacts.position,
            area=contacts.area,
            force=contacts.force,
            peak_pressure=1.5 * contacts.force / contacts.area,
        )
        state = ContactState(
            plane=plane,
            patches=patches,
            force=force,
            moment=plane.moment(contacts.x, contacts.y, contacts.force),
            contact_area=area,
            contacts=len(spots),
            peak_pressure=float(spots.peak_pressure.max(initial=0.0)),
            mean_separation=float(np.average(separation, weights=patches.areas)),
            iterations=solution.iterations,
            residual=solution.residual,
            overlapping_contacts=solution.overlapping_contacts,
            patch_force=patch_force,
            patch_area=patch_area,
            patch_contacts=spots.per_patch(patches),
            patch_displacement=displacement,
            patch_separation=separation,
            spots=spots,
            indentation=solution.indentation,
        )
        return replace(state, warning=self._warning(state))

    def stiffness(self, state: ContactState, *, turns: bool) -> NormalStiffness:
        """Return dF/dδ by the tangent of the contacts; see `MicroModel.stiffness`.

        Args:
            state: A solution of this model.
            turns: Whether the plane turns without moment.
        """
        tangent = plane_stiffness(self.pairs, state.guess.values, self._peaks.modes.matrix)
        approach = float(tangent[0] @ way_of_approach(tangent, turns=turns))
        return NormalStiffness(approach=approach, iterations=1)

    @property
    def _peaks(self) -> Peaks:
        """The summits under the plane; not cached, because models are sent between processes."""
        a = self.asperities
        modes = PlaneLevers.at(a.x, a.y, a.lengths)
        return Peaks(modes=modes, depth=a.highest - a.z, force=self.pairs.force(np.ones(len(a))))

    def _equilibrium(self, control: Control, start: Start | None) -> tuple[RigidPlane, Solution]:
        """Solve the contacts, and the motions of the plane that are free."""
        asperities, pairs = self.asperities, self.pairs
        own = np.zeros(len(asperities)) if start is None else start.values
        if own.shape != (len(asperities),):
            raise InputError(
                "the solution to start from is of other asperities",
                value=own.shape,
                allowed=f"({len(asperities)},)",
            )
        if control.approach is not None and control.tilt is not None:
            plane = RigidPlane.above(asperities, control.approach, control.tilt)
            return plane, solve_summits(pairs, asperities.interference(plane), own)
        useful = start is not None and (own.any() or control.force == 0.0)
        peaks, spent = self._peaks, 0

        def respond(motion: Array) -> PlaneResponse[Solution]:
            nonlocal own, spent
            interference = asperities.interference(RigidPlane.moved(asperities, motion))
            solution = solve_summits(pairs, interference, own)
            own, spent = solution.indentation, spent + solution.iterations
            return PlaneResponse(
                loads=peaks.modes.loads(pairs.force(own)),
                stiffness=lambda: plane_stiffness(pairs, solution.indentation, peaks.modes.matrix),
                state=solution._replace(iterations=spent),
            )

        near = start.plane if start is not None and useful else None
        motion, solution = peaks.equilibrium(respond, control, near)
        return RigidPlane.moved(asperities, motion), solution

    def _warning(self, state: ContactState) -> str:
        """Return why contacts are too large to count as separate; empty while they are not."""
        # A single contact, in a small patch say, is Hertz's at any area.
        single = state.contacts + state.overlapping_contacts <= 1
        fraction, largest = state.contact_area_fraction, 0.1  # errors may be large before
        if fraction <= largest or single:
            return ""
        return (
            f"at an approach of {state.approach:.4g} mm the contacts cover {fraction:.1%} of the"
            f" surface: the model {self.name} of separate summits stands for up to"
            f" {largest:.0%}"
        )
