"""A sphere in partial slip: Cattaneo's and Mindlin's closed forms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.support import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class MindlinSphere:
    """A sphere under a constant normal force, sheared along a line (Cattaneo 1938, Mindlin 1949).

    Sheared, the contact of radius a slips in an annulus a > r > c and sticks within. At ν = 0 the
    solution is exact; for other ν tractions across the shear, which the slip then asks for, are
    neglected. Theory: docs/theory.md, section 15.

    Args:
        radius: Contact radius a [mm].
        approach: Approach a²/R of the sphere [mm].
        force: Normal force P [N].
        coefficient: Coefficient of friction μ.
        poisson_ratio: ν of the elastic body.

    Source:
        Johnson, Contact Mechanics (1985), section 7.2.
    """

    radius: float
    approach: float
    force: float
    coefficient: float
    poisson_ratio: float

    @property
    def limit(self) -> float:
        """Shear force μ P at which the contact slides [N]."""
        return self.coefficient * self.force

    @property
    def sliding_shift(self) -> float:
        """Shift at which the contact slides, μ a²/R (2 − ν)/(2 (1 − ν)) [mm]."""
        ratio = (2.0 - self.poisson_ratio) / (2.0 * (1.0 - self.poisson_ratio))
        return self.coefficient * ratio * self.approach

    def shear_force(self, shift: ArrayLike) -> Array:
        """Return the shear force of a first shift, up to sliding [N] (Johnson, eq. 7.42).

        Args:
            shift: Shift ≥ 0 [mm].
        """
        part = np.minimum(np.asarray(shift, float) / self.sliding_shift, 1.0)
        return self.limit * (1.0 - (1.0 - part) ** 1.5)

    def stick_radius(self, shear_force: ArrayLike) -> Array:
        """Return the radius c of the circle that sticks [mm] (Johnson, eq. 7.41)."""
        return self.radius * np.cbrt(1.0 - np.asarray(shear_force, float) / self.limit)

    def traction(self, distance: ArrayLike, shear_force: float) -> Array:
        """Return tractions at distances from the axis [MPa] (Johnson, eq. 7.40).

        Args:
            distance: Distances [mm].
            shear_force: Shear force below sliding [N].
        """
        square, peak = np.asarray(distance, float) ** 2, 1.5 * self.force / self.radius**2 / np.pi
        inner = self.stick_radius(shear_force)
        outer = np.sqrt(np.maximum(self.radius**2 - square, 0.0))
        return np.asarray(
            self.coefficient
            * (peak / self.radius)
            * (outer - np.sqrt(np.maximum(inner**2 - square, 0.0)))
        )

    def force_after_turning(self, shift: ArrayLike, amplitude: float) -> Array:
        """Return the shear force on the way back from a first shift [N].

        Args:
            shift: Shifts between the amplitude and its opposite [mm].
            amplitude: The first shift, short of sliding [mm].

        Source:
            Mindlin & Deresiewicz 1953; Johnson, eq. 7.49.
        """
        back = 0.5 * (amplitude - np.asarray(shift, float))
        return self.shear_force(amplitude) - 2.0 * self.shear_force(back)

    def energy_per_cycle(self, amplitude: float) -> float:
        """Return the energy that a cycle between opposite shifts loses [N mm].

        It grows as the third power of small amplitudes, ½ μ P s (amplitude/s)³ with the shift s at
        which the contact slides.

        Args:
            amplitude: Largest shift, short of sliding [mm].

        Source:
            Mindlin & Deresiewicz 1953; Johnson, eq. 7.57, in terms of the shift.
        """
        part = amplitude / self.sliding_shift
        loading = part - 0.4 * (1.0 - (1.0 - part) ** 2.5)
        return (
            self.limit
            * self.sliding_shift
            * (8.0 * loading - 4.0 * part * (1.0 - (1.0 - part) ** 1.5))
        )
