"""The bases of what finds load steps: a model of a contact, with laws or without."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro.model import NormalStiffness, Stiffness
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotConverged


class Slid(NamedTuple):
    """Distance that surfaces have slid so far [mm], and the errors by the steps of their wear."""

    distance: float = 0.0
    errors: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)


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


ROUNDING = 1e-12
"""Share of a law's end by which a converged approach may exceed it."""


class BeyondLaws(NotConverged):
    """A patch is outside the range of its law, where smaller load steps do not help."""


class LawModel(Model):
    """Finds load steps from laws.

    Args:
        table: The laws.
    """

    def __init__(self, table: LawTable) -> None:
        self.table = table

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
                "somewhere on the face the pressure is larger than any that laws are made for, "
                "almost the hardness or the contact modulus: take a smaller load"
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
        elif self.face is not None and any(map(_is_loaded, self.meshed_bodies)):
            remedy = (
                "loads of the body shift the pressures further than the laws were made for: take "
                "law.kind = 'representative', whose laws are extended, or a smaller load"
            )
        else:
            remedy = (
                "the block lets the plane come or turn further than the half-space that the laws "
                "were made for: take coupling.kind = 'concurrent', which needs none"
            )
        reason = f"LAW_RANGE: {problem}"
        return BeyondLaws(f"the patches at {control}", reason=reason, iterations=0, remedy=remedy)


def _is_loaded(body: Any) -> bool:
    """Tell whether anything but contact moves a body."""
    return bool(body.is_preloaded)
