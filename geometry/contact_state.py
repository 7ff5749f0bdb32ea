"""The contact of a rough surface with a rigid plane at one load step, as any solver returns it.

Cells, asperities, patch laws and meshes know different things of a contact. What a solver does not
know has its default, which says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry.patches import PatchGrid
from patchlaw.geometry.rigid_plane import Pair, RigidPlane
from patchlaw.support import Array, Counts, Flags, Indices, InputError
from patchlaw.support.readable import Displayed, Table

_LARGE = (
    "spots x y pressure gap displacement yielding plastic_depth earlier_depth worn_depth "
    "indentation by_slopes displaced shear heat"
).split()

_DISPLAYED = {
    "approach": "mm", "force": "N", "mean_pressure": "MPa", "contact_area_fraction": "",
    "contacts": "", "peak_pressure": "MPa", "mean_separation": "mm", "elastic_energy": "N mm",
    "plastic_work": "N mm", "iterations": "", "residual": "",
}  # fmt: skip
"""What a printed state shows, with the units."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spots:
    """The m connected spots of a contact.

    Args:
        place: Where the pressure of each spot is largest, shape (m, 2) [mm].
        area: Real contact areas of the spots, shape (m,) [mm²].
        force: Their forces, shape (m,) [N].
        peak_pressure: Their largest pressures, shape (m,) [MPa].
    """

    place: Array
    area: Array
    force: Array
    peak_pressure: Array

    def __len__(self) -> int:
        return len(self.force)

    def per_patch(self, patches: PatchGrid) -> Counts:
        """Return how many spots have their largest pressure in each patch, shape (N,).

        Args:
            patches: The N patches; places that rounding alone puts beyond them, by 1e-12 of their
                sides, count as within.
        """
        x, y = patches.borders_x, patches.borders_y
        nearest = np.clip(self.place, (x[0], y[0]), (x[-1], y[-1]))
        beyond = np.abs(self.place - nearest) > 1e-12 * np.array(patches.lengths)
        owner = patches.index_of(*np.where(beyond, self.place, nearest).T)
        return np.bincount(owner, minlength=patches.count)


