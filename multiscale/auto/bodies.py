"""The meshes of a scene's bodies, as far as an accuracy may change them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from multiscale.auto.keys import auto_keys, with_value
from multiscale.inputs.bodies import LAW_BLOCK_CELLS, BodyFacts, stated_cells
from multiscale.inputs.scene_parts import SceneParts
from multiscale.scene.scene import Scene

_DEGREES = {1: "linear", 2: "quadratic"}


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
