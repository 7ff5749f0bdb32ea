"""The base class of models of a contact, and the loop that presses one along a path of loads.

`for step in Problem(model, [Step(force=25.0), Step(force=50.0)]).steps()` is a whole example.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface
from patchlaw.geometry.contact_state import ContactState
from patchlaw.geometry.surface import FIRST_TOUCH
from patchlaw.micro import NormalStiffness, Stiffness
from patchlaw.multiscale.loading.load_history import ForceChange, LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.loading.path import Path as LoadPath
from patchlaw.multiscale.loading.path import Step
from patchlaw.support import Array, Has, InputError, NotBalanced, NotConverged, checked

if TYPE_CHECKING:  # only laws take it
    from patchlaw.multiscale.laws.law_table import LawTable


class Slid(NamedTuple):
    """Distance that surfaces have slid so far [mm], and the errors by the steps of their wear.

    They are those of `micro.wear.Worn`. On faces under laws also the integral of the force of every
    law over the distance [N mm]; of cells what their worn depths err by, (nx, ny) [mm].
    """

    distance: float = 0.0
    errors: tuple[float, ...] = (0.0,) * 6
    forces: Array | float = 0.0
    apart: Array | float = 0.0


class Model(ABC):
    """A model of a contact, pressed load step by load step; defaults for what one cannot tell.

    Attributes:
        past: What the load steps so far left behind beyond initial guesses; None where nothing. Set
            it to take load steps back.
        latest: The contact at the latest load step, see `detail`; None where it is not known.
        face: The contact face of a flat mesh that load steps are solved on; None without.
        on_mesh: Whether load steps are those of a mesh, whose displacements are known.
        wears: Whether what slides wears.
    """

    past: Any = None
    latest: Any = None
    face: Any = None
    on_mesh: bool = False
    wears: bool = False

    @abstractmethod
    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step, whose number is still 0.

        Args:
            control: What the step prescribes of the plane.

        Returns:
            The load step, with the `PatchState` of every patch, one patch where there is no grid.

        Raises:
            NotConverged: When none is found. Earlier equilibria stay what they were, so that a
                smaller step can be tried.

        Note:
            Collective, as all here.
        """

    def stiffness(self) -> NormalStiffness:
        """Return the stiffnesses −dF/dū and dF/dδ at the latest load step, where they are known.

        The slopes of the plane stay or, where it turns, its moments stay zero.
        """
        return NormalStiffness()

    def tangential_stiffness(self) -> Stiffness:
        """Return the slope of the shear force over the shift at the latest load step.

        The shift goes on in the direction of its last change, the normal load as it is.
        """
        return Stiffness(None, 0)

    def state(self) -> Any:
        """Return what the next load step starts from; it does not depend on the number of ranks.

        It is made of numbers, texts, arrays and records of them, or None where there is nothing.
        """
        return None

    def restore(self, state: Any) -> None:
        """Start from a state, in a model newly made from the same scene.

        Args:
            state: What `state` returned.
        """
        assert state is None, "a model without a state has none to start from"

    def detail(self, latest: Any) -> ContactState | None:
        """Return the spots and fields of a contact, the same on every rank; None without any.

        Args:
            latest: What `latest` was after a load step.
        """
        return None

    def conducting_stiffness(self, step: LoadStep) -> float | None:
        """Return the elastic stiffness of the interface, which its conductance follows from [N/mm].

        Args:
            step: The load step accepted last.

        Returns:
            The stiffness; None where it is not known, NaN where the interface touches everywhere.
        """
        known = step.interface_stiffness_N_per_mm
        return self.stiffness().interface if known is None else known

    @property
    def gaps(self) -> Array | None:
        """Gaps of all cells at the latest load step, 0 in contact; None without cells.

        Shape (nx, ny) [mm]; on rank 0 alone.
        """
        return None

    def face_pressures(self) -> Array | None:
        """Return places on a face with laws at points and the pressures there; None otherwise.

        Returns:
            Columns x, y [mm] and p [MPa] of the points of all ranks, shape (n, 3).
        """
        return None

    def facet_pressures(self) -> tuple[Array, Array] | None:
        """Return the facets of a face with laws at points and their mean pressures; else None.

        Returns:
            Vertices around the facets of all ranks, in the plane of the face, shape (n, 3 or 4, 2)
            [mm], and pressures, shape (n,) [MPa].
        """
        return None

    def facet_shear(self) -> tuple[Array, Array, Array] | None:
        """Return the shear of a face with friction of laws at points; None otherwise; collective.

        Returns:
            Vertices of the facets as `facet_pressures` returns them; their mean shear stresses
            along the axes of the face, shape (n, 2) [MPa]; and the share of their contact area that
            slips, shape (n,), NaN where nothing touches.
        """
        return None

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what the fields of the load step just accepted are made from.

        Args:
            step: The load step.
            parts: Parts of the contact face whose mean pressures stand for contacts.
        """
        return step.patches.pressure_MPa

    def field_record(self, state: Any) -> Any:
        """Return what makes the fields of the load step just accepted again in a resumed run.

        Args:
            state: What `field_state` returned.

        Returns:
            The same on every number of ranks, and of what `state` may consist of.
        """
        return state

    def field_state_again(self, record: Any, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what `field_state` did at an earlier load step, from its record.

        Args:
            record: What `field_record` returned then.
            step: The load step.
            parts: As for `field_state`.
        """
        return record

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of load steps as XDMF and VTX, where they are those of a mesh.

        Args:
            path: File to write, ending in ``.xdmf``.
            states: By number of the load step what `field_state` returned.
        """
        raise NotImplementedError

    @property
    def meshed_bodies(self) -> list[Any]:
        """The meshed bodies that load steps are solved on, the finest last."""
        return []

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        return None


def in_one_line(places: Array) -> bool:
    """Tell whether points lie in one line, as up to two do.

    Args:
        places: Their coordinates, shape (2, n).
    """
    if places.shape[1] < 3:
        return True
    spread = np.cov(places, bias=True)
    return bool(np.linalg.det(spread) <= 1e-9 * np.trace(spread) ** 2)


class BeyondLaws(NotConverged):
    """A patch is outside the range of its law, where smaller load steps do not help."""


class LawModel(Model):
    """Finds load steps from laws.

    Args:
        table: The laws.
    """

    def __init__(self, table: LawTable) -> None:
        self.table = table

    def transmissivities(self, step: LoadStep, cause: str | None, wider: float) -> Array:
        """Return the transmissivities of patches along x and y at a load step, (N, 2) [mm³].

        Args:
            step: The load step.
            cause: Cause of error that is varied, as for `Transmissivity.varied`.
            wider: What is added to the mean gaps [mm].
        """
        laws, closure = self.table.together(), step.patches.closure_mm
        point = laws.at(np.arange(len(closure)), closure, extend=True)
        return laws.transmissivities(point.separation + wider, cause)

    def beyond_law(self, control: Control, problem: str, *, falls: bool = False) -> BeyondLaws:
        """Return the error of a patch outside the range of its law.

        Args:
            control: The load step.
            problem: Which patch, and the range of its law.
            falls: Whether closure falls somewhere in a law, where the mesh cannot follow.
        """
        made_by = self.table.made_by.get("coupling")
        if made_by == "representative":
            remedy = (
                "somewhere on the face the pressure is larger than any that laws are made for; "
                "these end where the plane reaches the mean plane of the sample, or at 95 % of the "
                "hardness: take a smaller load"
            )
        elif made_by != "consistent":
            remedy = (
                "near full contact a patch taken alone has no pressure as a function of closure: "
                "take coupling.kind = 'consistent' or 'concurrent', larger patches (patches.grid) "
                "or a smaller load"
            )
        elif falls:
            remedy = (
                "where the closure of a law falls the mesh cannot follow: take coupling.kind = "
                "'concurrent', which needs no law"
            )
        elif self.face is not None and any(one.is_preloaded for one in self.meshed_bodies):
            remedy = (
                "loads of the body shift the pressures further than laws can be made for: take "
                "law.kind = 'representative' or a smaller load"
            )
        else:
            remedy = (
                "the block lets the plane come or turn further than the half-space that the laws "
                "were made for: take coupling.kind = 'concurrent', which needs none"
            )
        reason = f"LAW_RANGE: {problem}"
        return BeyondLaws(f"the patches at {control}", reason=reason, iterations=0, remedy=remedy)


_MOST_HALVINGS = 8
"""Halvings of a load step that does not converge, or that changes the force by too much."""
_SMALLEST = 1.0 / 2**_MOST_HALVINGS


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Position in a path between two load steps; all that is needed to continue there.

    Attributes:
        steps: Load steps accepted so far.
        time: The last accepted step, counted in steps of the path.
        ahead: The step of the path that was begun, and what is to be reached before it, the next
            one last, counted likewise; empty once it is reached.
        approach: Approach there [mm].
        force: Force there [N].
        largest: Largest force so far [N].
        origin: Approach [mm] and force [N] when the present stage began, or since when the present
            one of them is prescribed.
    """

    steps: int = 0
    time: float = 0.0
    ahead: tuple[float, ...] = ()
    approach: float = 0.0
    force: float = 0.0
    largest: float = 0.0
    origin: tuple[float, float] = (0.0, 0.0)

    def is_at_end(self, path: Sequence[Step]) -> bool:
        """Whether all load steps of a path are accepted."""
        return self.time == len(path)


