"""Loads that are each other's mirror images on a square, of which one is solved for."""

import numpy as np
import pytest

from patchlaw.geometry import Material
from patchlaw.macro.compliance.elements import ProductStiffness, block_lines


def stiffness(lengths, odd):
    """Return the stiffness of a block under pressures of one parity along both axes."""
    x, y, z = block_lines(lengths, 0.7, 5)
    lines = [
        [x.of_parity((odd + (axis == 0)) % 2), y.of_parity((odd + (axis == 1)) % 2), z]
        for axis in range(3)
    ]
    return ProductStiffness(lines, Material(young_modulus=4000.0, poisson_ratio=0.3))


@pytest.mark.parametrize("odd", [0, 1])
def test_a_mirrored_load_displaces_as_if_solved_for_by_itself(odd, monkeypatch):
    block, solved, solve = stiffness((1.0, 1.0), odd), [], ProductStiffness._solved

    def counted(self, forces):
        solved.append(forces.shape[1])
        return solve(self, forces)

    monkeypatch.setattr(ProductStiffness, "_solved", counted)
    x, y, _ = block.lines[2]
    load = np.random.default_rng(3).normal(size=(len(x.values), len(y.values)))
    tops, every = block.solve({2: np.stack([load, load.T])})
    assert sum(solved) == 1
    alone, coefficients = block.solve({2: load.T[None]})
    assert sum(solved) == 2
    # iterations end at 1e-11 of the load
    for found, exact in zip([*tops, every], [*alone, coefficients], strict=True):
        assert found[..., 1] == pytest.approx(exact[..., 0], abs=1e-9 * np.abs(exact).max())


def test_a_rectangle_has_no_mirrored_loads():
    block = stiffness((1.0, 1.2), 0)
    x, y, _ = block.lines[2]
    load = np.random.default_rng(4).normal(size=(len(x.values), len(y.values)))
    tops, _ = block.solve({2: np.stack([load, load.T])})
    alone, _ = block.solve({2: load.T[None]})
    for found, exact in zip(tops, alone, strict=True):
        assert found[..., 1] == pytest.approx(exact[..., 0], abs=1e-9 * np.abs(exact).max())
