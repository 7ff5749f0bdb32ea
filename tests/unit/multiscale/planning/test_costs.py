"""Predicted work against counted work, and what becomes of a prediction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry import BlockShape
from micro import HalfSpaceModel
from multiscale import Run, Scene, make_setup
from multiscale.loading.stepper import LoadHistory
from multiscale.planning.costs import ROWS, predicted_cost, step_count
from multiscale.planning.machine_speed import Machine
from multiscale.setup.reference_meshes import mesh_unknowns


class Reference(Machine):
    """The machine on which work was measured."""

    arrays = sparse = 1.0


def scene(kind="concurrent", grid=64, cells=(4, 4, 4), **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 8], "rms_slope": 0.215, "seed": 1}
    return Scene.from_dict(
        {
            "surface": {"spectrum": spectrum, "grid": [grid, grid], "lengths": [1.0, 1.0]},
            "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": list(cells)},
            "micro": {"model": "half-space"},
            "coupling": {"kind": kind},
            "load": {"approach": 0.008, "steps": 4},
            "output": {"figures": False, "check": "none"},
        }
        | sections
    )


def test_ratios_of_this_machine_are_those_of_a_computer():
    machine = Machine()
    # between a thousandth of the speed of the machine of measurement and a thousand times it
    assert all(1e-3 < ratio < 1e3 for ratio in (machine.arrays, machine.sparse))


@pytest.fixture
def solved(monkeypatch):
    """Load steps that half-spaces are solved for, by their number of cells."""
    made: dict[int, int] = {}
    press = HalfSpaceModel.press

    def counted(self, *given, **options):
        cells = self.surface.heights.size
        made[cells] = made.get(cells, 0) + 1
        return press(self, *given, **options)

    monkeypatch.setattr(HalfSpaceModel, "press", counted)
    return made


@pytest.mark.parametrize("kind", ["analytic", "concurrent"])
@pytest.mark.parametrize(
    "load", [{"approach": 0.008}, {"force": 2.0}, {"approach": 0.008, "tilt": "free"}]
)
def test_a_load_step_is_one_solution(solved, load, kind):
    run = Run(scene(kind, load=load | {"steps": 4}))
    solved.clear()
    list(run.load_steps())
    assert solved == {64**2: step_count(run.scene.loading.load_history)}


@pytest.mark.parametrize("kind", [pytest.param("consistent", marks=pytest.mark.long), "isolated"])
def test_rows_of_laws_are_as_many_as_predicted(solved, kind):
    run = Run(scene(kind))
    solved.clear()
    sizes = [len(law.rows) for law in run.make_laws().laws if len(law.rows)]
    # the laws of a whole surface share its rows, and each takes some of them
    rows = solved[64**2] if kind == "consistent" else np.mean(sizes)
    # refinement takes 33 to 65 rows of the 56 that are predicted, and some to find its ends
    assert ROWS["cells"] / 1.7 <= rows <= 1.7 * ROWS["cells"]


@pytest.mark.parametrize("element", ["Q1", "Q2"])
def test_unknowns_of_a_mesh(element):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(3, 4, 5), element=element)
    degree = int(element[1])
    assert mesh_unknowns(shape) == 3 * math.prod(degree * n + 1 for n in (3, 4, 5))


def test_work_grows_with_what_is_asked():
    def total(**sections):
        setup = make_setup(scene(**sections))
        return predicted_cost(setup, Reference()).total

    assert total(load={"approach": 0.008, "steps": 40}) > total()
    assert total(grid=128) > total()
    assert total(output={"figures": True}) > total()
    assert total(kind="analytic") < total()
    meshes = [{"mesh": "hexahedra", "cells": [n, n, n // 2]} for n in (16, 32)]
    costs = [total(kind="reference", reference=mesh) for mesh in meshes]
    assert costs[0] < costs[1]
    tilting = {"approach": 0.008, "tilt": "free", "steps": 4}
    assert total(kind="reference", reference=meshes[0], load=tilting) > costs[0]


def test_steps_that_may_be_halved_are_counted():
    plain = LoadHistory(quantity="approach", points=(0.008, 0.002), steps=3, tilt=(0.0, 0.0))
    assert step_count(plain) == 6
    fine = LoadHistory(
        quantity="approach", points=(0.008,), steps=3, tilt=(0.0, 0.0), force_change=0.05
    )
    assert step_count(fine) == 20
