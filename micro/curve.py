"""From the indentations of asperities to the response of the surface and its patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Asperities, Partition, PatchGrid, Surface
from geometry.errors import InputError
from micro.complementarity.contact_problem import Solution
from micro.pairs.body_points import BodyPoints
from micro.patch_displacement import patch_displacements
from micro.plane import RigidPlane
from micro.response import Response
from micro.summits.asperity_state import HertzCoefficients
from micro.summits.attribution import shares

Array = NDArray[np.float64]

LARGEST_AREA_FRACTION = 0.1
"""Contact area fraction up to which separate summits are meant (errors may be large before)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchSums:
    """Sums and means over patches of what the asperities do.

    A contact that straddles borders is shared by the integral of its pressure over the patches
    (`micro.summits.attribution`); as a contact it counts for the patch that holds its summit. The
    paper assigns it whole.

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


def whole_patch(surface: Surface) -> PatchGrid:
    """Return the single patch that a surface's rectangle is."""
    return PatchGrid(grid=(1, 1), lengths=surface.lengths)


def checked_approaches(approaches: ArrayLike) -> Array:
    """Return approaches as an array of shape (m,) [mm].

    Raises:
        InputError: When they are no finite, non-empty list of numbers.
    """
    allowed = "a number or a list of finite numbers in mm"
    try:
        given = np.atleast_1d(np.asarray(approaches, float))
    except (TypeError, ValueError):
        raise InputError(
            "the approaches are no numbers", value=approaches, allowed=allowed
        ) from None
    if given.size == 0:
        raise InputError("a response needs at least one approach", value=[])
    if given.ndim != 1:
        raise InputError("the approaches are no list", value=given.shape, allowed=allowed)
    if not np.isfinite(given).all():
        first = float(given[~np.isfinite(given)][0])
        raise InputError("the approach must be finite", value=first, allowed="mm")
    return given


def checked_means(mean_heights: ArrayLike, patches: Partition) -> Array:
    """Return the mean heights of patches as an array.

    Raises:
        InputError: When there is not one finite number for every patch.
    """
    allowed = f"shape ({patches.count},)"
    try:
        means = np.asarray(mean_heights, float)
    except (TypeError, ValueError):
        raise InputError(
            "the mean heights are no numbers", value=mean_heights, allowed=allowed
        ) from None
    if means.shape != (patches.count,):
        raise InputError(
            "every patch needs one mean height",
            value=means.shape,
            allowed=allowed,
        )
    if not np.isfinite(means).all():
        raise InputError("a mean height is not finite", value=means.tolist(), allowed="mm")
    return means
