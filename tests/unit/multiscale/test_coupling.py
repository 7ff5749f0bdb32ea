"""Load steps of the embedded coupling: halving, keeping what was accepted, laws' ranges."""

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.errors import NotConverged
from geometry.patches import PatchGrid
from multiscale.coupling import EmbeddedCoupling, tilted_approaches
from multiscale.law_files import LawTable
from multiscale.laws import PatchLaw

PATCHES = PatchGrid(grid=(2, 1), lengths=(1.0, 0.5))


def law(end=1.0):
    closure = np.linspace(0.0, end, 11)
    return PatchLaw(
        closure=closure,
        pressure=closure**1.5,
        approach=closure,
        contact_area_fraction=0.1 * closure,
        contacts=np.arange(11),
        touch=0.0,
        reach=2.0,
    )


class ShyBlock:
    """Stands for a block that converges only when the approach grows by little at a time."""

    def __init__(self, largest_step):
        self.largest_step, self.last, self.tried = largest_step, 0.0, []

    def press(self, approach, tilt):
        self.tried.append(approach)
        if abs(approach - self.last) > self.largest_step:
            raise NotConverged(
                "the block", reason="DIVERGED_LINE_SEARCH", iterations=2, remedy="smaller steps"
            )
        self.last = approach
        return SimpleNamespace(
            approach=approach,
            closure=np.full(2, approach),
            pressure=np.full(2, approach**1.5),
            force=0.5 * approach**1.5,
            reaction=0.5 * approach**1.5,
            newton_iterations=3,
            linear_iterations=10,
            residuals=np.array([1.0, 1e-11]),
            reason="CONVERGED_FNORM_RELATIVE",
            wall_s=0.0,
        )


def embedded(block, *laws):
    table = LawTable(patches=PATCHES, laws=laws or (law(), law()), made_by={})
    return EmbeddedCoupling(pressed=block, table=table)


def test_steps_read_the_laws_at_their_closures():
    (step,) = embedded(ShyBlock(1.0)).load_steps([0.45])
    assert step.contacts == 8
    assert step.contact_area_fraction == pytest.approx(0.045, rel=1e-12)  # a straight line
    assert step.mean_separation_mm == pytest.approx(1.55, rel=1e-12)  # the same subtraction
    assert step.mean_pressure_MPa == pytest.approx(0.45**1.5, rel=1e-12)  # force over area


def test_failing_step_is_halved_and_its_work_is_counted():
    block = ShyBlock(0.3)
    (step,) = embedded(block).load_steps([1.0])
    assert block.tried == [1.0, 0.5, 0.25, 0.5, 1.0, 0.75, 1.0]
    assert step.approach_mm == 1.0
    assert step.newton_iterations == 3 * 2 + 4 * 3
    assert step.linear_iterations == 40


def test_hopeless_step_keeps_those_before_it():
    block, steps = ShyBlock(0.5), []
    with pytest.raises(
        NotConverged, match=r"load step 3 .approach .* DIVERGED_LINE_SEARCH after 2"
    ) as error:
        for step in embedded(block).load_steps([0.4, 0.8, 1.0]):
            steps.append(step.step)
            block.largest_step = 0.5 if step.step < 2 else 0.0
    assert steps == [1, 2]
    assert error.value.exit_code == 3
    assert "raise load.steps" in str(error.value)


def test_closure_beyond_a_law_ends_the_run():
    steps = embedded(ShyBlock(1.0), law(), law(end=0.5)).load_steps([0.4, 0.8])
    assert next(steps).step == 1
    with pytest.raises(NotConverged, match=r"load step 2 .*LAW_RANGE: .*closure up to 0.5 mm"):
        next(steps)


def test_tilt_turns_about_the_middle():
    approaches = tilted_approaches(PATCHES, 0.01, (0.004, 0.1))
    # patch centres lie a quarter of a millimetre beside the middle, along x only
    np.testing.assert_allclose(approaches, [0.009, 0.011], rtol=1e-12)
