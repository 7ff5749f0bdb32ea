"""Asperities whose curvature is that of the surface on the scale of their contacts.

The curvature at the very summit is sharper than that of the summit as a whole, by which the
models of the paper lose force and area. A contact with indentation t has the radius sqrt(R t); the
cap of the surface of height t above a level has the radius sqrt(2 R t), 1.4 times that. So the
paraboloid that fits the cap of height t in volume and second moments
(`micro.islands.shapes`) gives the curvature over 1.4 contact radii; t and the fit are found
in turn. So summits without a curvature, such as the flat ones of heights measured in steps, are
asperities as well.

A maximum on the border, cut by it, is an asperity of the same kind: the part of the cap that
exists has its volume and moments, hence a paraboloid. A summit cut in half gets half the R, 3.2
times as slender, its centre inside: what is missing carries nothing. Against half-space solutions
on 256 × 256 cells a summit cut in half is 6 % low in force and 10 % in area, one cut to a quarter
in a corner 10 % and 14 %.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry import Asperities, Surface, find_asperities
from micro.islands.shapes import equivalent, from_origin
from micro.islands.volumes import Relief

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SMALLEST = 1e-6
_NONE: Array = np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledAsperities:
    """The n summits of a surface, and their catchments for radii on any scale.

    Args:
        summits: The asperities; border ones with the radii of their smallest caps.
        relief: The catchments of the surface.
        catchment: Catchment of each asperity, −1 without one, shape (n,).
        fitted: Which asperities take the radii of their caps, shape (n,).
    """

    summits: Asperities
    relief: Relief
    catchment: Indices
    fitted: NDArray[np.bool_]

    @classmethod
    def of(
        cls, surface: Surface, *, curvature: str, border: str, floor: float = -np.inf
    ) -> ScaledAsperities:
        """Find the asperities of a surface.

        Args:
            surface: The surface; its border ends it, also when it is periodic.
            curvature: ``"summit"`` keeps the radii at the summits, ``"contact"`` fits them, and
                takes summits that have none, such as flat ones, too. Those of the border's
                asperities are always fitted.
            border: ``"ignore"`` or ``"include"`` the maxima within a cell of the border.
            floor: Height below which no fit is needed [mm].
        """
        inner = find_asperities(surface, periodic=False)
        relief = Relief.of(surface, floor=floor, ceiling=surface.highest)
        peaks = np.stack([relief.x, relief.y], axis=1)
        far, nearest = cKDTree(peaks).query(np.stack([inner.x, inner.y], axis=1).reshape(-1, 2))
        catchment = np.where(far < max(surface.spacing), nearest, -1)
        fitted = (catchment >= 0) & (curvature == "contact")
        scaled = cls(summits=inner, relief=relief, catchment=catchment, fitted=fitted)
        close = np.any(np.minimum(peaks, surface.lengths - peaks) < surface.spacing, axis=1)
        whole = scaled._with(np.where(close, border == "include", curvature == "contact"))
        if border == "ignore":
            return whole
        counted = replace(whole.summits, border_x=_NONE, border_y=_NONE, border_z=_NONE)
        return replace(whole, summits=counted)

    def _with(self, wanted: NDArray[np.bool_]) -> ScaledAsperities:
        """Add the wanted catchments that have no asperity, with the radii of their caps."""
        relief, taken = self.relief, np.zeros(len(self.relief), dtype=bool)
        taken[self.catchment[self.catchment >= 0]] = True
        added = np.flatnonzero(wanted & ~taken)
        # of peaks that nothing reaches, and of flat ones until something does
        some = np.full(len(added), np.sqrt(relief.cell))
        new: dict[str, Any] = {
            name: np.append(getattr(self.summits, name), value)
            for name, value in (
                ("x", relief.x[added]),
                ("y", relief.y[added]),
                ("z", relief.z[added]),
                ("radius_major", some),
                ("radius_minor", some),
                ("angle", np.zeros(len(added))),
            )
        }
        whole = replace(
            self,
            summits=replace(self.summits, **new),
            catchment=np.append(self.catchment, added),
            fitted=np.append(self.fitted, np.ones(len(added), dtype=bool)),
        )
        return replace(whole, summits=whole.at(np.zeros(len(whole.catchment))))

    def subset(self, mask: NDArray[np.bool_]) -> ScaledAsperities:
        """Return some of the asperities.

        Args:
            mask: Which, shape (n,).
        """
        return replace(
            self,
            summits=self.summits.subset(mask),
            catchment=self.catchment[mask],
            fitted=self.fitted[mask],
        )

    def at(self, indentation: Array) -> Asperities:
        """Return the asperities with the curvature at the scale of contacts.

        Args:
            indentation: Own indentations t ≥ 0, shape (n,) [mm].
        """
        which = np.flatnonzero(self.fitted)
        if not which.size:
            return self.summits
        relief, cap = self.relief, self.catchment[which]
        depth = np.maximum(indentation[which], _SMALLEST * relief.depth.max(initial=0.0))
        depth = np.maximum(depth, np.where(relief.small, relief.shaped, 0.0)[cap])
        height = np.zeros(len(relief))
        height[cap] = depth
        moments = from_origin(relief.caps(height)[:, cap], relief.x[cap], relief.y[cap])
        solid = moments[0] > 0.0
        which, found = which[solid], equivalent(moments[:, solid], depth[solid])
        old = self.summits
        values = {
            "x": (old.x, found.x),
            "y": (old.y, found.y),
            "radius_major": (old.radius_major, found.radius * np.sqrt(found.ratio)),
            "radius_minor": (old.radius_minor, found.radius / np.sqrt(found.ratio)),
            "angle": (old.angle, found.angle),
        }
        new: dict[str, Any] = {}
        for name, (before, fit) in values.items():
            new[name] = before.copy()
            new[name][which] = fit
        return replace(old, **new)
