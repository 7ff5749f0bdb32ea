"""A block whose rough top is meshed, under a rigid plane: one load step at a time."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from macro import compat
from macro.block import Block
from macro.contact.active_set import PrimalDualActiveSet
from macro.contact.augmented_lagrangian import AugmentedLagrangian
from macro.contact.face_nodes import TopNodes
from macro.contact.plane_over_nodes import PlaneOverNodes
from macro.contact.unilateral_state import UnilateralContactState, measured

Array = NDArray[np.float64]
Method = Literal["active-set", "augmented-lagrangian", "penalty"]


class UnilateralContactProblem:
    """A block with a rough top, pressed by a rigid plane.

    Args:
        block: The block; its top is where the mesh puts it.
        highest: Height of the highest point of the top, which the approach counts from [mm].
        method: ``"active-set"``: no node of the top penetrates; ``"augmented-lagrangian"``: no
            quadrature point of its facets does; ``"penalty"``: quadrature points penetrate in
            proportion to their pressure.
        patches: Patches on the top that forces and areas are told for; None: the whole top.
        penalty: Pressure per depth, for the last two methods [MPa/mm]; None: from the mesh.

    Attributes:
        top: Nodes of the top, of this rank.

    Raises:
        InputError: When there is no such method, the penalty is not positive, the block's top has
            a margin, or a patch reaches beyond the top.

    Note:
        Everything here is collective.
    """

    def __init__(
        self,
        block: Block,
        highest: float,
        *,
        method: Method = "active-set",
        patches: PatchGrid | None = None,
        penalty: float | None = None,
    ) -> None:
        if method not in get_args(Method):
            raise InputError(
                "unknown contact of the reference",
                value=method,
                allowed=", ".join(get_args(Method)),
            )
        if penalty is not None and not 0.0 < penalty < np.inf:
            raise InputError("the penalty must be positive", value=penalty, allowed="> 0 MPa/mm")
        lengths = block.mesh.shape.interface
        patches = patches or PatchGrid(grid=(1, 1), lengths=lengths)
        _check_top(block, patches)
        self.block, self.top = block, TopNodes(block, patches)
        self._plane = PlaneOverNodes(
            self.top.x, self.top.y, highest - self.top.height, lengths, block.mesh.comm
        )
        self._method: PrimalDualActiveSet | AugmentedLagrangian
        if method == "active-set":
            self._method = PrimalDualActiveSet(block, self.top, self._plane)
        else:
            exact = method == "augmented-lagrangian"
            self._method = AugmentedLagrangian(block, self.top, self._plane, penalty, exact=exact)

    def solve(self, control: Control) -> UnilateralContactState:
        """Find the contact of one load step, starting from those before.

        A force and a moment of zero are met to `macro.linear_solvers.constrained.TOLERANCE` of the
        force, or to what ``-patchlaw_ksp_rtol`` asks for. Without any force the plane just touches
        the highest node, tilted as is prescribed or as it was last.

        Args:
            control: What is prescribed of the plane.

        Raises:
            NotConverged: When an iteration fails, or nothing can hold the plane; the earlier
                solutions stay what they were, so that a smaller step can be tried.
        """
        state = measured(self.block, self.top, self._plane, self._method.solve(control))
        compat.collect_garbage(self.block.stiffness.comm)
        return state


def _check_top(block: Block, patches: PatchGrid) -> None:
    """Refuse what the plane would press on outside the interface, and patches out there."""
    shape = block.mesh.shape
    if shape.margin:
        raise InputError(
            "the plane presses on the whole top, which has no margin",
            value=shape.margin,
            allowed="0 mm",
        )
    sides = np.array(shape.interface)
    low, high = np.array(patches.origin), np.array(patches.origin) + patches.lengths
    slack = 1e-9 * sides
    if np.any(low < -slack) or np.any(high > sides + slack):
        raise InputError(
            "the patches reach beyond the top of the block",
            value=(patches.origin, patches.lengths),
            allowed=f"inside the interface {shape.interface} mm",
        )
