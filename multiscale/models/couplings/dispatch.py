"""The couplings by name: what is known of one before it is made, and where it is made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from patchlaw.geometry import Surface
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.scene.memory import scene_requests
from patchlaw.multiscale.scene.parts import FIELD_CELLS, LAW_BLOCK_CELLS, Cells, stated_cells
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """What is known of a coupling by its name.

    Attributes:
        place: Its module in this folder, and its class; a run loads its own.
        has_body: Whether the surface is on a body instead of a half-space.
        has_laws: Whether load steps use laws.
        meshes_roughness: Whether the roughness is meshed, so that there is no micro model.
        tolerance_by_accuracy: Whether the tolerance of laws, where it is open, follows from the
            accuracy of the scene.
        shows_contacts: Whether fields of a block are those under its contacts, which take more
            cells.
        patches_interact: Whether all patches interact in the compliance of the bodies.
        laws_made_by: Which ranks make laws of patches, ``"shared"`` or ``"root_only"``; empty
            without.
    """

    place: str
    has_body: bool = True
    has_laws: bool = False
    meshes_roughness: bool = False
    tolerance_by_accuracy: bool = False
    shows_contacts: bool = False
    patches_interact: bool = True
    laws_made_by: str = ""

    def unstated_cells(self, scene: Scene) -> Cells:
        """Return the cells of a block that a scene states none for: more under laws on its mesh."""
        return LAW_BLOCK_CELLS if self.shows_contacts or scene.on_mesh else FIELD_CELLS

    def block_cells(self, scene: Scene) -> Cells | None:
        """Return the cells of a flat block that is meshed: for laws, or for fields afterwards."""
        meshed = scene.on_mesh or (self.has_body and bool(scene.output.fields))
        if scene.block is None or not meshed or self.meshes_roughness:
            return None
        return stated_cells(scene, self.unstated_cells(scene))

    def patch_limits(self, scene: Scene, surface: Surface) -> dict[str, Sequence[int]]:
        """Return what limits the numbers of patches along x and y, each with these limits."""
        limits: dict[str, Sequence[int]] = {"heights of the surface": surface.grid}
        if scene.micro.cells:
            limits["cells of contacts (micro.cells)"] = scene.micro.cells
        if cells := self.block_cells(scene):
            limits["cells of the interface (block.cells)"] = cells[:2]
        return limits

    def requests(self, scene: Scene) -> Iterator[MemoryRequest]:
        """Yield the memory that a scene needs, key by key, as far as its file tells."""
        cells, made_by = self.block_cells(scene), self.laws_made_by
        return scene_requests(scene, cells, interact=self.patches_interact, made_by=made_by)

    def check_has_laws(self, scene: Scene) -> None:
        """Refuse a coupling without laws.

        Raises:
            InputError: When the coupling has no laws.
        """
        if not self.has_laws:
            raise InputError(
                "has no laws",
                key="coupling.kind",
                value=scene.kind,
                allowed="isolated, consistent",
                file=scene.file,
            )


COUPLINGS = {
    "analytic": Traits(place="cells.CellCoupling", has_body=False, patches_interact=False),
    "concurrent": Traits(place="cells.CellCoupling", shows_contacts=True),
    "consistent": Traits(
        place="patch_laws.ConsistentCoupling",
        has_laws=True,
        tolerance_by_accuracy=True,
        laws_made_by="root_only",
    ),
    "isolated": Traits(place="patch_laws.IsolatedCoupling", has_laws=True, laws_made_by="shared"),
    "representative": Traits(
        place="representative.RepresentativeCoupling", has_laws=True, tolerance_by_accuracy=True
    ),
    "reference": Traits(
        place="reference.ReferenceCoupling", meshes_roughness=True, patches_interact=False
    ),
}
"""All couplings."""


def traits_of(scene: Scene) -> Traits:
    """Return what is known of a scene's coupling by its name.

    Args:
        scene: The scene.
    """
    return COUPLINGS[scene.kind]


def open_keys(scene: Scene) -> frozenset[str]:
    """Return the keys that an accuracy chooses, which are not stated beside it.

    The block's cells are one of them only under laws on its mesh, the grid of the surface only
    where it is a spectrum's, the degree of displacements only under laws of samples.

    Args:
        scene: The scene.
    """
    if scene.accuracy is None:
        return frozenset()
    traits, by_samples = traits_of(scene), scene.law.representative
    keys = ["micro.finite_slopes"] if by_samples else ["coupling.kind", "patches.grid"]
    if scene.block is not None and scene.on_mesh:
        keys += ["block.cells"] + ["block.element"] * by_samples
    for name in ("body", "counter_body") if traits.has_body else ():
        if getattr(getattr(scene, name), "mesh", None):
            keys += [f"{name}.refinements"] + [f"{name}.element"] * by_samples
    found = {key for key in keys if key.split(".")[1] not in scene.stated(key.split(".")[0])}
    if scene.surface.lacks_grid:
        found.add("surface.grid")
    # other keys of a micro model belong to one that is stated
    if not (by_samples or scene.stated("micro")):
        found.add("micro.model")
    if traits.meshes_roughness and scene.reference.fine is None:
        found.add("reference.fine")
    return frozenset(found)


def coupling_class(scene: Scene) -> Any:
    """Return the class of a scene's coupling, a `Coupling`.

    Args:
        scene: The scene.
    """
    module, _, name = traits_of(scene).place.partition(".")
    return getattr(import_module(f"patchlaw.multiscale.models.couplings.{module}"), name)


def load_finite_elements(scene: Scene, comm: Any) -> None:
    """Import the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job, so that one rank alone must not
    import it.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone, which imports them when it needs them.

    Note:
        Collective.
    """
    meshed = scene.body is not None or (scene.counter_body and scene.counter_body.mesh)
    if comm is not None and (traits_of(scene).has_body or meshed):
        import patchlaw.macro.bodies  # noqa: F401
