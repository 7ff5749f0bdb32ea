"""The base of models with laws, and what they say where a load is beyond the range of a law."""

from __future__ import annotations

from typing import Any

from patchlaw.geometry import Control
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.models.model import BeyondLaws, Model

ROUNDING = 1e-12
"""Share of a law's end by which a converged approach may exceed it."""


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
