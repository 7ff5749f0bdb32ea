"""The record of one load step, and of every patch in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry import Control, PatchGrid, Regions
from patchlaw.multiscale.loading.column import (
    REQUIRED,
    DerivedColumn,
    Leak,
    Mode,
    column,
    columns_of,
    leak_columns,
    unknown_column,
)
from patchlaw.support import Array, check_fields
from patchlaw.support.readable import Displayed, Table, measured, number

LOOSE = (
    "the plane, free to tilt, rests on cells or patches in one line, about which nothing holds it, "
    "not even cells that yield: its tilt about that line, and with it gaps, mean separation and "
    "leak, are any of many"
)
"""What a load step warns of where the equilibrium leaves the tilt open."""
CLEAR = (
    "the plane, free to tilt, presses nothing at this approach: it stays as it came clear of the "
    "face, and its tilt, and with it gaps and mean separation, are any of many"
)
"""The same on faces of meshes. Over cells and whole patches that of largest clearance counts."""
_SAME = 1e-6
"""Relative change below which the forces, or approaches, of two load steps count as the same."""
_NO_GAP = 1e-15
"""Mean gap that counts as none [mm]: the rounding of heights of some mm, which is all that full
contact leaves."""


@dataclass(frozen=True, slots=True)
class PatchState:
    """State of every patch at one load step.

    Attributes:
        closure_mm: Mean closure of each patch, shape (N,) [mm].
        pressure_MPa: Mean pressure on each patch, shape (N,) [MPa].
        contact_area_fraction: Real over nominal contact area of each patch, shape (N,).
        interface_stiffness_MPa_per_mm: Derivative −dp/dū of each patch's law by its mean gap ū, or
            its mean over the points of the patch, shape (N,) [MPa/mm]; None without laws.
        force_N: Force on each region of a face, shape (N,) [N]; None of patches on a grid.
        contact_area_mm2: Real contact area of each region, shape (N,) [mm²]; None likewise.
        leak_mm3_per_s: Part of a leak over the face that leaves it from each region, shape (N,)
            [mm³/s]; None without.
    """

    closure_mm: Array
    pressure_MPa: Array
    contact_area_fraction: Array
    interface_stiffness_MPa_per_mm: Array | None = None
    force_N: Array | None = None
    contact_area_mm2: Array | None = None
    leak_mm3_per_s: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoadStep(Displayed):
    """One accepted load step.

    Meaning and unit of the columns of ``history.csv`` stand where they are declared; None stands
    for what a run does not measure. A new column is one more `column` here, behind those that are
    there.

    Attributes:
        step: 0 before the load step is accepted.
        approach_mm: Counted from first touch until `counted_from` another height.
        newton_iterations: Without laws the iterations of the contact problem.
        interface_stiffness_N_per_mm: Under fixed slopes or, where the plane turns, without moment,
            as the load goes on; that of unloading where no cell yields further. Of laws of samples
            the integral of −dp/dū over the face.
        interface_stiffness_error_N_per_mm: Sum of all causes; None where errors are not measured,
            as `stiffness_scatter` alone is not all of it.
        approach_stiffness_N_per_mm: Likewise, with the compliance of the bodies.
        stiffness_scatter: 0 of linear solutions, where no cell yields further.
        slip_area_fraction: None without friction, as in all columns on shear.
        patches: The state of every patch.
        imbalance: Force on the plane minus reaction of the support, relative to the force; None
            where there is no support.
        tilt: Slopes (tx, ty) of the approach about the middle of the interface [mm/mm].
        moment_N_mm: First moments (Σ P (x − xc), Σ P (y − yc)) of the forces about the middle
            [N mm].
        warnings: Why the micro model, where it was solved itself, is outside its range of
            validity, or that nothing holds the plane (`LOOSE`, `CLEAR`); empty otherwise.
        meshes: Approach [mm], force [N] and contact area fraction on every mesh of a reference;
            the last mesh is the finest, whose results the step has. Empty with other couplings.
        leaks: What leaks, by the way of the fluid; empty where the scene does not ask for it.
        modes: Natural modes about the load step; empty where the scene does not ask for them.
        zero_mm: Approach from first touch of the height that approach and closures count from [mm].
        control: What was prescribed, from first touch; None of load steps that are read.
        errors: Causes of the error, and how much each may change the force at this approach [N];
            empty where they were not measured.
        shear_errors: Likewise of the shear: of the shear force at this shift [N], or of the shift
            under this shear force [mm].
    """

    step: int = column("Number of the load step, from 1", heading="step", table="curve", default=0)
    approach_mm: float = column(
        "Approach of the rigid plane, counted from the zero of the load", "mm", heading="approach",
        table="curve", error="approach_error_mm", default=REQUIRED,
    )  # fmt: skip
    force_N: float = column(
        "Normal force on the plane", "N", heading="force", table="curve", digits=6,
        error="force_error_N", default=REQUIRED,
    )  # fmt: skip
    mean_pressure_MPa: float = column(
        "Force over the nominal contact area", "MPa", heading="pressure", table="curve", digits=5,
        default=REQUIRED,
    )  # fmt: skip
    contact_area_fraction: float = column(
        "Real over nominal contact area", heading="area", table="curve",
        error="contact_area_fraction_error", default=REQUIRED,
    )  # fmt: skip
    mean_separation_mm: float = column(
        "Mean gap between the plane and the deformed surface", "mm", heading="separation",
        table="curve", error="mean_separation_error_mm", default=REQUIRED,
    )  # fmt: skip
    contacts: int = column(
        "Number of contacts", heading="contacts", table="curve", default=REQUIRED
    )
    newton_iterations: int = column(
        "Iterations of the contact problem, Newton steps under laws; of halved load steps too",
        heading="iterations", table="solver", default=REQUIRED,
    )  # fmt: skip
    linear_iterations: int = column(
        "Iterations of the linear solver", heading="linear", table="solver", default=0
    )
    wall_s: float = column("Wall time", "s", heading="time", digits=3, table="solver", default=0.0)
    reason: str = column("Name of the reason for which the iteration stopped", default="CONVERGED")
    tilt_x = DerivedColumn(lambda step: step.tilt[0], "Slope of the approach along x", "mm/mm")
    tilt_y = DerivedColumn(lambda step: step.tilt[1], "Slope of the approach along y", "mm/mm")
    moment_x_N_mm = DerivedColumn(
        lambda step: step.moment_N_mm[0], "First moment Σ P (x − xc) of the forces P", "N mm"
    )
    moment_y_N_mm = DerivedColumn(
        lambda step: step.moment_N_mm[1], "First moment Σ P (y − yc) of the forces P", "N mm"
    )
    force_error_N: float | None = column("Error of the force; 0 where it is prescribed", "N")
    approach_error_mm: float | None = column(
        "Error of the approach; 0 where it is prescribed", "mm"
    )
    peak_pressure_MPa: float | None = column(
        "Largest contact pressure", "MPa", heading="peak pressure"
    )
    interface_stiffness_N_per_mm: float | None = column(
        "Stiffness of the interface alone, −dF/dū with the mean gap ū", "N/mm",
        heading="interface stiffness", error="interface_stiffness_error_N_per_mm",
        in_report="interface stiffness",
    )  # fmt: skip
    interface_stiffness_MPa_per_mm: float | None = column(
        "The same per nominal contact area", "MPa/mm", heading="per area",
        error="interface_stiffness_error_MPa_per_mm", in_report="interface stiffness per area",
    )  # fmt: skip
    approach_stiffness_N_per_mm: float | None = column(
        "Stiffness against the plane's approach, dF/dδ, bodies included", "N/mm",
        heading="approach stiffness", error="approach_stiffness_error_N_per_mm",
    )  # fmt: skip
    elastic_energy_mJ: float | None = column(
        "Energy of the elastic deformation", "mJ", heading="elastic energy"
    )
    plastic_work_mJ: float | None = column(
        "Work of the hardness on the plastic depth", "mJ", heading="plastic work"
    )
    work_mJ: float | None = column("Work of the forces on the plane", "mJ")
    yielding_area_fraction: float | None = column(
        "Area that carries the hardness over nominal contact area", heading="yielding area"
    )
    plastic_depth_mm: float | None = column(
        "Largest plastic depth that the loads so far have left", "mm", heading="plastic depth",
        in_report="plastic depth",
    )  # fmt: skip
    thermal_conductance_W_per_K: float | None = column(
        "Thermal conductance of contacts and gaps", "W/K", heading="thermal conductance",
        in_report="thermal conductance", error="thermal_conductance_error_W_per_K",
    )  # fmt: skip
    gap_conductance_W_per_K: float | None = column(
        "Part of it through gas and radiation", "W/K", heading="of it through gaps",
        error="gap_conductance_error_W_per_K",
    )  # fmt: skip
    electrical_conductance_S: float | None = column(
        "Electrical conductance of the contacts", "S", heading="electrical conductance",
        in_report="electrical conductance", error="electrical_conductance_error_S",
    )  # fmt: skip
    interface_stiffness_error_N_per_mm: float | None = column(
        "Error of the interface's stiffness", "N/mm"
    )
    approach_stiffness_error_N_per_mm: float | None = column(
        "Error of the stiffness against the approach", "N/mm"
    )
    first_touch_approach_mm = DerivedColumn(
        lambda step: step.approach_mm + step.zero_mm if step.zero_mm else None,
        "Approach counted from first touch, where approach_mm counts from another height", "mm",
        heading="from first touch",
    )  # fmt: skip
    shear_force_x_N: float | None = column(
        "Shear force on the plane along x", "N", heading="shear force x",
        error="shear_force_error_N", in_report="shear force along x",
    )  # fmt: skip
    shear_force_y_N: float | None = column(
        "Shear force on the plane along y", "N", heading="shear force y",
        in_report="shear force along y",
    )  # fmt: skip
    shear_x_mm: float | None = column(
        "Shift of the plane along x from where it first touched", "mm", heading="shift x",
        error="shear_error_mm", in_report="shift along x",
    )  # fmt: skip
    shear_y_mm: float | None = column(
        "Shift of the plane along y from where it first touched", "mm", heading="shift y",
        in_report="shift along y",
    )  # fmt: skip
    slip_area_fraction: float | None = column(
        "Area that bears the traction μ p over nominal contact area", heading="slip area",
        error="slip_area_error",
    )  # fmt: skip
    tangential_stiffness_N_per_mm: float | None = column(
        "Tangential stiffness, shear force over shift that goes on as it changed last, along x "
        "before its first change", "N/mm",
        heading="tangential stiffness", in_report="tangential stiffness",
    )  # fmt: skip
    dissipated_mJ: float | None = column(
        "Energy lost to friction", "mJ", heading="lost to friction", error="dissipated_error_mJ",
        in_report="lost to friction",
    )  # fmt: skip
    shear_force_error_N: float | None = column(
        "Error of the shear force; 0 where it is prescribed", "N"
    )
    shear_error_mm: float | None = column("Error of the shift; 0 where it is prescribed", "mm")
    stage: int | None = column(
        "Number of the stage, where the load history has stages", heading="stage"
    )
    dissipated_error_mJ: float | None = column("Error of the energy lost to friction", "mJ")
    slip_area_error: float | None = column("Error of the slip area fraction")
    contact_area_fraction_error: float | None = column("Error of the contact area fraction")
    mean_separation_error_mm: float | None = column("Error of the mean separation", "mm")
    first_frequency_Hz: float | None = column(
        "Lowest natural frequency", "Hz", heading="first frequency",
        error="first_frequency_error_Hz", in_report="first frequency",
    )  # fmt: skip
    first_frequency_error_Hz: float | None = column("Error of the lowest natural frequency", "Hz")
    least_damping_per_s: float | None = column(
        "Least rate at which one of the modes decays, below zero where it grows", "1/s",
        heading="least damping",
    )  # fmt: skip
    slid_mm: float | None = column(
        "Distance that the surfaces have slid on each other; under partial slip the mean over the "
        "contact, in proportion to the pressure", "mm", heading="slid",
    )  # fmt: skip
    worn_volume_mm3: float | None = column(
        "Volume that has worn off", "mm³", heading="worn volume", in_report="worn volume",
        error="worn_volume_error_mm3",
    )  # fmt: skip
    mean_worn_depth_mm: float | None = column(
        "The same over the nominal contact area", "mm", heading="mean worn depth",
        error="mean_worn_depth_error_mm",
    )  # fmt: skip
    worn_depth_mm: float | None = column(
        "Largest worn depth of a cell; under laws that of a point of the face or of a patch, the "
        "mean of its cells, of which the deepest lie several times as deep",
        "mm", heading="worn depth", in_report="largest worn depth", error="worn_depth_error_mm",
    )  # fmt: skip
    thermal_conductance_error_W_per_K: float | None = column(
        "Error of the thermal conductance", "W/K"
    )
    electrical_conductance_error_S: float | None = column(
        "Error of the electrical conductance", "S"
    )
    friction_power_W: float | None = column(
        "Power that friction takes where the surfaces slide at a speed, μ times force and speed",
        "W", heading="friction power", in_report="friction power",
    )  # fmt: skip
    stiffness_scatter: float | None = column(
        "Relative error of both stiffnesses by single cells alone, where cells yield further"
    )
    worn_volume_error_mm3: float | None = column("Error of the worn volume", "mm³")
    mean_worn_depth_error_mm: float | None = column("Error of the mean worn depth", "mm")
    worn_depth_error_mm: float | None = column("Error of the largest worn depth", "mm")
    gap_conductance_error_W_per_K: float | None = column(
        "Error of the conductance through gaps", "W/K"
    )
    patches: PatchState
    imbalance: float | None = None
    tilt: tuple[float, float] = (0.0, 0.0)
    moment_N_mm: tuple[float, float] = (0.0, 0.0)
    warnings: tuple[str, ...] = ()
    meshes: tuple[tuple[float, float, float], ...] = ()
    leaks: tuple[Leak, ...] = ()
    modes: tuple[Mode, ...] = ()
    zero_mm: float = 0.0
    control: Control | None = None
    errors: tuple[tuple[str, float], ...] = ()
    shear_errors: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise unknown_column(self, name)

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
        patches: PatchState,
        separation: Array | float,
        contacts: ArrayLike,
        areas: Array | None = None,
        shear: Any = None,
        **other: Any,
    ) -> LoadStep:
        """Return the load step that patches make together.

        Args:
            grid: The partition, or regions.
            plane: Approach at the middle of the interface [mm], and slopes of the approach.
            load: Force [N], and first moments of the forces about the middle [N mm].
            patches: Their closures, pressures, contact areas and stiffnesses.
            separation: Mean gaps of the patches, or their mean [mm].
            contacts: Numbers of contacts in the patches, or their sum.
            areas: Areas of the patches, shape (N,) [mm²]; needed of regions.
            shear: Force [N], shift [mm] and energy lost [N mm] of a `ShearState` or of the like of
                laws; none without friction.
            **other: Other fields of the load step.
        """
        (approach, tx, ty), (force, mx, my) = map(float, plane), map(float, load)
        whole, weights, fractions = 0.0, areas, patches.contact_area_fraction
        if shear is not None:
            other["shear_force_x_N"], other["shear_force_y_N"] = shear.force
            other["shear_x_mm"], other["shear_y_mm"] = shear.shift
            other["dissipated_mJ"] = shear.dissipated
        if isinstance(grid, PatchGrid):
            whole, weights = grid.area * grid.count, None
        elif areas is not None:
            whole = float(areas.sum())
        if areas is not None:
            forces = areas * patches.pressure_MPa
            patches = replace(patches, force_N=forces, contact_area_mm2=areas * fractions)
        gap = float(np.average(np.broadcast_to(separation, fractions.shape), weights=weights))
        return cls(
            approach_mm=approach,
            force_N=force,
            mean_pressure_MPa=force / whole,
            contact_area_fraction=float(np.average(fractions, weights=weights)),
            mean_separation_mm=0.0 if abs(gap) < _NO_GAP else gap,
            contacts=int(np.sum(contacts)),
            patches=patches,
            tilt=(tx, ty),
            moment_N_mm=(mx, my),
            **other,
        )

    def counted_from(self, zero: float) -> LoadStep:
        """Return the load step with approach and closures counted from another height.

        Args:
            zero: Approach at which the plane is at this height, as this load step counts it [mm].
        """
        return replace(
            self,
            approach_mm=self.approach_mm - zero,
            zero_mm=self.zero_mm + zero,
            meshes=tuple((approach - zero, *others) for approach, *others in self.meshes),  # type: ignore[misc]
            patches=replace(self.patches, closure_mm=self.patches.closure_mm - zero),
        )

    def is_unloading(self, before: LoadStep | None) -> bool:
        """Tell whether the force fell to this load step, or under the same force the approach.

        Not where the surfaces slid to it: a force then falls because they wear.

        Args:
            before: The load step before it; None for the first.
        """
        if before is None or self.slid_since(before):
            return False
        if not math.isclose(self.force_N, before.force_N, rel_tol=_SAME):
            return self.force_N < before.force_N
        same = math.isclose(self.approach_mm, before.approach_mm, rel_tol=_SAME)
        return not same and self.approach_mm < before.approach_mm

    def slid_since(self, before: LoadStep | None) -> bool:
        """Tell whether the surfaces slid on each other, and wore, on the way to this load step.

        Args:
            before: The load step before it; None for the first.
        """
        slid = 0.0 if before is None else before.slid_mm or 0.0
        return (self.slid_mm or 0.0) > slid

    @property
    def interface_stiffness_error_MPa_per_mm(self) -> float | None:
        """Error of the interface's stiffness per nominal area [MPa/mm]; None if not measured."""
        whole, share = self.interface_stiffness_N_per_mm, self.interface_stiffness_MPa_per_mm
        error = self.interface_stiffness_error_N_per_mm
        return None if error is None or not whole or share is None else error * share / whole

    @property
    def by_force(self) -> bool:
        """Whether the force was prescribed, and not the approach."""
        return self.control is not None and self.control.force is not None

    @property
    def by_shift(self) -> bool:
        """Whether the shear, where there is one, was prescribed as a shift, and not as a force."""
        shear = None if self.control is None else self.control.shear
        return shear is None or shear.force is None

    @property
    def turned_freely(self) -> bool:
        """Whether the plane was free to tilt."""
        return self.control is not None and self.control.tilt is None

    @property
    def body_state(self) -> float:
        """Position among the states of the bodies' loads, see `geometry.Control`."""
        return 0.0 if self.control is None else self.control.body_state

    def leak(self, way: str) -> Leak | None:
        """Return the leak along a way; None where it was not computed.

        Args:
            way: A key of `multiscale.loading.column.WAYS`.
        """
        return next((one for one in self.leaks if one.way == way), None)


