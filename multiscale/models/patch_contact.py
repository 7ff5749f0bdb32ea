"""Patch laws without the mesh of a body: on the compliance of its patches, or along their rows.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from patchlaw.geometry import Control, PatchGrid, RigidPlane
from patchlaw.geometry.rigid_plane import UNSUPPORTED, plane_failure
from patchlaw.micro import NormalStiffness
from patchlaw.multiscale.laws.interpolation import LawPoint
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.of_patches import Displacements
from patchlaw.multiscale.laws.patch_law import ROUNDING, PatchLaws
from patchlaw.multiscale.laws.worn_laws import SlidLaws, WornLaws
from patchlaw.multiscale.loading.load_step import LOOSE, LoadStep, PatchState
from patchlaw.multiscale.models.loaded_patches import (
    TOLERANCE,
    DenseState,
    LoadedPatches,
    check_compliance,
    whole_stiffness,
)
from patchlaw.multiscale.models.problem import LawModel, in_one_line
from patchlaw.support import Array, NotConverged, checked

_LEAST_SLOPE = 1e-3
"""Slope of the closure over the approach, at least, in the stiffness of a patch that vibrates: near
full contact, where closures turn back, springs are as good as rigid."""


class PatchContact(LawModel):
    """Patch laws on the compliance of a body under them; a load step is a small dense system.

    The body is linear, so that its compliance says all that patchwise laws need to know of it.

    Args:
        table: The laws.
        compliance: Mean displacement of patch i of the block by unit pressure on patch j, shape
            (N, N) [mm/MPa].
    """

    @checked
    def __init__(self, table: LawTable, compliance: Array) -> None:
        super().__init__(table)
        check_compliance(compliance, len(table.laws))
        self._laws, self._compliance = table.together(), compliance
        self._last: DenseState | None = None
        self._control = Control(approach=0.0)

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Model.press`."""
        patches, end = self.table.grid, self._laws.end
        state = equilibrium(self._laws, self._compliance, patches, control, self._last)
        worst = int(np.argmax(state.local - end))
        if state.local[worst] > end[worst] + ROUNDING * np.abs(end).max():  # ends may be negative
            problem = (
                f"patch {patches.unravel(worst)} at a local approach of {state.local[worst]:.6g} "
                f"mm (allowed: up to {end[worst]:.6g} mm)"
            )
            raise self.beyond_law(control, problem)
        self._last, self._control = state, control
        point, stiffness = state.point, self._laws.interface_stiffness(state.point)
        bearing = patches.centres[point.pressure > 0.0].T
        loose = control.tilt is None and len(bearing.T) > 0 and in_one_line(bearing)
        return LoadStep.of_patches(
            patches,
            plane=state.plane,
            load=state.load,
            patches=PatchState(
                point.closure, point.pressure, point.contact_area_fraction, stiffness
            ),
            separation=point.separation,
            contacts=point.contacts,
            newton_iterations=state.iterations,
            warnings=(LOOSE,) * loose,
        )

    def stiffness(self) -> NormalStiffness:
        """Return −dF/dū and dF/dδ at the latest load step."""
        if self._last is None:
            return NormalStiffness()
        problem = LoadedPatches(self._laws, self._compliance, self.table.grid, self._control)
        return problem.stiffness(self._last)

    def state(self) -> Any:
        """Return the latest equilibrium."""
        return self._last

    def restore(self, state: Any) -> None:
        """Start from an equilibrium."""
        self._last = state


