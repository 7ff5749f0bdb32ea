"""Which law holds on which part of a user's interface, and where laws are evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from macro.contact.contact_forces import ContactLaw
from macro.contact.loaded_face import Mode
from support.errors import InputError

Array = NDArray[np.float64]

_ROUNDING = 1e-12
"""Shift of patches, relative to the face, that is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceLaws:
    """Laws of patches on a face.

    Args:
        laws: One law per patch.
        patches: The patches.
        mode: Where the laws are evaluated.
        shift: Where the patches' coordinates begin in those of the face, shape (2,) [mm].
    """

    laws: tuple[ContactLaw, ...]
    patches: PatchGrid
    mode: Mode
    shift: Array


def laws_on_face(
    laws: Any,
    patches: PatchGrid | None,
    mode: Mode | None,
    lower: Array,
    lengths: tuple[float, float],
) -> InterfaceLaws:
    """Return laws per patch from whatever a user gives.

    Args:
        laws: A table with ``patches`` and ``laws``, a law, or a law per patch.
        patches: Patches on the face; None: those of the table in the middle of the face, or one
            patch on its bounding rectangle.
        mode: Where laws are evaluated; None: the default of such laws.
        lower: Lower corner of the face's bounding rectangle, shape (2,) [mm].
        lengths: Sides of that rectangle [mm].

    Raises:
        InputError: When these are no laws, or not as many as patches, or there is no such mode.
    """
    if mode is not None and mode not in get_args(Mode):
        raise InputError("unknown interface", value=mode, allowed=", ".join(get_args(Mode)))
    if not isinstance(patches, PatchGrid | None):
        raise InputError("these are no patches", value=patches, allowed="a PatchGrid")
    shift = np.zeros(2)
    if _is_law(laws):
        corner = (float(lower[0]), float(lower[1]))
        patches = patches or PatchGrid(grid=(1, 1), lengths=lengths, origin=corner)
        return InterfaceLaws(
            laws=(laws,) * patches.count, patches=patches, mode=mode or "pointwise", shift=shift
        )
    if hasattr(laws, "patches") and hasattr(laws, "laws"):
        if not isinstance(laws.patches, PatchGrid):
            return laws_on_face(_only_region(laws), patches, mode, lower, lengths)
        if patches is None:
            patches = laws.patches
            shift = lower + 0.5 * np.asarray(lengths) - patches.middle
            shift[np.abs(shift) < _ROUNDING * max(lengths)] = 0.0
        laws = laws.laws
    if not isinstance(laws, Sequence) or not laws or not all(map(_is_law, laws)):
        raise InputError(
            "the interface has no laws",
            value=laws,
            allowed="a law table, a law with pressure() and stiffness(), or a list of such laws",
        )
    if patches is None:
        raise InputError("laws of patches need the patches", key="patches", allowed="a PatchGrid")
    if len(laws) != patches.count:
        raise InputError("every patch needs a law", value=len(laws), allowed=f"{patches.count}")
    return InterfaceLaws(laws=tuple(laws), patches=patches, mode=mode or "patchwise", shift=shift)


def _only_region(table: Any) -> Any:
    """Return the law of a table of regions, which must be one: others need faces of their own."""
    if len(table.laws) != 1:
        raise InputError(
            "a table of several regions holds on no single face",
            value=len(table.laws),
            allowed="an Interface for the facets of each region, with that region's law of the "
            "table, such as laws=table['ring']",
        )
    return table.laws[0]


def _is_law(candidate: Any) -> bool:
    return callable(getattr(candidate, "pressure", None)) and callable(
        getattr(candidate, "stiffness", None)
    )
