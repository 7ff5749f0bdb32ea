"""Run all cases on all ranks and print what rank 0 found as JSON; for test_block_ranks.py."""

import numpy as np
from helpers.block_cases import block_of, interface_of, uneven_laws
from helpers.contact_laws import PowerLaw
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.geometry import BlockShape, Control, Material, PatchGrid, RefinedShape
from patchlaw.geometry.face_frame import UPWARD
from patchlaw.macro import (
    BOTTOM,
    TOP,
    LawContactProblem,
    MeshedBody,
    Support,
    TaggedMesh,
    block_mesh,
    contact_facets,
)
from patchlaw.macro.compliance.mesh_face import FaceMoments, mesh_face_tractions
from patchlaw.micro import RectangleFields
from patchlaw.support import InputError, NotConverged

COMM = MPI.COMM_WORLD
SHAPES = {
    "whole": ({"cells": (6, 6, 4)}, (4, 4)),
    "tets": ({"cells": (3, 4, 2), "element": "P2", "sides": "roller"}, (2, 3)),
    # a single facet on the interface: only one rank owns any of it
    "one facet": (
        {"interface": (0.2, 0.2), "cells": (1, 1, 5), "margin": 0.4, "margin_cells": 3},
        (2, 2),
    ),
}


def run(case, mode):
    """Press a block and return what must not depend on the number of ranks."""
    shape, grid = SHAPES[case]
    interface = interface_of(block_of(comm=COMM, **shape), grid)
    pressed = LawContactProblem(interface, uneven_laws(np.prod(grid)), mode)
    states = [
        pressed.solve(Control(approach=approach, tilt=(1e-3, 5e-4))) for approach in (4e-3, 8e-3)
    ]
    # enough for more than two patches: a plane on an edge has no tilt of its own
    force = 20.0 * float(interface.areas.sum())
    states.append(pressed.solve(Control(force=force, tilt=None)))
    numbers = {
        "force": [state.force for state in states],
        "plane": [states[-1].approach, *states[-1].tilt],
        "closure": states[-1].patch_closure.tolist(),
        "pressure": states[-1].patch_pressure.tolist(),
    }
    reaction = [state.reaction for state in states]
    everyone = COMM.allgather((numbers, reaction))
    assert all(other == everyone[0] for other in everyone), "ranks disagree"
    points = COMM.allgather(np.bincount(interface.quadrature.patch, minlength=np.prod(grid)))
    return {
        "numbers": numbers,
        "reaction": reaction,
        "points_of_ranks": [int(count.sum()) for count in points],
        "patches_missing_on_ranks": [int((count == 0).sum()) for count in points],
    }


def tractions_on_mesh():
    """Return norms of the displacements of a cube on a mesh by modes of traction, (3, 3)."""
    mesh = block_mesh(BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2)), COMM)
    tagged = TaggedMesh(mesh=mesh.mesh, facet_tags=mesh.facet_tags, cell_tags=None)
    material = Material(young_modulus=4e3, poisson_ratio=0.2)
    body = MeshedBody(tagged, material, (Support(tag=BOTTOM),))
    facets = contact_facets(mesh.mesh, mesh.facet_tags.find(TOP), UPWARD)
    rectangle = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    # what fields are extended by beyond the face, no rank shares with another
    sides = {"lengths": (1.0, 1.0), "extended": (False,) * 4}
    fields = [RectangleFields(count=2, material=material, axis=k, **sides) for k in range(2)]
    found = mesh_face_tractions(FaceMoments(body, facets, rectangle, 2), fields)
    return np.linalg.norm(found, axis=(2, 3)).tolist()


class Unmeshable(RefinedShape):
    """A block that cannot be meshed."""

    def meshed(self):
        """Raise instead of meshing."""
        raise InputError("meshing gave up", value=3, allowed="better luck")


def fail_in_meshing():
    """Return the error that every rank meets when meshing fails on rank 0."""
    shape = Unmeshable(
        interface=(1.0, 1.0), height=1.0, places=np.array([[0.5, 0.5]]), fine=0.5, coarse=0.5
    )
    return error_of(lambda: block_mesh(shape, COMM))


class RefusingLaw(PowerLaw):
    """A law that one rank alone gets to evaluate."""

    def pressure(self, closure):
        if closure.size:
            raise InputError("closure beyond the table", value=0.25)
        return closure


def fail_in_law(mode):
    """Return the error that every rank meets when a law refuses on the rank that has it."""
    shape, grid = SHAPES["one facet"]
    interface = interface_of(block_of(comm=COMM, **shape), grid)
    laws = [*uneven_laws(3), RefusingLaw(1.0)]
    return error_of(lambda: LawContactProblem(interface, laws, mode).solve(Control(approach=1e-3)))


def fail_to_converge():
    """Return the error that every rank meets when Newton's method may take one step only."""
    interface = interface_of(block_of(comm=COMM), (2, 2))
    pressed = LawContactProblem(interface, uneven_laws(4))
    pressed.newton.snes.setTolerances(max_it=0)
    return error_of(lambda: pressed.solve(Control(approach=8e-3)))


def fail_to_hold(mode):
    """Return the error that every rank meets when a free plane has supports on one side only."""
    shape, grid = SHAPES["one facet"]
    interface = interface_of(block_of(comm=COMM, **shape), grid)
    laws = [*[PowerLaw(3e4, touch=np.inf)] * 2, *uneven_laws(2)]
    pressed = LawContactProblem(interface, laws, mode)
    return error_of(lambda: pressed.solve(Control(force=1.0, tilt=None)))


def error_of(action):
    """Return type and text of the error that an action raises on every rank."""
    try:
        action()
        found = "none"
    except (InputError, NotConverged) as error:
        found = f"{type(error).__name__}: {error}"
    return COMM.allgather(found)


if __name__ == "__main__":
    modes = ("patchwise", "pointwise")
    result = {f"{case}, {mode}": run(case, mode) for case in SHAPES for mode in modes}
    result |= {f"law, {mode}": fail_in_law(mode) for mode in modes}
    result |= {f"plane, {mode}": fail_to_hold(mode) for mode in modes}
    result |= {"newton": fail_to_converge(), "meshing": fail_in_meshing()}
    result |= {"tractions": tractions_on_mesh()}
    tell(result)
