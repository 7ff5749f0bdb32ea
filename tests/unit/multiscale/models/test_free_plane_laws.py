"""Planes that turn as those of the rows of laws did."""

from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw import InputError, NotConverged
from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import influence_matrix, micro_model
from patchlaw.multiscale import LawTable, PatchLaw, consistent_laws
from patchlaw.multiscale.laws.rows import LawRows, PlanePath
from patchlaw.multiscale.laws.worn_laws import worn_share
from patchlaw.multiscale.models.patch_contact import PathContact

MODULUS = 4000.0
APPROACH = np.linspace(1.0, 3.0, 9)


def path(**other):
    given = {
        "approach": APPROACH,
        "tilt": np.column_stack([0.2 * (APPROACH - 1.0), 0.1 * APPROACH]),
        "force": (APPROACH - 1.0) ** 1.5,
        "moment": np.zeros((9, 2)),
    }
    return PlanePath(**{**given, **other})


def test_slopes_are_those_of_the_rows_and_stay_beyond_them():
    assert path().at(2.25)[:2] == pytest.approx((0.25, 0.225), rel=1e-12)
    assert path().at(0.0)[:2] == pytest.approx((0.0, 0.1))
    assert path().at(9.0)[:2] == pytest.approx((0.4, 0.3))


def test_force_is_found_and_beyond_the_path_an_approach_beyond():
    turns = path()

    def force(approach):
        return max(approach - 1.0, 0.0) ** 1.5

    found, asked = turns.approach_under(1.7, force)
    assert force(found) == pytest.approx(1.7, rel=1e-12)
    assert asked < 20
    assert turns.approach_under(0.0, force) == (1.0, 0)
    assert turns.approach_under(4.0, force)[0] > 3.0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"approach": APPROACH[::-1]}, "a path needs a strictly increasing approach"),
        ({"force": APPROACH[1:]}, "a path needs a finite force"),
        ({"tilt": np.full((9, 2), np.nan)}, "a path needs a finite tilt"),
        ({"approach": np.empty(0)}, "a path needs a finite approach"),
    ],
)
def test_refuses(wrong, message):
    with pytest.raises(InputError, match=message):
        path(**wrong)


@pytest.mark.parametrize(
    "grid",
    [(1, 1), (2, 1), *(pytest.param(grid, marks=pytest.mark.long) for grid in ((2, 2), (8, 8)))],
)
def test_any_partition_turns_as_the_contacts_do(grid):
    """Also a single patch, whose pressure does not tell how the plane turns."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    model = micro_model("circular", surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=grid, lengths=surface.lengths)
    means = patch_means(surface, patches)
    table = consistent_laws(
        model, patches, mean_heights=means, largest=Control(force=2.0, tilt=None)
    )
    compliance = influence_matrix(patches) / (np.pi * MODULUS)
    coupling = PathContact(table, lambda pressures: pressures @ compliance.T)
    for force in (0.3, 1.1, 2.0):
        control = Control(force=force, tilt=None)
        plane = model.press(control, patches=patches, mean_heights=means).plane
        step = coupling.press(control)
        assert step.force_N == pytest.approx(force, rel=1e-8)
        assert step.approach_mm == pytest.approx(plane.approach, rel=1e-3)
        np.testing.assert_allclose(step.tilt, plane.tilt, atol=3e-3 * np.abs(plane.tilt).max())
        assert np.abs(step.moment_N_mm).max() < 1e-6 * force
    with pytest.raises(NotConverged, match="LAW_RANGE"):
        coupling.press(Control(force=3.0, tilt=None))
    other = PathContact(table, lambda pressures: 6.0 * pressures @ compliance.T)
    with pytest.raises(NotConverged, match=r"the patches at .*make the laws for this block"):
        other.press(Control(force=2.0, tilt=None))


def test_laws_of_a_given_tilt_have_no_path():
    patches = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    law = PatchLaw(rows=LawRows.none(), first_touch=1.0, initial_separation=1.0)
    with pytest.raises(ValueError, match="whole surface"):
        PathContact(LawTable(patches=patches, laws=(law,), made_by={}), lambda _: _)


def test_what_wears_at_a_held_approach_is_cubic_in_the_distance():
    """The load of a linear spring falls exponentially; a straight line is 0.09 off half-way."""

    def share(part, first, last, rate):
        ends = [SimpleNamespace(worn=np.array([x]), at=x) for x in (first, last)]
        return worn_share(part, 0.7, ends, lambda one: rate(one.at))

    first, last = 0.4, 1.1
    worn = [1.0 - np.exp(-first), 1.0 - np.exp(-last)]
    for part in (0.0, 0.2, 0.5, 0.9, 1.0):
        ends = [SimpleNamespace(worn=np.array([one])) for one in worn]
        found = worn_share(part, last - first, ends, lambda one: 1.0 - one.worn[0])
        true = (1.0 - np.exp(-first - part * (last - first)) - worn[0]) / (worn[1] - worn[0])
        assert found == pytest.approx(true, abs=1.2e-3)  # h⁴ f⁗ / 384
    assert share(0.37, 0.4, 1.1, lambda _: 1.0) == pytest.approx(0.37, rel=1e-12)
    assert share(0.37, 0.0, 0.0, lambda _: 1.0) == 0.37  # nothing wears
    steep = [share(part, 0.4, 1.1, lambda at: 50.0 * (at < 1.0)) for part in (0.0, 0.3, 0.6, 1.0)]
    assert (np.diff(steep) >= 0.0).all() and steep[-1] == pytest.approx(1.0)
