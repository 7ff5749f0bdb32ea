"""The couplings without laws: the contact problem itself at every load step.

``analytic`` is the micro model on a half-space, ``concurrent`` the same on the scene's body: they
differ by a term of the compliance.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from geometry import PatchGrid
from multiscale.couplings.describe import times
from multiscale.couplings.micro_coupling import MicroCoupling
from multiscale.inputs.bodies import FIELD_CELLS
from multiscale.loading.stepper import StepSolver


@dataclass(kw_only=True, eq=False)
class ConcurrentCoupling(MicroCoupling):
    """The whole surface on the scene's body at every load step, without laws."""

    shows_contacts: ClassVar[bool] = True

    def _make_solver(self) -> StepSolver:
        return self.contact_solver(self.model_on_body())

    @property
    def field_parts(self) -> PatchGrid:
        """The parts of the contact face that contacts are seen on: facets of a block's mesh."""
        nx, ny, _ = FIELD_CELLS if self.body.shape is None else self.body.shape.cells
        if self.body.shape is None:
            nx, ny = map(min, self.surface.grid, (nx, ny))
        return PatchGrid(grid=(nx, ny), lengths=self.surface.lengths)

    def coupling_statement(self) -> str:
        """Say how contacts and bodies are put together."""
        return (
            "concurrent: the whole surface on the block at every load step, no laws; "
            f"{times(self.patches.grid)} patches gather the results"
        )


@dataclass(kw_only=True, eq=False)
class AnalyticCoupling(ConcurrentCoupling):
    """The micro model alone on a half-space, without finite elements."""

    has_body: ClassVar[bool] = False
    shows_contacts: ClassVar[bool] = False
    patches_interact: ClassVar[bool] = False

    def coupling_statement(self) -> str:
        """Say how contacts and bodies are put together."""
        counted = "; displacements, and so the approach, count from the mean of the surface"
        return "analytic: the micro model alone on a half-space, no finite elements" + (
            counted if self.scene.surface.periodic else ""
        )
