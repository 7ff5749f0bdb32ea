"""A foot that is no cuboid against its own roughness, meshed."""

import numpy as np
import pytest
from helpers.l_shape import LENGTHS, SPECTRUM, Reference, reach, scene, write_foot

from geometry import Spectrum, synthesise
from multiscale import run

SEED, APPROACH, CELLS = 193, 10e-3, 128
ALLOWED = 5e-3
"""Difference to the reference beyond its error bar, relative to the force."""


@pytest.mark.long
def test_concurrent_and_calibrated_laws_are_within_the_bar_of_the_meshed_foot(tmp_path):
    foot = write_foot(tmp_path / "foot.msh", 0.25)

    def go(kind, mesh=foot):
        return run(scene(SEED, APPROACH, 1, foot=mesh, cells=CELLS, coupling={"kind": kind}))

    concurrent, consistent, cuboid = go("concurrent"), go("consistent"), go("concurrent", None)
    spectrum = Spectrum(**SPECTRUM, seed=SEED)
    reference = Reference(
        surface=synthesise(spectrum, grid=(CELLS, CELLS), lengths=LENGTHS),
        approaches=(APPROACH,),
        plane=reach(concurrent),
        edges=2.0,
        count=2,
    )
    solved = [reference.solved(shape) for shape in reference.shapes]
    found = reference.extrapolated([[state.force for state in states] for _, states in solved])
    value, bar = float(found.value[0]), float(found.error[0])
    assert bar < 0.02 * value
    for history in (concurrent, consistent):
        assert abs(history.force_N[-1] - value) < bar + ALLOWED * value
    np.testing.assert_allclose(consistent.force_N, concurrent.force_N, rtol=1e-3)
    # the arm matters: the face sinks, and turns by what a plane would tilt
    assert cuboid.force_N[-1] > 1.1 * value
    assert abs(reach(concurrent)[1][0]) > 5e-4
    problem, (state,) = solved[-1]
    assert state.reaction == pytest.approx(state.force, rel=1e-8)
    assert problem.top.area.sum() == pytest.approx(1.0, rel=1e-9)
