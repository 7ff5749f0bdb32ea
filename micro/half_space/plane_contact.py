"""A rigid plane on the cells of a surface: the contact problem, and the contact that solves it.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, Partition, Surface, overlaps, patch_means
from geometry.rigid_plane import RigidPlane, motion_units
from micro.compliance.grid_compliance import Compliance
from micro.contact.problem import ContactPressures, ContactProblem
from micro.contact.rigid_motions import Motions
from micro.contact.slope_iteration import solve_contact
from micro.contact.tangent import approach_stiffness
from micro.contact_detail import ContactDetail
from micro.half_space.contact_spots import Contacts, find_contacts
from micro.model import Stiffness
from support.cores import blas_threads
from support.errors import InputError, NotConverged

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEVEL = (0.0, 0.0)

_BACK, _SAFETY = 0.05, 1.5
"""Part of the largest interference that the plane goes back by where cells yield anew, and error of
the stiffness over what going back half and twice as far changes it by. On 24 surfaces of 64² cells,
of which half or nearly all that touch yield, the error was 1.5 times that or less on 21 and at most
twice that. As single cells come and go, it is 10 % in the median where 40 cells yield."""
_ROUNDING = 1e-7
"""Plastic depth, relative to the largest interference, that counts as none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneContact:
    """Contacts of rigid planes with one surface.

    Args:
        surface: The surface.
        reference_height: Height z_M that the approach counts from [mm].
        compliance: The elastic body.
        tolerance: Largest residual.
        hardness: Largest pressure [MPa]; None where contacts are elastic.
        depth: Plastic depth that earlier loads left in the cells, by which the heights are lower,
            shape (nx, ny) [mm]; None: none.
    """

    surface: Surface
    reference_height: float
    compliance: Compliance
    tolerance: float
    hardness: float | None = None
    depth: Array | None = None

    def equilibrium(
        self, control: Control, start: Array | None = None, near: RigidPlane | None = None
    ) -> HalfSpaceState:
        """Solve the contact and the motions of the plane that are free, as one problem.

        Args:
            control: What is prescribed of the plane.
            start: Pressures nearby, shape (nx, ny) [MPa].
            near: The plane that they belong to; needed where the force is prescribed.

        Raises:
            InputError: When a periodic surface is pressed to full contact or by a tilted plane.
            NotConverged: When the contact conditions cannot be met.
        """
        surface, modulus = self.surface, self.compliance.modulus
        if control.force == 0.0:
            control, start = self._first_touch(control, near), None
        motion = control.prescribed(np.zeros(3))
        interference = self.interference(RigidPlane.moved(surface, motion))
        if self.compliance.periodic:
            yields = self.hardness is not None  # cells give way: no approach closes all gaps
            _check_periodic(control, -np.inf if yields else float(interference.mean()))
        problem = self._problem(interference, control.free, control.loads)
        with blas_threads(1):  # all cores are taken by threads of ours
            found = solve_contact(problem, self._start(start, near))
        motion[control.free] = found.motion * self._units[control.free]
        yielding, pressure = problem.yielding(found.pressure), found.pressure * modulus
        if self.hardness is not None:
            pressure[yielding] = self.hardness
        return HalfSpaceState(
            contact=self,
            plane=RigidPlane.moved(surface, motion),
            pressure=pressure,
            yielding=yielding,
            residual=found.residual,
            iterations=found.iterations,
        )

    def interference(self, plane: RigidPlane) -> Array:
        """Return the overlap δ(x, y) − (z_M − z) of the plane and the surface without load [mm].

        Args:
            plane: The plane.

        Returns:
            Negative where they are apart, shape (nx, ny).
        """
        surface = self.surface
        below = self.reference_height - surface.heights
        if self.depth is not None:
            below += self.depth
        return np.asarray(plane.at(surface.x[:, None], surface.y) - below)

    def elastic_stiffness(self, state: HalfSpaceState, *, turns: bool) -> tuple[float, int]:
        """Return dF/dδ of the cells in contact [N/mm], and the products of the compliance.

        It is that of unloading: cells that yield bear less than the hardness then.

        Args:
            state: A solution.
            turns: Whether the plane turns without moment; otherwise its slopes stay.
        """
        free, modulus = np.array([False, turns, turns]), self.compliance.modulus
        problem = self._problem(self.interference(state.plane), free, np.zeros(3))
        with blas_threads(1):
            rate, products = approach_stiffness(problem, state.pressure / modulus)
        return rate * modulus * float(np.prod(self.surface.spacing)), products

    @property
    def _units(self) -> Array:
        """Motions of the plane, approach and slopes, that move its corners by 1 mm, shape (3,)."""
        return motion_units(0.5 * float(np.hypot(*self.surface.lengths)))

    def _problem(self, interference: Array, free: Flags, loads: Array) -> ContactProblem:
        """Return the contact problem of a plane.

        Args:
            interference: Overlap at zero free motions, shape (nx, ny) [mm].
            free: Which of approach and slopes are free, shape (3,).
            loads: Force and first moments, shape (3,) [N, N mm]; those of free motions count.
        """
        surface, modulus, unit = self.surface, self.compliance.modulus, self._units
        lx, ly = surface.lengths
        x, y = (surface.x - 0.5 * lx) * unit[1], (surface.y - 0.5 * ly) * unit[2]
        cell = surface.spacing[0] * surface.spacing[1]
        return ContactProblem(
            compliance=self.compliance,
            spacing=surface.spacing,
            interference=interference,
            motions=Motions.of_plane(x, y, free, loads / (modulus * cell)),
            tolerance=self.tolerance,
            hardness=np.inf if self.hardness is None else self.hardness / modulus,
        )

    def _first_touch(self, control: Control, near: RigidPlane | None) -> Control:
        """Return the approach at which a plane without force, tilted as one near, first touches."""
        tilt = control.tilt if control.tilt is not None else near.tilt if near else LEVEL
        touch = -float(self.interference(RigidPlane.above(self.surface, 0.0, tilt)).max())
        return Control(approach=touch, tilt=tilt)

    def _start(self, pressure: Array | None, near: RigidPlane | None) -> ContactPressures | None:
        if pressure is None:
            return None
        if pressure.shape != self.surface.grid:
            problem, allowed = "the solution to start from is of another grid", self.surface.grid
            raise InputError(problem, value=pressure.shape, allowed=f"{allowed}")
        motion = np.zeros(0) if near is None else np.array([near.approach])
        return ContactPressures(np.divide(pressure, self.compliance.modulus), motion)


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpaceState:
    """Contact of all cells with one plane; maps are evaluated when first used.

    Args:
        contact: What the plane presses on.
        plane: The rigid plane: approach at the centre from first touch, and slopes.
        pressure: Contact pressure, shape (nx, ny) [MPa].
        yielding: Which cells bear the hardness, shape (nx, ny).
        residual: Largest violation of gap ≥ 0 and of gap = 0 under pressure, relative to the
            largest interference. It bounds the error of the force: this is exact for a surface
            whose heights differ by ``residual`` δ at most.
        iterations: Products of the compliance with pressures.
    """

    contact: PlaneContact
    plane: RigidPlane
    pressure: Array
    yielding: Flags
    residual: float
    iterations: int

    @property
    def approach(self) -> float:
        """Rigid approach δ at the centre, counted from first touch [mm]."""
        return self.plane.approach

    @property
    def spacing(self) -> tuple[float, float]:
        """Sides (dx, dy) of a cell [mm]."""
        return self.contact.surface.spacing

    @property
    def force(self) -> float:
        """Normal force [N]."""
        return float(self.pressure.sum()) * self.spacing[0] * self.spacing[1]

    @property
    def peak_pressure(self) -> float:
        """Largest pressure of a cell [MPa]."""
        return float(self.pressure.max())

    @property
    def detail(self) -> ContactDetail:
        """The spots, and pressures and gaps of all cells."""
        spots, surface = self.contacts, self.contact.surface
        return ContactDetail(
            place=spots.peak,
            area=spots.area,
            force=spots.force,
            peak_pressure=spots.peak_pressure,
            x=surface.x,
            y=surface.y,
            pressure=self.pressure,
            gap=self.gap,
            plastic_depth=self.plastic_depth,
        )

    @cached_property
    def plastic_depth(self) -> Array | None:
        """Plastic depth of the cells, that of earlier loads included, shape (nx, ny) [mm].

        It is what overlap is left where the pressure is the hardness; None without a hardness.
        """
        contact = self.contact
        if contact.hardness is None:
            return None
        return self._depth_anew if contact.depth is None else contact.depth + self._depth_anew

    @cached_property
    def _depth_anew(self) -> Array:
        """Plastic depth that this load adds to that of earlier ones, shape (nx, ny) [mm]."""
        overlap = self.contact.interference(self.plane) - self.displacement
        return np.where(self.yielding, np.maximum(overlap, 0.0), 0.0)

    def stiffness(self, *, turns: bool) -> Stiffness:
        """Return dF/dδ on the side that the plane came from.

        It is the elastic one, by a linear solution, unless cells yield anew. Then other cells keep
        entering that soon bear the whole hardness. The derivative for a fixed set of cells leaves
        them out, so that the plane is taken back by finite increments.

        Args:
            turns: Whether the plane turns without moment; otherwise its slopes stay.
        """
        contact = self.contact
        largest = float(contact.interference(self.plane).max())
        anew = max(_ROUNDING, 10.0 * contact.tolerance) * largest
        if contact.hardness is None or not float(self._depth_anew.max()) > anew:
            value, used = contact.elastic_stiffness(self, turns=turns)
            return Stiffness(value if np.isfinite(value) else None, used)
        tilt, found, used = None if turns else self.plane.tilt, [], 0
        for part in (0.5, 1.0, 2.0):
            back = part * _BACK * largest
            control = Control(approach=self.approach - back, tilt=tilt)
            try:
                state = contact.equilibrium(control, self.pressure, self.plane)
            except NotConverged as error:
                return Stiffness(None, used + error.iterations)
            found.append((self.force - state.force) / back)
            used += state.iterations
        # one cell that enters, up to the hardness or as far as it gives way
        cell = float(np.prod(self.spacing))
        bears = contact.hardness * cell / (_BACK * largest)
        one = min(bears, contact.compliance.modulus * float(np.sqrt(cell)))
        change = max(one, float(np.abs(np.diff(found)).max()))
        return Stiffness(found[1], used, _SAFETY * change)

    def interface_stiffness(self) -> float:
        """Return the elastic dF/dδ of the contacts on half-spaces, without body and slopes [N/mm].

        Cells that yield conduct as the others.
        """
        alone = replace(self.contact.compliance, sides=None, body=None, slopes=None)
        return replace(self.contact, compliance=alone).elastic_stiffness(self, turns=False)[0]

    @property
    def elastic_energy(self) -> float:
        """Energy ½ ∫ p u dA of the elastic deformation [N mm]."""
        cell = self.spacing[0] * self.spacing[1]
        return 0.5 * float(np.vdot(self.pressure, self.displacement)) * cell

    @property
    def plastic_work(self) -> float:
        """Work of the hardness on the plastic depth, that of earlier loads included [N mm]."""
        depth, hardness = self.plastic_depth, self.contact.hardness
        if depth is None or hardness is None:
            return 0.0
        return hardness * float(depth.sum()) * self.spacing[0] * self.spacing[1]

    @property
    def in_contact(self) -> Flags:
        """Which cells carry a pressure, shape (nx, ny)."""
        return self.pressure > 0.0

    @property
    def counted_area(self) -> float:
        """Area of all cells under pressure [mm²]; too large by a part of the perimeter."""
        return np.count_nonzero(self.pressure) * self.spacing[0] * self.spacing[1]

    @property
    def contact_area(self) -> float:
        """Real contact area, corrected by the perimeter [mm²]."""
        return float(self.contacts.area.sum())

    @cached_property
    def contacts(self) -> Contacts:
        """The connected contacts."""
        contact = self.contact
        return find_contacts(
            self.pressure,
            self.spacing,
            periodic=contact.compliance.periodic,
            hardness=contact.hardness,
        )

    @cached_property
    def displacement(self) -> Array:
        """Normal displacement of the surface at the cell centres, shape (nx, ny) [mm].

        On a periodic surface it counts from its own mean.
        """
        compliance = self.contact.compliance
        pressure = np.divide(self.pressure, compliance.modulus)
        found = compliance.on_grid(pressure.shape, self.spacing).displacement(pressure)
        if compliance.slopes is not None:
            found += compliance.slope_displacement(pressure)
        return found

    @property
    def interference(self) -> Array:
        """Overlap of the plane and the surface without load, shape (nx, ny) [mm].

        It is negative where they are apart. The surface has its plastic depth.
        """
        return replace(self.contact, depth=self.plastic_depth).interference(self.plane)

    @property
    def gap(self) -> Array:
        """Distance of the displaced surface from the plane, shape (nx, ny) [mm]."""
        return self.displacement - self.interference

    def row(self, patches: Partition, mean_heights: Array) -> dict[str, Any]:
        """Return the fields of a `Response` at this approach: sums and means over patches.

        Pressure, area and displacement of a cell that straddles a border are shared by area; force
        and area outside of all patches count for the nearest. A contact counts for the patch that
        holds its largest pressure.

        Args:
            patches: The N patches, within the surface's rectangle.
            mean_heights: Mean heights of the patches, shape (N,) [mm].
        """
        plane, surface = self.plane, self.contact.surface
        displaced = Surface(heights=self.displacement, lengths=surface.lengths)
        displacement = patch_means(displaced, patches)
        below = self.contact.reference_height - plane.means(patches)
        separation = below - mean_heights + displacement
        if self.plastic_depth is not None:
            flattened = Surface(heights=self.plastic_depth, lengths=surface.lengths)
            separation += patch_means(flattened, patches)
        borders = patches.borders_x, patches.borders_y
        x, y = map(overlaps, borders, surface.lengths, surface.grid)
        forces = self.pressure * (self.spacing[0] * self.spacing[1])
        return {
            "approach": plane.approach,
            "force": self.force,
            "moment": plane.moment(surface.x[:, None], surface.y, forces),
            "contact_area": self.contact_area,
            "contacts": len(self.contacts),
            "mean_separation": np.average(separation, weights=patches.areas),
            "iterations": self.iterations,
            "residual": self.residual,
            "overlapping_contacts": 0,
            "patch_force": (x @ self.pressure @ y.T).ravel(),
            "patch_contact_area": (x @ self.contacts.share @ y.T).ravel(),
            "patch_contacts": self.contacts.per_patch(patches, self.spacing),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": "",
        }


def _check_periodic(control: Control, overlap: float) -> None:
    """Refuse planes that are not level, and approaches beyond full contact."""
    if control.tilt is None or any(control.tilt):
        problem, value = "a plane over a periodic surface must be level", control.tilt or "free"
        raise InputError(problem, value=value, allowed="tilt (0, 0)")
    if control.approach is not None and overlap >= 0.0:
        allowed = f"< {control.approach - overlap:.6g} mm; beyond it give the force"
        problem = "a periodic surface has no gap left at this approach"
        raise InputError(problem, value=control.approach, allowed=allowed)