class Problem:
    """A model and the path of loads that it is pressed along.

    A load step that does not converge is reached through smaller ones, which are not yielded. One
    that changes the force by more than is allowed is replaced by two.

    Loads are taken as they are. Whether an approach is small beside a body is checked in scenes.

    Args:
        model: What finds the equilibria; without an attribute `past` it leaves nothing behind.
        path: The load steps in turn, or a history of loads that is written out into them.
        position: Where in them to start.
        force_change: Largest change of the force in one step, relative to the largest force so far;
            by default that of the history.
        zero: Approach that approaches count from in errors [mm].
        file: The scene's file, for errors.

    Raises:
        InputError: When the path is empty, or a history needs a surface for its zero, or a face
            for its pressures.

    Attributes:
        position: Where the latest load step left the path; all that is needed to go on.
    """

    @checked
    def __init__(
        self,
        model: Annotated[Model, Has("a model such as a CellContact", ("press",))],
        path: LoadHistory | Sequence[Step],
        position: Position | None = None,
        *,
        force_change: ForceChange | None = None,
        zero: float = 0.0,
        file: str | None = None,
    ) -> None:
        self._model, self._zero, self._file = model, zero, file
        self._force_change = force_change
        if isinstance(path, LoadHistory):
            self._force_change = force_change or path.force_change
            if path.zero != FIRST_TOUCH:
                problem = "is a height of a surface, which is not known here"
                raise InputError(problem, key="zero", value=path.zero, allowed=FIRST_TOUCH)
            path = path.path()
        if not path:
            raise InputError("has no step", key="path", value=[], allowed="steps, one at least")
        slid = [0.0, *(step.slid for step in path)]
        if any(slid) and not getattr(model, "wears", False):
            allowed = "a model that wears, as CellContact.of(…, wear=1e-8)"
            raise InputError("slides where nothing wears", key="path", allowed=allowed)
        if any(after < before for before, after in pairwise(slid)):
            allowed = "distances slid so far, which do not fall"
            raise InputError("slides back", key="path", value=slid[1:], allowed=allowed)
        self._path = path
        self.position = position or Position()
        self._newton = self._linear = 0
        self._seconds = 0.0

    def steps(self) -> Iterator[LoadStep]:
        """Yield the load steps from the position on, as they are accepted.

        Raises:
            NotConverged: When a step fails at the smallest increment too, or a patch leaves the
                range of its law; the steps yielded before stay valid.

        Note:
            Collective.
        """
        while not self.position.is_at_end(self._path):
            now = self.position
            if not now.ahead:
                index = round(now.time)
                here, last = self._path[index], self._path[index - 1]
                if not index or (here.stage, here.quantity) != (last.stage, last.quantity):
                    now = replace(now, origin=(now.approach, now.force))
                now = replace(now, ahead=(index + 1.0,))
            began = time.perf_counter()
            self.position = now
            step = self._within_limit(now.ahead[-1])
            self._seconds += time.perf_counter() - began
            if step is None:
                between = 0.5 * (now.time + now.ahead[-1])
                self.position = replace(now, ahead=(*now.ahead, between))
            else:
                yield self._accepted(step)

    def _step(self, target: float) -> Step:
        """Return the step that leads to a target, or in part to one between two steps."""
        index = math.ceil(target) - 1
        step, share = self._path[index], target - index
        return step if share == 1.0 else step.part(share, self._path[index - 1] if index else None)

    def _control(self, target: float) -> Control:
        return self._step(target).control(self.position.origin)

    def _within_limit(self, target: float) -> LoadStep | None:
        """Press to a load step; return None when the force would change by too much."""
        limit, last = self._force_change, self.position.force
        if limit is None or last == 0.0 or target - self.position.time <= _SMALLEST:
            return self._reached(target)

        def exceeds(force: float) -> bool:
            # halved steps of a force may meet the limit exactly, up to rounding
            return abs(force - last) > limit * max(self.position.largest, force) * (1.0 + 1e-9)

        force, past = self._control(target).force, getattr(self._model, "past", None)
        if force is not None and exceeds(force):
            return None
        step = self._reached(target)
        if not exceeds(step.force_N):
            return step
        if past is not None:
            self._model.past = past
        return None

    def _reached(self, target: float) -> LoadStep:
        """Press to a load step, through smaller ones where the whole one fails."""
        last, ahead = self.position.time, [target]
        while True:
            control = self._control(ahead[-1])
            try:
                step = self._model.press(control)
            except InputError as error:
                raise self._refused(error, control) from None
            except NotConverged as error:
                self._newton += error.iterations
                beyond = isinstance(error, BeyondLaws | NotBalanced)
                if beyond or ahead[-1] - last <= _SMALLEST:
                    halved = "" if beyond else f"it was halved {_MOST_HALVINGS} times; "
                    remedy = halved + error.remedy
                    raise self._failed(control, error.reason, error.iterations, remedy) from error
                ahead.append(0.5 * (last + ahead[-1]))
                continue
            self._newton += step.newton_iterations
            self._linear += step.linear_iterations
            last = ahead.pop()
            if not ahead:
                return replace(step, stage=self._step(last).stage, control=control)

    def _failed(self, control: Control, reason: str, iterations: int, remedy: str) -> NotConverged:
        """Return the error of a load step that is not found, with the approach as users see it."""
        if control.approach is not None:
            control = replace(control, approach=control.approach - self._zero)
        what = f"load step {self.position.steps + 1} ({control})"
        return NotConverged(what, reason=reason, iterations=iterations, remedy=remedy)

    def _refused(self, error: InputError, control: Control) -> InputError | NotConverged:
        """Return the error of a load that a solver refuses, as only the solution shows.

        Before the first load step it is wrong input. Later ones end a run as one that does not
        converge, with the load steps up to there.
        """
        if not error.key:  # options of the command line have theirs
            key = self._step(self.position.ahead[-1]).key
            error = error.located(key=key, file=self._file)
        if not self.position.steps:
            return error
        return self._failed(control, "REFUSED", self._newton, str(error))

    def _accepted(self, step: LoadStep) -> LoadStep:
        """Number a step, give it all iterations and the time that led to it, and move on."""
        now = self.position
        accepted = replace(
            step,
            step=now.steps + 1,
            newton_iterations=self._newton,
            linear_iterations=self._linear,
            wall_s=self._seconds,
        )
        self.position = replace(
            now,
            steps=now.steps + 1,
            ahead=now.ahead[:-1],
            time=now.ahead[-1],
            approach=step.approach_mm,
            force=step.force_N,
            largest=max(now.largest, step.force_N),
        )
        self._newton, self._linear, self._seconds = 0, 0, 0.0
        return accepted


def plane_at_largest_load(
    path: LoadPath, model: Model | None, surface: Surface
) -> RigidPlane | None:
    """Return the rigid plane at the largest load; of several, that which comes nearest.

    Args:
        path: The loads.
        model: Finds the plane where the force or the moment is prescribed; None leaves it open.
        surface: The surface.

    Raises:
        NotConverged: When the plane is not found in smaller steps either.
    """
    planes = []
    for control in path.largest_controls:
        if control.approach is not None and control.tilt is not None:
            planes.append(RigidPlane.above(surface, control.approach, control.tilt))
            continue
        if model is None:
            return None
        whole = Step(approach=control.approach, force=control.force, tilt=control.tilt)
        (step,) = Problem(model, [whole]).steps()
        planes.append(RigidPlane.above(surface, step.approach_mm, step.tilt))
    return max(planes, key=lambda plane: plane.approach)
