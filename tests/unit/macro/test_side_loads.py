"""Tractions of the half-space on the sides of a block, and their nodal forces."""

import numpy as np
import pytest

from geometry import PatchGrid
from geometry.meshes import BlockShape
from geometry.smooth_shape import smooth_shape
from macro.side_loads import LineRule, sides
from micro.boussinesq import HalfSpace

FIELD = HalfSpace(1.0, 0.3)
SHAPE = smooth_shape(BlockShape(interface=(1.0, 0.8), height=0.9, cells=(8, 8, 8)))
LOADS = PatchGrid(grid=(4, 4), lengths=(1.0, 0.8))


def test_rule_integrates_every_quadratic_on_its_ticks():
    ticks = np.array([-0.9, -0.5, -0.1, 0.0])
    nodes = np.array([-0.9, -0.7, -0.5, -0.3, -0.1, -0.05, 0.0])
    rule = LineRule.between(ticks, np.array([-0.33, -0.5, 7.0]))
    weights = rule.shapes.sum(axis=1)
    assert weights.sum() == pytest.approx(0.9, rel=1e-14)
    for power in range(3):
        # shape functions reproduce quadratics: integrals against one of degree 5 are exact
        found = rule.shapes @ nodes**power
        np.testing.assert_allclose(found, weights * rule.points**power, atol=1e-15)
        moment = (found * rule.points**5).sum()
        assert moment == pytest.approx(-((-0.9) ** (6 + power)) / (6 + power), rel=1e-13)


def test_half_space_balances_every_load_over_the_cut_out_block():
    """Tractions on sides and bottom hold the pressure, in force and moment about the x axis."""
    force = np.zeros((3, LOADS.count))
    moment = np.zeros(LOADS.count)
    for side in sides(SHAPE, LOADS):
        x, y, depth = side.points
        weight = np.outer(side.along.shapes.sum(axis=1), side.down.shapes.sum(axis=1)).ravel()
        stress = FIELD.stresses(x, y, depth, LOADS)
        rows = ((0, 5, 4), (5, 1, 3))[side.axis]
        traction = side.outward * stress[list(rows)] * weight[:, None]
        force += traction.sum(axis=1)
        moment += (y[:, None] * traction[2] - depth[:, None] * traction[1]).sum(axis=0)
    rules = [LineRule.between(SHAPE.ticks[axis], np.empty(0), 8) for axis in (0, 1)]
    x, y = (grid.ravel() for grid in np.meshgrid(*(rule.points for rule in rules), indexing="ij"))
    weight = np.outer(*(rule.shapes.sum(axis=1) for rule in rules)).ravel()
    depth = np.full_like(x, SHAPE.height)
    stress = FIELD.stresses(x, y, depth, LOADS)
    traction = stress[[4, 3, 2]] * weight[:, None]
    force += traction.sum(axis=1)
    moment += (y[:, None] * traction[2] - depth[:, None] * traction[1]).sum(axis=0)
    # the rules along the edge leave 1.2e-4 of the load
    np.testing.assert_allclose(force[:2] / LOADS.area, 0.0, atol=2e-4)
    np.testing.assert_allclose(force[2] / LOADS.area, -1.0, atol=2e-4)
    np.testing.assert_allclose(moment / LOADS.area, -LOADS.centres[:, 1], atol=2e-4)


def test_rules_agree_with_much_finer_ones():
    for side, fine in zip(sides(SHAPE, LOADS), sides(SHAPE, LOADS, 12), strict=True):
        rows = ((0, 5, 4), (5, 1, 3))[side.axis]
        coarse, finer = (
            np.stack([one.nodal(FIELD.stresses(*one.points, LOADS)[row]) for row in rows])
            for one in (side, fine)
        )
        # 0.14 %, where a rectangle ends at the edge; compliances feel 0.02 % of it
        assert np.abs(coarse - finer).max() <= 0.002 * np.abs(finer).max()
