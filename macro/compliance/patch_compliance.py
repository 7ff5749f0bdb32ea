"""The compliance of a block at its patches, from one linear solve per patch.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from macro import compat
from macro.contact.law_interface import Interface

Array = NDArray[np.float64]


def patch_compliance_matrix(interface: Interface) -> Array:
    """Return the mean downward displacement of patch i by unit pressure on patch j.

    By reciprocity the matrix is symmetric for patches of equal area. Errors of the linear solver
    are averaged between the two triangles.

    Args:
        interface: Patches on the block's top.

    Returns:
        The compliance, the same on every rank, shape (N, N) [mm/MPa].

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective.
    """
    compliance = displacements_under(interface, np.eye(interface.patches.count))
    return np.asarray(0.5 * (compliance + compliance.T))


def displacements_under(interface: Interface, pressures: Array) -> Array:
    """Return the mean displacements of patches under pressures on them, shape (m, N) [mm].

    Args:
        interface: Patches on the block's top.
        pressures: Pressures of all patches, the same on every rank, shape (m, N) [MPa].

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective.
    """
    block, rows = interface.block, []
    work = block.stiffness.createVecRight()
    for row in pressures:
        displacement = block.solve(interface.load(row))
        work.array[:] = displacement.x.array[: block.owned_dofs]
        rows.append(interface.patch_displacements(work))
        compat.collect_garbage(work.comm)
    return np.array(rows)
