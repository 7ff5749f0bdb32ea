"""Predicted work against counted work, and what becomes of a prediction."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from geometry import BlockShape
from micro import HalfSpaceModel
from multiscale import Run, Scene, make_setup
from multiscale.loading.stepper import LoadHistory
from multiscale.planning.busy_cores import Competition
from multiscale.planning.contact_costs import ContactCosts
from multiscale.planning.costs import ROWS, predicted_cost
from multiscale.planning.machine_speed import Machine
from multiscale.planning.memory_costs import Launch, step_count
from multiscale.planning.plan import cost_statements
from multiscale.setup.reference_meshes import mesh_unknowns


class Reference(Machine):
    """The machine on which work was measured."""

    arrays = sparse = 1.0
    competition = Competition(cores=2)

    def product(self, cells):
        return 1e-9 * cells * math.log2(cells + 2.0)


class Crowded(Reference):
    """The same with two cores, one of which another program uses."""

    competition = Competition(others=1.0, cores=2)


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
    times = [machine.product(side**2) for side in (32, 128, 2048)]
    assert 0.0 < times[0] < times[1] < times[2] < 1e3


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


@pytest.mark.parametrize("kind", ["analytic", "concurrent"])
@pytest.mark.parametrize("grid", [64, 128])
def test_products_of_load_steps_are_about_as_many_as_predicted(grid, kind):
    run = Run(scene(kind, grid=grid, micro={"model": "half-space", "finite_slopes": False}))
    counted = np.mean([step.newton_iterations for step in run.load_steps()])
    costs = ContactCosts(run.setup, Reference())
    assert costs.products(grid**2) / 2.0 <= counted <= 2.0 * costs.products(grid**2)


@pytest.mark.parametrize("threads", ["1", "2"])
def test_a_busy_machine_is_said_and_counted(monkeypatch, threads):
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    setup = make_setup(scene(output={"check": "none", "figures": False}))
    calm, crowded = (predicted_cost(setup, machine) for machine in (Reference(), Crowded()))
    assert "busy" not in dict(cost_statements(calm))
    assert calm.total == pytest.approx(calm.idle, rel=1e-12) == crowded.idle
    # one thread has a core of its own beside the other program; two threads have 4/3 of two cores
    if threads == "1":
        assert crowded.total == pytest.approx(calm.total, rel=1e-12)
    else:
        assert calm.total < crowded.total < 1.5 * calm.total
    said = dict(cost_statements(crowded))
    assert "other programs would use 1 of the 2 cores" in said["busy"]
    assert ("on one core" if threads == "1" else "on 2 cores") in said["cost"]


def test_libraries_are_imported_by_a_program_of_its_own():
    setup = make_setup(scene())
    here = predicted_cost(setup, Reference(), Launch(imported=lambda _: True, memory=1e8))
    anew = predicted_cost(setup, Reference(), Launch.anew(1e8))
    assert anew.seconds["block"] > here.seconds["block"] + 0.5
    assert anew.memory > here.memory


def test_ranks_share_meshes_and_laws_of_patches():
    one, two = (
        predicted_cost(make_setup(scene("isolated")), Reference(), Launch(ranks=ranks))
        for ranks in (1, 2)
    )
    assert two.seconds["laws"] == pytest.approx(0.5 * one.seconds["laws"], rel=1e-12)
    assert two.seconds["load steps"] < one.seconds["load steps"]


def test_the_largest_part_of_the_memory_is_said():
    launch = Launch(memory=1e6, imported=lambda _: True)
    cost = predicted_cost(make_setup(scene(grid=512, cells=(4, 4, 4))), Reference(), launch)
    assert "most of it for the contact problem" in dict(cost_statements(cost))["cost"]
    assert cost.memory == pytest.approx(sum(cost.parts.values()), rel=1e-12)
    meshed = make_setup(scene(coupling={"kind": "consistent", "compliance": "finite-element"}))
    cost = predicted_cost(meshed, Reference(), launch)
    assert cost.parts["meshes and laws"] > 0.0


def test_memory_of_the_contact_problem_is_what_a_run_allocates():
    data = scene("analytic", grid=256, load={"approach": 0.008, "steps": 1},
                 micro={"model": "half-space", "finite_slopes": False},
                 output={"figures": False, "check": "none", "contact": "none"})  # fmt: skip
    run = Run(data)
    tracemalloc.start()
    list(run.load_steps())
    allocated = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    predicted = predicted_cost(run.setup, Reference()).parts["contact problem"]
    assert predicted / 2.0 < allocated < 2.0 * predicted
