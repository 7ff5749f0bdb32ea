"""What causes of error may take of an accuracy, and how cells and meshes are refined for that."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from patchlaw.multiscale.auto.keys import MOST_HEIGHTS, auto_keys, with_value
from patchlaw.multiscale.inputs.bodies import LAW_BLOCK_CELLS, BodyFacts, stated_cells
from patchlaw.multiscale.inputs.scene_parts import SceneParts
from patchlaw.multiscale.scene.scene import Scene

Errors = Mapping[str, float]
"""Errors of the force by cause, relative to it."""
Grid = tuple[int, int]

_DEGREES = {1: "linear", 2: "quadratic"}
TRIALS = 6
"""Most trials of a grid, of a mesh, or of the size of meshes."""


@dataclass(frozen=True)
class Share:
    """What some causes of error have of an accuracy.

    Args:
        errors: Errors of all causes.
        causes: Those that are refined together.
        accuracy: Relative error of the force that may be left.
    """

    errors: Errors
    causes: Collection[str]
    accuracy: float

    @property
    def error(self) -> float:
        """Their error."""
        return sum(self.errors.get(cause, 0.0) for cause in self.causes)

    @property
    def allowed(self) -> float:
        """What they may leave: what the others do, or half of the others where that is more."""
        others = sum(error for cause, error in self.errors.items() if cause not in self.causes)
        # at other loads errors differ: this one may take 0.8 of the accuracy
        return max(0.8 * self.accuracy - others, 0.5 * others)

    @property
    def excess(self) -> float:
        """Error over allowed error; above 1 where they are to be refined."""
        return 0.0 if not self.error else self.error / self.allowed


def refinement(excess: float, order: float) -> float:
    """Return the refinement for the next trial.

    Args:
        excess: Error over allowed error.
        order: Known order of the error in the size.
    """
    return min(max(excess ** (1.0 / order), 1.3), 2.0)


def scaled(cells: Grid, factor: float) -> Grid:
    """Return cells along the sides times a factor, as multiples of 8 within the limits.

    Args:
        cells: Cells along x and y.
        factor: The factor.
    """
    x, y = (min(max(8 * math.ceil(factor * count / 8 - 1e-9), 48), MOST_HEIGHTS) for count in cells)
    return x, y


@dataclass(frozen=True)
class OpenMeshes:
    """Elements and refinements of bodies that a scene leaves open.

    Args:
        given: The scene as it was given.
    """

    given: Scene

    def _open(self, field: str) -> list[str]:
        """Return the sections that leave a key open."""
        keys = (key.partition(".") for key in auto_keys(self.given))
        return sorted(name for name, _, key in keys if key == field)

    def start(self, scene: Scene) -> Scene:
        """Return the scene with the meshes to try first under laws of samples.

        These are quadratic elements, and a quarter of the cells that a block has by default.

        Args:
            scene: The scene.
        """
        scene = self.of_degree(scene, 2)
        if "block.cells" in auto_keys(self.given):
            x, y, z = (count // 4 for count in LAW_BLOCK_CELLS)
            scene = with_value(scene, "block.cells", (x, y, z))
        return scene

    def of_degree(self, scene: Scene, degree: int) -> Scene:
        """Return the scene with another degree of the displacements, wherever it is open.

        Args:
            scene: The scene.
            degree: The degree.
        """
        for name in self._open("element"):
            element = _DEGREES[degree]
            if name == "block" and scene.block is not None:
                element = f"{scene.block.element[0]}{degree}"
            scene = with_value(scene, f"{name}.element", element)
        return scene

    def refined(self, parts: SceneParts, most: float) -> Scene | None:
        """Return the scene with every cell cut into eight, wherever that is open.

        Args:
            parts: What is known of the scene with its present meshes.
            most: Unknowns that all bodies may have together.

        Returns:
            The scene; None where nothing is open, or the unknowns would be more.
        """
        scene, names = parts.scene, self._open("refinements")
        by_cells = "block.cells" in auto_keys(self.given) and self.given.law.representative
        unknowns = {"body": parts.body, "counter_body": parts.counter}
        fixed = [one for name, one in unknowns.items() if one and name not in names and one.on_mesh]
        cut = [one for name, one in unknowns.items() if one and name in names]
        if by_cells:
            cut.append(parts.body)
        if not cut or _unknowns(fixed) + 8 * _unknowns(cut) > most:
            return None
        for name in names:
            times = getattr(scene, name).refinements
            scene = with_value(scene, f"{name}.refinements", times + 1)
        if by_cells:
            x, y, z = (2 * count for count in stated_cells(scene, LAW_BLOCK_CELLS))
            scene = with_value(scene, "block.cells", (x, y, z))
        return scene


def _unknowns(bodies: Sequence[BodyFacts]) -> int:
    return sum(body.unknowns for body in bodies)


def as_quadratic(bodies: Sequence[BodyFacts]) -> int:
    """Return the unknowns that bodies have with quadratic elements, about.

    Args:
        bodies: What is known of the bodies.
    """
    return sum(body.unknowns * (8 if body.degree == 1 else 1) for body in bodies)
