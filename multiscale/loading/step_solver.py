"""The base of what finds load steps: contact problems, patch laws, and meshed roughness."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, PatchGrid
from geometry.contact_state import ContactState
from micro.model import Stiffness
from multiscale.loading.load_step import LoadStep

Array = NDArray[np.float64]


class StepSolver(ABC):
    """Finds load steps; what a solver does not know is here.

    Attributes:
        past: What the load steps so far left behind beyond initial guesses; None where nothing. Set
            it to take load steps back.
        latest: The contact at the latest load step, see `detail`; None where it is not known.
        on_mesh: Whether load steps are those of a mesh, whose displacements are known.
    """

    past: Any = None
    latest: Any = None
    on_mesh: bool = False

    @abstractmethod
    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step, whose number is still 0.

        Args:
            control: What the step prescribes of the plane.

        Raises:
            NotConverged: When none is found. Earlier equilibria stay what they were, so that a
                smaller step can be tried.

        Note:
            Collective, as all here.
        """

    def stiffness(self) -> Stiffness:
        """Return the interfacial stiffness dF/dδ at the latest load step, where it is known.

        The slopes of the plane stay or, where it turns, its moments stay zero.
        """
        return Stiffness(None, 0)

    def state(self) -> Any:
        """Return what the next load step starts from; it does not depend on the number of ranks.

        It is made of numbers, texts, arrays and records of them, or None where there is nothing.
        """
        return None

    def restore(self, state: Any) -> None:
        """Start from a state, in a solver newly made from the same scene.

        Args:
            state: What `state` returned.
        """
        assert state is None, "a solver without a state has none to start from"

    def detail(self, latest: Any) -> ContactState | None:
        """Return the spots and fields of a contact, the same on every rank; None without any.

        Args:
            latest: What `latest` was after a load step.
        """
        return None

    def interface_stiffness(self, step: LoadStep, areas: Array) -> float | None:
        """Return dF/dδ of the contacts between half-spaces; None where it is not known [N/mm].

        With laws it is that of all patches side by side.

        Args:
            step: The load step accepted last.
            areas: Nominal areas of the patches or regions, shape (N,) [mm²].
        """
        rates = step.patches.stiffness_MPa_per_mm
        return None if rates is None else float(rates @ areas)

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

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what the fields of the load step just accepted are made from.

        Args:
            step: The load step.
            parts: Parts of the contact face whose mean pressures stand for contacts.
        """
        return step.patches.pressure_MPa

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
