"""Planes that turn as those of the rows did."""

import numpy as np
import pytest

from geometry import InputError, NotConverged, PatchGrid, Spectrum, patch_means, synthesise
from geometry.control import Control
from micro import influence_matrix, micro_model
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.law_tables.consistent import consistent_laws
from multiscale.law_tables.plane_path import PlanePath

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
    assert path().tilt_at(2.25) == pytest.approx((0.25, 0.225), rel=1e-12)
    assert path().tilt_at(0.0) == pytest.approx((0.0, 0.1))
    assert path().tilt_at(9.0) == pytest.approx((0.4, 0.3))


@pytest.mark.parametrize("centre", [-0.6, 0.0, 0.6])
def test_force_is_found_where_the_macro_model_says(centre):
    """The plane turns about the middle, the springs stand at a place beside it."""
    turns = path()

    def press(control):
        tx, _ = control.tilt
        return control.force ** (2 / 3) + 1.1 - tx * centre  # the approach that bears the force

    found = turns.press(Control(force=1.0, tilt=None), press, lambda approach: approach)
    assert found == pytest.approx(2.1 - turns.tilt_at(found)[0] * centre, rel=1e-9)


def test_a_plane_that_never_settles_is_an_error():
    steps = iter(range(10**6))
    with pytest.raises(NotConverged, match="turns under a force of 1 N"):
        path().press(Control(force=1.0, tilt=None), lambda _: None, lambda _: float(next(steps)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"approach": APPROACH[::-1]},
        {"force": APPROACH[1:]},
        {"tilt": np.full((9, 2), np.nan)},
        {"approach": np.empty(0)},
    ],
)
def test_refuses(wrong):
    with pytest.raises(InputError, match="a path needs"):
        path(**wrong)


@pytest.mark.parametrize("grid", [(1, 1), (2, 1), (2, 2), (8, 8)])
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
    coupling = CondensedCoupling(table, influence_matrix(patches) / (np.pi * MODULUS))
    for force in (0.3, 1.1, 2.0):
        control = Control(force=force, tilt=None)
        _, plane, _ = model.press(control, patches=patches, mean_heights=means)
        step = coupling.press(control)
        assert step.force_N == pytest.approx(force, rel=1e-8)
        assert step.approach_mm == pytest.approx(plane.approach, rel=1e-3)
        np.testing.assert_allclose(step.tilt, plane.tilt, atol=3e-3 * np.abs(plane.tilt).max())
        assert np.abs(step.moment_N_mm).max() < 1e-6 * force
