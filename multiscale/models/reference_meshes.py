"""The meshes of a reference: their shapes and the memory they will take, before any is made.

They are arranged by estimates with a half-space under the surface. The body sinks under its load,
so that the plane comes less near to the rough face than to the undeformed surface. The contact
under that plane tells where meshes have to be fine.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from patchlaw.geometry import Control, PatchGrid, RefinedShape, RigidPlane, Surface
from patchlaw.geometry.meshes.refined_block import ContactMap, reference_shapes
from patchlaw.micro import HalfSpaceModel, influence_matrix
from patchlaw.multiscale.bodies.reader import SceneBody
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models.cell_contact import on_few_cells
from patchlaw.multiscale.scene.parts import BodyFacts, SceneParts, block_section
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support import Array, InputError, located
from patchlaw.support.readable import listed

_BISECTED = 1.6
"""Cells by bisection for a regular tetrahedron of their size, calibrated by unknowns of blocks."""

_SCATTER = 0.04
"""Scatter of the force on quadratic meshes by where nodes happen to lie, for one edge along the
radius of one contact: twice the 1.4 % that spheres show, and a part more by extrapolation."""

BYTES_PER_UNKNOWN = {1: 2000, 2: 3500}
"""Memory of mesh, stiffness and multigrid per unknown, by the element's degree [B]."""
_COUNTED = 0.9
"""Part of what the face of a body moves that its meshes count on."""

_MOST_CELLS = 512
"""Heights along a side on which contact is estimated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceMeshes:
    """The meshes of a reference, from coarse to fine.

    Attributes:
        shapes: What to mesh, the finest last.
        sizes: Edge lengths where contact can occur, falling, shape (meshes,) [mm].
        across: Edges of the finest mesh across a typical contact at the largest load, estimated.
        unknowns: Degrees of freedom, estimated.
        contacts: Number of equal contacts with as wide a spread of loads, estimated.
    """

    shapes: tuple[RefinedShape, ...]
    sizes: Array
    across: float
    unknowns: tuple[int, ...]
    contacts: float

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.shapes[-1].degree

    @property
    def force_order(self) -> float:
        """Known order of the force in the edge length where contact occurs.

        In families of quadratic tetrahedra all other edges fall with the square of that.
        """
        return {1: 2.0, 2: 4.0}[self.degree]

    def scatter(self, area: Array, contacts: Array) -> Array:
        """Return the relative scatter of forces by where nodes happen to lie, shape (steps,).

        It falls with the cube of the edges along a contact's radius, and by averaging over several
        contacts. With the load contacts shrink.

        Args:
            area: Contact area of load steps, shape (steps,) [mm²].
            contacts: Number of their contacts, shape (steps,).
        """
        if not np.any(area):
            return np.zeros(len(area))
        each = area / np.maximum(contacts, 1.0)
        shrunk = np.sqrt(each / each[np.argmax(area)])
        edges = np.clip(0.5 * self.across * shrunk, 1.0, 0.5 * self.across)
        return _SCATTER / edges**3 / np.sqrt(np.clip(contacts, 1.0, self.contacts))

    @property
    def bytes(self) -> float:
        """Memory of all meshes together over all ranks, roughly [B]."""
        return float(sum(self.unknowns)) * BYTES_PER_UNKNOWN[self.degree]

    @property
    def gathered(self) -> float:
        """Memory of rank 0 while it makes the largest mesh, roughly [B]."""
        # while tetrahedra are divided, 1 kB for each cell
        return float(max(self.unknowns)) * {1: 1900, 2: 250}[self.degree]

    def requests(self, scene: Scene) -> Iterator[MemoryRequest]:
        """Yield the memory that the meshes need.

        Args:
            scene: The scene.
        """
        yield _request(scene, "the reference", shared=self.bytes)
        yield _request(scene, "rank 0, which meshes the reference,", root_only=self.gathered)

    @property
    def statement(self) -> str:
        """What the meshes are, in words."""
        element = self.shapes[-1].element
        unknowns = [f"about {int(float(f'{count:.2g}'))}" for count in self.unknowns]
        count = {1: "one mesh", 2: "two meshes", 3: "three meshes"}[len(self.shapes)]
        sizes = listed(f"{1e3 * size:.3g}" for size in self.sizes)
        return (
            f"{count} of tetrahedra ({element}), small only where contact can occur; edges there "
            f"of {sizes} µm, {self.across:.2g} across a typical contact; {listed(unknowns)} "
            f"unknowns, about {self.bytes / 1e9:.2g} GB of memory"
        )

    def warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the meshes."""
        if len(self.shapes) == 1:
            yield (
                "one mesh: the discretisation error stays unknown, and the results have no error "
                "bar; reference.meshes = 2 gives one"
            )
        if self.across < {1: 12.0, 2: 3.0}[self.degree]:
            yield (
                f"{self.across:.2g} edges across a typical contact at the largest load: the "
                "force is wrong by several per cent; refine reference.fine"
            )


