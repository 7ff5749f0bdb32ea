"""The dense Newton method against closed forms and scipy, bordered by force and moment."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq, linprog, root

from patchlaw.geometry import Control, PatchGrid
from patchlaw.multiscale.models.loaded_patches import LoadedPatches
from patchlaw.multiscale.models.patch_contact import equilibrium
from patchlaw.support import InputError, NotConverged


class HertzLaws:
    """p = k w^(3/2) over the local approach, closure = approach − own compliance × p."""

    def __init__(self, touch, stiffness=1e5, own=0.0):
        self.first_touch, self.stiffness, self.own = np.asarray(touch, float), stiffness, own

    def along(self, approach):
        depth = np.maximum(approach - self.first_touch, 0.0)
        pressure = self.stiffness * depth**1.5
        rise = 1.5 * self.stiffness * np.sqrt(depth)
        return SimpleNamespace(
            closure=approach - self.own * pressure,
            pressure=pressure,
            dclosure=1.0 - self.own * rise,
            dpressure=rise,
        )


PATCHES = PatchGrid(grid=(4, 4), lengths=(1.0, 0.8), origin=(0.3, -0.2))
LEVERS = PATCHES.centres - (0.8, 0.2)
OWN = 6e-5


def compliance(own=OWN, patches=PATCHES):
    """Own displacement, and that of point loads for the others."""
    apart = np.linalg.norm(patches.centres[:, None] - patches.centres, axis=2)
    np.fill_diagonal(apart, 1.0)
    matrix = 0.2 * own * patches.size[0] / apart
    np.fill_diagonal(matrix, own)
    return matrix


def touches(seed=3):
    touch = np.random.default_rng(seed).uniform(0.0, 10e-3, 16)
    touch[5] = np.inf  # nothing to be touched there
    return touch


def imbalance(state, laws, matrix):
    point = laws.along(state.local)
    gap = point.closure + matrix @ point.pressure - state.plane[0] - LEVERS @ state.plane[1:]
    return np.abs(gap).max()


def test_one_patch_is_a_scalar_equation():
    patch = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    newton = partial(equilibrium, HertzLaws([1e-3]), np.array([[2e-4]]), patch)
    state = newton(Control(approach=8e-3))
    depth = brentq(lambda w: w + 2e-4 * 1e5 * w**1.5 - 7e-3, 0.0, 7e-3, xtol=1e-18)
    # the solver's residual of 1e-12, and brentq's
    assert state.load[0] == pytest.approx(1e5 * depth**1.5, rel=1e-11)


def test_many_patches_agree_with_another_solver():
    laws, matrix = HertzLaws(touches()), compliance()
    tilt = (4e-3, -2e-3)
    state = equilibrium(laws, matrix, PATCHES, Control(approach=8e-3, tilt=tilt))

    def gap(closure):
        depth = np.maximum(closure - laws.first_touch, 0.0)
        return closure + matrix @ (1e5 * depth**1.5) - 8e-3 - LEVERS @ tilt

    # at 1e-14 some releases of scipy stop for want of progress, with success False
    other = root(gap, np.full(16, 6e-3), method="hybr", options={"xtol": 1e-12})
    assert other.success
    # MINPACK's own convergence
    np.testing.assert_allclose(state.point.closure, other.x, rtol=1e-9)
    assert np.any(state.point.pressure == 0.0)


CONTROLS = {"approach": {"approach": 8e-3}, "force": {"force": 9.0}}
TILTS = {"level": (0.0, 0.0), "tilted": (3e-3, 5e-3), "free": None}


@pytest.mark.parametrize("own", [0.0, 0.95 * OWN, 40 * OWN], ids=["plain", "Love", "falling"])
@pytest.mark.parametrize("tilt", TILTS.values(), ids=TILTS)
@pytest.mark.parametrize("given", CONTROLS.values(), ids=CONTROLS)
def test_every_load_is_met_from_nothing(given, tilt, own):
    """Also where closure falls as the local approach rises ("falling")."""
    laws = HertzLaws(touches(), own=own)
    matrix = compliance() + own * np.eye(16)
    newton = partial(equilibrium, laws, matrix, PATCHES)
    if own > OWN:
        assert laws.along(np.full(16, 8e-3)).dclosure.min() < 0.0
    state = newton(Control(**given, tilt=tilt))
    # residuals of 1e-12 relative to approaches of 1e-2, forces of 10 N, and moments alike
    assert imbalance(state, laws, matrix) < 2e-14
    if "force" in given:
        assert state.load[0] == pytest.approx(9.0, rel=1e-11)
    else:
        assert state.plane[0] == 8e-3
    if tilt is None:
        assert np.abs(state.load[1:]).max() < 1e-11 * state.load[0]
    else:
        np.testing.assert_array_equal(state.plane[1:], tilt)
    moments = LEVERS.T @ state.point.pressure * PATCHES.area
    np.testing.assert_allclose(state.load[1:], moments, atol=1e-12)  # rounding of sums of ~1


def test_one_patch_cannot_turn():
    patch = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    newton = partial(equilibrium, HertzLaws([1e-3]), np.array([[2e-4]]), patch)
    state = newton(Control(force=2.0, tilt=None))
    np.testing.assert_array_equal(state.plane[1:], 0.0)


def test_no_force_is_first_touch():
    laws = HertzLaws(touches())
    newton = partial(equilibrium, laws, compliance(), PATCHES)
    state = newton(Control(force=0.0, tilt=(1e-3, 0.0)))
    assert state.plane[0] == pytest.approx(
        np.min(laws.first_touch - 1e-3 * LEVERS[:, 0]), rel=1e-12
    )
    assert state.load[0] < 1e-12  # the touch's rounding of 1e-18 mm


def test_plane_that_touches_nothing_carries_nothing():
    laws = HertzLaws(np.full(16, 5e-3))
    state = equilibrium(laws, compliance(), PATCHES, Control(approach=4e-3, tilt=None))
    assert not state.point.pressure.any()
    np.testing.assert_allclose(state.point.closure, 4e-3, rtol=1e-12)  # the iteration's residual


def test_a_plane_that_no_load_turns_is_farthest_from_its_nearest_patch():
    """The programme of all patches at once; before the plane stopped wherever it was clear."""
    laws, newton = HertzLaws(touches()), partial(equilibrium, HertzLaws(touches()), compliance())
    known = np.isfinite(laws.first_touch)
    rows = np.column_stack((LEVERS, -np.ones(16)))[known]
    best = linprog([0.0, 0.0, 1.0], rows, 1e3 * laws.first_touch[known], bounds=(None, None))
    highest, level = -1e-3 * best.fun, float(laws.first_touch.min())
    pressed = newton(PATCHES, Control(approach=8.1e-3, tilt=None))
    assert pressed.load[0] > 0.0 and level < highest
    for start, share in ((None, 0.93), (pressed, 0.93), (pressed, 0.31), (None, -1.7)):
        control = Control(approach=level + share * (highest - level), tilt=None)
        state = newton(PATCHES, control, start)
        assert not state.point.pressure.any()
        np.testing.assert_allclose(state.plane[1:], 1e-3 * best.x[:2], rtol=1e-9)
    assert newton(PATCHES, Control(approach=1.01 * highest, tilt=None)).point.pressure.any()


@pytest.mark.parametrize("tilt", TILTS.values(), ids=TILTS)
def test_a_plane_without_support_moves_on_to_the_next_touch(monkeypatch, tilt):
    newton = partial(equilibrium, HertzLaws(touches()), compliance(), PATCHES)
    above = newton(Control(approach=-5e-3, tilt=tilt or (0.0, 0.0)))
    assert not above.point.pressure.any()
    wanted = newton(Control(force=9.0, tilt=tilt))
    monkeypatch.delattr(LoadedPatches, "initial_guess")  # it would hide a plane that went away
    state = newton(Control(force=9.0, tilt=tilt), above)
    np.testing.assert_allclose(state.plane, wanted.plane, atol=1e-13)  # residuals of 1e-14 mm


def test_force_on_open_patches_is_refused():
    newton = partial(equilibrium, HertzLaws(np.full(16, np.inf)), compliance(), PATCHES)
    for force in (0.0, 1.0):
        with pytest.raises(NotConverged, match=r"the condensed block at force .* NO_CONTACT"):
            newton(Control(force=force))


def test_free_plane_on_a_single_patch_beside_the_middle_is_refused():
    touch = np.full(16, np.inf)
    touch[0] = 1e-3
    newton = partial(equilibrium, HertzLaws(touch), compliance(), PATCHES)
    with pytest.raises(
        NotConverged, match=r"the equilibrium of the plane .*NO_SUPPORT.*load\.tilt"
    ):
        newton(Control(force=1.0, tilt=None))


@pytest.mark.parametrize("matrix", [np.eye(3), np.full((16, 16), np.nan)])
def test_compliance_must_fit(matrix):
    with pytest.raises(InputError, match="compliance does not fit the patches"):
        equilibrium(HertzLaws(touches()), matrix, PATCHES, Control(approach=1e-3))
