"""Whether what is known of a scene's ingredients fits into the memory of the nodes."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.errors import InputError
from multiscale.couplings.blocks import correction_known, scene_loads
from multiscale.nodes import Need, Nodes
from multiscale.planning.block_work import smooth_need
from multiscale.reference.meshes import reference_needs
from multiscale.stage import Stage
from multiscale.stage_checks import needs


def check_smooth_rest(stage: Stage, nodes: Nodes) -> None:
    """Refuse the smooth rest of a decomposed block that the ranks of a node cannot hold.

    Args:
        stage: The scene's ingredients.
        nodes: The nodes of the run.

    Raises:
        InputError: Names key, value and what is allowed.
    """
    need = _lacking_smooth_rest(stage, nodes)
    if need is None:
        return
    raise InputError(
        f"the smooth rest of the block needs about {need.alone / 1e9:.3g} GB of memory",
        key="block.cells",
        value=list(stage.shape.cells),
        allowed=f"what fits into {nodes.room(need)}",
        file=stage.scene.file,
    )


def shortages(stage: Stage, nodes: Nodes) -> Iterator[str]:
    """Yield what a run would need more nodes for than there are.

    Args:
        stage: The scene's ingredients.
        nodes: The nodes there are.
    """
    wanted = [
        (f"{key} = {value}: {what}needs", need)
        for key, value, what, need in needs(stage.scene)
        if not nodes.fit(need)
    ]
    if stage.meshes is not None:
        of_meshes = reference_needs(stage.meshes.bytes, stage.meshes.gathered)
        wanted += [(f"{what} needs", need) for what, need in of_meshes if not nodes.fit(need)]
    smooth = _lacking_smooth_rest(stage, nodes)
    if smooth is not None:
        wanted.append(("the smooth rest of the block needs", smooth))
    for text, need in wanted:
        yield f"{text} about {need.alone / 1e9:.3g} GB of memory; there is {nodes.room(need)}"


def _lacking_smooth_rest(stage: Stage, nodes: Nodes) -> Need | None:
    """Return what the smooth rest takes where it has to be made and there is no room for it."""
    if not (stage.embedded and stage.scene.coupling.decomposed):
        return None
    need = smooth_need(stage.shape, scene_loads(stage).shape)
    return None if nodes.fit(need) or correction_known(stage) else need
