"""From the indentations of asperities to the response of the surface and its patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Asperities, Partition
from geometry.rigid_plane import RigidPlane
from micro.asperities.patch_shares import shares
from micro.asperities.state import HertzCoefficients
from micro.complementarity.contact_problem import Solution
from micro.pairs.body_points import BodyPoints
from micro.patch_displacement import patch_displacements
from micro.response import Response

Array = NDArray[np.float64]

LARGEST_AREA_FRACTION = 0.1
"""Contact area fraction up to which separate summits are meant (errors may be large before)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchSums:
    """Sums and means over patches of what the asperities do.

    A contact that straddles borders is shared by the integral of its pressure over the patches
    (`micro.asperities.patch_shares`); as a contact it counts for the patch that holds its summit.
    The paper assigns it whole.

    Args:
        asperities: The n asperities.
        home: The same at their summits, which tell the patch.
        patches: The N patches; every summit lies in one.
        mean_heights: Mean heights of the patches, shape (N,) [mm].
        hertz: Coefficients of the asperities.
        contact_modulus: E* [MPa].
        body: Compliance of a finite body between the asperities; None on a half-space.

    Raises:
        InputError: When a summit lies outside the patches.
    """

    asperities: Asperities
    home: Asperities
    patches: Partition
    mean_heights: Array
    hertz: HertzCoefficients
    contact_modulus: float
    body: BodyPoints | None = None

    def __post_init__(self) -> None:
        _ = self.owner  # refuses summits outside

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """Flat index of the patch that holds each summit, shape (n,)."""
        return self.patches.index_of(self.home.x, self.home.y)

    def row(self, plane: RigidPlane, solution: Solution) -> dict[str, Any]:
        """Return the fields of a response for one approach."""
        t = solution.indentation
        on = np.flatnonzero(t > 0.0)
        force, area = self.hertz.force[on] * t[on] ** 1.5, self.hertz.area[on] * t[on]
        axes = self.hertz.semi_axes[on] * np.sqrt(t[on])[:, None]
        displacement = self._displacement(on, axes, force)
        share = shares(self.patches, self._positions(on), axes, self.asperities.angle[on])
        below = self.asperities.highest - plane.means(self.patches)
        separation = below - self.mean_heights + displacement
        return {
            "approach": plane.approach,
            "force": force.sum(),
            "moment": plane.moment(self.asperities.x[on], self.asperities.y[on], force),
            "contact_area": area.sum(),
            "contacts": len(on),
            "mean_separation": np.average(separation, weights=self.patches.areas),
            "iterations": solution.iterations,
            "residual": solution.residual,
            "engulfed": solution.engulfed,
            "patch_force": self._summed(share.patch, share.force * force[share.contact]),
            "patch_contact_area": self._summed(share.patch, share.area * area[share.contact]),
            "patch_contacts": self._summed(self.owner[on], None),
            "patch_displacement": displacement,
            "patch_separation": separation,
        }

    def response(self, name: str, rows: Sequence[dict[str, Any]]) -> Response:
        """Put rows together, in their order, with warnings outside the range of validity."""
        told = [row | {"warning": self._warning(name, row)} for row in rows]
        return Response.of(told, name, self.contact_modulus, self.patches)

    def _warning(self, name: str, row: dict[str, Any]) -> str:
        fraction = row["contact_area"] / np.prod(self.patches.sides)
        alone = row["contacts"] + row["engulfed"] < 2  # in a small patch, say: Hertz's contact
        if fraction <= LARGEST_AREA_FRACTION or alone:
            return ""
        return (
            f"at an approach of {row['approach']:.4g} mm the contacts cover {fraction:.1%} of the"
            f" surface: the model {name} of separate summits stands for up to"
            f" {LARGEST_AREA_FRACTION:.0%}"
        )

    def _summed(self, patch: NDArray[np.intp], values: Array | None) -> NDArray[Any]:
        return np.bincount(patch, values, minlength=self.patches.count)

    def _positions(self, on: NDArray[np.intp]) -> Array:
        return np.stack([self.asperities.x[on], self.asperities.y[on]], axis=1)

    def _displacement(self, on: NDArray[np.intp], axes: Array, force: Array) -> Array:
        found = patch_displacements(
            self.patches,
            self._positions(on),
            axes,
            self.asperities.angle[on],
            force,
            self.contact_modulus,
        )
        if self.body is None:
            return found
        moment = force / (np.pi * self.contact_modulus)
        return found + self.body.among(on).patch_means(self.patches, moment)
