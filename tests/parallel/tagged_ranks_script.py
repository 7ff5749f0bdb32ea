"""Read meshes on all ranks, check them, and print facts as JSON; for test_tagged_ranks.py."""

import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from dolfinx import io
from dolfinx import mesh as dmesh
from helpers.mesh_files import tagged_box, write_boxes, write_msh2
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.macro import TaggedMesh, compat, planar_face, read_mesh, write_mesh
from patchlaw.macro.mesh.facets import parts
from patchlaw.macro.mesh.from_file import check_cells
from patchlaw.macro.mesh.supports import free_motions
from patchlaw.support import InputError, on_root

COMM = MPI.COMM_WORLD
CUBE = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
FIVE = [(0, 1, 2, 4), (1, 3, 2, 7), (1, 5, 4, 7), (2, 6, 7, 4), (1, 2, 4, 7)]


def measures(tagged):
    """Return volumes by tag, the faces, and the motions that supports leave."""
    mesh = tagged.mesh
    owned = mesh.topology.index_map(3).size_local
    corners = mesh.geometry.x[compat.cell_vertices(mesh)]
    volume = np.abs(np.linalg.det(corners[:, 1:4] - corners[:, :1])) / 6.0
    tags = tagged.cell_tags.values
    assert len(tags) == len(volume)  # ghosts too
    faces = {}
    for name, tag in tagged.facet_names.items():
        face = planar_face(tagged, tag)
        frame = [*face.frame.origin, *face.frame.axes.ravel()]
        faces[name] = [*frame, *face.lengths, face.area, face.deviation]
    support = SimpleNamespace(
        tag=next(iter(tagged.facet_names.values())), displacement=(0, None, 0)
    )
    by_tag = {
        name: COMM.allreduce(float(volume[:owned][tags[:owned] == tag].sum()))
        for name, tag in tagged.cell_names.items()
    }
    return {
        "volumes": by_tag,
        "faces": faces,
        "motions": free_motions(tagged, [support]),
        "parts": parts(mesh),
        "first_face_of_ranks": COMM.allgather(len(tagged.facet_tags.find(support.tag))),
    }


def errors(folder):
    """Return the messages of all ranks about each bad mesh."""
    points = np.vstack([CUBE, CUBE + np.array([3.0, 0.0, 0.0])])
    folded = CUBE.copy()
    folded[0] = 0.9
    cells = [(4, 1, 1, cell) for cell in FIVE]
    apart = cells + [(4, 1, 1, np.add(cell, 8)) for cell in FIVE]
    beside = [(2, 7, 1, (4, 5, 7)), (2, 7, 1, (4, 5, 6))]

    def write():
        write_msh2(folder / "apart.msh", points, apart)
        write_msh2(folder / "folded.msh", folded, cells)
        write_msh2(folder / "beside.msh", CUBE, cells + beside)
        write_msh2(folder / "flat.msh", CUBE, beside)
        (folder / "text.msh").write_text("no mesh")
        (folder / "text.xdmf").write_text("no mesh")

    on_root(COMM, write)
    told = {}
    for name in ("apart.msh", "folded.msh", "beside.msh", "flat.msh", "text.msh", "text.xdmf"):
        try:
            read_mesh(folder / name, COMM)
            message = "none"
        except InputError as error:
            message = str(error).replace(str(folder), "")
        told[name] = sorted(set(COMM.allgather(message)))
    return told


def pushed():
    """Return how many cells are found folded among tetrahedra of either hand."""
    alone = tagged_box(MPI.COMM_SELF, cells=(6, 2, 2)).mesh
    cells = compat.cell_vertices(alone).astype(np.int64)
    cells[::3] = cells[::3, ::-1]
    points = alone.geometry.x + 0.02 * np.sin(np.outer(np.arange(63), [1.0, 2.0, 3.0]))
    share = slice(None) if COMM.rank == 0 else slice(0)
    mesh = compat.mesh_from_cells(cells[share], points[share], None, COMM)
    none = np.empty(0, np.int32)
    crooked = TaggedMesh(mesh=mesh, facet_tags=dmesh.meshtags(mesh, 2, none, none))
    check_cells(crooked)
    inner = np.argmin(np.abs(points - 0.5).sum(axis=1))
    mesh.geometry.x[np.asarray(mesh.geometry.input_global_indices) == inner] += [0.4, 0.0, 0.0]
    try:
        check_cells(crooked)
    except InputError as error:
        return str(error).split(" of ")[0]
    return "0"


def xdmf(folder):
    """Return the measures of a box that dolfinx wrote."""
    box = tagged_box(COMM, lengths=(1.0, 2.0, 3.0))
    owned = box.mesh.topology.index_map(3).size_local
    middle = box.mesh.geometry.x[compat.cell_vertices(box.mesh)].mean(axis=1)[:owned]
    values = np.where(middle[:, 2] < 1.5, 3, 8).astype(np.int32)
    cells = dmesh.meshtags(box.mesh, 3, np.arange(owned, dtype=np.int32), values)
    box.facet_tags.name, cells.name = "sides", "halves"
    with io.XDMFFile(COMM, str(folder / "box.xdmf"), "w") as file:
        file.write_mesh(box.mesh)
        for tags in (box.facet_tags, cells):
            try:
                file.write_meshtags(tags, box.mesh.geometry)
            except TypeError:
                file.write_meshtags(tags)
    tagged = read_mesh(folder / "box.xdmf", COMM, unit=2.0)
    assert isinstance(tagged, TaggedMesh)
    middle = tagged.mesh.geometry.x[compat.cell_vertices(tagged.mesh)].mean(axis=1)
    assert (tagged.cell_tags.values == np.where(middle[:, 2] < 3.0, 3, 8)).all()  # ghosts too
    return measures(tagged)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as mine:
        folder = Path(COMM.bcast(mine))
        on_root(
            COMM, lambda: [write_boxes(folder / f"{v}.msh", v, v > 3) for v in (2.2, 4.1)] and 0
        )
        found = {str(v): measures(read_mesh(folder / f"{v}.msh", COMM)) for v in (2.2, 4.1)}
        write_mesh(read_mesh(folder / "4.1.msh", COMM), folder / "written.xdmf")
        found["written"] = measures(read_mesh(folder / "written.xdmf", COMM))
        found["xdmf"] = xdmf(folder)
        found["errors"] = errors(folder)
        found["pushed"] = pushed()
        COMM.barrier()
    tell(found)
