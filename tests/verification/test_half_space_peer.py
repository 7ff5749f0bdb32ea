"""The half-space model against ContactMechanics on the same cells, along 12 approaches."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.half_space_peer_table import APPROACHES, E_STAR, surface
from patchlaw.geometry import Control
from patchlaw.micro import HalfSpaceModel

TABLE = Path(__file__).parent / "data" / "half_space_peer.csv"


@pytest.mark.parametrize("periodic", [False, True])
def test_recorded_forces(periodic):
    table = np.loadtxt(TABLE, delimiter=",")
    rough = surface()
    model = HalfSpaceModel(surface=rough, contact_modulus=E_STAR, periodic=periodic)
    assert table[:, 0] == pytest.approx(APPROACHES)
    forces = [model.press(Control(approach=approach)).force for approach in APPROACHES]
    # same kernel, same conditions: what differs is the peer's remaining penetration, 1e-9 δ
    assert forces == pytest.approx(table[:, 1 + periodic], rel=1e-6)
