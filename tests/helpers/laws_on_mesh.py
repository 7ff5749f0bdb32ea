"""Patch laws on the mesh of a body where the program would take something cheaper."""

from patchlaw.multiscale.models.patch_coupling import PatchCoupling
from patchlaw.multiscale.scene.sections import SceneSections


def lay_on_mesh(monkeypatch, *, condensed=False):
    """Let laws lie on a mesh instead of a decomposed block.

    Args:
        monkeypatch: Takes it back.
        condensed: Whether load steps know the mesh by the compliance of its patches.
    """
    monkeypatch.setattr(
        SceneSections, "decomposed", property(lambda scene: scene.kind == "concurrent")
    )
    if not condensed:
        monkeypatch.setattr(PatchCoupling, "condensed", False)
