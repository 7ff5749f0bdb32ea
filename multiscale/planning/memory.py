"""Whether what is known of a scene's ingredients fits into the memory of the nodes."""

from __future__ import annotations

from collections.abc import Iterator

from multiscale.machine.nodes import ClusterNodes
from multiscale.setup.checks import memory_requests
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import reference_needs


def memory_warnings(setup: ProblemSetup, nodes: ClusterNodes) -> Iterator[str]:
    """Yield what a run would need more nodes for than there are.

    Args:
        setup: The scene's ingredients.
        nodes: The nodes there are.
    """
    wanted = [
        (f"{key} = {value}: {what}needs", need)
        for key, value, what, need in memory_requests(setup.scene)
        if not nodes.fits(need)
    ]
    if setup.meshes is not None:
        of_meshes = reference_needs(setup.meshes.bytes, setup.meshes.gathered)
        wanted += [(f"{what} needs", need) for what, need in of_meshes if not nodes.fits(need)]
    for text, need in wanted:
        yield f"{text} about {need.total / 1e9:.3g} GB of memory; there is {nodes.remedy(need)}"
