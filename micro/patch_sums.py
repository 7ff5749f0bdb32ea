"""Sums over patches of the forces and areas of contacts, and the mean displacements by them.

By reciprocity the mean displacement of patch i by a contact is the contact's force times the mean
of L_i over its pressure, divided by π E* A_i, with L_i the Love integral of the patch. That mean
is taken with a cubature for the semi-ellipsoidal pressure: 2 radii by 7 angles, exact to degree 6.
L_i is smooth except on the patch's border, where its slope is logarithmic.

So a contact of radius a that lies across a border of a patch of side s misplaces up to 0.015 a/s of
that patch's displacement between the two sides (0.035 a/s where it is larger than the patch; a
point force 0.17). The mean over all patches is good to 1e-9 for contacts away from the outer
border. For one that touches that border from inside it is good to 4e-4 a/s, s now the side of the
whole; for one that reaches across it to 0.02 a/s. Of more than 2000 contacts those that are small
and far from any border count as point forces, for which the same bound holds.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

from geometry import Partition
from geometry.rigid_plane import RigidPlane
from micro.closed_forms.love import corner_integral
from micro.compliance.body_modes import BodyModes
from micro.interaction.body_points import BodyPoints
from micro.response import Response

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_NODES, _SHARES = roots_jacobi(2, 0.5, 0.0)  # t = r² weighs as (1 − t)^½
_ANGLES = 7
_MANY = 2000
_BLOCK = 2**20


class EllipticContacts(NamedTuple):
    """Hertz contacts of a surface.

    Attributes:
        position: Centres (x, y), shape (m, 2) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
        semi_axes: Semi-axes (a, b), shape (m, 2) [mm].
        area: Areas π a b, shape (m,) [mm²].
        force: Forces, shape (m,) [N].
    """

    position: Array
    angle: Array
    semi_axes: Array
    area: Array
    force: Array


class ContactModel(Protocol):
    """A model whose contacts are Hertz's."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def reference_height(self) -> float:
        """Height z_M that the approach counts from [mm]."""

    @property
    def contact_modulus(self) -> float:
        """E* [MPa]."""

    @property
    def body(self) -> BodyModes | None:
        """What a finite body adds to the half-space."""


class PatchSums(NamedTuple):
    """Sums and means over N patches of what the contacts of a model do to a surface.

    Attributes:
        model: The model.
        patches: The patches.
        mean_heights: Mean heights of the surface on the patches, shape (N,) [mm].
    """

    model: ContactModel
    patches: Partition
    mean_heights: Array

    def response(self, rows: Sequence[dict[str, Any]]) -> Response:
        """Put rows together, in their order."""
        return Response.of(rows, self.model.name, self.model.contact_modulus, self.patches)

    def row(
        self, plane: RigidPlane, contacts: EllipticContacts, owner: Indices, **others: Any
    ) -> dict[str, Any]:
        """Return the fields of a `Response` at one approach.

        Args:
            plane: The rigid plane.
            contacts: The m contacts under it.
            owner: Flat index of the patch that each contact counts for, shape (m,).
            others: The other fields of the row: the shared forces and areas, the solver's figures
                and the warning.
        """
        (x, y), modulus = contacts.position.T, self.model.contact_modulus
        displacement = patch_displacements(self.patches, contacts, modulus)
        if self.model.body is not None:
            points = BodyPoints.at(self.model.body, x, y, modulus)
            force = contacts.force / (np.pi * modulus)
            displacement = displacement + points.patch_means(self.patches, force)
        below = self.model.reference_height - plane.means(self.patches)
        separation = below - self.mean_heights + displacement
        return {
            "approach": plane.approach,
            "force": contacts.force.sum(),
            "moment": plane.moment(x, y, contacts.force),
            "contact_area": contacts.area.sum(),
            "contacts": len(contacts.force),
            "mean_separation": np.average(separation, weights=self.patches.areas),
            "patch_contacts": np.bincount(owner, minlength=self.patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            **others,
        }


def patch_displacements(
    patches: Partition, contacts: EllipticContacts, contact_modulus: float
) -> Array:
    """Return the mean normal displacement of every patch of a half-space [mm], shape (N,).

    Args:
        patches: The N patches.
        contacts: The m contacts.
        contact_modulus: E* [MPa].
    """
    position, angle, semi_axes, _, force = contacts
    points, loads = [], []
    if len(force) > _MANY:
        inner = _far_from_borders(patches, position, semi_axes[:, 0])
        points, loads = [position[inner]], [force[inner]]
        position, semi_axes, angle, force = (
            part[~inner] for part in (position, semi_axes, angle, force)
        )
    cubature, weight = _cubature(position, semi_axes, angle)
    points.append(cubature)
    loads.append((force[:, None] * weight).ravel())
    point, load = np.concatenate(points), np.concatenate(loads)
    crossings = patches.shape[0] + 1, patches.shape[1] + 1
    corners = np.zeros(crossings[0] * crossings[1])
    block = max(1, _BLOCK // len(corners))
    for first in range(0, len(load), block):  # blocks bound the memory
        corners += _corners(patches, point[first : first + block], load[first : first + block])
    love = np.diff(np.diff(corners.reshape(crossings), axis=0), axis=1)
    return np.asarray(love.ravel() / (np.pi * contact_modulus * patches.areas))


def _corners(patches: Partition, point: Array, load: Array) -> Array:
    """Return the sum of loads times corner integrals at all crossings of borders, flat."""
    to_x = patches.borders_x - point[:, 0, None]
    to_y = patches.borders_y - point[:, 1, None]
    corners = corner_integral(to_x[:, :, None], to_y[:, None, :])
    return np.asarray(np.tensordot(load, corners, axes=1), dtype=np.float64).ravel()


def _far_from_borders(patches: Partition, position: Array, semi_major: Array) -> NDArray[np.bool_]:
    """Return which contacts are as good as point forces, small and 10 semi-axes off a border."""
    borders = patches.borders_x, patches.borders_y
    gap = np.min([_to_nearest(*pair) for pair in zip(borders, position.T, strict=True)], axis=0)
    narrowest = min(np.diff(ticks).min() for ticks in borders)
    return (gap > 10.0 * semi_major) & (semi_major < 5e-3 * narrowest)


def _to_nearest(borders: Array, place: Array) -> Array:
    above = np.clip(np.searchsorted(borders, place), 1, len(borders) - 1)
    return np.minimum(np.abs(place - borders[above - 1]), np.abs(borders[above] - place))


def _cubature(position: Array, semi_axes: Array, angle: Array) -> tuple[Array, Array]:
    """Return points, shape (14 m, 2), and the 14 weights of every contact's mean."""
    radius = np.sqrt(0.5 * (1.0 + _NODES))[:, None]
    around = 2.0 * np.pi / _ANGLES * (np.arange(_ANGLES) + np.array([[0.0], [0.5]]))
    u = (radius * np.cos(around)).ravel() * semi_axes[:, :1]
    v = (radius * np.sin(around)).ravel() * semi_axes[:, 1:]
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x = position[:, :1] + cos * u - sin * v
    y = position[:, 1:] + sin * u + cos * v
    weight = np.repeat(_SHARES / (_SHARES.sum() * _ANGLES), _ANGLES)
    return np.stack([x.ravel(), y.ravel()], axis=1), weight
