"""Causes of errors: the shares add up, and each is what was put in."""

import itertools

import pytest

from multiscale.comparing.causes import Best, causes

ROUNDING = 1e-12  # sums of five doubles of order one
BEST = Best(half_space=3.4, block=3.1, rough=3.0, slopes=-0.025)
TOPS = {"analytic": 3.4, "concurrent": 3.1, "reference": 3.0}
KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")


def split(value, kind, against, *, twin=3.2, cells=False, best=BEST):
    return causes(
        value, kind, against=TOPS[against], against_kind=against, best=best, twin=twin, cells=cells
    )


def total(found):
    shares = (found.micro, found.coupling, found.block, found.slopes, found.discretisation)
    return sum(share for share in shares if share is not None)


@pytest.mark.parametrize(("kind", "against"), list(itertools.product(KINDS, TOPS)))
@pytest.mark.parametrize("cells", [True, False])
@pytest.mark.parametrize("known", [True, False])
def test_shares_add_up(kind, against, cells, known):
    best = BEST if known else Best(half_space=None, block=None, rough=None)
    twin = 3.7 if kind == "analytic" else 3.2
    found = split(3.7, kind, against, twin=twin, cells=cells, best=best)
    assert total(found) == pytest.approx(3.7 / TOPS[against] - 1.0, abs=ROUNDING)


def test_micro_model_alone_against_the_meshed_roughness():
    found = split(3.2, "analytic", "reference", twin=3.2)
    assert found.micro == pytest.approx((3.2 - 3.4) / 3.0, rel=ROUNDING)
    assert found.block == pytest.approx((3.4 - 3.1) / 3.0, rel=ROUNDING)
    assert found.slopes == pytest.approx(0.025 * 3.1 / 3.0, rel=ROUNDING)  # of the smooth block
    rest = (3.1 - 3.0 - 0.025 * 3.1) / 3.0
    assert found.discretisation == pytest.approx(rest, rel=1e-9)  # a difference
    assert found.coupling == 0.0


def test_laws_against_the_smooth_block():
    found = split(2.5, "isolated", "concurrent", twin=3.2)
    assert found.micro == pytest.approx((3.2 - 3.4) / 3.1, rel=ROUNDING)
    assert found.coupling == pytest.approx((2.5 - 3.1 + 0.2) / 3.1, rel=ROUNDING)
    assert (found.block, found.slopes) == (0.0, 0.0)
    assert found.discretisation == pytest.approx(0.0, abs=ROUNDING)


def test_cells_of_the_half_space_are_discretisation():
    found = split(3.38, "analytic", "analytic", twin=3.38, cells=True)
    assert found.micro == 0.0
    assert found.discretisation == pytest.approx(-0.02 / 3.4, rel=1e-9)  # a difference


def test_the_other_way_round():
    found = split(3.0, "reference", "analytic", twin=None)
    assert found.block == pytest.approx(-(3.4 - 3.1) / 3.4, rel=ROUNDING)
    assert found.slopes == pytest.approx(-0.025 * 3.1 / 3.4, rel=ROUNDING)


def test_what_was_not_reached_cannot_be_told():
    best = Best(half_space=3.4, block=None, rough=3.0)
    found = split(3.2, "analytic", "reference", twin=3.2, best=best)
    assert found.block is None
    assert found.slopes is None
    assert split(3.0, "consistent", "reference", best=best).coupling is None
