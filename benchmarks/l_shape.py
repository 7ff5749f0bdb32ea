"""A foot that is no cuboid: its rough face on a leg, which stands on an arm that is held aside.

The leg is 1 × 1 mm and 0.75 mm high, the arm below it 1.5 × 1 × 1 mm, held at its end x = 1.5 mm.
Under a load the face sinks and turns. `Reference` meshes the roughness; `scene` has the flat foot,
with the roughness in the contact problem or in laws.
"""

from dataclasses import dataclass
from functools import cached_property

import gmsh
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from benchmarks.stepped import SteppedShape, rough_stepped_mesh
from patchlaw.geometry import Control, RefinedShape, Surface, reference_shapes
from patchlaw.geometry.meshes.refined_block import contact_radius
from patchlaw.macro import (
    Material,
    MeshedBody,
    RoughFace,
    Support,
    UnilateralContactProblem,
    nodal_contact,
)
from patchlaw.multiscale import Scene, extrapolated

SIDE, LEG, ARM, END = 1.0, 0.75, 1.0, 1.5
LENGTHS = (SIDE, SIDE)
BOXES = [[[0.0, 0.0, -LEG - ARM], [END, SIDE, -LEG]]]
HELD = {"held": (0, END)}
ELASTIC = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
SPECTRUM = {"hurst": 0.95, "waves": [2, 10], "rms_slope": 0.215}
"""Set 1 of Waddad et al. 2016, table 1."""

_GIVEN_WAY = 0.9
"""Part of what the face gives way by that the reference's meshes count on."""


def scene(seed, approach, steps, *, foot=None, cells=256, **sections):
    """Return a scene of the surface of a seed on a foot's mesh, or on a block as high as the foot.

    Args:
        seed: Of the spectrum.
        approach: Largest approach of the level plane [mm].
        steps: Load steps.
        foot: File of the foot's mesh; None for a block that is held at its bottom.
        cells: Heights along a side.
        sections: Further sections.
    """
    supports = [{"surface": "held", "displacement": [0.0, 0.0, 0.0]}]
    body = {"mesh": str(foot), "contact": "rough", "element": "quadratic", "supports": supports}
    surface = {"spectrum": {**SPECTRUM, "seed": seed}, "grid": [cells, cells]}
    return Scene.from_dict(
        {
            "surface": surface | {"lengths": list(LENGTHS)},
            **({"body": body | ELASTIC} if foot else {"block": {"height": LEG + ARM, **ELASTIC}}),
            "micro": {"model": "half-space"},
            "patches": {"grid": [4, 4]},
            "load": {"approach": approach, "steps": steps},
            "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
            **sections,
        }
    )


def write_foot(path, edge):
    """Write the flat foot in straight tetrahedra of an edge length [mm], its surfaces named."""
    middles = np.arange(0.5 * edge, SIDE, edge)
    places = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    block = RefinedShape(interface=LENGTHS, height=LEG, places=places, fine=edge, coarse=edge)
    shape = SteppedShape(block=block, boxes=BOXES)
    with shape.meshed() as model:
        for tag, (name, (axis, at)) in enumerate({"rough": (2, 0.0), **HELD}.items(), start=1):
            box = np.array([[-9.0] * 3, [9.0] * 3])
            box[:, axis] = at / shape.unit - 1e-6, at / shape.unit + 1e-6
            faces = [face for _, face in model.getEntitiesInBoundingBox(*box.ravel(), 2)]
            model.addPhysicalGroup(2, faces, tag)
            model.setPhysicalName(2, tag, name)
        gmsh.option.setNumber("Mesh.ScalingFactor", shape.unit)
        gmsh.write(str(path))
        gmsh.option.setNumber("Mesh.ScalingFactor", 1.0)
    return path


def reach(history):
    """Return the approach [mm] and tilt of the plane to the face that has sunk and turned.

    It is the plane through the closures of the patches at the last load step; a tenth of what the
    face gives way by is kept in reserve.
    """
    place = history.patches.centres - 0.5 * SIDE
    given = history.approach_mm[-1] - history.closure_mm[-1]
    sunk, *turned = np.linalg.lstsq(
        np.column_stack([np.ones(len(place)), place]), given, rcond=None
    )[0]
    tilt = -_GIVEN_WAY * np.array(turned)
    return float(history.approach_mm[-1] - _GIVEN_WAY * sunk), (float(tilt[0]), float(tilt[1]))


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The foot meshed with its roughness, ever finer, pressed alike.

    Args:
        surface: The rough surface.
        approaches: Approaches of the level plane, rising [mm].
        plane: Approach and tilt of the plane to the sunken face at the last one, see `reach`.
        edges: Edges of the finest cells along the radius of a typical contact.
        count: Number of meshes.
        comm: MPI communicator; None for this process alone.
    """

    surface: Surface
    approaches: tuple
    plane: tuple
    edges: float = 4.0
    count: int = 3
    comm: object = None

    @cached_property
    def shapes(self):
        """The bodies to mesh, the finest last."""
        approach, tilt = self.plane
        radius = contact_radius(self.surface, approach, tilt=tilt)
        blocks = reference_shapes(
            self.surface, approach, LEG, count=self.count, fine=radius / self.edges, tilt=tilt
        )
        return [SteppedShape(block=block, boxes=BOXES) for block in blocks]

    def solved(self, shape):
        """Return the contact problem of one mesh and its states."""
        comm, top = self.comm or MPI.COMM_SELF, self.surface.highest - self.surface.mean_height
        mesh, _ = rough_stepped_mesh(shape, HELD, self.surface, comm)
        supports = [Support(tag=mesh.facet_names["held"])]
        body = MeshedBody(mesh, Material(**ELASTIC), supports, order=shape.degree)
        face = RoughFace(body, mesh.facet_names["rough"], LENGTHS)
        problem = UnilateralContactProblem(face, top)
        states = [problem.solve(Control(approach=approach)) for approach in self.approaches]
        nodes = nodal_contact(problem, states[-1])
        touching = np.stack([nodes.x, nodes.y], axis=1)[nodes.region >= 0]
        # contact elsewhere would not be resolved
        assert cKDTree(shape.block.places).query(touching)[0].max() < 2.0 * shape.fine
        return problem, states

    def extrapolated(self, forces):
        """Return forces (meshes, steps) at mesh size zero, with error bars."""
        return extrapolated(forces, [shape.fine for shape in self.shapes], 4.0)
