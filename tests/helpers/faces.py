"""Outer facets of a mesh by where they lie, and tags of them."""

import numpy as np
from dolfinx import mesh as dmesh


def at(mesh, axis, value, *, among=None):
    """The outer facets on a plane across an axis, or those of them that a function accepts."""
    side = mesh.topology.dim - 1
    mesh.topology.create_connectivity(side, side + 1)
    return dmesh.locate_entities_boundary(
        mesh, side, lambda x: np.isclose(x[axis], value) & (True if among is None else among(x))
    )


def tagged(mesh, faces):
    """Facet tags of faces, each given by its tag and its facets."""
    facets = np.concatenate(list(faces.values())).astype(np.int32)
    values = np.repeat(np.array(list(faces), np.int32), list(map(len, faces.values())))
    order = np.argsort(facets)
    return dmesh.meshtags(mesh, mesh.topology.dim - 1, facets[order], values[order])
