"""Sets up the problem of a scene whose laws are those of periodic samples."""

from __future__ import annotations

import time

from geometry.meshes.block import BlockShape
from geometry.patches import PatchGrid, patch_means
from geometry.rigid_plane import RigidPlane
from micro import HalfSpaceModel
from multiscale.loading.stepper import LoadHistory
from multiscale.machine import ClusterNodes
from multiscale.scene.scene import Scene
from multiscale.setup.memory import check_memory
from multiscale.setup.mesh_bodies import FaceFacts, Faces, second_material
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import mesh_unknowns
from multiscale.setup.samples import region_samples
from multiscale.setup.surface_and_block import (
    Bulk,
    block_section,
    check_load,
    load_history_on,
    make_shape,
    sample_surface,
)


def representative_setup(scene: Scene, nodes: ClusterNodes, faces: Faces) -> ProblemSetup:
    """Set up the problem of a scene whose laws are those of periodic samples.

    The surface of the setup is the first sample, and its micro model the periodic half-space.

    Args:
        scene: The scene.
        nodes: The nodes of the run.
        faces: What is known of the meshes of its bodies.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    began, shape = time.perf_counter(), None
    check_memory(scene, nodes)
    face, counter = faces
    if face is None:
        shape = make_shape(scene, sample_surface(scene, scene.surface, "surface"))
        face = face_of_block(scene, shape)
    samples = region_samples(scene, face.materials, second_material(scene, counter))
    surface, materials = samples[0].surfaces[0], samples[0].materials
    surfaces = tuple(one for region in samples for one in region.surfaces)
    check_load(scene, surfaces, Bulk(face.area, face.depth, materials.first.young_modulus))
    model = HalfSpaceModel(
        surface,
        contact_modulus=materials.contact_modulus,
        periodic=True,
        hardness=scene.micro.hardness,
    )
    patches = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return ProblemSetup(
        scene=scene,
        surface=surface,
        counter_surface=None,
        micro=model,
        patches=patches,
        mean_heights=patch_means(surface, patches),
        block_shape=shape,
        materials=materials,
        face=face,
        counter_face=counter,
        samples=samples,
        plane_at_largest_load=_sample_plane(load_history_on(scene, surfaces), model),
        seconds={"surface": time.perf_counter() - began},
    )


def face_of_block(scene: Scene, shape: BlockShape) -> FaceFacts:
    """Return what is known of the contact face of a block.

    Args:
        scene: The scene.
        shape: Shape and mesh of its block.
    """
    x, y = (length + 2.0 * shape.margin for length in shape.interface)
    material = block_section(scene).material
    kind = "hexahedra" if shape.hexahedral else "tetrahedra"
    return FaceFacts(
        lengths=shape.interface,
        area=shape.interface[0] * shape.interface[1],
        depth=shape.height,
        cells=f"{' × '.join(map(str, shape.cells))} {kind}",
        unknowns=mesh_unknowns(shape),
        element=shape.element,
        materials=(material,),
        poisson_ratio=material.poisson_ratio,
        above=False,
        notes=(f"its sides are {x:g} × {y:g} mm",) if shape.margin else (),
    )


def _sample_plane(history: LoadHistory, model: HalfSpaceModel) -> RigidPlane | None:
    """Return the plane on a sample at the largest approach, or None under a force.

    The body takes part of the approach, and the plane is an upper bound.
    """
    surface = model.surface
    if history.quantity == "force":
        return None
    mean = model.reference_height - surface.mean_height
    return RigidPlane.above(surface, min(history.largest, mean))
