#!/usr/bin/env bash
# PETSc 3.18.5 of Debian 12: rows and columns of a symmetric matrix (MATSBAIJ) taken out in another order, MatCreateSubMatrix.
#
# Guess: the numbers of these rows and columns, as from aij and baij, or an error.
# Seen: in rising order, so they are. Where the same nodes are taken in another order, as after renumbering, blocks on the diagonal become
# twice as large, without a message: of two nodes that change places that of the second, of four in the order 3 1 0 2 all but that of the
# first. Couplings are right. Sort the set, or convert to aij or baij before.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
OMP_NUM_THREADS=1 /usr/bin/python3 - <<'END'
import numpy as np
from petsc4py import PETSc

print("PETSc", PETSc.Sys.getVersion())
NODES = 4


def taken(kind, full, size, order):
    """Return rows and columns of the nodes in order, from products with unit vectors."""
    matrix = PETSc.Mat().create(PETSc.COMM_SELF)
    matrix.setType(kind)
    matrix.setSizes(full.shape, size)
    matrix.setUp()
    for i in range(NODES):
        for j in range(i if kind == "sbaij" else 0, NODES):
            matrix.setValuesBlocked([i], [j], full[size * i : size * (i + 1), size * j : size * (j + 1)])
    matrix.assemble()
    places = PETSc.IS().createBlock(size, np.array(order, "i4"), comm=PETSc.COMM_SELF)
    part = matrix.createSubMatrix(places, places)
    columns = []
    for j in range(size * len(order)):
        x, y = part.createVecs()
        x.array[:] = np.eye(size * len(order))[j]
        part.mult(x, y)
        columns.append(y.array.copy())
    return np.array(columns).T


for size in (1, 3):
    drawn = np.random.default_rng(size).random((NODES * size, NODES * size))
    full = drawn + drawn.T + 4 * NODES * size * np.eye(NODES * size)  # symmetric, positive definite
    for order in ([0, 2], [2, 0], [3, 1, 0, 2]):
        rows = np.concatenate([np.arange(size * node, size * (node + 1)) for node in order])
        true = full[np.ix_(rows, rows)]
        found = {kind: taken(kind, full, size, order) for kind in ("sbaij", "baij", "aij")}
        wrong = {kind: int((abs(part - true) > 1e-12).sum()) for kind, part in found.items()}
        print(f"blocks of {size}, nodes {order}: wrong numbers {wrong} of {true.size}")
        assert wrong["baij"] == wrong["aij"] == 0
        if order != sorted(order):
            for node in range(1, len(order)):
                block = np.s_[size * node : size * (node + 1)]
                true[block, block] *= 2
        np.testing.assert_allclose(found["sbaij"], true, rtol=1e-12)
END
