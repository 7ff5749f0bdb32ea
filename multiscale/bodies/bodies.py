"""The bodies of a scene: their contact face, their compliance under patches, and their terms.

One rule holds for a counter-body that is a half-space. A compliance of the patches as a matrix is
that of both bodies. A mesh is that of the first body alone; then the laws, whose closures count its
displacements alone, contain those of the half-space.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, MaterialPair, PatchGrid
from micro import influence_matrix
from multiscale.bodies.block import block_terms
from multiscale.bodies.face_terms import FaceTerms
from multiscale.bodies.mesh import MeshTerms, PairTerms
from multiscale.bodies.scene_body import SceneBody
from multiscale.inputs.block import block_section
from multiscale.inputs.body_facts import BodyFacts
from multiscale.laws.consistent import Displacements
from multiscale.scene.scene import Scene

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, LoadedFace

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """The bodies of a scene, on every rank.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
        facts: What is known of the body below the surface and of a counter-body on a mesh.
        materials: The materials on both sides of the interface.
        lengths: Sides of the surface [mm].
        patches: Partition of the interface.
        regions: Whether the contact face is divided by its regions, as under laws of samples,
            instead of by patches.
        first: The body below the surface where it is a mesh; None for a block.
        counter: The counter-body where it is a mesh.
    """

    scene: Scene
    comm: Any
    facts: tuple[BodyFacts, BodyFacts | None]
    materials: MaterialPair
    lengths: tuple[float, float]
    patches: PatchGrid
    regions: bool = False
    first: SceneBody | None = None
    counter: SceneBody | None = None

    def contact_face(self) -> LoadedFace | FacePair:
        """Return the patches or regions on the contact face of the body, or of two on meshes.

        A block is meshed for it.

        Note:
            Collective.
        """
        from macro import FacePair, LoadedFace

        first = self._first_face()
        if self.counter is None:
            return first
        second = LoadedFace(self.counter.body, self.counter.facets[0], self.patches)
        if self.regions:
            lengths = self.facts[0].lengths
            second = LoadedFace.of_regions(self.counter.body, self.counter.facets, lengths)
        return FacePair(first, second)

    def _first_face(self) -> LoadedFace:
        """Return the patches, or regions under laws of samples, on the first body."""
        from mpi4py import MPI

        from macro import Block, LoadedFace, block_mesh
        from macro.mesh.contact_face import top_facets

        body: Any
        shape = self.facts[0].shape
        if self.first is not None:
            body, facets = self.first.body, self.first.facets
        else:
            assert shape is not None
            mesh = block_mesh(shape, self.comm or MPI.COMM_SELF)
            body = Block(mesh, self.materials.first, sides=block_section(self.scene).sides)
            if not self.regions:
                return LoadedFace.of_block(body, self.patches)
            facets = (top_facets(mesh),)
        if self.regions:
            return LoadedFace.of_regions(body, facets, self.facts[0].lengths)
        return LoadedFace(body, facets[0], self.patches)

    def terms(self, *, side_term: bool) -> FaceTerms:
        """Return the terms of the bodies in contact problems of the whole surface.

        Args:
            side_term: Whether free sides that bound the interface are a term of their own.

        Raises:
            InputError: When the surface reaches beyond a contact face.

        Note:
            Collective where a body is a mesh.
        """
        first: FaceTerms
        shape = self.facts[0].shape
        if self.first is not None:
            first = MeshTerms.of(self.first, self.lengths, side_term=side_term)
        else:
            assert shape is not None
            sides = block_section(self.scene).sides
            first = block_terms(shape, self.materials.first, sides, side_term=side_term)
        if self.counter is None:
            return first
        if first.margin:
            raise InputError(
                "a block with a margin has no smooth modes in common with a counter-body on a mesh",
                key="block.margin",
                value=first.margin,
                allowed="0; or both bodies from meshes",
            )
        second = MeshTerms.of(self.counter, self.lengths, side_term=False, behind=True)
        return PairTerms(first=first, second=second)

    def patch_displacements(self, *, dense: bool, solutions: int) -> Displacements:
        """Return what gives the mean displacements of patches in the macro model.

        Args:
            dense: Whether the macro model is the compliance of the patches, or the mesh itself.
            solutions: Solutions of the mesh that are expected to be asked for.

        Returns:
            A function from pressures of N patches at m load steps to displacements, (m, N) both,
            [MPa] to [mm]. It is collective.

        Note:
            Collective.
        """
        if dense:
            compliance = self.patch_compliance()
            return lambda pressures: np.asarray(pressures @ compliance.T)
        return self._by_loaded_patches(solutions)

    def _by_loaded_patches(self, solutions: int) -> Displacements:
        """Return what gives displacements of the mesh, from those by patches that carry a load.

        Args:
            solutions: Patches that are loaded one by one, at most.
        """
        from mpi4py import MPI

        from macro import displacements_under
        from macro.compliance.cache import cached
        from macro.linear_solvers.options import users_options

        key = (*self._as_text(), self.patches, users_options())
        faces: list[Any] = []  # meshed when a column is missing
        columns: dict[int, Array] = {}

        def under(pressures: Array) -> Array:
            if not faces:
                faces.append(self.contact_face())
            return displacements_under(faces[0], pressures)

        def by_unit_load(patch: int) -> Array:
            one = np.eye(1, self.patches.count, patch)
            comm = self.comm or MPI.COMM_SELF
            return cached("column", (*key, patch), lambda: {"column": under(one)}, comm)["column"]

        def displacements(pressures: Array) -> Array:
            loaded = np.flatnonzero(pressures.any(axis=0)).tolist()
            if len(loaded) > solutions:
                return under(pressures)
            columns.update((patch, by_unit_load(patch)) for patch in loaded if patch not in columns)
            total = np.zeros(pressures.shape)
            for patch in loaded:
                total += pressures[:, [patch]] * columns[patch]
            return total

        return displacements

    def patch_compliance(self) -> Array:
        """Return the compliance of both sides under the patches, shape (N, N) [mm/MPa].

        Note:
            Collective.
        """
        first, second = self._of_first, self.materials.second
        # two meshes are loaded together; decomposed, they are two half-spaces and what bodies add
        meshed_together = self.facts[1] is not None and not self.scene.decomposed
        if second is None or meshed_together:
            return first
        half_space = influence_matrix(self.patches) * second.surface_compliance / np.pi
        return np.asarray(first + half_space)

    @cached_property
    def _of_first(self) -> Array:
        """Return the compliance of the meshes under the patches, of the first body or of both."""
        if self.scene.decomposed:
            return self.terms(side_term=True).patch_compliance(self.patches, self.comm)
        from mpi4py import MPI

        from macro import patch_compliance_matrix
        from macro.compliance.cache import cached
        from macro.linear_solvers.options import users_options

        def compute() -> dict[str, Array]:
            return {"compliance": patch_compliance_matrix(self.contact_face())}

        key = (*self._as_text(), self.patches, users_options())
        return cached("plain", key, compute, self.comm or MPI.COMM_SELF)["compliance"]

    def _as_text(self) -> tuple[Any, ...]:
        """Return all that the compliance of the meshes depends on, besides the patches."""
        scene, parts, shape = self.scene, [], self.facts[0].shape
        if shape is not None:
            parts += [shape, self.materials.first, block_section(scene).sides]
        for section, facts in zip((scene.body, scene.counter_body), self.facts, strict=True):
            if section is not None and facts is not None:
                parts += [section, facts.digest]
        return tuple(parts)
