"""Response of a rough surface to the approach of a rigid plane, as a whole and patch by patch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from geometry import Partition
from geometry.errors import InputError
from geometry.rigid_plane import RigidPlane

Array = NDArray[np.float64]
Counts = NDArray[np.int64]


class Pressed(NamedTuple):
    """The result of one load step.

    Attributes:
        response: The response, of one row.
        plane: The plane in equilibrium.
        start: Initial guess of the same model for a load step nearby.
    """

    response: Response
    plane: RigidPlane
    start: Any


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Results at n approaches on N patches.

    The separation of a patch is the average gap between the plane and the *displaced* surface,
    g_i = z_M − mean height − mean approach + mean displacement. The paper's eq. 9 leaves the
    displacement out. It is the displacement by the model's pressures, to the errors stated in
    `micro.patch_sums`, also for the models without interaction.

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

    Raises:
        InputError: When the arrays do not fit each other.
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

    def __post_init__(self) -> None:
        count = len(self.approach)
        columns = self.patch_force.shape[1:]
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, np.ndarray):
                continue
            expected: tuple[int, ...] = (count,)
            if item.name.startswith("patch_"):
                expected = (count, *columns)
            elif item.name == "moment":
                expected = (count, 2)
            if value.shape != expected:
                raise InputError(
                    f"{item.name} of a response does not fit",
                    value=value.shape,
                    allowed=f"shape {expected}",
                )

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

        Raises:
            InputError: When there is no row.
        """
        if not rows:
            raise InputError("a response needs at least one approach", value=[])
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
