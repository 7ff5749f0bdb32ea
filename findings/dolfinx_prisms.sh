#!/usr/bin/env bash
# dolfinx 0.11: blocks of prisms (create_box with CellType.prism), in its .pvd and .xdmf files.
#
# Guess: all cells are the right way round, as those of hexahedra and tetrahedra are, and PyVista finds the block's volume.
# Seen: every second prism is inside out. dolfinx integrates over absolute volumes and finds 1, PyVista and meshio's copy of the .xdmf file
# have 0, as half of the volumes are negative. Take absolute values of them, or hexahedra.
set -euo pipefail
for PYTHON in python3 python3.12 python3.13 python3.14 ""; do # dolfinx 0.11 needs Python 3.12
    [ "$PYTHON" ] || { echo "no Python 3.12 or newer"; exit 2; }
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && break
done
source "$(dirname "$0")/packages.sh" dolfinx-solver-real==0.11.0.post0 h5py==3.16.0 meshio==5.3.5 pyvista==0.49.1 vtk==9.7.2
python - <<'EOF' 2>errors.log || { cat errors.log; exit 1; }
from mpi4py import MPI  # isort: skip  # before dolfinx, which finds its library so

import meshio
import numpy as np
import pyvista
import ufl
from dolfinx import fem, io, mesh

for kind, volume, right in (("tetrahedron", 1.0, 1.0), ("hexahedron", 1.0, 1.0), ("prism", 0.0, 0.5)):
    block = mesh.create_box(MPI.COMM_WORLD, [[0, 0, 0], [1, 1, 1]], [2, 2, 2], mesh.CellType[kind])
    own = fem.assemble_scalar(fem.form(fem.Constant(block, 1.0) * ufl.dx(domain=block)))
    with io.VTKFile(MPI.COMM_WORLD, f"{kind}.pvd", "w") as file:
        file.write_mesh(block)
    with io.XDMFFile(MPI.COMM_WORLD, f"{kind}.xdmf", "w") as file:
        file.write_mesh(block)
    meshio.read(f"{kind}.xdmf").write(f"{kind}.vtu")
    one, other = pyvista.read(f"{kind}_p0_000000.vtu"), pyvista.read(f"{kind}.vtu")
    share = (other.compute_cell_sizes()["Volume"] > 0).mean()
    print(f"{kind}: volume {own:.3f}, in PyVista {one.volume:.3f}, by meshio {other.volume:.3f}, cells the right way round {share:.0%}")
    np.testing.assert_allclose([own, one.volume, other.volume, share], [1.0, volume, volume, right], atol=1e-9)
EOF