class PathContact(LawModel):
    """Consistent laws along the path of the plane that they were made under.

    Of a plane without moment that of the contacts decides how it turns: mean pressures of few large
    patches do not tell it, and a single law knows nothing of it. A surface that wears does so under
    the pressures of its cells, to which near full contact laws are no functions of closure. So
    load steps are those of the rows of the laws, where the macro model that these were made for is
    in equilibrium with their pressures.

    Every load step is found without those before it.

    Args:
        table: The laws, with the path of the plane; those of a surface that wears have theirs too.
        displacements: Mean displacements of the patches by their pressures in the macro model.
            Collective.
        tilt: Slopes of the plane; None where it was free to turn.
        wear: Coefficient of wear of a surface that slides [mm²/N].
        friction: Coefficient of the friction whose energy is told of what slides.
        face: The contact face of bodies that vibrate.

    Raises:
        ValueError: When the laws have no path.
    """

    def __init__(
        self,
        table: LawTable,
        displacements: Displacements,
        tilt: tuple[float, float] | None = None,
        wear: float = 0.0,
        friction: float = 0.0,
        face: Any = None,
    ) -> None:
        if table.path is None:
            raise ValueError("the laws were not made of a whole surface")
        super().__init__(table)
        new = WornLaws(depth=np.zeros(table.grid.count), laws=table.laws, slid=0.0, path=table.path)
        self._levels = [(one, PatchLaws(one.laws)) for one in (new, *table.worn)]
        self._displacements, self.wears = displacements, wear > 0.0
        self._lean = 0.0 if tilt is None else self._local(0.0, *tilt)
        self._wear, self._friction, self.face = wear, friction, face
        self.past: tuple[SlidLaws, float, LawPoint] | None = None

    def _local(self, approach: float, *tilt: float) -> Array:
        """Return the local approaches of the patches, or what they change by, (N,) [mm]."""
        patches = self.table.grid
        centre: Any = tuple(map(float, patches.middle))
        plane: Any = {"approach": approach, "tilt": tilt, "centre": centre}
        return np.asarray(RigidPlane(**plane).means(patches))

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `Model.press`.

        Raises:
            NotConverged: Also when the laws were made for another macro model.
        """
        approach, evaluations = control.approach, 0
        rate = None if approach is None else lambda one: self._rate(one.along(approach))
        laws = SlidLaws(self._levels, control.slid, self._lean, rate)
        path = laws.path
        if approach is None:
            approach, evaluations = path.approach_under(
                control.force or 0.0, lambda at: self._force(laws.along(at))
            )
        end = float(path.approach[-1])
        if approach > end + ROUNDING * abs(end):
            problem = f"the plane at an approach of {approach:.6g} mm (allowed: up to {end:.6g} mm)"
            raise self.beyond_law(control, problem)
        tx, ty, *moment = map(float, path.at(approach))
        point, local = laws.along(approach), self._local(approach, tx, ty)
        closure = local - laws.worn - self._displacements(point.pressure[None])[0]
        residual = np.abs(np.where(point.pressure > 0.0, closure - point.closure, 0.0)).max()
        residual /= float(np.abs(local).max()) or 1.0
        if residual > 0.05:  # between rows of laws of this macro model it is hundredths of that
            raise NotConverged(
                f"the patches at {control}",
                reason="OTHER_BODY",
                iterations=0,
                remedy=f"their closures miss {residual:.1%} of the approach: make the laws for "
                "this block and mesh",
            )
        # of those that stay open, the approach at the middle is not that of the law
        open_ = laws.untouched(closure)
        self.past = laws, approach, open_
        separation = np.where(point.pressure > 0.0, point.separation, open_.separation)
        stiffness = laws.interface_stiffness(approach)
        return LoadStep.of_patches(
            self.table.grid,
            plane=(approach, tx, ty),
            load=(self._force(point), *moment),
            patches=PatchState(closure, point.pressure, point.contact_area_fraction, stiffness),
            separation=separation,
            contacts=point.contacts,
            newton_iterations=evaluations,
            **self._of_wear(laws),
        )

    def _of_wear(self, laws: SlidLaws) -> dict[str, Any]:
        """Return what has worn off the surface."""
        if not self.wears:
            return {}
        volume = self.table.grid.area * float(laws.worn.sum())
        return {
            "slid_mm": laws.slid,
            "worn_volume_mm3": volume,
            "mean_worn_depth_mm": float(laws.worn.mean()),
            "worn_depth_mm": float(laws.worn.max()),
        } | ({"dissipated_mJ": self._friction / self._wear * volume} if self._friction else {})

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Array:
        """Return pressures of patches, and what has worn off them; see `write_solved`."""
        pressure, worn = step.patches.pressure_MPa, self.past and self.past[0].worn
        return np.array([pressure, worn]) if self.wears else pressure

    def transmissivities(self, step: LoadStep, cause: str | None, wider: float) -> Array:
        """Return the transmissivities of the patches; see `LawModel.transmissivities`.

        They are those of the latest load step.
        """
        assert self.past is not None, "load steps have been solved"
        laws, approach, _ = self.past
        return laws.transmissivities(approach, step.patches.closure_mm, cause, wider)

    def vibration_tangents(self, direction: Array | None) -> tuple[str, Array]:
        """Return where the contact is sampled, and its stiffnesses; see `FaceContact`."""
        assert self.past is not None, "load steps have been solved"
        laws, approach, _ = self.past
        point, tangents = laws.along(approach), np.zeros((self.table.grid.count, 3, 3))
        closing = np.sign(point.dpressure) * point.dclosure  # some are left as the plane turns
        stiffness = np.abs(point.dpressure) / np.maximum(closing, _LEAST_SLOPE)
        tangents[:, 0, 0] = stiffness
        if direction is not None:
            tangents[:, 1:, 0] = self._friction * np.outer(stiffness, direction)
        return "patchwise", tangents[self.face.sampling("patchwise").patch]

    def stiffness(self) -> NormalStiffness:
        """Return −dF/dū and dF/dδ at the latest load step, from the laws alone."""
        if self.past is None:
            return NormalStiffness()
        laws, approach, open_ = self.past
        patches, point = self.table.grid, laws.along(approach)
        force = patches.area * float(point.dpressure.sum())
        coming = self._local(1.0, *map(float, laws.path.turning(approach)))
        closing = coming - self._displacements(point.dpressure[None])[0]
        closing *= -open_.dseparation
        closed = np.where(point.pressure > 0.0, -point.dseparation, closing)
        own = whole_stiffness(laws.interface_stiffness(approach), closed, point.dpressure)
        return NormalStiffness(patches.area * own, force)

    def _force(self, point: LawPoint) -> float:
        return self.table.grid.area * float(point.pressure.sum())

    def _rate(self, point: LawPoint) -> float:
        return self._wear * float(point.pressure.mean())


def equilibrium(
    laws: PatchLaws,
    compliance: Array,
    patches: PatchGrid,
    control: Control,
    start: DenseState | None = None,
) -> DenseState:
    """Solve closure_i(s_i) = δ_i − Σ_j C_ij p_j(s_j) for the local approaches s of all patches.

    The laws are given over the local approach, so that it does not matter whether their pressure
    is a function of closure. Where the plane's force is prescribed, or its moment is zero, its
    approach and slopes are unknowns beside s, eliminated by Schur's complement. Steps are halved
    until the residual falls below the largest of the last few (Grippo, Lampariello & Lucidi 1986,
    doi 10.1137/0723046). A plane that nothing supports moves on to the next touch. Without a load,
    one that can turn clear of all patches turns to where it is farthest from the nearest.

    Args:
        laws: The laws.
        compliance: C, mean displacement of patch i of the block by unit pressure on patch j, shape
            (N, N) [mm/MPa].
        patches: The partition.
        control: What the load step prescribes.
        start: A solution nearby.

    Raises:
        InputError: When the compliance is not a finite matrix of the size of the partition.
        NotConverged: When neither the start nor one common approach of all laws leads to a
            solution.
    """
    problem = LoadedPatches(laws, compliance, patches, control)
    plane = np.zeros(3) if start is None else start.plane
    if control.force is None and (clear := problem.turned_clear()) is not None:
        return clear
    if control.force == 0.0:
        problem.control = problem.first_touch(plane)
    plane = problem.control.prescribed(plane)
    if start is not None:
        try:
            return _iterated(problem, start.local, plane)
        except NotConverged:  # a law has a kink in between: try without the earlier solution
            pass
    return _iterated(problem, *problem.initial_guess(plane))


def _iterated(problem: LoadedPatches, local: Array, plane: Array) -> DenseState:
    now = problem.at(local, plane)
    recent: deque[float] = deque(maxlen=4)  # at kinks of the laws a residual may rise for a while
    for iterations in range(100):
        problem.force_scale = max(problem.force_scale, float(now.load[0]))
        if problem.relative_residual(now) <= TOLERANCE:
            return replace(now, iterations=iterations)
        step, motion, supported = _newton_step(problem, now)
        if supported:
            recent.append(problem.norm(now))
            now = _line_search(problem, now, step, motion, max(recent), iterations + 1)
        else:
            recent.clear()
            now = problem.at(now.local + step, now.plane + motion)
    raise problem.failure("DIVERGED_MAX_IT", 100)


def _newton_step(problem: LoadedPatches, now: DenseState) -> tuple[Array, Array, bool]:
    """Return the change of s and of the plane, and whether it is Newton's."""
    free = problem.control.free
    unit, lever = problem.levers.unit[free], problem.levers.scaled(free)
    solved = problem.tangent(now).solve(np.column_stack((now.residual, lever)))
    step, columns = solved[:, 0], solved[:, 1:]
    change = np.zeros(3)
    if not free.any():
        return step, change, True
    loads = problem.area * lever.T * now.point.dpressure
    stiffness = loads @ columns
    values, vectors = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
    residual = vectors.T @ (problem.load_residual(now) - loads @ step)
    loose = values <= UNSUPPORTED * max(values[-1], 0.0)
    falling = loose & (np.abs(residual) > TOLERANCE * (problem.force_scale or 1.0))
    if falling.any():
        change[free] = unit * (vectors @ np.where(falling, residual, 0.0))
        return *_to_next_touch(problem, now, change), False
    motion = vectors @ np.divide(residual, values, out=np.zeros_like(residual), where=~loose)
    change[free] = unit * motion
    return step + columns @ motion, change, True


