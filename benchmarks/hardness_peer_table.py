"""Forces by ContactMechanics under a hardness, on the surfaces that `test_hardness_peer.py` solves.

Run from the project's root by an interpreter that has ContactMechanics 1.7.0 (MIT), numpy, scipy:

    python benchmarks/hardness_peer_table.py > tests/verification/data/hardness_peer.csv
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from patchlaw.geometry import Spectrum, synthesise

E_STAR, SEEDS = 4000.0, (21, 22, 23)
CASES = [(4e-3, 300.0), (8e-3, 300.0), (8e-3, 100.0)]
"""Approaches [mm] and hardnesses [MPa]."""


def surface(seed):
    """Draw a surface on cells that are not square."""
    spectrum = Spectrum(hurst=0.8, waves=(2, 12), rms_slope=0.2, seed=seed)
    return synthesise(spectrum, grid=(48, 60), lengths=(1.0, 1.0))


def force(rough, approach, hardness):
    """Press the surface; return the force [N] and the number of cells that yield."""
    from ContactMechanics import FreeFFTElasticHalfSpace
    from ContactMechanics.PlasticSystemSpecialisations import PlasticNonSmoothContactSystem
    from SurfaceTopography import PlasticTopography, Topography

    body = PlasticTopography(
        Topography(rough.heights, physical_sizes=rough.lengths, periodic=False), hardness
    )
    substrate = FreeFFTElasticHalfSpace(rough.grid, E_STAR, rough.lengths)
    found = PlasticNonSmoothContactSystem(substrate, body).minimize_proxy(
        offset=approach - rough.highest, pentol=1e-9 * approach, maxiter=2000
    )
    if not found.success:
        raise RuntimeError(found.message)
    forces = np.abs(np.asarray(found.jac))
    area = float(np.prod(rough.spacing))
    return float(forces.sum()), int(np.sum(forces >= hardness * area * (1 - 1e-9)))


def main():
    print(
        "# ContactMechanics 1.7.0: seed, approach [mm], hardness [MPa], force [N], yielding cells"
    )
    for seed in SEEDS:
        rough = surface(seed)
        for approach, hardness in CASES:
            found, yielding = force(rough, approach, hardness)
            print(f"{seed},{approach:.3f},{hardness:g},{found:.9e},{yielding}")


if __name__ == "__main__":
    main()