def reference_meshes(
    scene: Scene,
    surface: Surface,
    body: BodyFacts,
    plane_at_largest_load: RigidPlane,
    contact: ContactMap,
) -> ReferenceMeshes:
    """Return the meshes of a scene's reference.

    Args:
        scene: The scene.
        surface: Its surface.
        body: What is known of its body.
        plane_at_largest_load: The rigid plane at the largest load, relative to the rough face.
        contact: Where contact is expected then.

    Raises:
        InputError: When they cannot be made; names file and key.
    """
    block = scene.block
    if block is not None and block.margin > 0.0:
        whole = "whose rough surface is the whole top"
        problem = f"does not go with coupling.kind = 'reference', {whole}"
        raise InputError(problem, key="block.margin", value=block.margin, allowed="0")
    approach, tilt = plane_at_largest_load.approach, plane_at_largest_load.tilt
    linear = block is not None and body.element == "P1"
    with located(scene.file, "reference.fine"):
        shapes = reference_shapes(
            surface,
            _largest_approach(scene, approach),
            body.depth,
            count=scene.reference.meshes,
            fine=scene.reference.fine,
            tilt=tilt,
            element="P1" if linear else "P2",
            contact=contact,
        )
    sizes = np.array([shape.fine for shape in shapes])
    return ReferenceMeshes(
        shapes=shapes,
        sizes=sizes,
        across=2.0 * contact.typical / float(sizes[-1]),
        unknowns=tuple(_unknowns(shape, body) for shape in shapes),
        contacts=contact.effective,
    )


def least_requests(scene: Scene, surface: Surface, plane: RigidPlane) -> Iterator[MemoryRequest]:
    """Yield the least memory that any meshes of a reference could need.

    It is known before their sizes are arranged, which takes memory too.

    Args:
        scene: The scene.
        surface: Its surface.
        plane: The rigid plane at the largest load.
    """
    fine = scene.reference.fine
    if fine is None:
        return
    # the nodes of the top face where contact can occur alone
    lowered = RigidPlane.above(surface, _largest_approach(scene, plane.approach), plane.tilt)
    depth = surface.highest - surface.heights
    share = float((lowered.at(surface.x[:, None], surface.y) > depth).mean())
    least = 3.0 * BYTES_PER_UNKNOWN[1] * surface.area * share / fine / fine
    yield _request(scene, "the reference", shared=least)


def _largest_approach(scene: Scene, approach: float) -> float:
    """Return the approach that meshes are for; bodies yield more than half-spaces."""
    prescribed = scene.loading.outline.quantity == "approach" and scene.loading.tilt != "free"
    return approach if prescribed else 1.1 * approach  # else it is estimated on a half-space


def _request(scene: Scene, purpose: str, **sizes: Any) -> MemoryRequest:
    return MemoryRequest(
        key="reference.fine",
        value=scene.reference.fine,
        purpose=purpose,
        alternative="fewer reference.meshes",
        **sizes,
    )


def _unknowns(shape: RefinedShape, body: BodyFacts) -> int:
    """Estimate the degrees of freedom of a mesh from the sizes of its tetrahedra.

    Args:
        shape: What is meshed: a block, or what lies below the rough part of a body's face.
        body: What is known of the body; the cells are added to those of a mesh.
    """
    nodes = {1: 1.1, 2: 8.4}[shape.degree]  # of tetrahedra per cube of their edge
    least, own = 0.0, 0.0
    if body.on_mesh:  # a linear mesh has an eighth of the nodes of quadratic displacements
        own = body.unknowns * 8.0 ** (shape.degree - body.degree)
    else:
        least = {1: 5.0, 2: 34.0}[shape.degree] * math.prod(shape.cubes)
    return round(3.0 * max(_BISECTED * nodes * _cubes(shape), least) + own)


def _cubes(shape: RefinedShape) -> float:
    """Return the number of cubes as large as the edges at their place that fill a block."""
    counts = [int(np.clip(np.ceil(length / shape.fine), 8, 400)) for length in shape.interface]
    spacing = np.divide(shape.interface, counts)
    near = np.minimum((shape.places / spacing).astype(int), np.array(counts) - 1)
    classes = np.rint(np.log2(shape.edges / shape.fine) / 0.3).astype(int)
    beside, edges = [], []
    for one in np.unique(classes):
        away, chosen = np.ones(counts, dtype=bool), classes == one
        away[near[chosen, 0], near[chosen, 1]] = False
        beside.append(np.asarray(scipy.ndimage.distance_transform_edt(away, sampling=spacing)))
        edges.append(float(shape.edges[chosen].mean()))

    def density(depth: float) -> float:
        """Return cubes per volume, summed over the columns of the grid."""
        size = np.full(counts, shape.coarse + shape.growth * depth)
        for distance, edge in zip(beside, edges, strict=True):
            away = np.maximum(np.hypot(distance, depth) - 2.0 * edge, 0.0)
            np.minimum(size, edge + shape.growth * away, out=size)
        return float(np.sum(size**-3.0))

    # layers half as thick as the edges at their depth below the smallest, or a twentieth of it:
    # edges too tiny for any memory would grow through 10⁵ layers and more
    depths, total, least = [0.0], 0.0, min(edges)
    while depths[-1] < shape.height:
        grown = least + shape.growth * max(depths[-1] - 2.0 * least, 0.0)
        edge = min(grown, shape.coarse + shape.growth * depths[-1])
        depths.append(min(depths[-1] + max(0.5 * edge, 0.05 * depths[-1]), shape.height))
    for above, below in pairwise(depths):
        total += (below - above) * density(0.5 * (above + below))
    return total * float(np.prod(spacing))


