"""Press rough blocks on all ranks and print what was found as JSON; for test_rough_ranks.py."""

import numpy as np
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw import InputError
from patchlaw.geometry import (
    BlockShape,
    Control,
    PatchGrid,
    RefinedShape,
    Spectrum,
    Surface,
    places_in_reach,
    synthesise,
)
from patchlaw.macro import Block, Material, UnilateralContactProblem, rough_block_mesh

COMM = MPI.COMM_WORLD
TILT = (4e-3, -2e-3)
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.1, seed=3), grid=(64, 48), lengths=(1.0, 0.8)
)


FLAT = Surface(heights=np.zeros((8, 8)), lengths=SURFACE.lengths)


def refined(element, **changes):
    """Return tetrahedra that are small where the surface is high."""
    places = places_in_reach(SURFACE, 12e-3, spacing=0.05)
    sizes = {"fine": 0.06, "coarse": 0.3, "growth": 0.5} | changes
    return RefinedShape(
        interface=SURFACE.lengths, height=0.6, places=places, element=element, **sizes
    )


def hexahedra(cells):
    """Return a regular block below the surface."""
    return BlockShape(interface=SURFACE.lengths, height=0.6, cells=cells)


APPROACHES = [Control(approach=at, tilt=TILT) for at in (6e-3, 10e-3, 8e-3)]
FORCES = [Control(force=force, tilt=None) for force in (0.5, 2.0)]
CASES = {
    "hexahedra": (hexahedra((12, 10, 4)), SURFACE, "roller", "active-set", APPROACHES),
    # one rank alone has any of the top
    "one facet": (hexahedra((1, 1, 6)), FLAT, "free", "active-set", APPROACHES),
    "linear": (refined("P1"), SURFACE, "free", "active-set", APPROACHES),
    "quadratic": (refined("P2", fine=0.12), SURFACE, "free", "active-set", APPROACHES),
    "free plane": (hexahedra((12, 10, 4)), SURFACE, "free", "active-set", FORCES),
    "points": (hexahedra((8, 6, 3)), SURFACE, "free", "augmented-lagrangian", FORCES[:1]),
}


def run(shape, surface, sides, method, controls):
    """Press a rough block and return what must not depend on the number of ranks."""
    mesh, quality = rough_block_mesh(shape, surface, COMM)
    highest = surface.highest - surface.mean_height
    cells = getattr(shape, "cells", (12, 12, 4))
    patches = PatchGrid(grid=(min(3, cells[0]), 1), lengths=surface.lengths)
    block = UnilateralContactProblem(
        Block(mesh, MATERIAL, sides), highest, method=method, patches=patches
    )
    states = [block.solve(control) for control in controls]
    numbers = {
        "force": [state.force for state in states],
        "approach": [state.approach for state in states],
        "area": [state.nodal_area for state in states],
        "fine area": [state.contact_area for state in states],
        "nodes": [state.nodes for state in states],
        "contacts": [state.contacts for state in states],
        "separation": [state.mean_separation for state in states],
        "patches": np.concatenate(
            [[*state.patch_force, *state.patch_area, *state.patch_closure] for state in states]
        ).tolist(),
        "quality": [quality.thinnest, quality.steepest],
    }
    reaction = [state.reaction for state in states]
    everyone = COMM.allgather((numbers, reaction))
    assert all(other == everyone[0] for other in everyone), "ranks disagree"
    return {
        "numbers": numbers,
        "reaction": reaction,
        "iterations": sum(state.linear_iterations for state in states),
        "top_nodes_of_ranks": COMM.allgather(len(block.top.dofs)),
    }


def fail_too_steep():
    """Return the error that every rank meets when some rank finds the top too steep."""
    try:
        rough_block_mesh(hexahedra((12, 10, 6)), SURFACE.scaled(11.0), COMM)
        found = "none"
    except InputError as error:
        found = str(error)
    return COMM.allgather(found)


if __name__ == "__main__":
    result = {name: run(*case) for name, case in CASES.items()}
    result["too steep"] = fail_too_steep()
    tell(result)
