"""The bodies of a scene: contact face, compliance, contact models on them.

One rule holds for a counter-body that is a half-space. The compliance of decomposed bodies is that
of both. A mesh is that of the first body alone; then the laws, whose closures count its
displacements alone, contain those of the half-space.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.geometry import MaterialPair, Surface, rough_sides
from patchlaw.micro import FiniteSlopes, HalfSpaceModel, influence_matrix
from patchlaw.micro.half_space.error_probe import OnBody
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_sides, block_term, mesh_term
from patchlaw.multiscale.bodies.reader import SceneBody
from patchlaw.multiscale.scene.parts import SceneParts, block_section
from patchlaw.support import Array, Indices

if TYPE_CHECKING:  # finite elements and laws are imported only by scenes that need them
    from patchlaw.macro import ElasticBody, FaceCompliance, FacePair, LoadedFace
    from patchlaw.multiscale.laws.of_patches import Displacements

_RESIDUAL = 1e-10
"""Residual of half-space solutions. Their forces are then right to 1e-12, so that neither the unit
of length nor the number of ranks changes a result. It costs a tenth more than 1e-8."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """The bodies of a scene, on every rank.

    Args:
        parts: What is known of the scene.
        comm: MPI communicator; None for this process alone.
        first: The body below the surface where it is a mesh; None for a block.
        counter: The counter-body where it is a mesh.
    """

    parts: SceneParts
    comm: Any
    first: SceneBody | None = None
    counter: SceneBody | None = None
    _terms: dict[bool, FaceTerms] = field(default_factory=dict, init=False)
    _columns: dict[int, Array] = field(default_factory=dict, init=False)
    """Displacements by unit pressure on single patches, as far as they were asked for."""

    @cached_property
    def contact_face(self) -> LoadedFace | FacePair:
        """The patches or regions on the contact face of the body, or of two on meshes; collective.

        A block is meshed for it, once: whatever loads it shares one mesh, one stiffness, one
        solver.
        """
        from patchlaw.macro import FacePair

        first = self._first_face()
        if self.counter is None:
            return first
        return FacePair(first, self._on_mesh(self.counter))

    @property
    def made_bodies(self) -> list[ElasticBody]:
        """The bodies whose contact face has been made."""
        face: Any = self.__dict__.get("contact_face")
        return [] if face is None else [one.body for one in face.sides]

    def _first_face(self) -> LoadedFace:
        """Return the patches, or regions under laws of samples, on the first body."""
        from mpi4py import MPI

        from patchlaw.macro import Block, LoadedFace, block_mesh
        from patchlaw.macro.mesh.contact_face import top_facets

        parts, shape = self.parts, self.parts.body.shape
        if self.first is not None:
            return self._on_mesh(self.first)
        assert shape is not None
        mesh = block_mesh(shape, self.comm or MPI.COMM_SELF)
        body = Block(mesh, parts.materials.first, sides=block_section(parts.scene).sides)
        if parts.regions is None:
            return LoadedFace.of_block(body, parts.patches)
        return LoadedFace.of_regions(body, (top_facets(mesh),), parts.body.lengths)

    def _on_mesh(self, mesh: SceneBody) -> LoadedFace:
        """Return the patches or regions on a body that is a mesh of its own."""
        from patchlaw.macro import LoadedFace

        if self.parts.regions is None:
            return LoadedFace(mesh.body, mesh.facets[0], self.parts.patches)
        return LoadedFace.of_regions(mesh.body, mesh.facets, self.parts.body.lengths)

    def terms(self, *, side_term: bool) -> FaceTerms:
        """Return the terms of the bodies in contact problems of the whole surface, made once.

        Args:
            side_term: Whether free sides that bound the interface are a term of their own.

        Raises:
            InputError: When the surface reaches beyond a contact face.

        Note:
            Collective where a body is a mesh.
        """
        if side_term not in self._terms:
            self._terms[side_term] = self._make_terms(side_term)
        return self._terms[side_term]

    def _make_terms(self, side_term: bool) -> FaceTerms:
        parts, shape = self.parts, self.parts.body.shape
        lengths = parts.surface.lengths
        if self.first is not None:
            first = mesh_term(self.first, lengths, side_term=side_term)
        else:
            assert shape is not None
            material, sides = parts.materials.first, block_section(parts.scene).sides
            own = block_sides(shape, material, sides) if side_term else None
            first = block_term(shape, material, sides, own)
        if self.counter is None:
            return FaceTerms((first,))
        second = mesh_term(self.counter, lengths, side_term=False, opposite=first)
        return FaceTerms((first, second))

    def patch_displacements(self, solutions: int) -> Displacements:
        """Return what gives the mean displacements of patches in the macro model.

        Args:
            solutions: Patches that a mesh is loaded on one by one, at most; rows of more are solved
                for as a whole.

        Returns:
            A function from pressures of N patches at m load steps to displacements, (m, N) both,
            [MPa] to [mm]. It is collective.

        Note:
            Collective.
        """
        if self.parts.scene.decomposed:
            compliance = self.patch_compliance()
            return lambda pressures: np.asarray(pressures @ compliance.T)

        def displacements(pressures: Array) -> Array:
            loaded = np.flatnonzero(pressures.any(axis=0))
            if len(loaded) > solutions:
                from patchlaw.macro import displacements_under

                return displacements_under(self.contact_face, pressures)
            return np.asarray(pressures[:, loaded] @ self._unit_displacements(loaded).T)

        return displacements

    def compliance_under(self, loaded: Indices) -> Array:
        """Return the compliance of the macro model under some patches, shape (N, N) [mm/MPa].

        Args:
            loaded: Indices of the patches that can carry load; on a mesh the columns of others are
                zero.

        Note:
            Collective; on a mesh one solution for each patch that has not been loaded before.
        """
        if self.parts.scene.decomposed:
            return self.patch_compliance()
        compliance = np.zeros(2 * (self.parts.patches.count,))
        compliance[:, loaded] = self._unit_displacements(loaded)
        return compliance

    def _unit_displacements(self, loaded: Indices) -> Array:
        """Return displacements by single unit pressures, solved for once, (N, m) [mm/MPa]."""
        new = [patch for patch in loaded.tolist() if patch not in self._columns]
        if new:
            found = self._cached("columns", tuple(new), lambda: self._under(np.array(new)))
            self._columns.update(zip(new, found.T, strict=True))
        columns = [self._columns[patch] for patch in loaded.tolist()]
        return np.reshape(columns, (len(loaded), self.parts.patches.count)).T

    def _under(self, loaded: Indices) -> Array:
        """Return the mean displacements of the mesh by unit pressures one at a time, (N, m)."""
        parts = self.parts
        if self.needs_no_mesh:
            from patchlaw.macro.compliance.face_compliance import lattice_compliance

            shape, sides = parts.body.shape, block_section(parts.scene).sides
            assert shape is not None
            material = parts.materials.first
            return lattice_compliance(shape, material, sides, parts.patches, loaded, self.comm)
        from patchlaw.macro import displacements_under

        loads = np.eye(parts.patches.count)[loaded]
        return displacements_under(self.contact_face, loads).T

    @property
    def needs_no_mesh(self) -> bool:
        """Whether patches are solved for without a mesh: on one block of hexahedra."""
        shape = self.parts.body.shape
        return self.counter is None and shape is not None and shape.hexahedral

    def _cached(self, kind: str, more: Any, compute: Callable[[], Array]) -> Array:
        """Return an array that depends on the meshes and patches, from the cache if it is there."""
        from patchlaw.macro.disk_caches import cached

        options: tuple[Any, ...] = ()
        if not self.needs_no_mesh:
            from patchlaw.macro.linear_solvers.options import users_options

            options = users_options()
        key = (*self._as_text(), self.parts.patches, options, more)
        return cached(kind, key, lambda: {kind: compute()}, self.comm)[kind]

    def patch_compliance(self) -> Array:
        """Return the compliance of decomposed bodies under the patches, shape (N, N) [mm/MPa].

        They are half-spaces of both materials, and what the bodies add; worked out once.

        Note:
            Collective.
        """
        return self._decomposed

    @cached_property
    def _decomposed(self) -> Array:
        parts, second = self.parts, self.parts.materials.second
        bodies = self.terms(side_term=True).patch_compliance(parts.patches, self.comm)
        if second is None:
            return bodies
        half_space = influence_matrix(parts.patches) * second.surface_compliance / np.pi
        return np.asarray(bodies + half_space)

    def mean_compliance(self) -> float:
        """Return the mean displacement of the face by a uniform unit pressure [mm/MPa].

        Note:
            Collective.
        """
        from patchlaw.macro import displacements_under

        total = 0.0
        for one in self.contact_face.sides:
            moved = displacements_under(one, np.ones((1, one.patches.count)))[0]
            total += float(moved @ one.areas / one.areas.sum())
        return total

    def largest_preload(self) -> float:
        """Return how far loads besides the contact raise the faces towards each other at most [mm].

        It is the sum of the largest displacements out of both faces at any point, in any state of
        the loads.

        Note:
            Collective.
        """
        from patchlaw.macro import largest_rise

        return sum(
            max(largest_rise(one, state) for state in range(len(one.body.loads)))
            for one in self.contact_face.sides
        )

    def _as_text(self) -> tuple[Any, ...]:
        """Return all that the compliance of the meshes depends on, besides the patches."""
        parts, scene, found = self.parts, self.parts.scene, list[Any]()
        if parts.body.shape is not None:
            found += [parts.body.shape, parts.materials.first, block_section(scene).sides]
        sections = (scene.body, parts.body), (scene.counter_body, parts.counter)
        for section, facts in sections:
            if section is not None and facts is not None:
                found += [section, facts.digest]
        return tuple(found)


def on_body(
    terms: FaceTerms | None,
    materials: MaterialPair,
    counter: Surface | None,
    *,
    comm: Any = None,
    more_modes: int = 0,
) -> OnBody:
    """Return what puts half-space models on the bodies of a scene, which are solved for once.

    Theory: docs/theory.md, sections 3 and 7.

    Args:
        terms: The terms of the bodies, with free sides as a term of their own; None for
            half-spaces.
        materials: The materials on both sides.
        counter: What of the surface is the counter-body's; None where that is smooth.
        comm: MPI communicator; None for this process alone.
        more_modes: Modes of the body along a side beyond those that its shape needs.

    Returns:
        A function from a model and the order of finite slopes, 0 for none, to the model on the
        body. It is not collective.

    Note:
        Collective.
    """
    faces: Sequence[FaceCompliance] = ()
    if terms is not None:
        faces = terms.face(comm, modes=terms.modes + more_modes if more_modes else None)

    def put(model: HalfSpaceModel, order: int) -> HalfSpaceModel:
        model = replace(model, tolerance=_RESIDUAL)
        sides = rough_sides(model.surface, counter, materials)  # each has slopes of its own
        stressed = list(zip(terms.bodies, faces, strict=True)) if terms else []
        if terms is not None:
            # With finite slopes heights count from the highest point, near the loads, where slopes
            # add least. A flat body then ends at it, while its height is that of the mean plane.
            higher = [one.highest - one.mean_height for one, _ in sides] if order else []
            model = replace(model, body=terms.term(faces, higher=higher))
            if terms.side_term is not None:
                share = terms.side_share(model.contact_modulus)
                model = replace(model, sides=replace(terms.side_term, share=share))
        if not order:
            return model
        slopes = []
        for (surface, material), body in zip_longest(sides, stressed[: len(sides)]):
            stresses = [] if body is None else body[0].stresses(body[1], surface)
            slopes.append(
                FiniteSlopes(
                    surface,
                    material,
                    periodic=model.periodic,
                    plane=surface.highest if stresses else None,
                    edge_stresses=stresses,
                )
            )
        return replace(model, slopes=tuple(slopes))

    return put


def free_bodies(bodies: list[ElasticBody]) -> None:
    """Free bodies that nothing else refers to any more.

    PETSc keeps objects that Python drops until it is asked on their own communicator. Without this
    a program that makes many runs would grow by a block with each.

    Args:
        bodies: The bodies; the list is emptied.

    Note:
        Collective.
    """
    if not bodies:
        return
    from patchlaw.macro.compat import collect_garbage

    comms = [body.stiffness.comm.duplicate() for body in bodies]  # these outlive their bodies
    bodies.clear()
    gc.collect()  # a body and its contact problem refer to each other
    for comm in comms:
        collect_garbage(comm)
        comm.destroy()