def _to_next_touch(problem: LoadedPatches, now: DenseState, motion: Array) -> tuple[Array, Array]:
    """Return the change of s and of the plane along a motion until one more patch is touched."""
    rise = problem.levers.matrix @ motion
    gap = problem.laws.first_touch - now.point.closure
    coming = (now.point.pressure == 0.0) & (rise > 1e-9 * np.abs(rise).max()) & (gap < np.inf)
    if not coming.any():
        raise plane_failure(problem.control, "NO_SUPPORT")
    largest = max(float(np.abs(problem.levers.matrix @ now.plane).max()), float(gap[coming].max()))
    way = np.maximum(gap[coming], 0.0) + 0.02 * largest  # beyond touch, for a support
    share = float(np.min(way / rise[coming]))
    return share * rise, share * motion


def _line_search(
    problem: LoadedPatches,
    now: DenseState,
    step: Array,
    motion: Array,
    reference: float,
    iterations: int,
) -> DenseState:
    """Shorten a Newton step until the residual falls, straight or along the laws.

    A straight step is taken where it lowers the residual. Otherwise the better one of the straight
    step and the one along the laws is taken where its residual is below the reference.
    """
    before = problem.norm(now)
    for share in 0.5 ** np.arange(40):
        part, plane = share * step, now.plane + share * motion
        trial, enough = problem.at(now.local + part, plane), 1.0 - 1e-4 * share
        if problem.norm(trial) <= enough * before:
            return trial
        trial = min(trial, problem.along_laws(now, part, plane), key=problem.norm)
        if problem.norm(trial) <= enough * reference:
            return trial
    raise problem.failure("DIVERGED_LINE_SEARCH", iterations)
