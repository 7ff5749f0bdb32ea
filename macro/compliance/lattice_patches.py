"""Compliance of patches on a flat block of hexahedra, solved for without a mesh in dolfinx.

The displacements are those of the elements in the block's mesh, as all their functions are
products of functions along the axes.

Theory: sections 6 and 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.geometry.materials import Material
from patchlaw.geometry.meshes.block import BlockShape, require_inside
from patchlaw.geometry.patches import PatchGrid
from patchlaw.macro.compliance.elements import nodal, upwards
from patchlaw.macro.compliance.face_compliance import PARITIES, ParityBlock
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.parallel import shared

if TYPE_CHECKING:
    from patchlaw.macro.bodies import Sides

_TOGETHER = 16
"""Loads that a rank solves for together, whatever the number of ranks."""


def lattice_compliance(
    shape: BlockShape,
    material: Material,
    sides: Sides,
    patches: PatchGrid,
    loaded: Indices,
    comm: Any,
) -> Array:
    """Return the mean displacements of all patches by unit pressure on some of them.

    Args:
        shape: The block, of hexahedra.
        material: Elastic constants.
        sides: Support of the block's sides.
        patches: N patches inside its interface.
        loaded: Indices of those that are loaded, shape (m,).
        comm: MPI communicator; None for this process alone.

    Returns:
        Displacements downwards, shape (N, m) [mm/MPa]; the same on every rank and for every number
        of ranks.

    Raises:
        InputError: When a patch reaches beyond the interface.
        NotConverged: When a solution fails.

    Note:
        Collective; the ranks share parities and loads. A load on the paper's cube of 40 × 40 × 25
        hexahedra takes 0.1 s on one core, a tenth of a solution by multigrid.
    """
    require_inside(shape.interface, patches)
    x, y, z = shape.ticks
    lines = (
        nodal(x, shape.degree, patches.borders_x),
        nodal(y, shape.degree, patches.borders_y),
        upwards(z, (shape.degree,) * (len(z) - 1)),
    )
    blocks = [
        ParityBlock(lines=lines, height=shape.height, material=material, sides=sides, parity=parity)
        for parity in PARITIES
    ]
    parts = [loaded[first : first + _TOGETHER] for first in range(0, len(loaded), _TOGETHER)]

    def response(index: int) -> Array:
        part, parity = divmod(index, len(blocks))
        return blocks[parity].between_modes(parts[part])

    found = shared(comm, len(blocks) * len(parts), response)
    sums = [sum(found[first : first + len(blocks)]) for first in range(0, len(found), len(blocks))]
    total = np.concatenate([np.zeros((patches.count, 0)), *sums], axis=1)
    return np.asarray(total / patches.areas[:, None])