def contact_under(plane: RigidPlane, surface: Surface, contact_modulus: float) -> ContactMap:
    """Return where a half-space would be in contact under a plane.

    A body moves that little: contacts under the same load differ by finite slopes alone.

    Args:
        plane: The plane, in coordinates of the rough face.
        surface: The surface.
        contact_modulus: E* [MPa].
    """
    count_x, count_y = surface.grid
    model = HalfSpaceModel(surface, contact_modulus=contact_modulus)
    model = model.resampled((min(count_x, _MOST_CELLS), min(count_y, _MOST_CELLS)))
    state = model.press(Control(approach=plane.approach, tilt=plane.tilt))
    if state.pressures is None or not state.contacts:
        return ContactMap.of_interference(surface, plane.approach, tilt=plane.tilt)
    found = ContactMap.of_pressures(model.surface, np.reshape(state.pressures, model.surface.grid))
    return found.with_islands(surface, plane.approach, plane.tilt)


def plane_over_face(
    plane: RigidPlane, model: HalfSpaceModel, compliance: Array, *, turns: bool
) -> RigidPlane:
    """Return a plane at a prescribed approach in coordinates of the face that has moved.

    The body takes a part of the approach; a tenth of that is kept in reserve.

    Args:
        plane: The plane at the largest load.
        model: The surface on a half-space.
        compliance: Displacement of the face and its slopes by a mean pressure of 1 MPa, beyond
            those of a half-space, shape (3,); see `added_compliance`.
        turns: Whether the plane turns freely, and so with the face.
    """
    contact, surface = on_few_cells(model), model.surface
    counted = np.array([1.0, 0.0, 0.0] if turns else [1.0, 1.0, 1.0])

    def over_face(pressure: float) -> RigidPlane:
        moved = _COUNTED * pressure * compliance * counted
        tilt = plane.tilt[0] - moved[1], plane.tilt[1] - moved[2]
        return RigidPlane.above(surface, plane.approach - float(moved[0]), tilt)

    def excess(pressure: float) -> float:
        """Return what a half-space bears under the plane over the face, less the pressure."""
        at = over_face(pressure)
        step = contact.press(Control(approach=at.approach, tilt=at.tilt))
        return step.force_N / surface.area - pressure

    most = excess(0.0)
    if most <= 0.0:
        return plane
    return over_face(
        scipy.optimize.brentq(excess, 0.0, most, rtol=0.01) if excess(most) < 0.0 else most
    )


def added_compliance(parts: SceneParts, body: SceneBody | None) -> Array:
    """Return what a body adds to a half-space under a uniform pressure on its rough rectangle.

    Args:
        parts: What is known of the scene.
        body: The body, placed; None for a block, which is compressed as a column.

    Returns:
        Displacement of the middle into the body [mm/MPa], and its slopes along x and y
        [1/MPa], shape (3,): the plane through the mean displacements of 4 × 4 parts.

    Note:
        Collective.
    """
    material, lengths = parts.materials.first, parts.surface.lengths
    if body is None:
        nu, sides = material.poisson_ratio, block_section(parts.scene).sides
        confined = (1.0 + nu) * (1.0 - 2.0 * nu) / (1.0 - nu) if sides == "roller" else 1.0
        column = confined * parts.body.depth / material.young_modulus
        whole = PatchGrid(grid=(1, 1), lengths=lengths)
        own = float(influence_matrix(whole)[0, 0]) * material.surface_compliance / np.pi
        return np.array([column - own, 0.0, 0.0])
    from patchlaw.macro import LoadedFace, displacements_under

    patches = PatchGrid(grid=(4, 4), lengths=lengths)
    uniform = np.ones((1, patches.count))
    moved = displacements_under(LoadedFace(body.body, body.facets[0], patches), uniform)[0]
    moved = moved - influence_matrix(patches) @ uniform[0] * material.surface_compliance / np.pi
    arms = patches.centres - 0.5 * np.asarray(lengths)
    plane = np.linalg.lstsq(np.column_stack([np.ones(patches.count), arms]), moved, rcond=None)[0]
    return np.asarray(plane)