def peaks_of(group: NDArray[np.integer], values: Array, count: int) -> Indices:
    """Return the index of the largest value in each of some groups, shape (count,).

    Args:
        group: Number 0 … count − 1 of the group of every value, shape (n,); none is empty.
        values: The values, shape (n,).
        count: Number of groups.
    """
    high, other = np.ones(len(values), bool), group[1:] != group[:-1]
    high[1:] &= other | (values[1:] >= values[:-1])
    high[:-1] &= other | (values[:-1] >= values[1:])
    some = np.flatnonzero(high)  # few are as large as those of their group beside them
    rising = some[np.argsort(values[some], kind="stable")]
    peaks = np.zeros(count, np.intp)
    peaks[group[rising]] = rising  # the last, largest one stays
    return peaks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """What the solution of a load may start from: a solution of the same model at another load.

    Args:
        plane: The plane there.
        values: Pressures of the cells, shape (nx, ny) [MPa], or indentations of the asperities,
            shape (n,) [mm].
        plastic_depth: Plastic depth that loads so far have left in the cells, by which the heights
            are lower, shape (nx, ny) [mm]; None for the surface as it was made.
        worn_depth: Depth that has worn off, by which they are lower as well; None likewise.
        by_slopes: What finite slopes add to the displacements of the cells there, (nx, ny) [mm];
            None where that is not known.
        nearby: Other solutions, which tell how solutions change with the load.
    """

    plane: RigidPlane
    values: Array
    plastic_depth: Array | None = None
    worn_depth: Array | None = None
    by_slopes: Array | None = None
    nearby: tuple[Start, ...] = ()

    @property
    def lowered(self) -> Array | None:
        """What the heights are lower by than those of the surface as it was made [mm]; or None."""
        return sum_of(self.plastic_depth, self.worn_depth)

    def towards(self, other: Start, share: float) -> Start:
        """Return what a load between this and another one, or beyond, may start from.

        Args:
            other: What the other load left behind, on the surface as it was made as well.
            share: Of the way to the other one; below 0 or above 1 it is extrapolated.
        """
        values = np.maximum(self.values + share * (other.values - self.values), 0.0)
        by_slopes = None
        if self.by_slopes is not None and other.by_slopes is not None:
            by_slopes = self.by_slopes + share * (other.by_slopes - self.by_slopes)
        known = replace(other, nearby=()), replace(self, nearby=())
        return Start(plane=self.plane, values=values, by_slopes=by_slopes, nearby=known)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShearState:
    """Tangential tractions and slip of a contact on nx × ny cells, and what follows from them.

    Args:
        shift: Shift of the plane along x and y from where it first touched [mm].
        force: Shear force on the plane along x and y [N].
        traction: Tractions on the surface along x and y, shape (2, nx, ny) [MPa].
        slip: Slip of the cells in contact since they touched, 0 elsewhere, shape (2, nx, ny) [mm].
        bound: Coulomb's bound μ p of the tractions, 0 out of contact, shape (nx, ny) [MPa].
        slipping: Which cells in contact bear the traction μ p, shape (nx, ny).
        direction: Unit vector of the last change of the shift.
        heat: Energy lost to friction per area in all load steps so far, shape (nx, ny) [N/mm].
        dissipated: The same on all cells [N mm].
        dissipated_in_step: Part of it that was lost in the last one [N mm].
        residual: Largest violation of the conditions over the largest shift of a cell.
        products: Products of the tangential compliance in the last load step.
    """

    shift: Pair
    force: Pair
    traction: Array
    slip: Array
    bound: Array
    slipping: Flags
    heat: Array
    direction: Pair = (1.0, 0.0)
    dissipated: float = 0.0
    dissipated_in_step: float = 0.0
    residual: float = 0.0
    products: int = 0

    @classmethod
    def none(cls, grid: tuple[int, int]) -> ShearState:
        """Return the state of a surface that nothing touches.

        Args:
            grid: Numbers of cells (nx, ny).
        """
        return cls(
            shift=(0.0, 0.0),
            force=(0.0, 0.0),
            traction=np.zeros((2, *grid)),
            slip=np.zeros((2, *grid)),
            bound=np.zeros(grid),
            slipping=np.zeros(grid, bool),
            heat=np.zeros(grid),
        )

    @property
    def closed(self) -> Flags:
        """Which cells are in contact, shape (nx, ny)."""
        return np.asarray(self.bound > 0.0)

    @property
    def sticking(self) -> Flags:
        """Which cells are in contact and stick, shape (nx, ny)."""
        return self.closed & ~self.slipping


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ContactState(Displayed):
    """A rough surface in contact with a rigid plane, and its sums over N patches.

    Fields are given at points: the centres of nx × ny cells, or n points anywhere. A number that is
    not known is NaN; an array by patches that is not known is empty.

    Args:
        plane: The plane in equilibrium: its approach counts from first touch, at its centre.
        patches: The patches, which make up the nominal area.
        force: Normal force [N].
        moment: First moments Σ P (x − xc), Σ P (y − yc) about the plane's centre [N mm].
        contact_area: Real contact area [mm²].
        contacts: Number of spots, or of asperities in contact.
        peak_pressure: Largest contact pressure [MPa]; 0 without contact.
        mean_separation: Mean gap between the plane and the displaced surface [mm].
        iterations: Iterations of the solver.
        residual: Largest violation of the contact conditions over the largest interference.
        overlapping_contacts: Pairs of contacts of asperities that have grown into each other.
        warning: Why the load lies outside the model's range of validity; empty within it.
        patch_force: Forces on the patches, shape (N,) [N].
        patch_area: Real contact areas in the patches, shape (N,) [mm²].
        patch_contacts: Numbers of contacts that have their largest pressure in them, shape (N,).
        patch_displacement: Mean displacements of the patches into the body, shape (N,) [mm].
        patch_separation: Mean gaps of the patches, shape (N,) [mm].
        spots: The connected spots of the contact.
        x: Abscissae of the points, shape (nx,) or (n,) [mm].
        y: Their ordinates, shape (ny,) or (n,) [mm].
        pressure: Contact pressures, shape (nx, ny) or (n,) [MPa].
        gap: Distances of the displaced surface from the plane, shape (nx, ny) or (n,) [mm]; in
            contact 0 up to the residual.
        displacement: Displacements of the surface, positive into the body, shape (nx, ny) [mm];
            of a periodic surface they count from their own mean.
        yielding: Points that bear the hardness, shape (nx, ny).
        plastic_depth: Plastic depth that loads so far have left, by which the heights are lower,
            shape (nx, ny) [mm].
        earlier_depth: That of the loads before this one, shape (nx, ny) [mm]; None: none.
        worn_depth: Depth that has worn off so far, by which the heights are lower as well, shape
            (nx, ny) [mm]; None: none.
        elastic_energy: Energy ½ ∫ p u dA of the elastic deformation [N mm].
        plastic_work: Work of the hardness on the plastic depth of all loads so far [N mm].
        indentation: Indentations of the asperities, shape (n,) [mm].
        shear: Tractions and slip along the surface; None without friction.
        heat: Energy lost to friction per area so far, shape (nx, ny) [N/mm]; None: none.
        by_slopes: What finite slopes add to the displacements, shape (nx, ny) [mm]; None: nothing.
        displaced: What other loads than pressures add to them, as tractions do where they are
            coupled, shape (nx, ny) [mm]; None: nothing.
    """

    plane: RigidPlane
    patches: PatchGrid
    force: float
    moment: tuple[float, float] = (0.0, 0.0)
    contact_area: float = np.nan
    contacts: int = 0
    peak_pressure: float = np.nan
    mean_separation: float = np.nan
    iterations: int = 0
    residual: float = 0.0
    overlapping_contacts: int = 0
    warning: str = ""
    patch_force: Array = field(default_factory=lambda: np.zeros(0))
    patch_area: Array = field(default_factory=lambda: np.zeros(0))
    patch_contacts: Counts = field(default_factory=lambda: np.zeros(0, np.int64))
    patch_displacement: Array = field(default_factory=lambda: np.zeros(0))
    patch_separation: Array = field(default_factory=lambda: np.zeros(0))
    spots: Spots | None = None
    x: Array | None = None
    y: Array | None = None
    pressure: Array | None = None
    gap: Array | None = None
    displacement: Array | None = None
    yielding: Flags | None = None
    plastic_depth: Array | None = None
    earlier_depth: Array | None = None
    worn_depth: Array | None = None
    elastic_energy: float = np.nan
    plastic_work: float = np.nan
    indentation: Array | None = None
    shear: ShearState | None = None
    heat: Array | None = None
    by_slopes: Array | None = None
    displaced: Array | None = None

    def displayed(self) -> tuple[str, Table]:
        """Return force and approach in a line, and a table of all numbers that are known."""
        line = f"ContactState: {self.force:.6g} N at an approach of {1e3 * self.approach:.4g} µm"
        known = {name: getattr(self, name) for name in _DISPLAYED}
        rows = [
            (f"{name} [{unit}]" if unit else name, f"{known[name]:.6g}")
            for name, unit in _DISPLAYED.items()
            if not np.isnan(known[name])
        ]
        return line, (("", "value"), rows)

    @property
    def approach(self) -> float:
        """Approach δ of the plane at its centre, counted from first touch [mm]."""
        return self.plane.approach

    @property
    def tilt(self) -> tuple[float, float]:
        """Slopes (tx, ty) of the approach [mm/mm]."""
        return self.plane.tilt

    @property
    def nominal_area(self) -> float:
        """Area of all patches [mm²]."""
        return float(np.prod(self.patches.lengths))

    @property
    def mean_pressure(self) -> float:
        """Force per nominal area [MPa]."""
        return self.force / self.nominal_area

    @property
    def contact_area_fraction(self) -> float:
        """Real over nominal contact area A/A0."""
        return self.contact_area / self.nominal_area

    @property
    def patch_pressure(self) -> Array:
        """Mean pressures of the patches, shape (N,) [MPa]."""
        return np.asarray(self.patch_force / self.patches.areas)

    @property
    def patch_closure(self) -> Array:
        """Mean approach of the plane less the mean displacement of each patch, (N,) [mm]."""
        return np.asarray(self.plane.means(self.patches) - self.patch_displacement)

    @property
    def in_contact(self) -> Flags:
        """Which points carry a pressure, shape (nx, ny) or (n,)."""
        return np.asarray(self.pressures > 0.0)

    @property
    def pressures(self) -> Array:
        """Contact pressures at the points, of a model that knows them [MPa].

        Raises:
            InputError: When the model has no cells.
        """
        if self.pressure is None:
            raise InputError("these contacts are not made of cells", allowed="the model half-space")
        return self.pressure

    @property
    def open_gap(self) -> Array:
        """Gaps beside the contact and 0 within, of a model that knows the points, (nx, ny) [mm]."""
        assert self.gap is not None
        return np.where(self.in_contact, 0.0, np.maximum(self.gap, 0.0))

    @property
    def guess(self) -> Start:
        """What any other load may start from, on the surface as it was made."""
        own = self.indentation
        values = self.pressures if own is None else own
        return Start(plane=self.plane, values=values, by_slopes=self.by_slopes)

    @property
    def start(self) -> Start:
        """What the next load starts from, on the surface that all loads so far have left."""
        return replace(self.guess, plastic_depth=self.plastic_depth, worn_depth=self.worn_depth)

    def summary(self) -> ContactState:
        """Return the state without spots and fields, which is small."""
        fields: dict[str, Any] = dict.fromkeys(_LARGE)
        return replace(self, **fields)

    def kappa(self, rms_slope: float, contact_modulus: float) -> float:
        """Return κ of A/A0 = κ p/(rms slope · E*); NaN where nothing touches.

        Args:
            rms_slope: Root of the mean squared gradient of the surface, sqrt<|∇h|²>.
            contact_modulus: E* [MPa].

        Source:
            Waddad et al. 2016, section 2.2, doi 10.1016/j.triboint.2015.12.023.
        """
        if not self.force > 0.0:
            return float(np.nan)
        return self.contact_area_fraction * rms_slope * contact_modulus / self.mean_pressure


def sum_of(one: Array | None, other: Array | None) -> Array | None:
    """Return the sum of two fields, where None stands for zero."""
    if one is None or other is None:
        return other if one is None else one
    return one + other


def stacked(states: Sequence[ContactState], name: str) -> NDArray[Any]:
    """Return what several states know under one name, as an array whose first axis counts them.

    Args:
        states: The states.
        name: Name of an attribute.
    """
    return np.array([getattr(state, name) for state in states])
