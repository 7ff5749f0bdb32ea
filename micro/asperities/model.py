"""The four asperity models: elliptic or circular contacts, with or without interaction.

A rigid plane that has approached by δ interferes with every summit by d_k = <δ(x_k) − (z_M − z_k)>.
Without interaction each contact makes this displacement alone, w_k = d_k. With interaction the
displacements by all contacts add up to w_k (`micro.asperities.hertz_pairs`).

The search for the plane's equilibrium is that of `geometry.rigid_plane`. Contacts are few and
cheap alone, so that contacts that do not displace each other give a start close to the solution.

Theory: docs/theory.md, sections 8 and 9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self, TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry import Asperities, Control, PatchGrid, RigidPlane, Surface, find_asperities
from patchlaw.geometry.contact_state import ContactState, Spots, Start
from patchlaw.geometry.rigid_plane import (
    PlaneLevers,
    PlaneResponse,
    find_equilibrium,
    plane_failure,
    way_of_approach,
)
from patchlaw.micro.asperities.hertz_pairs import (
    HertzPairs,
    Solution,
    SummitProblem,
    check_pairs,
    patch_displacements,
    patch_loads,
    solve,
)
from patchlaw.micro.boundary_elements.body_modes import BodyModes, BodyPoints
from patchlaw.micro.closed_forms import checked_modulus, shape_factors
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.micro.model import MicroModel, NormalStiffness, checked_patches
from patchlaw.support import Array, InputError

T = TypeVar("T")


def solve_summits(pairs: HertzPairs, interference: Array, start: Array) -> Solution:
    """Solve for the summits above the plane.

    These are the undisplaced summits above it, and those that the body raises above it. The
    interaction is summed over all pairs: time and memory grow with the square of their number.

    Args:
        pairs: The n asperities.
        interference: Depth of the plane below each undisplaced summit, negative for summits below
            the plane, shape (n,) [mm].
        start: First guess of the indentations, shape (n,) [mm].

    Raises:
        InputError: When the interaction of so many summits does not fit into the memory.
        NotConverged: When the contact conditions cannot be met to 1e-10.
    """
    if not pairs.interact:
        return Solution(np.maximum(interference, 0.0), 0, 0.0, 0)
    above = np.flatnonzero(interference > 0.0)
    own, spent = np.zeros_like(interference), 0
    if above.size == 0:
        return Solution(own, 0, 0.0, 0)
    while True:
        check_pairs(len(above))
        problem = SummitProblem(
            interaction=pairs.subset(above).evaluate, interference=interference[above]
        )
        solved = solve(problem, start[above])
        own[above] = solved.indentation
        spent += solved.iterations
        if pairs.body is None:
            break
        # Through the half-space contacts only press summits down; a body can raise them.
        raised = interference - pairs.body.displacement(pairs.force(own)) > 0.0
        raised[above] = False
        if not raised.any():
            break
        above, start = np.sort(np.append(above, np.flatnonzero(raised))), own
    return solved._replace(indentation=own, iterations=spent)


def plane_stiffness(pairs: HertzPairs, indentation: Array, modes: Array) -> Array:
    """Return the derivative of the loads on a rigid plane by its motions, shape (k, k).

    Args:
        pairs: The n asperities.
        indentation: Indentations of their contacts, shape (n,) [mm].
        modes: Displacements of the summits by unit motions, shape (n, k).
    """
    active = np.flatnonzero(indentation > 0.0)
    touching, t, moved = pairs.subset(active), indentation[active], modes[active]
    rate, own = 1.5 * touching.force(t) / t, moved
    if pairs.interact:
        own = np.linalg.solve(np.eye(len(active)) + touching.evaluate(t).derivative, moved)
    return np.asarray(moved.T @ (rate[:, None] * own))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """Points that a rigid plane can touch, each by Hertz's law, without displacing the others.

    Args:
        modes: Rigid-body modes of the plane at the n points.
        depth: Depths below the height that approaches count from, shape (n,) [mm].
        force: Forces of the points alone, indented by 1 mm, shape (n,) [N].
    """

    modes: PlaneLevers
    depth: Array
    force: Array

    def equilibrium(
        self,
        respond: Callable[[Array], PlaneResponse[T]],
        control: Control,
        near: RigidPlane | None = None,
    ) -> tuple[Array, T]:
        """Find the plane in equilibrium with contacts on these points.

        Args:
            respond: Returns what the contacts do to a plane (3,), and their state.
            control: What is prescribed.
            near: A plane in equilibrium nearby.

        Returns:
            The plane, shape (3,), and the state of the contacts.

        Raises:
            NotConverged: When no plane is in equilibrium, or ``respond`` fails at first touch.
        """
        start = self._first_plane(control, near)
        touch = self.modes.first_touch(self.depth, start[1:])
        half = self.modes.half
        # the contact conditions themselves are met to 1e-10
        return find_equilibrium(respond, control, start, half, aim=1e-9, first_touch=touch)

    def _first_plane(self, control: Control, near: RigidPlane | None) -> Array:
        """Return a plane to start from: one near, or one that suits contacts that stand alone.

        It is approach and slopes, shape (3,).
        """
        tilt = control.tilt
        if tilt is None and near is not None:
            nearer = (control.approach or np.inf) >= near.approach
            tilt = near.tilt if nearer or control.force == 0.0 else None
        if tilt is None:
            tilt = (0.0, 0.0) if control.force == 0.0 else self._resting(control)
        if control.approach is not None:
            return np.array([control.approach, *tilt])
        touch = self.modes.first_touch(self.depth, tilt)
        if not np.isfinite(touch):
            raise plane_failure(control, "NO_CONTACT")
        if near is not None and control.force and near.approach > touch:
            return np.array([near.approach, *tilt])
        return np.array([touch + self._depth(control.force or 0.0, tilt), *tilt])

    def _depth(self, force: float, tilt: tuple[float, float]) -> float:
        """Return how far a plane of given slopes moves from first touch under a force [mm]."""
        if force == 0.0:
            return 0.0
        gap = self.depth - self.modes.matrix[:, 1:] @ np.asarray(tilt)
        gap = gap - gap.min()

        def residual(depth: float) -> float:
            return float(self.force @ np.maximum(depth - gap, 0.0) ** 1.5) - force

        most = 1e-6 * self.modes.half
        while residual(most) < 0.0:
            most *= 4.0
        return float(scipy.optimize.brentq(residual, 0.0, most, rtol=1e-3))

    def _resting(self, control: Control) -> tuple[float, float]:
        """Return the slopes of a plane that rests on the rigid peaks under a force in the centre.

        Of all planes that penetrate no peak it is the one with the largest approach, found by a
        linear programme. Where the approach is prescribed, it need not be much larger than that.
        """
        if not len(self.depth):
            return 0.0, 0.0
        scale = float(np.ptp(self.depth)) or 1.0
        most = None if control.approach is None else control.approach / scale + 1.0
        programme = scipy.optimize.linprog(
            [-1.0, 0.0, 0.0],
            A_ub=self.modes.matrix / [1.0, self.modes.half, self.modes.half],
            b_ub=self.depth / scale,
            bounds=[(None, most), (None, None), (None, None)],
            method="highs",
        )
        if programme.status != 0:  # the centre lies outside of the peaks' hull
            raise plane_failure(control, "NO_EQUILIBRIUM")
        slopes = programme.x[1:] * (scale / self.modes.half)
        return float(slopes[0]), float(slopes[1])


MODELS = ("elliptic", "circular", "elliptic-independent", "circular-independent")
"""The models (1) to (4) of Waddad et al. 2016, section 2.2: contacts are ellipses, or circles of
radius sqrt(R' R''), and displace each other's summits through the half-space or not."""
MODEL_NAMES = (*MODELS, "half-space")
"""Names of all micro models."""


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
        peaks, share = 1.5 * contacts.force / contacts.area, area / float(np.prod(patches.lengths))
        spots = Spots(
            place=contacts.position, area=contacts.area, force=contacts.force, peak_pressure=peaks
        )
        return ContactState(
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
            warning=self._warning(plane, share, len(spots), solution),
            patch_force=patch_force,
            patch_area=patch_area,
            patch_contacts=spots.per_patch(patches),
            patch_displacement=displacement,
            patch_separation=separation,
            spots=spots,
            indentation=solution.indentation,
        )

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

    def _warning(
        self, plane: RigidPlane, fraction: float, contacts: int, solution: Solution
    ) -> str:
        """Return why contacts are too large to count as separate; empty while they are not."""
        # A single contact, in a small patch say, is Hertz's at any area.
        single = contacts + solution.overlapping_contacts <= 1
        largest = 0.1  # errors may be large before
        if fraction <= largest or single:
            return ""
        return (
            f"at an approach of {plane.approach:.4g} mm the contacts cover {fraction:.1%} of the"
            f" surface: the model {self.name} of separate summits stands for up to"
            f" {largest:.0%}; micro.model = 'half-space' has no such range"
        )


def micro_model(name: str, surface: Surface, *, contact_modulus: float) -> MicroModel:
    """Return the micro model of a surface whose border is free, as that of a block's top is.

    Args:
        name: A name in `MODEL_NAMES`.
        surface: The surface.
        contact_modulus: E* [MPa].

    Raises:
        InputError: When there is no such model, or the modulus is not positive.
    """
    if name == "half-space":
        return HalfSpaceModel(surface=surface, contact_modulus=contact_modulus)
    if name not in MODELS:
        raise InputError("unknown micro model", value=name, allowed=", ".join(MODEL_NAMES))
    asperities = find_asperities(surface)
    return AsperityModel(name, asperities, contact_modulus=contact_modulus)
