"""The rough face of a body, which a rigid plane is pressed on.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from mpi4py import MPI

from geometry.face_frame import UPWARD, FaceFrame
from geometry.patches import PatchGrid
from macro.block import Block
from macro.contact.loaded_face import LoadedFace
from macro.elastic_body import ElasticBody
from macro.mesh.block import TOP
from macro.mesh.contact_face import ContactFacets, contact_facets
from support.errors import InputError

_UPRIGHT = 1e-12
"""Deviation of a face's normal from the z axis that is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RoughFace:
    """The rough face of a body that is meshed with its roughness; it looks along the z axis.

    Args:
        body: The body.
        marker: Marker of the face's facets.
        lengths: Sides (Lx, Ly) of the face's rectangle, about whose middle a plane turns [mm].
        modulus: Contact modulus E* of the body at the face [MPa].
        frame: Frame of the face, in whose coordinates the rectangle begins at the origin.

    Raises:
        InputError: When the face does not look along the z axis.
    """

    body: ElasticBody
    marker: int
    lengths: tuple[float, float]
    modulus: float
    frame: FaceFrame = UPWARD

    def __post_init__(self) -> None:
        if not np.allclose(self.frame.normal, [0.0, 0.0, 1.0], rtol=0.0, atol=_UPRIGHT):
            raise InputError(
                "a face that is meshed with its roughness must look along the z axis",
                value=self.frame.normal.tolist(),
                allowed="[0, 0, 1]",
            )

    @classmethod
    def of_block(cls, block: Block) -> Self:
        """Return the top of a block.

        Raises:
            InputError: When the block has a margin.
        """
        if block.mesh.shape.margin:
            raise InputError(
                "the plane presses on the whole top, which has no margin",
                value=block.mesh.shape.margin,
                allowed="0 mm",
            )
        lengths, modulus = block.mesh.shape.interface, block.material.contact_modulus
        return cls(body=block, marker=TOP, lengths=lengths, modulus=modulus)

    @classmethod
    def of_body(
        cls,
        body: ElasticBody,
        marker: int,
        lengths: tuple[float, float],
        frame: FaceFrame = UPWARD,
    ) -> Self:
        """Return a face of any body, with the largest contact modulus of the cells behind it.

        Args:
            body: The body.
            marker: Marker of the face's facets.
            lengths: Sides (Lx, Ly) of the face's rectangle [mm].
            frame: Frame of the face, in whose coordinates the rectangle begins at the origin.

        Raises:
            InputError: When no facet has the marker, or the face does not look along the z axis.

        Note:
            Collective.
        """
        facets = contact_facets(body.mesh.mesh, body.mesh.facet_tags.find(marker), frame)
        lame, shear = body.cell_lame
        modulus = np.broadcast_to(
            4.0 * shear * (lame + shear) / (lame + 2.0 * shear), np.shape(lame) or 1
        )
        behind = modulus[facets.cell] if np.ndim(lame) else modulus[: len(facets.cell)]
        largest = body.comm.allreduce(float(behind.max(initial=0.0)), op=MPI.MAX)
        if not largest:
            raise InputError("no facet of the body has this marker", value=marker)
        return cls(body=body, marker=marker, lengths=lengths, modulus=largest, frame=frame)

    @property
    def facets(self) -> ContactFacets:
        """The facets whose cells this rank owns; there may be none."""
        mesh = self.body.mesh
        return contact_facets(mesh.mesh, mesh.facet_tags.find(self.marker), self.frame)

    @property
    def whole(self) -> PatchGrid:
        """One patch of the whole face."""
        return PatchGrid(grid=(1, 1), lengths=self.lengths)

    def loaded(self, degree: int) -> LoadedFace:
        """Return the face with quadrature that is exact for a polynomial degree."""
        return LoadedFace(self.body, self.facets, self.whole, degree)
