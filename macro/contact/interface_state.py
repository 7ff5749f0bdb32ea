"""What laws on an interface make of displacements: pressures, forces, closures, contact area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from geometry.rigid_plane import RigidPlane
from macro.contact.contact_forces import ContactForces, ContactLaw
from macro.contact.loaded_face import Sampling
from support.collective import together
from support.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceState:
    """The contact on an interface. All but the samples is the same on every rank.

    Args:
        plane: The plane; its centre is the middle of the patches.
        force: Force on the face against its normal [N].
        moment: First moments of the pressures about the middle, shape (2,) [N mm].
        area: Real contact area [mm²]; None where a law does not know it.
        patch_pressure: Mean pressures of the patches, shape (N,) [MPa].
        patch_closure: Mean closures of the patches, shape (N,) [mm].
        closure: Closures of this rank's samples, shape (n,) [mm].
        pressure: Pressures of this rank's samples, shape (n,) [MPa].
    """

    plane: RigidPlane
    force: float
    moment: Array
    area: float | None
    patch_pressure: Array
    patch_closure: Array
    closure: Array
    pressure: Array

    @classmethod
    def of(
        cls,
        forces: ContactForces,
        sampling: Sampling,
        laws: Sequence[ContactLaw],
        areas: Array,
        patches: PatchGrid,
        closure: Array,
    ) -> InterfaceState:
        """Return the state at closures of this rank's samples; collective.

        Args:
            forces: Forces of the laws, the plane in its place.
            sampling: The samples.
            laws: One law per patch.
            areas: Areas of the patches, shape (N,) [mm²].
            patches: The patches.
            closure: Closures, shape (n,) [mm].
        """
        pressure = forces.pressure(closure)
        loads, (approach, tx, ty) = forces.loads(pressure), map(float, forces.plane)
        xc, yc = map(float, patches.middle)
        return cls(
            plane=RigidPlane(approach=approach, tilt=(tx, ty), centre=(xc, yc)),
            force=float(loads[0]),
            moment=loads[1:],
            area=_contact_area(forces, sampling, laws, closure),
            patch_pressure=sampling.patch_sums(pressure) / areas,
            patch_closure=sampling.patch_sums(closure) / areas,
            closure=closure,
            pressure=pressure,
        )


class InterfaceResults:
    """The contact at the latest evaluation, read part by part without communication."""

    _state: InterfaceState | None = None

    @property
    def state(self) -> InterfaceState:
        """The contact at the latest `evaluate`.

        Raises:
            InputError: Before that.
        """
        if self._state is None:
            raise InputError("nothing is solved or evaluated on this interface yet")
        return self._state

    @property
    def force(self) -> float:
        """Force on the face against its normal [N]."""
        return self.state.force

    @property
    def moment(self) -> Array:
        """First moments of the pressures about the middle of the patches, shape (2,) [N mm]."""
        return self.state.moment

    @property
    def area(self) -> float | None:
        """Real contact area [mm²]; None where a law does not know it."""
        return self.state.area

    @property
    def patch_pressure(self) -> Array:
        """Mean pressures of the patches, shape (N,) [MPa]."""
        return self.state.patch_pressure

    @property
    def patch_closure(self) -> Array:
        """Mean closures of the patches, shape (N,) [mm]."""
        return self.state.patch_closure

    @property
    def closure(self) -> Array:
        """Closures of this rank's samples, patches or quadrature points, shape (n,) [mm]."""
        return self.state.closure

    @property
    def pressure(self) -> Array:
        """Pressures of this rank's samples, shape (n,) [MPa]."""
        return self.state.pressure

    @property
    def plane(self) -> RigidPlane:
        """The plane, also where it follows from loads; its centre is the middle of the patches."""
        return self.state.plane


def _contact_area(
    forces: ContactForces, sampling: Sampling, laws: Sequence[Any], closure: Array
) -> float | None:
    """Return the contact area, on the tangents beyond tables; None without ``at`` of a law."""
    if not all(hasattr(law, "at") for law in laws):
        return None
    functions = [partial(_area_fraction, law) for law in laws]
    share = together(forces.comm, lambda: sampling.by_patch(functions, closure))
    return float(sampling.patch_sums(share).sum())


def _area_fraction(law: Any, closure: Array) -> Array:
    return np.asarray(law.at(closure, extend=True).contact_area_fraction)
