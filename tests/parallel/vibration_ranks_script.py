"""Natural modes of a block under laws on all ranks, printed as JSON; for the test beside."""

import tempfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from dolfinx import fem
from helpers.on_ranks import tell
from helpers.user_problems import PATCHES, TETRAHEDRA, TOP, PowerLaw, box, marked
from mpi4py import MPI
from scipy.io import mmread

from patchlaw.geometry import BlockShape, Control, RigidPlane
from patchlaw.macro import (
    BOTTOM,
    Block,
    Interface,
    LawContactProblem,
    LoadedFace,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    block_mesh,
    compat,
    write_contact_stiffness,
)
from patchlaw.macro.contact.face_vibration import FaceVibration
from patchlaw.macro.fields import surface_shapes, write_shapes
from patchlaw.multiscale import Run, Scene

COMM = MPI.COMM_WORLD
LAWS = [PowerLaw(k, touch) for k, touch in ((3e4, 0.0), (1e4, 2e-3), (5e4, 4e-3), (2e4, 1e-3))]
CASES = {
    "held": ("Q1", "pointwise", None, None, 10_000),
    "mass": ("P2", "pointwise", 3e-9, None, 0),
    "slides": ("Q1", "patchwise", 2e-9, (0.7, -0.2), 10_000),
    "multigrid slides": ("Q1", "pointwise", None, (0.7, -0.2), 0),
    "square": ("Q1", "pointwise", None, None, 10_000),
    "square slides": ("Q1", "pointwise", None, (0.4, 0.4), 0),
}
"""Elements, where laws act, mass of the plane, how it slides, unknowns that are factorised.

A square has one law and no tilt: its modes along the face are repeated.
"""


def modes(element, mode, plane, sliding, factorised, *, square):
    """Return frequencies, damping, participations, and the largest residual."""
    lengths = (1.0, 1.0)
    cells = (3 if square else 4, 3, 3)
    shape = BlockShape(interface=lengths, height=1.3, cells=cells, element=element)
    material = Material(young_modulus=4000.0, poisson_ratio=0.3, density=2e-9)
    mesh = block_mesh(shape, COMM)
    block = Block(mesh, material)
    face = LoadedFace.of_block(block, PATCHES)
    if element[0] == "P":  # a body without a lattice, whose multigrid knows the laws
        body = MeshedBody(
            TaggedMesh(mesh=mesh.mesh, facet_tags=mesh.facet_tags),
            material,
            [Support(tag=BOTTOM)],
            order=2,
        )
        face = replace(face, body=body)
    problem = LawContactProblem(face, LAWS[:1] * 4 if square else LAWS, mode)
    state = problem.solve(Control(approach=8e-3, tilt=(0.0, 0.0) if square else (2e-3, -1e-3)))
    along = None if sliding is None else np.array(sliding)
    tangents = problem.forces.vibration_tangents(state, along)
    vibration = FaceVibration(face, mode, plane, factorised)
    found, shares, parts = vibration.modes(tangents, 6)
    folder = Path(COMM.bcast(tempfile.mkdtemp()))
    write_shapes(folder / "modes.xdmf", face, found)
    ((body, rows),) = vibration.by_body(found.shapes.real)
    corners, moved = surface_shapes(body, rows)
    assert moved.shape == (len(shares), *corners.shape)
    whole = np.column_stack([found.frequencies, found.damping, shares, parts])
    facets = len(corners) if (folder / "modes.h5").is_file() else 0
    return whole.tolist(), float(found.residuals.max()), facets


def scene():
    """Return frequencies of a block of few cells under laws of patches that wear [Hz]."""
    spectrum = {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.08, "seed": 77}
    block = {"young_modulus": 4000.0, "poisson_ratio": 0.2, "density": "2500 kg/m^3"}
    data = {
        "surface": {"spectrum": spectrum, "grid": [18, 16], "lengths": [1.0, 0.93]},
        "block": block | {"height": 1.0, "cells": [2, 2, 2]},
        "coupling": {"kind": "consistent"},
        "patches": {"grid": [2, 2]},
        "wear": {"coefficient": "1e-8 mm^2/N"},
        "load": {"force": 9.0, "steps": 1, "sliding": [2e3], "tilt": [1.1e-3, -7e-4]},
        "vibration": {"modes": 3},
        "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
    }
    with closing(Run(Scene.from_dict(data), COMM)) as run:
        return [mode.frequency_Hz for step in run.load_steps() for mode in step.modes]


def springs():
    """Return a contact stiffness as a matrix by the numbers of nodes in the file of the mesh."""
    mesh = box(cell=TETRAHEDRA, comm=COMM)
    tags, space = marked(mesh), compat.vector_space(mesh, 1)
    rough = Interface(space, tags, TOP, laws=LAWS[0], indenter=RigidPlane(approach=8e-3))
    matrix = rough.stiffness_matrix(fem.Function(space))
    path = Path(COMM.bcast(tempfile.mkdtemp())) / "contact.mtx"
    write_contact_stiffness(path, matrix, space)
    if COMM.rank:
        return []
    rows = [line.split(",") for line in path.read_text().splitlines() if line.startswith("% ")]
    order = np.argsort([int(row[1]) for row in rows[2:]])
    dofs = (3 * order[:, None] + np.arange(3)).ravel()
    return [[int(row[1]) for row in rows[2:]], mmread(path).toarray()[dofs][:, dofs].tolist()]


if __name__ == "__main__":
    result = {name: modes(*one, square=name[:2] == "sq") for name, one in CASES.items()}
    result |= {"springs": springs(), "scene": scene()}
    tell(result)
