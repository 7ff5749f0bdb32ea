"""What slopes that are not small add to the compliance of a half-space, to second order.

The body fills z < h(x, y). Pressures p per area of the plane push its surface straight down, and
u_z is wanted on that surface. Continued to the plane z = 0, with Greek indices in the plane, the
equations of equilibrium give the traction there,

    σ_iz = −p δ_iz + ∂_α (h σ_iα + ½ h² ∂_z σ_iα + …),    u_z(h) = u_z + h ∂_z u_z + ½ h² ∂_z² u_z.

Order by order these are half-space problems. With σ the stresses in the plane under p (a double
Riesz transform, σ_αβ = −2ν p δ_αβ − (1 − 2ν) k_α k_β/|k|² p in waves of wave vector k), e(σ) the
strains by them alone, and ∇∇u_z = (1 − ν)/G · k_α k_β/|k| p, the compliance, softer positive, is

    first order:   ∫ h (σ_zz σ'_zz / E − σ : e(σ')) dA,
    second order:  ∫ t · G_tt t' dA + ½ ∫ h² (σ : ∇∇u_z' + σ' : ∇∇u_z) dA,    t_β = ∂_α (h σ_αβ),

G_tt the tangential compliance (1/G|k|) (1 − ν k k/|k|²) of the half-space (Cerruti). The first is
what Eshelby's energy-momentum tensor gives, as e(σ) = ε − e(σ_zz). Both are symmetric, and do not
change when h does by a constant.

Heights of either sign are those of a possible body, so the compliance has no singularity at real
multiples of h: its series in them ends at the circle through some complex pair. The sum is taken
as a₁ + a₂/(1 + (a₂/a₁)²), with the values a₁, a₂ of both forms at the pressures: the simplest
function with these two terms and no real pole.

Sources: Eshelby 1975, doi 10.1007/BF00126994; Johnson 1985, ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Surface
from geometry.errors import InputError
from micro.boussinesq import HalfSpace
from micro.compliance.surface_stress import SurfaceStress
from micro.compliance.waves import Spectrum, Waves

Array = NDArray[np.float64]

_LARGE = 128
"""Cells along the shorter side from which on two of them make a coarse one."""


class FiniteSlopes:
    """The compliance that finite slopes add to a surface on a half-space.

    Stresses fall off as 1/r² around contacts: the term acts on the whole surface. Beyond a
    surface that is not periodic nothing is added.

    Args:
        surface: The surface.
        half_space: The half-space.
        order: Highest power of the heights, 1 or 2.
        periodic: Whether surface and pressures continue periodically; displacements then count
            from their mean, as those of the periodic half-space do.
        beside: Stresses in the surface beyond those of the half-space, on the cells of `grid`
            with sides `spacing`.

    Attributes:
        grid: Cells that the term works on, the surface's or coarser.
        spacing: Sides of these cells [mm].

    Raises:
        InputError: When the order is unknown, or a surface is not periodic that should be.
    """

    def __init__(
        self,
        surface: Surface,
        half_space: HalfSpace,
        *,
        order: int = 2,
        periodic: bool = False,
        beside: Sequence[SurfaceStress] = (),
    ) -> None:
        if order not in (1, 2):
            raise InputError("this order of slopes is unknown", value=order, allowed="1 or 2")
        if periodic and not surface.periodic:
            raise InputError("periodic slopes need a periodic surface", value=surface.source)
        self.half_space, self.order, self.beside = half_space, order, tuple(beside)
        ratio = coarse_ratio(surface.grid)
        self._waves = Waves(surface.grid, surface.spacing, periodic=periodic, ratio=ratio)
        self.grid, self.spacing = self._waves.coarse, self._waves.spacing
        self._periodic = periodic
        # counted from the top, where the load is, what rounding and cut tails leave is least
        self._heights = _means(surface.heights, ratio) - float(surface.heights.max())

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement that is added to the half-space's, positive into the body.

        Args:
            pressure: Pressures on all cells, shape (nx, ny) [MPa].

        Returns:
            Shape (nx, ny) [mm].
        """
        loads = self._waves.entering(pressure)
        parts = self._of_load(loads)
        beside = self._beside(parts[0])
        first, moments = self._first(parts, beside)
        total = first
        if self.order == 2:
            second = self._second(loads, parts, beside, moments)
            total = first + _share(_value(loads, first), _value(loads, second)) * second
        if self._periodic:
            total[0, 0] = 0.0
        return self._waves.leaving(total)

    def _of_load(self, loads: Spectrum) -> Array:
        """Return p, and its Riesz transforms along xx and xy, on the cells, (3, cx, cy) [MPa]."""
        along = self._waves.directions
        return self._waves.fields(np.stack([loads, along[0] * loads, along[2] * loads]))

    def _beside(self, pressure: Array) -> Array | None:
        """Return the stresses that the half-space does not have."""
        if not self.beside:
            return None
        return np.sum([term.stresses(pressure) for term in self.beside], axis=0)

    def _first(self, parts: Array, beside: Array | None) -> tuple[Spectrum, Spectrum]:
        """Return the waves of the first-order displacement, and of h σ."""
        heights, waves = self._heights, self._waves
        loaded = waves.of(heights * parts)
        moments = self._stresses(loaded)
        if beside is not None:
            moments = moments + waves.of(heights * beside)
        stresses = None if beside is None else self._stresses(parts) + beside
        strains = None if stresses is None else heights * self._strains(stresses)
        modulus = self.half_space.young_modulus
        return loaded[0] / modulus - self._adjoint(self._strains(moments), strains), moments

    def _second(
        self, loads: Spectrum, parts: Array, beside: Array | None, moments: Spectrum
    ) -> Spectrum:
        """Return the waves of the second-order displacement."""
        heights, waves = self._heights, self._waves
        nu, shear = self.half_space.poisson_ratio, self.half_space.shear_modulus
        bending = (1.0 - nu) / shear * waves.wave_number
        curvatures = bending * waves.directions * loads
        strains, curved = waves.fields(np.stack([self._strains_by_traction(moments), curvatures]))
        pulled = heights * (0.5 * heights * curved - strains)
        doubled = self._stresses(waves.of(heights**2 * parts))
        if beside is not None:
            doubled = doubled + waves.of(heights**2 * beside)
        return self._adjoint(waves.of(pulled), pulled) + 0.5 * bending * self._along(doubled)

    def _stresses(self, parts: NDArray[Any]) -> NDArray[Any]:
        """Return σ_xx, σ_yy, σ_xy of the half-space from p and its Riesz transforms."""
        nu = self.half_space.poisson_ratio
        p, xx, xy = parts
        side = 1.0 - 2.0 * nu
        return np.stack([-2.0 * nu * p - side * xx, -p + side * xx, -side * xy])

    def _strains(self, stresses: NDArray[Any]) -> NDArray[Any]:
        """Return the strains by stresses in the plane alone: xx, yy, xy."""
        nu, modulus = self.half_space.poisson_ratio, self.half_space.young_modulus
        xx, yy, xy = stresses
        return np.stack([xx - nu * yy, yy - nu * xx, (1.0 + nu) * xy]) / modulus

    def _strains_by_traction(self, moments: Spectrum) -> Spectrum:
        """Return the waves of the strains in the surface by the tractions ∂_α (h σ_αβ)."""
        nu, shear = self.half_space.poisson_ratio, self.half_space.shear_modulus
        along = self._waves.directions
        xx, yy, xy = moments
        main = nu * self._along(moments)
        found = [
            along[0] * xx + along[2] * xy - along[0] * main,
            along[1] * yy + along[2] * xy - along[1] * main,
            0.5 * ((along[0] + along[1]) * xy + along[2] * (xx + yy)) - along[2] * main,
        ]
        return np.stack(found) * (-self._waves.wave_number / shear)

    def _along(self, tensor: Spectrum) -> Spectrum:
        """Return the component k · tensor k / |k|² of every wave."""
        xx, yy, xy = self._waves.directions
        return np.asarray(xx * tensor[0] + yy * tensor[1] + 2.0 * xy * tensor[2])

    def _adjoint(self, waves: Spectrum, tensor: Array | None) -> Spectrum:
        """Return the adjoint of the stresses, applied to a tensor of given waves."""
        nu = self.half_space.poisson_ratio
        found = -2.0 * nu * (waves[0] + waves[1]) - (1.0 - 2.0 * nu) * self._along(waves)
        if tensor is None or not self.beside:
            return found
        whole = tensor * np.array([1.0, 1.0, 2.0])[:, None, None]  # xy and yx
        return found + self._waves.of(np.sum([term.adjoint(whole) for term in self.beside], axis=0))


def coarse_ratio(grid: tuple[int, int]) -> int:
    """Return how many cells along an axis make a cell that finite slopes are worked out on.

    Halving 256² cells changes the force of rough surfaces by less than 0.1 %.
    """
    even = all(count % 2 == 0 for count in grid)
    return 2 if even and min(grid) >= _LARGE else 1


def _means(heights: Array, ratio: int) -> Array:
    """Return the means over ratio × ratio cells."""
    nx, ny = heights.shape
    return np.asarray(heights.reshape(nx // ratio, ratio, ny // ratio, ratio).mean(axis=(1, 3)))


def _value(loads: Spectrum, waves: Spectrum) -> float:
    """Return the sum over the torus of two fields' product, up to a factor."""
    product = (np.conj(loads) * waves).real
    return float(2.0 * product.sum() - product[:, 0].sum())  # the last column is left out


def _share(first: float, second: float) -> float:
    """Return what the second order is multiplied by for those beyond it, ½ at least."""
    if abs(second) >= abs(first):
        return 0.5
    return 1.0 / (1.0 + (second / first) ** 2)
