"""The record of one load step, and of every patch in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geometry import Control, PatchGrid, Regions
from multiscale.loading.leak import Leak
from multiscale.readable import measured, number
from support.arrays import Array
from support.displayed import Displayed, Table

_SAME = 1e-6
"""Relative change below which the forces, or approaches, of two load steps count as the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchState:
    """State of every patch at one load step.

    Attributes:
        closure_mm: Mean closure of each patch, shape (N,) [mm].
        pressure_MPa: Mean pressure on each patch, shape (N,) [MPa].
        contact_area_fraction: Real over nominal contact area of each patch, shape (N,).
        stiffness_MPa_per_mm: Derivative dp/dc of each patch's law at its closure, or its mean over
            the points of the patch, shape (N,) [MPa/mm]; None without laws.
    """

    closure_mm: Array
    pressure_MPa: Array
    contact_area_fraction: Array
    stiffness_MPa_per_mm: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoadStep(Displayed):
    """One accepted load step; the fields up to `reason` are columns of ``history.csv``.

    Attributes:
        step: Number of the step, from 1; 0 before it is accepted.
        approach_mm: Approach of the rigid plane from first touch [mm].
        force_N: Normal force on the plane [N].
        mean_pressure_MPa: Force over nominal contact area [MPa].
        contact_area_fraction: Real over nominal contact area.
        mean_separation_mm: Mean gap between the plane and the deformed surface [mm].
        contacts: Number of contacts.
        newton_iterations: Newton steps, those of failed and halved steps included; without laws
            (analytic, concurrent) the iterations of the contact problem.
        linear_iterations: Iterations of the linear solver.
        wall_s: Wall time of the step [s].
        reason: Name of the reason for which the iteration stopped.
        patches: The state of every patch.
        imbalance: Force on the plane minus reaction of the support, relative to the force; None
            where there is no support.
        tilt: Slopes (tx, ty) of the approach about the middle of the interface [mm/mm].
        moment_N_mm: First moments (Σ P (x − xc), Σ P (y − yc)) of the forces about the middle
            [N mm].
        warnings: Why the micro model, where it was solved itself, is outside its range of
            validity; empty within it.
        meshes: Approach [mm], force [N] and contact area fraction on every mesh of a reference;
            the last mesh is the finest, whose results the step has. Empty with other couplings.
        force_error_N: Error bound of the force [N]; 0 where it is prescribed, None where it was
            not measured.
        approach_error_mm: Error bound of the approach [mm]; 0 where it is prescribed, None where
            it was not measured.
        peak_pressure_MPa: Largest contact pressure [MPa]; None where it is not known.
        stiffness_N_per_mm: Interfacial stiffness, the derivative dF/dδ of the force by the
            approach, under fixed slopes or, where the plane turns, without moment, on the side
            that the plane came from [N/mm]; None where it was not found.
        stiffness_error_N_per_mm: Error bound of the stiffness where cells yield further; 0 where a
            linear solution gives it [N/mm].
        elastic_energy_mJ: Energy of the elastic deformation of all bodies; None where it is not
            known [mJ].
        plastic_work_mJ: Work of the hardness on the plastic depth, since the start [mJ]; None where
            it is not known.
        yielding_area_fraction: Area that carries the hardness over nominal contact area; None
            without a hardness.
        plastic_depth_mm: Largest plastic depth that the loads so far have left [mm]; None without a
            hardness.
        work_mJ: Work of the forces on the plane, since the start [mJ]; None where no energy is
            known.
        thermal_conductance_W_per_K: Conductance of contacts and gaps [W/K]; None where the scene
            asks for none.
        gap_conductance_W_per_K: Part of it through gas and radiation [W/K].
        electrical_conductance_S: Conductance of the contacts [S]; None where the scene asks for
            none.
        shear_force_x_N: Shear force on the plane along x [N]; None without friction, as all up to
            the dissipated energy.
        shear_force_y_N: Shear force along y [N].
        shear_x_mm: Shift of the plane along x from where it first touched [mm].
        shear_y_mm: Shift along y [mm].
        slip_area_fraction: Area that bears the traction μ p over nominal contact area.
        tangential_stiffness_N_per_mm: Derivative of the shear force along the shift, in the
            direction of its last change [N/mm]; None where it was not found.
        dissipated_mJ: Energy lost to friction since the start [mJ].
        leaks: What leaks, by the way of the fluid; empty where the scene does not ask for it.
        zero_mm: Approach from first touch of the height that approach and closures count from [mm].
        stage: Number of the stage, from 1; None where the load history has none.
        body_state: Position among the states of the bodies' loads, see `geometry.Control`.
        errors: Causes of the error, and how much each may change the force at this approach [N];
            empty where they were not measured.
    """

    step: int = 0
    approach_mm: float
    force_N: float
    mean_pressure_MPa: float
    contact_area_fraction: float
    mean_separation_mm: float
    contacts: int
    newton_iterations: int
    linear_iterations: int = 0
    wall_s: float = 0.0
    reason: str = "CONVERGED"
    patches: PatchState
    imbalance: float | None = None
    tilt: tuple[float, float] = (0.0, 0.0)
    moment_N_mm: tuple[float, float] = (0.0, 0.0)
    warnings: tuple[str, ...] = ()
    meshes: tuple[tuple[float, float, float], ...] = ()
    force_error_N: float | None = None
    approach_error_mm: float | None = None
    peak_pressure_MPa: float | None = None
    stiffness_N_per_mm: float | None = None
    stiffness_error_N_per_mm: float | None = None
    elastic_energy_mJ: float | None = None
    plastic_work_mJ: float | None = None
    work_mJ: float | None = None
    yielding_area_fraction: float | None = None
    plastic_depth_mm: float | None = None
    thermal_conductance_W_per_K: float | None = None
    gap_conductance_W_per_K: float | None = None
    electrical_conductance_S: float | None = None
    shear_force_x_N: float | None = None
    shear_force_y_N: float | None = None
    shear_x_mm: float | None = None
    shear_y_mm: float | None = None
    slip_area_fraction: float | None = None
    tangential_stiffness_N_per_mm: float | None = None
    dissipated_mJ: float | None = None
    leaks: tuple[Leak, ...] = ()
    zero_mm: float = 0.0
    stage: int | None = None
    body_state: float = 0.0
    errors: tuple[tuple[str, float], ...] = ()

    def displayed(self) -> tuple[str, Table]:
        """Return approach and force in a line, and a table of all numbers that are known."""
        line = (
            f"LoadStep {self.step}: {measured(self.approach_mm, self.approach_error_mm, 'mm')}, "
            f"{measured(self.force_N, self.force_error_N, 'N')}"
        )
        values = ((one.name, getattr(self, one.name)) for one in fields(self))
        rows = [
            (name, number(value, 6) if isinstance(value, float) else str(value))
            for name, value in values
            if isinstance(value, float | int | str) and value != ""
        ]
        return line, (("", "value"), rows)

    @classmethod
    def of_patches(
        cls,
        grid: PatchGrid | Regions,
        *,
        plane: Sequence[float] | Array,
        load: Sequence[float] | Array,
        closure: Array,
        pressure: Array,
        area_fraction: Array,
        separation: Array | float,
        contacts: ArrayLike,
        stiffness: Array | None = None,
        areas: Array | None = None,
        **other: Any,
    ) -> LoadStep:
        """Return the load step that patches make together.

        Args:
            grid: The partition, or regions.
            plane: Approach at the middle of the interface [mm], and slopes of the approach.
            load: Force [N], and first moments of the forces about the middle [N mm].
            closure: Mean closures of the patches, shape (N,) [mm].
            pressure: Mean pressures of the patches, shape (N,) [MPa].
            area_fraction: Real over nominal contact areas of the patches, shape (N,).
            separation: Mean gaps of the patches, or their mean [mm].
            contacts: Numbers of contacts in the patches, or their sum.
            stiffness: Stiffnesses dp/dc of the patches' laws, shape (N,) [MPa/mm]; none without.
            areas: Areas of the patches, shape (N,) [mm²]; needed of regions.
            **other: Other fields of the load step.
        """
        (approach, tx, ty), (force, mx, my) = map(float, plane), map(float, load)
        whole, weights = 0.0, areas
        if isinstance(grid, PatchGrid):
            whole, weights = grid.area * grid.count, None
        elif areas is not None:
            whole = float(areas.sum())
        return cls(
            approach_mm=approach,
            force_N=force,
            mean_pressure_MPa=force / whole,
            contact_area_fraction=float(np.average(area_fraction, weights=weights)),
            mean_separation_mm=float(
                np.average(np.broadcast_to(separation, np.shape(closure)), weights=weights)
            ),
            contacts=int(np.sum(contacts)),
            patches=PatchState(
                closure_mm=closure,
                pressure_MPa=pressure,
                contact_area_fraction=area_fraction,
                stiffness_MPa_per_mm=stiffness,
            ),
            tilt=(tx, ty),
            moment_N_mm=(mx, my),
            **other,
        )

    def counted_from(self, zero: float) -> LoadStep:
        """Return the load step with approach and closures counted from another height.

        Args:
            zero: Approach at which the plane is at this height, as this load step counts it [mm].
        """
        if not zero:
            return self
        return replace(
            self,
            approach_mm=self.approach_mm - zero,
            zero_mm=self.zero_mm + zero,
            meshes=tuple((approach - zero, *others) for approach, *others in self.meshes),  # type: ignore[misc]
            patches=replace(self.patches, closure_mm=self.patches.closure_mm - zero),
        )

    def is_unloading(self, before: LoadStep | None) -> bool:
        """Tell whether the force fell to this load step, or under the same force the approach.

        Args:
            before: The load step before it; None for the first.
        """
        if before is None:
            return False
        for here, there in (
            (self.force_N, before.force_N),
            (self.approach_mm, before.approach_mm),
        ):
            if abs(here - there) > _SAME * max(abs(here), abs(there)):
                return here < there
        return False

    @property
    def under_its_plane(self) -> Control:
        """What brings the plane of the load step, counted from first touch, back to where it is."""
        return Control(approach=self.approach_mm, tilt=self.tilt, body_state=self.body_state)

    @property
    def first_touch_approach_mm(self) -> float | None:
        """Approach counted from first touch [mm]; None where `approach_mm` counts from there."""
        return self.approach_mm + self.zero_mm if self.zero_mm else None

    def leak(self, way: str) -> Leak | None:
        """Return what leaks along a way; None where that is not known.

        Args:
            way: A key of `multiscale.loading.leak.WAYS`.
        """
        return next((one for one in self.leaks if one.way == way), None)

    @property
    def tilt_x(self) -> float:
        """Slope of the approach along x."""
        return self.tilt[0]

    @property
    def tilt_y(self) -> float:
        """Slope of the approach along y."""
        return self.tilt[1]

    @property
    def moment_x_N_mm(self) -> float:
        """First moment of the forces along x [N mm]."""
        return self.moment_N_mm[0]

    @property
    def moment_y_N_mm(self) -> float:
        """First moment of the forces along y [N mm]."""
        return self.moment_N_mm[1]
