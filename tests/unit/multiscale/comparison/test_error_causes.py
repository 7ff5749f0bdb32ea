"""Errors by cause: the shares add up, and each is what was put in."""

import itertools
from dataclasses import astuple

import numpy as np
import pytest

from geometry.patches import PatchGrid
from multiscale.comparison.configuration import Configuration, Curves, RunResult
from multiscale.comparison.errors import ErrorCauses
from multiscale.comparison.scene_content import LOW_HEIGHTS, SMALL_SLOPES

ROUNDING = 1e-12  # sums of five doubles of order one
FIRST, WHOLE = -0.025, -0.03
KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")
NUMBERS = ("approach", "area", "separation", "approach_error", "force_error", "area_error")


def result(kind, force, *, model="half-space", slopes=False, name=None, heights=64):
    content = {
        "coupling": {"kind": kind}, "micro": {"model": model}, "surface": {"grid": [heights] * 2},
    }  # fmt: skip
    curves = Curves(
        patches=PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)), force=np.array([force]),
        patch_pressure=np.ones((1, 1)), **dict.fromkeys(NUMBERS, np.ones(1)),
    )  # fmt: skip
    one = Configuration(name=name or kind, content=content, cost=1.0)
    return RunResult(configuration=one, status="done", curves=curves, finite_slopes=slopes)


TOPS = {
    "analytic": result("analytic", 3.4, slopes=True),
    "concurrent": result("concurrent", 3.1, slopes=True),
    "reference": result("reference", 3.0),
}
EFFECTS = (  # pairs that show the effects of slopes
    result("concurrent", 3.1 / (1.0 + FIRST), name="concurrent" + SMALL_SLOPES),
    result("reference", 3.0 / (1.0 + WHOLE), name="reference" + LOW_HEIGHTS),
)
ALONE = result("analytic", 3.2, model="elliptic", name="elliptic")


def split(one, against, best=TOPS, others=(*EFFECTS, ALONE)):
    known = [*best.values(), *others, one]
    return ErrorCauses(known, best, best[against], "force").breakdown(one)


@pytest.mark.parametrize(("kind", "against"), list(itertools.product(KINDS, TOPS)))
@pytest.mark.parametrize("model", ["half-space", "elliptic"])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("slopes", [True, False])
def test_shares_add_up(kind, against, model, known, slopes):
    some = {} if known else {"best": {against: TOPS[against]}, "others": ()}
    found = split(result(kind, 3.7, model=model, slopes=slopes, name="one"), against, **some)
    error = 3.7 / TOPS[against].last("force") - 1.0
    assert np.nansum(astuple(found)) == pytest.approx(error, abs=ROUNDING)


def test_micro_model_of_small_slopes_against_the_meshed_roughness():
    found = split(ALONE, "reference")
    assert found.micro == pytest.approx((3.2 * (1.0 + FIRST) - 3.4) / 3.0, rel=ROUNDING)
    assert found.block == pytest.approx((3.4 - 3.1) / 3.0, rel=ROUNDING)
    assert found.slopes == pytest.approx(-3.2 * WHOLE / 3.0, rel=ROUNDING)
    assert found.coupling == 0.0


def test_slopes_in_the_first_order_alone():
    found = split(TOPS["concurrent"], "reference")
    lost = 1.0 - (1.0 + WHOLE) / (1.0 + FIRST)
    assert found.slopes == pytest.approx(3.1 * lost / 3.0, rel=ROUNDING)
    assert found.discretisation == pytest.approx(3.1 / 3.0 - 1.0 - found.slopes, rel=ROUNDING)
    assert (found.micro, found.coupling, found.block) == (0.0, 0.0, 0.0)


def test_laws_against_the_block():
    found = split(result("isolated", 2.5, model="elliptic", name="laws"), "concurrent")
    micro = (3.2 * (1.0 + FIRST) - 3.4) / 3.1
    assert found.micro == pytest.approx(micro, rel=ROUNDING)
    coupling = (2.5 * (1.0 + FIRST) - 3.1) / 3.1 - micro
    assert found.coupling == pytest.approx(coupling, rel=ROUNDING)
    assert found.block == 0.0
    assert found.slopes == pytest.approx(-2.5 * FIRST / 3.1, rel=ROUNDING)
    assert found.discretisation == pytest.approx(0.0, abs=ROUNDING)


def test_cells_of_the_half_space_are_discretisation():
    coarse = result("analytic", 3.38, slopes=True, name="coarse", heights=32)
    found = split(coarse, "analytic")
    assert (found.micro, found.slopes) == (0.0, 0.0)
    assert found.discretisation == pytest.approx(-0.02 / 3.4, rel=1e-9)  # a small difference


def test_the_other_way_round():
    found = split(TOPS["reference"], "analytic")
    assert found.block == pytest.approx(-(3.4 - 3.1) / 3.4, rel=ROUNDING)
    lost = 1.0 - (1.0 + FIRST) / (1.0 + WHOLE)
    assert found.slopes == pytest.approx(3.0 * lost / 3.4, rel=ROUNDING)


def test_what_was_not_reached_is_unknown():
    some = {"best": {kind: TOPS[kind] for kind in ("analytic", "reference")}, "others": (ALONE,)}
    found = split(ALONE, "reference", **some)
    assert np.isnan([found.block, found.slopes]).all()
    laws = result("consistent", 3.1, slopes=True, name="laws")
    assert np.isnan(split(laws, "reference", **some).coupling)
