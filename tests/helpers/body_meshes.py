"""Boxes with marked faces as bodies on meshes, for tests."""

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from helpers.faces import at, tagged
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import LoadedFace, MeshedBody, Support, TaggedMesh, contact_facets

CELLS = {"hexahedron": dmesh.CellType.hexahedron, "tetrahedron": dmesh.CellType.tetrahedron}
LOW, HIGH, SIDE = 1, 2, 3
"""Markers of the lowest and highest face across z, and of the lowest across x."""


def box(lower, upper, cells, cell="hexahedron", comm=MPI.COMM_SELF):
    """Return a box whose faces across z are marked, and the first across x."""
    mesh = dmesh.create_box(
        comm, [np.array(lower, float), np.array(upper, float)], cells, CELLS[cell]
    )
    faces = {LOW: at(mesh, 2, lower[2]), HIGH: at(mesh, 2, upper[2]), SIDE: at(mesh, 0, lower[0])}
    names = {"low": LOW, "high": HIGH}
    return TaggedMesh(mesh=mesh, facet_tags=tagged(mesh, faces), facet_names=names)


def standing(mesh, material, patches, order=1, **loads):
    """Return the upper face of a box that stands on its lower face."""
    body = MeshedBody(mesh, material, [Support(tag=LOW)], order=order, **loads)
    upper = mesh.mesh.geometry.x[:, 2].max(initial=-np.inf)
    upper = mesh.comm.allreduce(upper, op=MPI.MAX)
    frame = FaceFrame(origin=np.array([0.0, 0.0, upper]), axes=np.eye(3))
    return LoadedFace(body, contact_facets(mesh.mesh, mesh.facet_tags.find(HIGH), frame), patches)


def hanging(mesh, material, patches, order=1):
    """Return the lower face of a box that hangs at its upper face, above the plane z = 0."""
    body = MeshedBody(mesh, material, [Support(tag=HIGH)], order=order, normal=(0, 0, -1))
    frame = FaceFrame(origin=np.zeros(3), axes=np.eye(3))
    facets = contact_facets(mesh.mesh, mesh.facet_tags.find(LOW), frame, opposed=True)
    return LoadedFace(body, facets, patches)
