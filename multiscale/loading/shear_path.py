"""The shear of a load history: how the plane is moved, or pulled, along the interface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

from multiscale.loading.stages import Pairs, Repeats, Stage, stated_shears
from support.errors import InputError
from support.fields import Unit


@dataclass(frozen=True, kw_only=True)
class ShearPath:
    """The shear that follows a load, or goes along with it.

    Args:
        shear: Shift of the plane along x and y from where it first touched, or a list of turning
            points [mm]. Exactly one of ``shear`` and ``shear_force`` may be given, with a
            coefficient of friction. A history of stages states it in them.
        shear_force: Shear force on the plane along x and y, or a list of turning points [N].
        shear_path: Whether the plane goes through the points of the shear ``after`` the load has
            come to its end, which then stays, or ``along`` with the load: each of them is then
            reached together with one of the load's turning points.
        shear_steps: Load steps to every point of a shear that follows the load; ``steps`` when not
            given.
        shear_cycles: How often the plane goes through the points of a shear that follows the load,
            of which it needs two at least.
    """

    shear: Annotated[Pairs, Unit("mm", pairs=True)] | None = None
    shear_force: Annotated[Pairs, Unit("N", pairs=True)] | None = None
    shear_path: Literal["after", "along"] = "after"
    shear_steps: Repeats | None = None
    shear_cycles: Repeats = 1

    @property
    def stated_shear(self) -> Pairs:
        """Points of the shear as they were stated; none of stages."""
        return self.shear or self.shear_force or ()

    def shear_problems(
        self, stages: Sequence[Stage], turns: Sequence[float]
    ) -> Iterator[InputError]:
        """Yield errors of two shear loads, of what belongs to none, and of senseless paths.

        Args:
            stages: The stages of the load history.
            turns: Turning points of its load; none with stages.
        """
        points, either = self.stated_shear, "either 'shear' or 'shear_force'"
        key = "shear" if self.shear_force is None else "shear_force"
        if len(stated_shears(self)) > 1:
            yield InputError("is a second shear load", key=key, value=points, allowed=either)
        if points and stages:
            allowed = f"'{key}' of a stage"
            yield InputError("does not go beside stages", key=key, value=points, allowed=allowed)
        if len({key for one in stages for key in stated_shears(one)}) > 1:
            yield InputError("state shifts and shear forces", key="stage", allowed=either)
        along = self.shear_path == "along"
        beside = {
            "shear_steps": self.shear_steps is not None,
            "shear_cycles": self.shear_cycles > 1,
        }
        for name, stated in {"shear_path": along, **beside}.items():
            if stated and not points:
                yield InputError("needs 'shear' or 'shear_force'", key=name)
            if stated and along and name in beside:
                problem = "does not go with shear_path = 'along', which has the steps of the load"
                yield InputError(problem, key=name, allowed="leave it out")
        if any(one == other for one, other in pairwise([(0.0, 0.0), *points])):
            problem, allowed = "repeats a point, or starts without shear", "points that differ"
            yield InputError(problem, key=key, value=points, allowed=allowed)
        if points and along and len(points) != len(turns):
            problem = "has another number of points than the load that it goes along with"
            yield InputError(problem, key=key, value=points, allowed=f"{len(turns)} pairs")
        if self.shear_cycles > 1 and len(points) < 2:
            problem, key, allowed = (
                "needs two points of the shear",
                "shear_cycles",
                "a list of pairs, or 1",
            )
            yield InputError(problem, key=key, value=self.shear_cycles, allowed=allowed)
