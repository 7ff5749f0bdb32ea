"""Press a foot that is meshed with its roughness; rank 0 prints the results as JSON."""

import numpy as np
from helpers.on_ranks import tell
from mpi4py import MPI

from benchmarks.l_shape import LENGTHS, SPECTRUM, Reference
from patchlaw.geometry import Spectrum, synthesise

COMM = MPI.COMM_WORLD


def main():
    surface = synthesise(Spectrum(**SPECTRUM, seed=5), grid=(64, 64), lengths=LENGTHS)
    reference = Reference(
        surface=surface, approaches=(4e-3, 8e-3), plane=(6e-3, (3e-3, 0.0)), edges=0.8, count=1,
        comm=COMM,
    )  # fmt: skip
    problem, states = reference.solved(reference.shapes[0])
    found = {
        "force": [state.force for state in states],
        "moment": [state.moment.tolist() for state in states],
        "balance": [state.reaction / state.force - 1.0 for state in states],
        "nodes": [state.nodes for state in states],
        "area": [state.contact_area for state in states],
        "top_nodes_of_ranks": COMM.allgather(len(problem.top.dofs)),
        "largest": COMM.allreduce(float(np.abs(states[-1].displacement).max()), op=MPI.MAX),
    }
    tell(found)


if __name__ == "__main__":
    main()
