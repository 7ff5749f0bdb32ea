"""Forces by ContactMechanics on the surface that `test_half_space_peer.py` solves.

Run from the project's root by an interpreter that has ContactMechanics 1.7.0 (MIT), numpy, scipy:

    python benchmarks/half_space_peer_table.py > tests/verification/data/half_space_peer.csv
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from patchlaw.geometry import Spectrum, synthesise

E_STAR = 4000.0
APPROACHES = np.array([1, 2, 3, 4, 6, 8, 10, 12, 14, 17, 20, 23]) * 1e-3  # mm


def surface():
    """Draw a surface of Set 1 on cells that are not square and not a power of two."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=5)
    return synthesise(spectrum, grid=(60, 72), lengths=(1.0, 1.0))


def force(rough, approach, *, periodic):
    """Press the surface by an approach that counts from its highest point; return the force [N]."""
    from ContactMechanics import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace
    from ContactMechanics.Systems import NonSmoothContactSystem
    from SurfaceTopography import Topography

    if periodic:
        # displacements count from their mean
        substrate = PeriodicFFTElasticHalfSpace(rough.grid, E_STAR, rough.lengths, stiffness_q0=0.0)
    else:
        substrate = FreeFFTElasticHalfSpace(rough.grid, E_STAR, rough.lengths)
    body = Topography(rough.heights, physical_sizes=rough.lengths, periodic=periodic)
    found = NonSmoothContactSystem(substrate, body).minimize_proxy(
        offset=approach - rough.highest, pentol=1e-9 * approach, forcetol=1e-12, thermotol=1e-10
    )
    if not found.success:
        raise RuntimeError(found.message)
    return float(np.abs(np.asarray(found.jac)).sum())


def main():
    rough = surface()
    print("# ContactMechanics 1.7.0: approach [mm], force without periodicity [N], periodic [N]")
    for approach in APPROACHES:
        forces = (force(rough, approach, periodic=periodic) for periodic in (False, True))
        print(f"{approach:.3f}," + ",".join(f"{value:.9e}" for value in forces))


if __name__ == "__main__":
    main()