for _name, _column in leak_columns():
    setattr(LoadStep, _name, _column)

COLUMNS = columns_of(LoadStep)
"""The columns of ``history.csv``, in their order."""

_ERRORS = {one.name: one.error for one in COLUMNS if one.error in LoadStep.__dataclass_fields__}


def of_older_run(step: LoadStep) -> LoadStep:
    """Return a load step as it was written before scatter had a column of its own.

    The error of the stiffness against the approach was what cells that yield scatter then.

    Args:
        step: The load step; one that has the scatter is returned as it is.
    """
    whole, error = step.approach_stiffness_N_per_mm, step.approach_stiffness_error_N_per_mm
    if whole is None or step.stiffness_scatter is not None:
        return step
    return replace(step, stiffness_scatter=(error or 0.0) / whole if whole else 0.0)


def with_exact_zeros(step: LoadStep, errors: Mapping[str, Any]) -> dict[str, Any]:
    """Return columns of errors, by one rule for load steps without contact.

    What vanishes there does so exactly, unless the force that is found has an error, or one that is
    not known: the plane may then touch. The approach of a plane without a force is any up to first
    touch, and has no error.

    Args:
        step: The load step.
        errors: Columns of its errors, None where not known.
    """
    may_touch = not step.by_force and errors.get("force_error_N", 0.0) != 0.0
    if step.force_N or may_touch:
        return dict(errors)
    known = {name: error for name, error in errors.items() if error is not None}
    zeros = {error: 0.0 for name, error in _ERRORS.items() if getattr(step, name) == 0.0}
    return zeros | known | ({"approach_error_mm": None} if step.by_force else {})
