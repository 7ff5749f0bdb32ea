"""The four asperity models with curvature at the scale of the contact and border asperities.

The paper's models are 6 to 11 % low in force and 10 to 23 % low in area between 1 and 10 % of
contact area. The two options remove most of that. Against half-space solutions on 20 surfaces of
Sets 1 and 2 the elliptic, interacting model with both is within 1 to 2.5 % in force (root mean
square; 6 % at most) from 0.3 to 10 % of contact area, and within 7 % in area. Its force is
3 to 7 % low without border asperities and 4 to 8 % low without fitted curvature.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, PatchGrid, Surface
from geometry.errors import NotConverged
from geometry.rigid_plane import RigidPlane
from micro.asperities.contact_scale import ScaledAsperities
from micro.asperities.contacts import SOLVERS, AsperityState, checked_name
from micro.asperities.model import MODELS, AsperityModel, Equilibrium, asperity_model
from micro.closed_forms.hertz import checked_modulus
from micro.compliance.body_modes import BodyModes
from micro.interaction.contact_problem import Solution
from micro.islands.equilibrium import Relaxation
from micro.model import checked_approaches, checked_patches
from micro.patch_sums import PatchSums
from micro.response import Pressed, Response

Array = NDArray[np.float64]

CURVATURES = ("summit", "contact")
"""Where the curvature is taken: at the very summit, as in the paper, or over 1.4 contact radii."""

BORDERS = ("ignore", "include")
"""What becomes of maxima on the border of the surface; the paper ignores them."""

_LEVEL = (0.0, 0.0)
_TOLERANCE = 1e-9  # so that a load comes back on the way down as it was on the way up
_ROUNDING = 64.0 * np.finfo(float).eps
_MARGIN = 1.2  # depth of the watersheds that are found, in units of the approach
_FURTHER = 1.1  # margin beyond the plane that was found, so that the next one lies within


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledModel:
    """One of the four asperity models on the asperities of a surface, fitted to the load.

    Args:
        kind: Name in `MODELS`.
        surface: The surface; its border ends it, also when it is periodic.
        contact_modulus: E* [MPa].
        curvature: A name in `CURVATURES`.
        border: A name in `BORDERS`. The radii of border asperities are always fitted.
        solver: Solver of the models with interaction.
        body: What a finite body adds to the half-space, as for `AsperityModel`.
        within: Patches, and the flat index of the one whose summits the model consists of; all
            summits when not given.
        most_cached: Largest number of cells of a surface whose watersheds are found once and
            cached. Those of a larger surface are found again for every plane, only as deep as
            needed.
        most_iterations: Number of times that the curvatures may be fitted to the contacts.

    Raises:
        InputError: When a name is unknown or the modulus not positive.
    """

    kind: str
    surface: Surface
    contact_modulus: float
    curvature: str = "contact"
    border: str = "include"
    solver: str = "active-set"
    body: BodyModes | None = None
    within: tuple[PatchGrid, int] | None = None
    most_cached: int = 2**20
    most_iterations: int = 100

    def __post_init__(self) -> None:
        checked_name(self.kind, MODELS, "micro model")
        checked_name(self.curvature, CURVATURES, "scale of the curvature")
        checked_name(self.border, BORDERS, "treatment of the border")
        checked_name(self.solver, SOLVERS, "solver")
        checked_modulus(self.contact_modulus)

    @property
    def name(self) -> str:
        """Name of the model with its options."""
        return f"{self.kind}, curvature {self.curvature}, border {self.border}"

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""
        return self.surface.highest

    @cached_property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]; infinite without asperities."""
        heights = self._scaled(0.0).summits.z
        return float(self.reference_height - heights.max()) if heights.size else np.inf

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of the summits of one patch; see `MicroModel.of_patch`."""
        return replace(self, within=(patches, index), body=None), patches.single(index)

    @cached_property
    def asperities(self) -> Asperities:
        """The asperities, with the radii of their smallest contacts."""
        return self._scaled(np.inf).summits

    def solve(
        self,
        approach: float,
        *,
        tilt: tuple[float, float] = _LEVEL,
        start: AsperityState | None = None,
    ) -> AsperityState:
        """Solve the contact at one approach of the plane.

        The caps that give the curvature are those above level planes, also under a tilt.

        Args:
            approach: Rigid approach δ at the centre of the rectangle [mm].
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).
            start: A solution nearby to start from.

        Raises:
            InputError: When the approach or the tilt is not finite, or the interaction of all
                contacts does not fit into the memory.
            NotConverged: When contacts and curvatures do not agree to 1e-9 of the largest
                interference, or the contact conditions cannot be met.
        """
        plane = RigidPlane.above(self.surface, approach, tilt)
        scaled = self._scaled(self._highest_approach(plane))
        own = None if start is None else start.indentation
        given = Control(approach=approach, tilt=tilt)
        model, found = self._fitted(scaled, given, plane, own=own)
        return model.state(*found)

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = _LEVEL,
    ) -> Response:
        """Solve along approaches, each from the solution before it; see `MicroModel.respond`."""
        sums = PatchSums(self, *checked_patches(self.surface, patches, mean_heights))
        planes = [
            RigidPlane.above(self.surface, approach, tilt)
            for approach in checked_approaches(approaches)
        ]
        scaled = self._scaled(max(map(self._highest_approach, planes)))
        owner = sums.patches.index_of(scaled.summits.x, scaled.summits.y)
        rows: dict[int, dict[str, Any]] = {}
        own: Array | None = None
        for index in np.argsort([plane.approach for plane in planes], kind="stable"):
            plane = planes[index]
            given = Control(approach=plane.approach, tilt=tilt)
            model, found = self._fitted(scaled, given, plane, own=own)
            own = found.solution.indentation
            rows[int(index)] = model.row(found, sums, owner)
        return sums.response([rows[index] for index in range(len(planes))])

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step; see `MicroModel.press`."""
        sums = PatchSums(self, *checked_patches(self.surface, patches, mean_heights))
        depth: float | None = None
        while True:
            scaled = self._scaled(depth or 0.0)
            known = start is not None and len(start.solution.indentation) == len(scaled.summits)
            near = start if known else None
            plane = self._model(scaled.summits).first_plane(control, near)
            # The plane determines how deep the watersheds of a large surface must be.
            before, depth = depth, self._highest_approach(plane)
            if before is None and not self._is_cached:
                continue
            model, found = self._fitted(scaled, control, plane, near)
            depth = self._highest_approach(found.plane)
            if self._is_cached or depth <= (before or 0.0):
                break
            depth *= _FURTHER
        owner = sums.patches.index_of(scaled.summits.x, scaled.summits.y)
        response = sums.response([model.row(found, sums, owner)])
        return Pressed(response, found.plane, found)

    def _fitted(
        self,
        scaled: ScaledAsperities,
        control: Control,
        plane: RigidPlane,
        near: Equilibrium | None = None,
        own: Array | None = None,
    ) -> tuple[AsperityModel, Equilibrium]:
        """Fit the curvatures to the contacts and solve for the contacts until both agree."""
        interference = np.maximum(scaled.summits.interference(plane), 0.0)
        nothing = np.zeros_like(interference)
        found = near or Equilibrium(plane, Solution(nothing, nothing, 0, 0.0, 0))
        own = found.solution.indentation if own is None else own
        own = own if own.any() else interference
        rounding = _ROUNDING * float(np.abs(scaled.summits.z).max(initial=0.0))
        relaxed, spent = Relaxation(), 0
        for _ in range(self.most_iterations):
            model = self._model(scaled.at(own))
            found = model.equilibrium(control, found)
            spent += max(found.solution.iterations, 1)
            change = found.solution.indentation - own
            scale = float(scaled.summits.interference(found.plane).max(initial=0.0)) or 1.0
            if np.abs(change).max(initial=0.0) <= max(_TOLERANCE * scale, rounding):
                solution = found.solution._replace(iterations=spent)
                return model, Equilibrium(found.plane, solution)
            own = np.maximum(relaxed.next(own, change), 0.0)
        raise NotConverged(
            f"the fit of curvatures to contacts at an approach of {found.plane.approach:.4g} mm",
            reason="MAX_ITERATIONS",
            iterations=spent,
            remedy="lower load.approach, or take the curvature at the summits",
        )

    def _model(self, asperities: Asperities) -> AsperityModel:
        return asperity_model(
            self.kind,
            asperities,
            contact_modulus=self.contact_modulus,
            solver=self.solver,
            body=self.body,
        )

    def _scaled(self, approach: float) -> ScaledAsperities:
        """Return the asperities with watersheds as deep as a plane at some approach needs."""
        if self._is_cached:
            return self._whole
        return self._found(self.surface.highest - _MARGIN * max(approach, 0.0))

    @property
    def _is_cached(self) -> bool:
        return self.surface.heights.size <= self.most_cached

    @cached_property
    def _whole(self) -> ScaledAsperities:
        return self._found(-np.inf)

    def _found(self, floor: float) -> ScaledAsperities:
        found = ScaledAsperities.of(
            self.surface, curvature=self.curvature, border=self.border, floor=floor
        )
        if self.within is None:
            return found
        patches, index = self.within
        return found.subset(patches.index_of(found.summits.x, found.summits.y) == index)

    def _highest_approach(self, plane: RigidPlane) -> float:
        """Return the largest approach over the surface, that of a corner [mm]."""
        x, y = np.meshgrid(*[(0.0, length) for length in self.surface.lengths])
        return float(plane.at(x, y).max())
