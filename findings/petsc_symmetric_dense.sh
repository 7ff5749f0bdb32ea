#!/usr/bin/env bash
# PETSc 3.18.5 of Debian 12: a symmetric blocked matrix (MATSBAIJ) times a dense one, MatMatMult.
#
# Guess: every column of the product is that of MatMult with the vector.
# Seen: with blocks of 3, 4 and 5, those of nodes in space among them, the product is wrong, here by 2 to 5 % of its largest number,
# without a message: blocks below the diagonal count as those above, not transposed. With blocks of 1, 2 and 6, and with a single
# vector, it is right. In aij or baij it is right, too.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
OMP_NUM_THREADS=1 /usr/bin/python3 - <<'END'
import numpy as np
from petsc4py import PETSc

print("PETSc", PETSc.Sys.getVersion())
for size, right in ((1, True), (2, True), (3, False), (4, False), (5, False), (6, True)):
    drawn = np.random.default_rng(size).random((2 * size, 2 * size))
    full = drawn + drawn.T + 4 * size * np.eye(2 * size)  # symmetric, positive definite
    given = np.asfortranarray(drawn[:, :2])
    off = {}
    for kind in ("sbaij", "baij", "aij"):
        matrix = PETSc.Mat().create(PETSc.COMM_SELF)
        matrix.setType(kind)
        matrix.setSizes(full.shape, size)
        matrix.setUp()
        blocks = [(0, 0), (0, 1), (1, 0), (1, 1)]
        for i, j in blocks[: 2] + blocks[3 if kind == "sbaij" else 2 :]:
            block = full[size * i : size * (i + 1), size * j : size * (j + 1)]
            matrix.setValuesBlocked([i], [j], block)
        matrix.assemble()
        dense = PETSc.Mat().createDense(given.shape, array=given, comm=PETSc.COMM_SELF)
        dense.assemble()
        x, y = matrix.createVecs()
        x.array[:] = given[:, 1]
        matrix.mult(x, y)
        true = full @ given
        assert np.allclose(y.array, true[:, 1])
        off[kind] = abs(matrix.matMult(dense).getDenseArray() - true).max() / abs(true).max()
    print(f"blocks of {size}, off by:", ", ".join(f"{kind} {value:.1e}" for kind, value in off.items()))
    assert max(off["baij"], off["aij"]) < 1e-14
    assert (off["sbaij"] < 1e-14) == right
END
