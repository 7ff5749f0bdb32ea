"""Load histories: each coupling is a generator of load steps."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from micro import MicroModel
from multiscale.history import LoadStep, PatchState
from multiscale.law_files import LawTable

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import PressedBlock, PressState

Array = NDArray[np.float64]
_MOST_HALVINGS = 8


class Coupling(Protocol):
    """Anything that turns approaches into load steps."""

    def load_steps(self, approaches: Sequence[float]) -> Iterator[LoadStep]:
        """Yield one accepted load step per approach, in order.

        Args:
            approaches: Approaches of the plane at the middle of the interface [mm].

        Raises:
            NotConverged: When a step fails for good; the steps yielded before stay valid.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalyticCoupling:
    """The micro model alone: the whole surface on one elastic half-space.

    Attributes:
        model: Micro model of the whole surface.
        patches: Partition that the results are summed over; it does not change the solution.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        tilt: Slopes of the plane's approach along x and y.
    """

    model: MicroModel
    patches: PatchGrid
    mean_heights: Array
    tilt: tuple[float, float] = (0.0, 0.0)

    def load_steps(self, approaches: Sequence[float]) -> Iterator[LoadStep]:
        """Yield one load step per approach; see `Coupling.load_steps`."""
        lean = tilted_approaches(self.patches, 0.0, self.tilt)
        for number, approach in enumerate(approaches, start=1):
            start = time.perf_counter()
            response = self.model.respond(
                np.array([approach]),
                patches=self.patches,
                mean_heights=self.mean_heights,
                tilt=self.tilt,
            )
            state = PatchState(
                closure_mm=approach + lean - response.patch_displacement[0],
                pressure_MPa=response.patch_force[0] / self.patches.area,
                contact_area_fraction=response.patch_contact_area[0] / self.patches.area,
            )
            yield LoadStep(
                step=number,
                approach_mm=float(approach),
                force_N=float(response.force[0]),
                mean_pressure_MPa=float(response.mean_pressure[0]),
                contact_area_fraction=float(response.contact_area_fraction[0]),
                mean_separation_mm=float(response.mean_separation[0]),
                contacts=int(response.contacts[0]),
                newton_iterations=int(response.iterations[0]),
                linear_iterations=0,
                wall_s=time.perf_counter() - start,
                reason="CONVERGED",
                patches=state,
                residuals=(float(response.residual[0]),),
            )


@dataclass(slots=True, kw_only=True)
class EmbeddedCoupling:
    """Patch laws on the flat interface of an elastic block (Waddad et al. 2016, section 3.2).

    Attributes:
        pressed: The block with the laws on its interface.
        table: The laws, which also give contact area, contacts and separation.
        tilt: Slopes of the plane's approach along x and y.
        last: The block's latest equilibrium; histories of displacement fields are not kept.
    """

    pressed: PressedBlock
    table: LawTable
    tilt: tuple[float, float] = (0.0, 0.0)
    last: PressState | None = None

    def load_steps(self, approaches: Sequence[float]) -> Iterator[LoadStep]:
        """Yield one load step per approach; a step that fails is halved.

        Raises:
            NotConverged: When a step fails at the smallest increment too, or a patch is closed
                beyond the end of its law.
        """
        last = 0.0
        for number, approach in enumerate(approaches, start=1):
            start = time.perf_counter()
            press, newton, linear = self._advance(number, last, float(approach))
            step = self._load_step(number, press, newton, linear)
            self.last = press
            yield replace(step, wall_s=time.perf_counter() - start)
            last = float(approach)

    def _advance(self, number: int, last: float, target: float) -> tuple[PressState, int, int]:
        """Press to an approach, through smaller steps where the whole one fails."""
        newton = linear = 0
        smallest = abs(target - last) / 2**_MOST_HALVINGS
        ahead = [target]
        while True:
            try:
                press = self.pressed.press(ahead[-1], tilt=self.tilt)
            except NotConverged as error:
                newton += error.iterations
                if abs(ahead[-1] - last) <= smallest:
                    raise _failed_step(number, ahead[-1], error) from error
                ahead.append(0.5 * (last + ahead[-1]))
                continue
            newton += press.newton_iterations
            linear += press.linear_iterations
            last = ahead.pop()
            if not ahead:
                return press, newton, linear

    def _load_step(self, number: int, press: PressState, newton: int, linear: int) -> LoadStep:
        """Read area, contacts and separation off the laws at the converged closures."""
        laws, closure = self.table.laws, press.closure
        try:
            area = np.array([law.area_fraction_at(c) for law, c in zip(laws, closure, strict=True)])
        except InputError as error:
            raise _beyond_law(number, press.approach, error) from error
        contacts = sum(int(law.contacts_at(c)) for law, c in zip(laws, closure, strict=True))
        gaps = [law.separation_at(c) for law, c in zip(laws, closure, strict=True)]
        nominal = self.table.patches.area * self.table.patches.count
        return LoadStep(
            step=number,
            approach_mm=press.approach,
            force_N=press.force,
            mean_pressure_MPa=press.force / nominal,
            contact_area_fraction=float(np.mean(area)),
            mean_separation_mm=float(np.mean(gaps)),
            contacts=contacts,
            newton_iterations=newton,
            linear_iterations=linear,
            wall_s=press.wall_s,
            reason=press.reason,
            patches=PatchState(
                closure_mm=closure, pressure_MPa=press.pressure, contact_area_fraction=area
            ),
            imbalance=(press.force - press.reaction) / press.force if press.force else 0.0,
            residuals=tuple(map(float, press.residuals)),
        )


def tilted_approaches(patches: PatchGrid, approach: float, tilt: tuple[float, float]) -> Array:
    """Return the plane's mean approach at every patch, shape (N,) [mm].

    Args:
        patches: The partition.
        approach: Approach at the middle of the interface [mm].
        tilt: Slopes of the approach along x and y, about the middle.
    """
    centre = np.asarray(patches.origin) + 0.5 * np.asarray(patches.lengths)
    return approach + (patches.centres - centre) @ np.asarray(tilt)


def _failed_step(number: int, approach: float, error: NotConverged) -> NotConverged:
    return NotConverged(
        f"load step {number} (approach {approach:.6g} mm)",
        reason=error.reason,
        iterations=error.iterations,
        remedy=f"it was halved {_MOST_HALVINGS} times; raise load.steps, or see {error.remedy}",
    )


def _beyond_law(number: int, approach: float, error: InputError) -> NotConverged:
    return NotConverged(
        f"load step {number} (approach {approach:.6g} mm)",
        reason=f"LAW_RANGE: {error}",
        iterations=0,
        remedy=(
            "near full contact a patch taken alone has no pressure as a function of closure: "
            "use larger patches (patches.grid) or a smaller load.approach"
        ),
    )
