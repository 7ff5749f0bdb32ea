"""Load steps of the embedded coupling: what is read off the laws, and their ranges."""

from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw.geometry import Control, PatchGrid
from patchlaw.multiscale import FaceContact, LawTable, PatchLaw
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.multiscale.models.problem import BeyondLaws

PATCHES = PatchGrid(grid=(2, 1), lengths=(1.0, 0.5))


def law(end=1.0, **columns):
    closure = np.linspace(0.0, end, 11)
    rows = {
        "closure": closure, "pressure": closure**1.5, "approach": closure,
        "contact_area_fraction": 0.1 * closure, "contacts": np.arange(11),
        "unresolved_displacement": 0.01 * closure,
    }  # fmt: skip
    return PatchLaw(rows=LawRows(**(rows | columns)), first_touch=0.0, initial_separation=2.0)


class EasyBlock:
    """Stands for a block that gives way to nothing: closures are the approach."""

    sliders = past = None  # no friction

    def __init__(self, laws):
        self.forces = SimpleNamespace(laws=laws, worn=np.zeros(2))

    def solve(self, control):
        self.approach = approach = control.approach
        return SimpleNamespace(
            approach=approach, tilt=control.tilt, moment=np.array([-0.0625, 0.0]) * approach**1.5,
            patch_closure=np.full(2, approach), patch_pressure=np.array([1.5, 0.5]) * approach**1.5,
            force=0.5 * approach**1.5, reaction=0.5 * approach**1.5 * (1 - 1e-11),
            displacement=np.array([approach]), iterations=3, linear_iterations=10,
            residuals=np.array([1.0, 1e-11]), reason="CONVERGED_FNORM_RELATIVE", shear=None,
        )  # fmt: skip

    def patch_means(self, function):
        return function(np.arange(2), np.full(2, self.approach))


def embedded(*laws):
    table = LawTable(patches=PATCHES, laws=laws or (law(), law()), made_by={})
    return FaceContact(EasyBlock(table.together()), table, face=None)


def test_steps_read_the_laws_at_their_closures():
    step = embedded().press(Control(approach=0.45, tilt=(1e-3, 0.0)))
    assert step.contacts == 8
    assert step.contact_area_fraction == pytest.approx(0.045, rel=1e-12)  # a straight line
    assert step.mean_separation_mm == pytest.approx(
        1.5545, rel=1e-12
    )  # initial separation − closure + unresolved displacement
    assert step.mean_pressure_MPa == pytest.approx(0.45**1.5, rel=1e-12)  # force over area
    assert step.imbalance == pytest.approx(1e-11, rel=1e-4)  # of a difference of near equals
    assert step.tilt == (1e-3, 0.0)
    # patches of a quarter of a square millimetre, a quarter of a millimetre beside the middle
    assert step.moment_N_mm[0] == pytest.approx(-0.0625 * 0.45**1.5, rel=1e-12)
    assert step.moment_N_mm[1] == 0.0


def test_closure_beyond_a_law_is_refused_and_the_state_stays():
    coupling = embedded(law(), law(end=0.5))
    with pytest.raises(ValueError, match="no load step"):
        _ = coupling.solved
    coupling.press(Control(approach=0.4))
    with pytest.raises(BeyondLaws, match=r"LAW_RANGE: .*closure up to 0.5 mm"):
        coupling.press(Control(approach=0.8))
    np.testing.assert_array_equal(coupling.solved[1].displacement, [0.4])


@pytest.mark.parametrize(
    ("falls", "remedy"), [(False, "further than the half"), (True, "of a law falls")]
)
def test_remedy_beyond_a_consistent_law_fits_what_is_wrong(falls, remedy):
    closure = law(end=0.5).rows.closure
    falling = {"closure": np.append(closure[:-1], closure[-3])} if falls else {}
    bent = law(0.5, **falling)
    table = LawTable(patches=PATCHES, laws=(law(), bent), made_by={"coupling": "consistent"})
    with pytest.raises(BeyondLaws, match=f"LAW_RANGE: .*{remedy}.* take coupling.kind = .conc"):
        FaceContact(EasyBlock(table.together()), table, face=None).press(Control(approach=0.8))


def test_remedy_beyond_the_law_of_a_sample_names_its_range():
    made_by = {"coupling": "representative"}
    table = LawTable(patches=PATCHES, laws=(law(), law(0.5)), made_by=made_by)
    with pytest.raises(BeyondLaws, match=r"LAW_RANGE: .* 95 % of the hardness"):
        FaceContact(EasyBlock(table.together()), table, face=None).press(Control(approach=8.0))
