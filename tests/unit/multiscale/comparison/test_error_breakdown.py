"""Errors by cause: the shares add up, and each is what was put in."""

import itertools

import pytest

from multiscale.comparison.error_breakdown import Response, error_breakdown

ROUNDING = 1e-12  # sums of five doubles of order one
FIRST, WHOLE = -0.025, -0.03
TOPS = {
    "analytic": Response(value=3.4, slope_effect=FIRST),
    "concurrent": Response(value=3.1, slope_effect=FIRST),
    "reference": Response(value=3.0, slope_effect=WHOLE),
}
KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")
ALONE = Response(value=3.2)


def split(response, kind, measure, **changes):
    others = {"best": TOPS, "slope_effect": FIRST, "alone": ALONE, "is_half_space": False}
    return error_breakdown(response, kind, measure=measure, **(others | changes))


def total(found):
    shares = (found.micro, found.coupling, found.block, found.slopes, found.discretisation)
    return sum(share for share in shares if share is not None)


@pytest.mark.parametrize(("kind", "against"), list(itertools.product(KINDS, TOPS)))
@pytest.mark.parametrize("cells", [True, False])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("slopes", [0.0, FIRST, WHOLE])
def test_shares_add_up(kind, against, cells, known, slopes):
    some = {} if known else {"best": {against: TOPS[against]}, "slope_effect": None}
    response = Response(value=3.7, slope_effect=slopes)
    alone = response if kind == "analytic" else ALONE
    found = split(response, kind, against, alone=alone, is_half_space=cells, **some)
    right = TOPS[against].value
    assert total(found) == pytest.approx(3.7 / right - 1.0, abs=ROUNDING)


def test_micro_model_of_small_slopes_against_the_meshed_roughness():
    found = split(ALONE, "analytic", "reference")
    assert found.micro == pytest.approx((3.2 * (1.0 + FIRST) - 3.4) / 3.0, rel=ROUNDING)
    assert found.block == pytest.approx((3.4 - 3.1) / 3.0, rel=ROUNDING)
    assert found.slopes == pytest.approx(-3.2 * WHOLE / 3.0, rel=ROUNDING)
    assert found.coupling == 0.0


def test_slopes_in_the_first_order_alone():
    found = split(TOPS["concurrent"], "concurrent", "reference", is_half_space=True)
    lost = 1.0 - (1.0 + WHOLE) / (1.0 + FIRST)
    assert found.slopes == pytest.approx(3.1 * lost / 3.0, rel=1e-11)  # a difference
    assert found.discretisation == pytest.approx(3.1 / 3.0 - 1.0 - found.slopes, rel=1e-11)
    assert (found.micro, found.coupling, found.block) == (0.0, 0.0, 0.0)


def test_laws_against_the_block():
    found = split(Response(value=2.5), "isolated", "concurrent")
    micro = (3.2 * (1.0 + FIRST) - 3.4) / 3.1
    assert found.micro == pytest.approx(micro, rel=ROUNDING)
    coupling = (2.5 * (1.0 + FIRST) - 3.1) / 3.1 - micro
    assert found.coupling == pytest.approx(coupling, rel=ROUNDING)
    assert found.block == 0.0
    assert found.slopes == pytest.approx(-2.5 * FIRST / 3.1, rel=ROUNDING)
    assert found.discretisation == pytest.approx(0.0, abs=ROUNDING)


def test_cells_of_the_half_space_are_discretisation():
    coarse = Response(value=3.38, slope_effect=FIRST)
    found = split(coarse, "analytic", "analytic", alone=coarse, is_half_space=True)
    assert (found.micro, found.slopes) == (0.0, 0.0)
    assert found.discretisation == pytest.approx(-0.02 / 3.4, rel=1e-9)  # a difference


def test_the_other_way_round():
    found = split(TOPS["reference"], "reference", "analytic", alone=None)
    assert found.block == pytest.approx(-(3.4 - 3.1) / 3.4, rel=ROUNDING)
    lost = 1.0 - (1.0 + FIRST) / (1.0 + WHOLE)
    assert found.slopes == pytest.approx(3.0 * lost / 3.4, rel=1e-11)  # a difference


def test_what_was_not_reached_cannot_be_told():
    some = {"best": {kind: TOPS[kind] for kind in ("analytic", "reference")}, "slope_effect": None}
    found = split(ALONE, "analytic", "reference", **some)
    assert found.block is None
    assert found.slopes is None
    assert split(TOPS["concurrent"], "consistent", "reference", **some).coupling is None
