"""What is known of a scene whose sections fit together: surface, materials, bodies, loads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

from geometry import Asperities, MaterialPair, PatchGrid, Regions, Surface, find_asperities
from geometry.zero import Zero
from multiscale.inputs.bodies import BodyFacts
from multiscale.loading.load_history import LoadHistory
from multiscale.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was taken, and the errors that were measured for it before the run.

    Attributes:
        accuracy: Relative error of the force that was requested.
        taken: The coupling, and the cells, meshes or micro model that it works on.
        why: Why this coupling was taken; empty where the scene states it or it was missed for.
        errors: Measured errors of the force by cause, relative to it, at the load where they are
            worst; empty where they cannot be measured beforehand. That of laws is among them only
            after the run.
        missed: Errors by cause of what was tried first and could not keep the accuracy, if any.
        work: What the choice took, counted, in words; empty where nothing was tried.
    """

    accuracy: float
    taken: str
    errors: Mapping[str, float]
    why: str = ""
    missed: Mapping[str, float] = field(default_factory=dict)
    work: str = ""

    @property
    def error(self) -> float:
        """Measured relative error of the force; 0 where it was not measured."""
        return sum(self.errors.values())

    @property
    def kept(self) -> bool:
        """Whether the measured error is within the accuracy."""
        return bool(self.errors) and self.error <= self.accuracy

    @property
    def sentence(self) -> str:
        """What was taken, why, and what was measured for it."""
        parts = [
            self.taken + f" ({self.why})" * bool(self.why),
            f"an accuracy of {100 * self.accuracy:.3g} % is asked for, {_listed(self.errors)}",
        ]
        if self.missed:
            parts.append(f"without meshing the roughness {_listed(self.missed)}")
        if self.work:
            parts.append(f"the choice took {self.work}")
        return "; ".join(parts)

    @property
    def warning(self) -> str | None:
        """A warning that the accuracy is not kept; None where it is, or is not known beforehand."""
        if self.kept or not self.errors:
            return None
        largest = max(self.errors, key=lambda cause: self.errors[cause])
        if self.error == math.inf:
            return (
                f"whether an accuracy of {100 * self.accuracy:.3g} % is kept is not known: the "
                f"error by {largest} could not be measured at the largest load"
            )
        return (
            f"an accuracy of {100 * self.accuracy:.3g} % is not kept: measured at the largest "
            f"load, the force may be off by {100 * self.error:.2g} %, most of it by {largest}"
        )


@dataclass(kw_only=True, eq=False)
class SceneParts:
    """What is made from a scene alone; it does not change.

    Attributes:
        scene: The scene with its auto values resolved.
        surface: Its rough surface, with the heights of both sides where both are rough; under laws
            of samples the first sample.
        counter_surface: What of it is the counter-body's; None where that is smooth, and under laws
            of samples.
        patches: Partition of the interface.
        materials: The materials on both sides of the interface.
        body: What is known of the body below the surface.
        counter: The same of a counter-body on a mesh; None where that is rigid or a half-space.
        load_history: The loads, counted from first touch.
        decision: Why the auto values became what they are, where measured errors decided.
        seconds: Wall time of each part of making it [s].
    """

    has_body: ClassVar[bool] = True
    """Whether the surface is on a body instead of a half-space."""
    has_laws: ClassVar[bool] = False
    """Whether load steps use laws."""
    meshes_roughness: ClassVar[bool] = False
    """Whether the roughness is meshed, so that there is no micro model."""

    scene: Scene
    surface: Surface
    counter_surface: Surface | None = None
    patches: PatchGrid
    materials: MaterialPair
    body: BodyFacts
    counter: BodyFacts | None = None
    load_history: LoadHistory
    decision: Decision | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def regions(self) -> Regions | None:
        """The regions of a face under laws of samples; None with other laws."""
        return None

    @property
    def area(self) -> float:
        """Nominal contact area [mm²]."""
        return self.patches.area * self.patches.count

    @property
    def rough_surfaces(self) -> tuple[Surface, ...]:
        """The surface, or all samples of all regions."""
        return (self.surface,)

    @property
    def shown_bodies(self) -> list[BodyFacts]:
        """What is known of the bodies that the record of a run tells: those loaded as meshes."""
        loaded = self.meshes if self.regions is None else [self.body, self.counter]
        return [one for one in loaded if one is not None]

    @property
    def both_elastic(self) -> bool:
        """Whether the counter-body is an elastic half-space."""
        return self.materials.second is not None and self.counter is None

    @property
    def zero(self) -> float:
        """Approach from first touch of the height that approaches are shown from [mm]."""
        return self.load_history.depth

    @cached_property
    def zero_error(self) -> float:
        """Error of that height [mm]."""
        return Zero(self.scene.loading.zero).error(self.surface)

    @cached_property
    def asperities(self) -> Asperities:
        """The surface's summits; found when first needed, which takes seconds on 4096² heights."""
        return find_asperities(self.surface)  # the block's sides are free

    @property
    def summits(self) -> Asperities | None:
        """The summits that the micro model consists of; None where it knows the whole surface."""
        return None

    @property
    def finite_slopes(self) -> bool:
        """Whether finite slopes of the surface count."""
        return False

    @property
    def meshes(self) -> list[BodyFacts]:
        """What is known of the bodies that are meshes of their own."""
        return [one for one in (self.body, self.counter) if one is not None and one.on_mesh]


def _listed(errors: Mapping[str, float]) -> str:
    if not errors:
        return "which is not measured beforehand"
    if math.inf in errors.values():
        largest = max(errors, key=lambda cause: errors[cause])
        return f"which is not known: the error by {largest} could not be measured"
    causes = ", ".join(f"{cause} {100 * error:.2g} %" for cause, error in errors.items())
    return f"measured at the largest load {100 * sum(errors.values()):.2g} % ({causes})"
