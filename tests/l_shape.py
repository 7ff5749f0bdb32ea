"""A foot that is no cuboid: its rough face on a leg, which stands on an arm that is held far aside.

The leg is 1 × 1 mm and 0.75 mm high, the arm below it 1.5 × 1 × 1 mm, held at its end x = 1.5 mm.
Under a load the face sinks and turns. The roughness is meshed (`Reference`), or it is in the
contact problem and in the laws of the flat body's face (`embedded_model`, `laws_on_mesh`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from geometry import (
    BlockShape,
    Control,
    PatchGrid,
    RefinedShape,
    Spectrum,
    patch_means,
    reference_shapes,
    synthesise,
)
from geometry.face_frame import UPWARD
from geometry.legendre_modes import mode_values
from geometry.meshes.expected_contact import contact_radius
from geometry.meshes.stepped import SteppedShape
from macro import (
    LawContactProblem,
    LoadedFace,
    Material,
    MeshedBody,
    Support,
    UnilateralContactProblem,
    contact_facets,
    nodal_contact,
    patch_compliance_matrix,
)
from macro.contact.rough_face import RoughFace
from macro.linear_solvers.options import solve_linear
from macro.mesh.stepped import ROUGH, rough_stepped_mesh, stepped_mesh
from micro import BodyModes, FiniteSlopes, FreeSides, HalfSpaceModel
from multiscale import consistent_laws, extrapolated
from multiscale.couplings.body import Body

SIDE, LEG, ARM, LENGTH = 1.0, 0.75, 1.0, 1.5
LENGTHS = (SIDE, SIDE)
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
BOXES = {
    "L": [[[0.0, 0.0, -LEG - ARM], [LENGTH, SIDE, -LEG]]],
    "block": [[[0.0, 0.0, -LEG - ARM], [SIDE, SIDE, -LEG]]],
}
HELD = {"L": {"held": (0, LENGTH)}, "block": {"held": (2, -LEG - ARM)}}
EDGE, SMOOTH_MODES = 0.14, 4
"""Edges of the flat body's cells [mm]; modes along a side that the arm changes the face in: deeper
by the leg's height all others have decayed by a factor of 500 and more."""
_RESERVE = 1.1
_PER_MOMENT = 2.0 * np.sqrt(3.0) / SIDE
"""Slope of the first Legendre mode on a side."""


def rough(seed, cells=256):
    """Return a surface of Set 1 (Waddad et al. 2016, table 1)."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    return synthesise(spectrum, grid=(cells, cells), lengths=LENGTHS)


def held(mesh):
    supports = [Support(tag=mesh.facet_names["held"])]
    return MeshedBody(mesh, MATERIAL, supports, order=2)


def flat_body(name="L", edge=EDGE, comm=MPI.COMM_SELF):
    """Return the body with a flat face, with the name of its face's marker."""
    x = np.arange(0.5 * edge, SIDE, edge)
    places = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    block = RefinedShape(
        interface=LENGTHS, height=LEG, places=places, fine=edge, coarse=edge, element="P2"
    )
    shape = SteppedShape(block=block, boxes=BOXES[name])
    return held(stepped_mesh(shape, HELD[name], comm))


def face_of(body, count):
    mesh = body.mesh
    facets = contact_facets(mesh.mesh, mesh.facet_tags.find(mesh.facet_names[ROUGH]), UPWARD)
    return LoadedFace(body, facets, PatchGrid(grid=(count, count), lengths=LENGTHS))


def mode_compliance(body, count):
    """Return the compliance of the face in Legendre modes, shape (K², K²) [mm/N]."""
    sampling = face_of(body, 1).pointwise
    operator, work = sampling.operator, body.stiffness.createVecRight()
    x, y = (mode_values(at, SIDE, count) for at in (sampling.x, sampling.y))
    modes = (x[:, None] * y).reshape(count**2, -1)
    loads = []
    for mode in modes:
        sampling.values.array[:] = mode
        loads.append(body.stiffness.createVecLeft())
        operator.mult(sampling.values, loads[-1])
    columns = []
    for load in loads:
        solve_linear(body.solver, load, work)
        columns.append([work.dot(other) for other in loads])
    found = np.array(columns) / SIDE**4
    return 0.5 * (found + found.T)


def added_by_arm(edge=EDGE):
    """Return what L-shaped bodies add to a leg that is held at its bottom, in smooth modes.

    Both bodies have the same cells in the leg, whose errors cancel.
    """
    whole, leg = (mode_compliance(flat_body(name, edge), SMOOTH_MODES) for name in ("L", "block"))
    return whole - leg


