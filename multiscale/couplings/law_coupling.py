"""What couplings with laws have in common: a table of laws, and a solver of load steps with it."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from patchlaw.geometry import Friction
from patchlaw.multiscale.couplings.coupling import Coupling
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.models.law_model import LawModel
from patchlaw.multiscale.models.model import Model
from patchlaw.multiscale.readable import Observer


@dataclass(kw_only=True, eq=False)
class LawCoupling(Coupling):
    """A coupling whose load steps use laws."""

    has_laws: ClassVar[bool] = True

    @property
    def condensed(self) -> bool:
        """Whether load steps know the bodies by the compliance of their patches alone."""
        return False

    @property
    def law_friction(self) -> Friction | None:
        """Friction of the laws; None without."""
        section = self.scene.friction
        return None if section is None else Friction(coefficient=section.coefficient)

    @property
    def table_tolerance(self) -> float:
        """Interpolation error that laws are tabulated to."""
        # finer tables on cells would trace the steps of single ones
        default = 2e-3 if self.summits is None else 1e-4
        return self.scene.coupling.table_tolerance or default

    @abstractmethod
    def _make_table(self, observe: Observer | None) -> LawTable:
        """Tabulate the laws; collective."""

    @abstractmethod
    def _solver_of(self, table: LawTable) -> LawModel:
        """Make what finds load steps from laws; collective."""

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once; see `Coupling.make_laws`."""
        if self.table is None:
            self._prepare_laws()
            with self.clock.phase("laws"):
                made = self._make_table(self.clock.observe)
                self.table = made.with_stiffness_ratios(self._stiffness_ratios())
        return self.table

    def _stiffness_ratios(self) -> list[float]:
        """Return Mindlin's ratio of the bodies for every law."""
        return [self.materials.stiffness_ratio] * self.patches.count

    def _prepare_laws(self) -> None:
        """Make what laws need, in phases of their own."""

    def _make_solver(self) -> Model:
        return self._solver_of(self.make_laws())

    def describe(self) -> dict[str, str]:
        """Return what will be done and why, and how load steps are found from laws."""
        where = "condensed to the patches" if self.condensed else "on the mesh of the body"
        said = super().describe() | {"newton": where}
        if self.law_friction is not None:
            said["friction"] = (
                f"coefficient {self.law_friction.coefficient:g}; the laws are beds of springs with "
                "a slider each; GMRES, as tangents are unsymmetric"
            )
        return said
