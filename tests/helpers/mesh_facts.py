"""What of a block's mesh must depend neither on who made it nor on the ranks."""

import numpy as np

from patchlaw.geometry import PatchGrid
from patchlaw.macro import BOTTOM, SIDES, TOP, Block, LoadedFace, Material, compat


def cells_of(block):
    """Return the cells of all ranks, each with its corners sorted, sorted; exact coordinates."""
    table = compat.cell_vertices(block.mesh)[: block.mesh.topology.index_map(3).size_local]
    return _everyones(block.comm, block.mesh.geometry.x[table])


def faces_of(block, marker):
    """Return the facets of a face in the same way, those that ghosts repeat once."""
    topology = block.mesh.topology
    topology.create_connectivity(2, 3)
    topology.create_connectivity(3, 2)
    _, shapes = compat.reference_facets(topology.cell_name())
    facets = block.facet_tags.find(marker)
    cells_at, facets_of = topology.connectivity(2, 3), topology.connectivity(3, 2)
    cell = cells_at.array[cells_at.offsets[facets]]
    side = np.argmax(facets_of.array.reshape(-1, len(shapes))[cell] == facets[:, None], axis=1)
    rows = np.take_along_axis(compat.cell_vertices(block.mesh)[cell], shapes[side], axis=1)
    return np.unique(_everyones(block.comm, block.mesh.geometry.x[rows]), axis=0)


def measures_of(block):
    """Return volume, areas of the faces, and the work of uneven patch pressures."""
    cells = cells_of(block)
    elastic = Block(block, Material(young_modulus=4000.0, poisson_ratio=0.3), "roller")
    patches = PatchGrid(grid=(2, 2), lengths=block.shape.interface)
    interface = LoadedFace.of_block(elastic, patches)
    load = interface.load(np.array([1.0, 2.0, 3.0, 4.0]))
    found = load.duplicate()
    elastic.solver.solve(load, found)
    return {
        "volume": float(sum(map(_volume, cells))),
        "areas": [
            float(sum(map(_area, faces_of(block, marker)))) for marker in (BOTTOM, TOP, SIDES)
        ],
        "patches": interface.areas.tolist(),
        "work": load.dot(found),
        "unknowns": elastic.dofs,
    }


def _everyones(comm, corners):
    corners = np.concatenate(comm.allgather(corners))
    order = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    flat = corners.reshape(len(corners), -1)
    return corners[np.lexsort(flat.T[::-1])]


def _volume(corners):
    if len(corners) == 8:
        return np.prod(np.ptp(corners, axis=0))
    return abs(np.linalg.det(corners[1:] - corners[0])) / 6.0


def _area(corners):
    # of a rectangle, two of whose four corners are opposite, or of a triangle
    u, v = corners[1] - corners[0], corners[2] - corners[0]
    return np.linalg.norm(np.cross(u, v)) * (1.0 if len(corners) == 4 else 0.5)
