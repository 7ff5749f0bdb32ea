"""The couplings without laws: the contact problem itself at every load step.

``analytic`` is the micro model on a half-space, ``concurrent`` the same on the scene's body: they
differ by a term of the compliance.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from geometry import Control, PatchGrid
from micro.contact_detail import ContactDetail
from micro.model import Stiffness
from multiscale.couplings.contact_solver import ContactSolver
from multiscale.couplings.micro_coupling import MicroCoupling
from multiscale.inputs.block import FIELD_CELLS, LAW_BLOCK_CELLS, Cells
from multiscale.loading.load_step import LoadStep
from multiscale.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(kw_only=True, eq=False)
class ConcurrentCoupling(MicroCoupling):
    """The whole surface on the scene's body at every load step, without laws."""

    @classmethod
    def cells_unstated(cls, scene: Scene) -> Cells:
        """Return the cells of a block that a scene states none for: contacts are seen on them."""
        return LAW_BLOCK_CELLS

    @cached_property
    def _solver(self) -> ContactSolver:
        return self.contact_solver(self.model_on_body())

    def prepare(self) -> None:
        """Put the micro model on its body, once."""
        with self.clock.phase("block"):
            _ = self._solver

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `Coupling.press`."""
        return self._solver.press(control)

    def stiffness(self) -> Stiffness:
        """Return dF/dδ at the latest load step."""
        return self._solver.stiffness()

    @property
    def past(self) -> Any:
        """What the load steps so far left behind: initial guess and, under a hardness, depths."""
        return self._solver.past

    @past.setter
    def past(self, value: Any) -> None:
        self._solver.past = value

    def state(self) -> Any:
        """Return the latest solution; it is whole on rank 0 alone."""
        return self._solver.state()

    def restore(self, state: Any) -> None:
        """Start from a solution."""
        self._solver.restore(state)

    def contact_state(self) -> Any:
        """Return the contact at the latest load step, on rank 0 alone."""
        return self._solver.latest

    def contact(self, step: LoadStep, state: Any) -> tuple[LoadStep, ContactDetail] | None:
        """Return the spots and fields of the contact of a load step."""
        return step, self._solver.detail(state)

    def interface_stiffness(self, step: LoadStep) -> float | None:
        """Return dF/dδ of the contacts between half-spaces [N/mm]."""
        return self._solver.interface_stiffness()

    def gaps(self) -> Array | None:
        """Return the gaps of all cells at the latest load step; see `Coupling.gaps`."""
        return self._solver.gaps

    def field_state(self, step: LoadStep) -> Any:
        """Return the mean pressures of the parts of the face that fields are shown on."""
        return self._solver.pressures_on(self._face_parts)

    def write_fields(
        self, path: Path, states: Mapping[int, Any], steps: Sequence[LoadStep]
    ) -> None:
        """Write the fields of the body under the pressures of its contacts."""
        from multiscale.couplings.fields import write_solved

        write_solved(path, self.bodies, self._face_parts, states)

    @property
    def _face_parts(self) -> PatchGrid:
        """The parts of the contact face that contacts are seen on: facets of a block's mesh."""
        if self.body.shape is None:
            x, y = map(min, self.surface.grid, FIELD_CELLS[:2])
            return PatchGrid(grid=(x, y), lengths=self.surface.lengths)
        nx, ny, _ = self.body.shape.cells
        return PatchGrid(grid=(nx, ny), lengths=self.surface.lengths)

    def coupling_statement(self) -> str:
        """Say how contacts and bodies are put together."""
        x, y = self.patches.grid
        return (
            "concurrent: the whole surface on the block at every load step, no laws; "
            f"{x} × {y} patches gather the results"
        )

    def _drop_solvers(self) -> None:
        self.__dict__.pop("_solver", None)
        self.__dict__.pop("put_on_body", None)


@dataclass(kw_only=True, eq=False)
class AnalyticCoupling(ConcurrentCoupling):
    """The micro model alone on a half-space, without finite elements."""

    has_body: ClassVar[bool] = False

    @classmethod
    def cells_unstated(cls, scene: Scene) -> Cells:
        """Return the cells of a block that a scene states none for."""
        return FIELD_CELLS

    def coupling_statement(self) -> str:
        """Say how contacts and bodies are put together."""
        counted = "; displacements, and so the approach, count from the mean of the surface"
        return "analytic: the micro model alone on a half-space, no finite elements" + (
            counted if self.scene.surface.periodic else ""
        )