def embedded_model(surface, added, *, slopes=True, height=LEG + ARM):
    """Return the contact problem of a surface on the foot: half-space, sides, body and slopes."""
    nu = MATERIAL.poisson_ratio
    sides = FreeSides(lengths=LENGTHS, poisson_ratio=nu, decay_length=0.25 * SIDE)
    shape = BlockShape(interface=LENGTHS, height=height, cells=(1, 1, 1))
    body = Body(shape=shape, material=MATERIAL, sides="free", side_term=sides)
    face = body.face(None, modes=10)
    higher = surface.highest - surface.mean_height if slopes else 0.0
    term = body.term(face, higher=higher).matrix.reshape(4 * (face.count,)).copy()
    some = slice(SMOOTH_MODES)
    term[some, some, some, some] += added.reshape(4 * (SMOOTH_MODES,))
    model = HalfSpaceModel(
        surface=surface,
        contact_modulus=MATERIAL.contact_modulus,
        sides=sides,
        body=BodyModes(LENGTHS, term.reshape(2 * (face.count**2,))),
        tolerance=1e-10,
    )
    if not slopes:
        return model
    stresses = body.stresses(face, surface)
    return replace(
        model,
        slopes=FiniteSlopes(surface, MATERIAL, plane=surface.highest, edge_stresses=stresses),
    )


def embedded(model, approaches):
    """Return the solutions of a contact problem under a level plane, one after the other."""
    states = []
    for approach in approaches:
        states.append(model.solve(approach, start=states[-1] if states else None))
    return states


def laws_on_mesh(model, approaches, count, body):
    """Return the states of a flat meshed body with calibrated laws of count × count patches."""
    face = face_of(body, count)
    compliance = patch_compliance_matrix(face)
    table = consistent_laws(
        model,
        face.patches,
        mean_heights=patch_means(model.surface, face.patches),
        largest=Control(approach=approaches[-1]),
        displacements=lambda pressures: pressures @ compliance.T,
        tolerance=5e-4,
    )
    problem = LawContactProblem(face, table.laws)
    return [problem.solve(Control(approach=approach)) for approach in approaches]


def moments(state):
    """Return the moments of a half-space solution about the middle of the face, (2,) [N mm]."""
    surface, dx, dy = state.contact.surface, *state.spacing
    forces = state.pressure * (dx * dy)
    levers = surface.x[:, None] - 0.5 * SIDE, surface.y - 0.5 * SIDE
    return np.array([float(np.sum(forces * lever)) for lever in levers])


def reach(state, added):
    """Return the approach and tilt of the plane to a face that has sunk and turned with the arm.

    A tenth of what the face gives way by is kept in reserve. In a leg that is held at its bottom
    contact is possible only where the surface lies above this plane.
    """
    order = [0, SMOOTH_MODES, 1]  # constant, along x, along y
    loads = np.concatenate([[state.force], _PER_MOMENT * moments(state)])
    sunk, *turned = added[np.ix_(order, order)] @ loads / _RESERVE
    tilt = -_PER_MOMENT * np.array(turned)
    return state.approach - float(sunk), (float(tilt[0]), float(tilt[1]))


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The foot meshed with its roughness, ever finer, pressed alike.

    Args:
        surface: The rough surface.
        approaches: Approaches of the level plane, rising [mm].
        plane: Approach and tilt of the plane to the sunken face at the last one, see `reach`.
        edges: Edges of the finest cells along the radius of a typical contact.
        count: Number of meshes.
        name: ``L`` or ``block``.
        comm: MPI communicator.
    """

    surface: object
    approaches: tuple
    plane: tuple
    edges: float = 3.0
    count: int = 3
    name: str = "L"
    comm: object = None

    @cached_property
    def shapes(self):
        approach, tilt = self.plane
        radius = contact_radius(self.surface, approach, tilt=tilt)
        blocks = reference_shapes(
            self.surface,
            approach,
            LEG,
            count=self.count,
            fine=radius / self.edges,
            tilt=tilt,
            radius=radius,
        )
        return [SteppedShape(block=block, boxes=BOXES[self.name]) for block in blocks]

    def solved(self, shape):
        """Return the contact problem of one mesh and its states."""
        planes, top = HELD[self.name], self.surface.highest - self.surface.mean_height
        mesh, _ = rough_stepped_mesh(shape, planes, self.surface, self.comm or MPI.COMM_SELF)
        face = RoughFace.of_body(held(mesh), mesh.facet_names[ROUGH], LENGTHS)
        problem = UnilateralContactProblem(face, top)
        states = [problem.solve(Control(approach=approach)) for approach in self.approaches]
        self._check_reach(shape, problem, states[-1])
        return problem, states

    def _check_reach(self, shape, problem, state):
        """Contact beyond the places that the mesh is fine at would not be resolved."""
        nodes = nodal_contact(problem, state)
        touching = np.stack([nodes.x, nodes.y], axis=1)[nodes.region >= 0]
        if len(touching):
            away = cKDTree(shape.block.places).query(touching)[0].max()
            assert away < 2.0 * shape.fine

    def extrapolate(self, forces):
        """Return the forces of all meshes (meshes, steps) at mesh size zero, with error bars."""
        sizes = np.array([shape.fine for shape in self.shapes])
        return extrapolated(np.array(forces), sizes, 3.0)
