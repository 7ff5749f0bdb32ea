"""The meshed rough block against an independent finite element code on the same mesh.

GetFEM (Debian's python3-getfem) assembles its own stiffness, finds its own faces, and solves for
multipliers at the nodes of the top by a semismooth Newton with a direct solver. It does so in a
process of its own, as its library brings another Qhull than matplotlib's.
"""

from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from multiprocessing import get_context

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import (
    BlockShape,
    Control,
    RefinedShape,
    Spectrum,
    places_in_reach,
    synthesise,
)
from patchlaw.macro import Block, Material, UnilateralContactProblem, compat, rough_block_mesh

MISSING = "" if find_spec("getfem") else "python3-getfem is not installed"

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
APPROACH, HEIGHT = 8e-3, 1.0
SURFACE = synthesise(
    Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1),
    grid=(128, 128),
    lengths=(1.0, 1.0),
)
SHAPES = {
    "hexahedra": BlockShape(interface=(1.0, 1.0), height=HEIGHT, cells=(20, 20, 8), grading=8.0),
    "tetrahedra": RefinedShape(
        interface=(1.0, 1.0),
        height=HEIGHT,
        places=places_in_reach(SURFACE, APPROACH, spacing=0.02),
        fine=0.02,
        coarse=0.2,
    ),
}
KINDS = {  # geometric transformation, quadrature as exact as ours
    "hexahedra": ("GT_QK(3,1)", "IM_GAUSS_PARALLELEPIPED(3,3)"),
    "tetrahedra": ("GT_PK(3,1)", "IM_TETRAHEDRON(2)"),
}


def independent(mesh, kind, plane):
    """Return the contact forces that GetFEM finds at nodes of the top, (n,) [N]."""
    corners = mesh.geometry.x[compat.cell_vertices(mesh)]
    with ProcessPoolExecutor(1, get_context("spawn")) as other:
        return other.submit(of_getfem, mesh.geometry.x, corners, kind, plane).result()


def of_getfem(nodes, corners, kind, plane):
    import getfem

    transformation, quadrature = KINDS[kind]
    theirs = getfem.Mesh("empty", 3)
    theirs.add_point(nodes.T)
    theirs.add_convex(getfem.GeoTrans(transformation), corners.transpose(2, 1, 0))
    faces, points = theirs.outer_faces(), theirs.pts()
    around = [points[:, theirs.pid_in_faces(faces[:, [i]])] for i in range(faces.shape[1])]
    bottom = [np.all(place[2] < -HEIGHT * (1 - 1e-9)) for place in around]
    upright = [np.min(np.ptp(place[:2], axis=1)) < 1e-9 for place in around]
    top = ~np.array(bottom) & ~np.array(upright)
    theirs.set_region(1, faces[:, bottom])
    theirs.set_region(2, faces[:, top])

    field = getfem.MeshFem(theirs, 3)
    field.set_classical_fem(1)
    rule = getfem.MeshIm(theirs, getfem.Integ(quadrature))
    model = getfem.Model("real")
    model.add_fem_variable("u", field)
    for name, value in zip(("first", "shear"), MATERIAL.lame, strict=True):
        model.add_initialized_data(name, value)
    model.add_isotropic_linearized_elasticity_brick(rule, "u", "first", "shear")
    model.add_Dirichlet_condition_with_simplification("u", 1)
    model.add_variable("forces", len(field.basic_dof_on_region(2)) // 3)
    model.add_initialized_data("augmentation", MATERIAL.young_modulus * 0.01)
    model.add_nodal_contact_with_rigid_obstacle_brick(
        rule, "u", "forces", "augmentation", 2, f"{plane}-z", 2
    )
    model.solve("max_res", 1e-10, "max_iter", 200)
    return -model.variable("forces")


@pytest.mark.skipif(bool(MISSING), reason=MISSING)
@pytest.mark.parametrize("kind", ["hexahedra", pytest.param("tetrahedra", marks=pytest.mark.long)])
def test_getfem_finds_the_same_contact(kind):
    mesh, _ = rough_block_mesh(SHAPES[kind], SURFACE, MPI.COMM_SELF)
    top = SURFACE.highest - SURFACE.mean_height
    ours = UnilateralContactProblem(Block(mesh, MATERIAL), top).solve(Control(approach=APPROACH))
    forces = independent(mesh.mesh, kind, f"{top - APPROACH:.17g}")
    # the same discrete problem; 1e-9 is the tolerance of our linear solver. Measured 3e-11
    assert ours.force == pytest.approx(forces.sum(), rel=1e-9)
    assert ours.nodes == np.count_nonzero(forces > 1e-9)
    assert np.sort(ours.nodal.force)[::-1][: ours.nodes] == pytest.approx(
        np.sort(forces)[::-1][: ours.nodes], rel=1e-6
    )
