"""The protocol of all micro models, their response, and the checks of arguments that they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Control, Partition, PatchGrid, Surface, patch_means
from geometry.rigid_plane import RigidPlane
from micro.contact_detail import ContactDetail
from support.errors import InputError

Array = NDArray[np.float64]
Counts = NDArray[np.int64]


class MicroModel(Protocol):
    """A rough surface on an elastic body, pressed by a rigid plane."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def contact_modulus(self) -> float:
        """E* [MPa]."""

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]."""

    def of_patch(self, patches: PatchGrid, index: int) -> tuple[Self, PatchGrid]:
        """Return the model of one patch alone, on its own half-space.

        It is meant for level planes. A tilted plane turns about the middle of the rectangle that
        is left; for some models that is the patch, for others the whole surface.

        Args:
            patches: Patches of the surface.
            index: Flat index of the patch.

        Returns:
            The model, whose approach counts from the whole surface's highest point, and its patch.
        """

    def respond(
        self,
        approaches: ArrayLike,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        tilt: tuple[float, float] = (0.0, 0.0),
    ) -> Response:
        """Solve along approaches.

        Args:
            approaches: Rigid approaches δ at the centre of the rectangle in any order, shape (m,)
                [mm].
            patches: N patches within the surface's rectangle that results are summed over; the
                whole rectangle as one patch when not given.
            mean_heights: Mean heights of the surface on the patches, shape (N,) [mm]; the
                surface's own when not given.
            tilt: Slopes (tx, ty) of the approach: δ(x, y) = δ + tx (x − xc) + ty (y − yc).

        Returns:
            The response, in the order of ``approaches``, with a warning for each of them that
            lies outside the range of validity.

        Raises:
            InputError: When the approaches are not a finite, non-empty list, a contact lies
                outside the patches, or patches or mean heights do not fit the surface.
            NotConverged: When the contact conditions cannot be met.
        """

    def press(
        self,
        control: Control,
        *,
        patches: Partition | None = None,
        mean_heights: ArrayLike | None = None,
        start: Any = None,
    ) -> Pressed:
        """Solve one load step: contacts and the free motions of the plane.

        Args:
            control: What is prescribed of the plane: approach or force, tilt or no moment.
            patches: Patches that results are summed over, as for `respond`.
            mean_heights: Mean heights of the patches, shape (N,) [mm], as for `respond`.
            start: What this model returned at a load step nearby; without it the solution starts
                from no contact.

        Returns:
            The response, of one row, the plane, and where to start the next load step from.

        Raises:
            InputError: When the arguments do not fit the surface.
            NotConverged: When the contact conditions or the prescribed loads cannot be met.
        """

    def stiffness(self, state: Any, *, turns: bool) -> Stiffness:
        """Return the interfacial stiffness, the derivative dF/dδ of the force by the approach.

        Args:
            state: `Pressed.state` of this model.
            turns: Whether the plane turns without moment; otherwise its slopes stay.
        """


class Stiffness(NamedTuple):
    """How the force changes with the approach, on the side that the plane came from.

    Attributes:
        value: The derivative dF/dδ [N/mm]; None where nothing gives it.
        iterations: Iterations that it took.
        error: What the value may be off by [N/mm]; 0 from a linear solution.
    """

    value: float | None
    iterations: int
    error: float = 0.0


class SolvedContact(Protocol):
    """The contact that a micro model found."""

    @property
    def peak_pressure(self) -> float:
        """Largest contact pressure [MPa]; 0 without contact."""

    @property
    def detail(self) -> ContactDetail:
        """The spots of the contact and, where they are known, its fields."""


class Pressed(NamedTuple):
    """The result of one load step.

    Attributes:
        response: The response, of one row.
        plane: The plane in equilibrium.
        start: Initial guess of the same model for a load step nearby.
        state: The contact.
    """

    response: Response
    plane: RigidPlane
    start: Any
    state: SolvedContact


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Results at n approaches on N patches.

    The separation of a patch is the average gap between the plane and the *displaced* surface,
    g_i = z_M − mean height − mean approach + mean displacement. The paper's eq. 9 leaves the
    displacement out. It is the displacement by the model's pressures, to the errors stated in
    `micro.asperities.patch_sums`, also for the models without interaction.

    Args:
        model: Name of the micro model.
        contact_modulus: E* [MPa].
        nominal_area: Area of all patches [mm²].
        approach: Rigid approach at the centre, counted from first touch, shape (n,) [mm].
        force: Normal force, shape (n,) [N].
        moment: First moments Σ P (x − xc), Σ P (y − yc) of the pressures about the centre of the
            surface's rectangle, shape (n, 2) [N mm].
        contact_area: Real contact area, shape (n,) [mm²].
        contacts: Number of asperities in contact, shape (n,).
        mean_separation: Average gap, shape (n,) [mm].
        iterations: Iterations of the solver, shape (n,).
        residual: Complementarity error relative to the largest interference, shape (n,).
        overlapping_contacts: Number of pairs of contacts that have grown into each other, (n,).
        patch_force: Force on the patch, contacts across its border shared, shape (n, N) [N].
        patch_contact_area: Real contact area in the patch, shared likewise, shape (n, N) [mm²].
        patch_contacts: Number of contacts with their summit in the patch, shape (n, N).
        patch_displacement: Mean normal displacement of the patch by all contacts, (n, N) [mm].
        patch_separation: Average gap of the patch, shape (n, N) [mm].
        warning: Why the approach lies outside the model's range of validity, shape (n,); empty
            within it.
    """

    model: str
    contact_modulus: float
    nominal_area: float
    approach: Array
    force: Array
    moment: Array
    contact_area: Array
    contacts: Counts
    mean_separation: Array
    iterations: Counts
    residual: Array
    overlapping_contacts: Counts
    patch_force: Array
    patch_contact_area: Array
    patch_contacts: Counts
    patch_displacement: Array
    patch_separation: Array
    warning: NDArray[np.str_]

    @classmethod
    def of(
        cls,
        rows: Sequence[dict[str, Any]],
        model: str,
        contact_modulus: float,
        patches: Partition,
    ) -> Self:
        """Put together the fields at single approaches, in their order.

        Args:
            rows: For each approach the fields that have one entry per approach.
            model: Name of the micro model.
            contact_modulus: E* [MPa].
            patches: The patches.
        """
        columns = {key: np.array([row[key] for row in rows]) for key in rows[0]}
        return cls(
            model=model,
            contact_modulus=contact_modulus,
            nominal_area=float(np.prod(patches.sides)),
            **columns,
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each approach that lies outside the model's range of validity."""
        return tuple(str(sentence) for sentence in self.warning if sentence)

    @property
    def mean_pressure(self) -> Array:
        """Force per nominal area, shape (n,) [MPa]."""
        return np.divide(self.force, self.nominal_area)

    @property
    def patch_pressure(self) -> Array:
        """Force per area of each of N equal patches, shape (n, N) [MPa]."""
        return self.patch_force * (self.patch_force.shape[1] / self.nominal_area)

    @property
    def contact_area_fraction(self) -> Array:
        """Real over nominal contact area A/A0, shape (n,)."""
        return np.divide(self.contact_area, self.nominal_area)

    def kappa(self, rms_slope: float) -> Array:
        """Return κ of A/A0 = κ p/(rms slope · E*), shape (n,); NaN where nothing touches.

        Args:
            rms_slope: Root of the mean squared gradient of the surface, sqrt<|∇h|²>.

        Source:
            Waddad et al. 2016, section 2.2, doi 10.1016/j.triboint.2015.12.023.
        """
        area = self.contact_area_fraction * rms_slope * self.contact_modulus
        result = np.full_like(area, np.nan)
        return np.divide(area, self.mean_pressure, out=result, where=self.force > 0.0)


def whole_patch(rough: Surface | Asperities) -> PatchGrid:
    """Return the single patch that a surface's rectangle is."""
    return PatchGrid(grid=(1, 1), lengths=rough.lengths)


def checked_approaches(approaches: ArrayLike) -> Array:
    """Return approaches as an array of shape (m,) [mm].

    Raises:
        InputError: When they are no finite, non-empty list of numbers.
    """
    allowed = "a number or a list of finite numbers in mm"
    given = np.atleast_1d(_numbers(approaches, "the approaches are no numbers", allowed))
    if given.size == 0:
        raise InputError("a response needs at least one approach", value=[])
    if given.ndim != 1:
        raise InputError("the approaches are no list", value=given.shape, allowed=allowed)
    if not np.isfinite(given).all():
        first = float(given[~np.isfinite(given)][0])
        raise InputError("the approach must be finite", value=first, allowed="mm")
    return given


def checked_patches(
    rough: Surface | Asperities,
    patches: Partition | None = None,
    mean_heights: ArrayLike | None = None,
) -> tuple[Partition, Array]:
    """Return patches and their mean heights, by default those of the whole surface.

    Args:
        rough: The surface, or its asperities, which know its mean height but not a patch's.
        patches: The N patches; one, the whole rectangle, when not given.
        mean_heights: Their mean heights, shape (N,) [mm]; the surface's own when not given.

    Raises:
        InputError: When there is not one finite number for every patch, or only asperities are
            known and the patches have no mean heights.
    """
    given, patches = patches, whole_patch(rough) if patches is None else patches
    if mean_heights is None and isinstance(rough, Surface):
        return patches, patch_means(rough, patches)
    if mean_heights is None and given is not None:
        raise InputError(
            "asperities do not know the mean heights of patches",
            allowed="mean_heights, or no patches",
        )
    mean_heights = [rough.mean_height] if mean_heights is None else mean_heights
    allowed = f"shape ({patches.count},)"
    means = _numbers(mean_heights, "the mean heights are no numbers", allowed)
    if means.shape != (patches.count,):
        raise InputError("every patch needs one mean height", value=means.shape, allowed=allowed)
    if not np.isfinite(means).all():
        raise InputError("a mean height is not finite", value=means.tolist(), allowed="mm")
    return patches, means


def _numbers(values: ArrayLike, problem: str, allowed: str) -> Array:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError(problem, value=values, allowed=allowed) from None
