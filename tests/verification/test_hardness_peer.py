"""The half-space model with a hardness against ContactMechanics on the same cells."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hardness_peer_table import CASES, E_STAR, SEEDS, surface
from patchlaw.geometry import Control
from patchlaw.micro import HalfSpaceModel

TABLE = np.loadtxt(Path(__file__).parent / "data" / "hardness_peer.csv", delimiter=",")


@pytest.mark.parametrize("seed", SEEDS)
def test_recorded_forces(seed):
    rough = surface(seed)
    rows = TABLE[TABLE[:, 0] == seed]
    assert [tuple(row) for row in rows[:, 1:3]] == CASES
    for _, approach, hardness, force, yielding in rows:
        model = HalfSpaceModel(rough, contact_modulus=E_STAR, hardness=hardness, tolerance=1e-10)
        state = model.press(Control(approach=approach))
        assert state.force == pytest.approx(force, rel=1e-6)
        assert np.count_nonzero(state.yielding) == yielding
