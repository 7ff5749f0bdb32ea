"""Errors by cause: the shares add up, and each is what was put in."""

import itertools
import tomllib

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.studies.comparison import ErrorCauses, Row
from patchlaw.multiscale.studies.configurations import SMALL_SLOPES
from patchlaw.multiscale.studies.running import CaseResult

ROUNDING = 1e-12  # sums of five doubles of order one
SLOPES = -0.025
KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")
BASE = Scene.from_dict(tomllib.loads(SMALL_SCENE))


def result(kind, force, *, model="half-space", slopes=False, name=None, heights=64):
    changes = {
        "coupling": {"kind": kind}, "micro": {"model": model}, "surface.grid": [heights] * 2,
    }  # fmt: skip
    done = CaseResult(measured={"finite_slopes": slopes}, arrays={"force": np.array([force])})
    return Row(name=name or kind, scene=BASE.with_(changes), result=done)


TOPS = {
    "analytic": result("analytic", 3.4, slopes=True),
    "concurrent": result("concurrent", 3.1, slopes=True),
    "reference": result("reference", 3.0, slopes=True),
}
SMALL = result("concurrent", 3.1 / (1.0 + SLOPES), name="concurrent" + SMALL_SLOPES)
ALONE = result("analytic", 3.2, model="elliptic", name="elliptic")


def split(one, against, best=TOPS, others=(SMALL, ALONE)):
    known = [*best.values(), *others, one]
    return ErrorCauses(known, best, best[against], "force").shares(one)


@pytest.mark.parametrize("against", TOPS)
def test_shares_add_up(against):
    error = 3.7 / TOPS[against].last("force") - 1.0
    for kind, model, slopes in itertools.product(KINDS, ["half-space", "elliptic"], [True, False]):
        one = result(kind, 3.7, model=model, slopes=slopes, name="one")
        for some in ({}, {"best": {against: TOPS[against]}, "others": ()}):
            shares = list(split(one, against, **some).values())
            assert np.nansum(shares) == pytest.approx(error, abs=ROUNDING), (kind, model, slopes)


def test_micro_model_of_small_slopes_against_the_meshed_roughness():
    found = split(ALONE, "reference")
    assert found["micro"] == pytest.approx((3.2 * (1.0 + SLOPES) - 3.4) / 3.0, rel=ROUNDING)
    assert found["block"] == pytest.approx((3.4 - 3.1) / 3.0, rel=ROUNDING)
    assert found["slopes"] == pytest.approx(-3.2 * SLOPES / 3.0, rel=ROUNDING)
    assert found["coupling"] == 0.0


def test_laws_against_the_block():
    found = split(result("isolated", 2.5, model="elliptic", name="laws"), "concurrent")
    micro = (3.2 * (1.0 + SLOPES) - 3.4) / 3.1
    assert found["micro"] == pytest.approx(micro, rel=ROUNDING)
    coupling = (2.5 * (1.0 + SLOPES) - 3.1) / 3.1 - micro
    assert found["coupling"] == pytest.approx(coupling, rel=ROUNDING)
    assert found["block"] == 0.0
    assert found["slopes"] == pytest.approx(-2.5 * SLOPES / 3.1, rel=ROUNDING)
    assert found["discretisation"] == pytest.approx(0.0, abs=ROUNDING)


def test_cells_of_the_half_space_are_discretisation():
    coarse = result("analytic", 3.38, slopes=True, name="coarse", heights=32)
    found = split(coarse, "analytic")
    assert (found["micro"], found["slopes"]) == (0.0, 0.0)
    assert found["discretisation"] == pytest.approx(-0.02 / 3.4, rel=1e-9)  # a small difference


def test_the_other_way_round():
    found = split(TOPS["reference"], "analytic")
    assert found["block"] == pytest.approx(-(3.4 - 3.1) / 3.4, rel=ROUNDING)
    assert found["slopes"] == 0.0
    small = split(SMALL, "analytic")
    assert small["slopes"] == pytest.approx(-3.1 * SLOPES / (1.0 + SLOPES) / 3.4, rel=ROUNDING)


def test_what_was_not_reached_is_unknown():
    some = {"best": {kind: TOPS[kind] for kind in ("analytic", "reference")}, "others": (ALONE,)}
    found = split(ALONE, "reference", **some)
    assert np.isnan([found["block"], found["slopes"]]).all()
    laws = result("consistent", 3.1, slopes=True, name="laws")
    assert np.isnan(split(laws, "reference", **some)["coupling"])
