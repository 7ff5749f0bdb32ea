"""Counted work against what runs compute, and what is said of it."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from helpers.laws_on_mesh import lay_on_mesh

from patchlaw.geometry import BlockShape
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.complementarity import solver
from patchlaw.multiscale import Run, Scene, make_setup
from patchlaw.multiscale.couplings import micro_coupling, patch_laws
from patchlaw.multiscale.inputs import cost
from patchlaw.multiscale.inputs.cost import SOLUTIONS_OF_LAWS, magnitude, memory_parts
from patchlaw.multiscale.inputs.reference_meshes import mesh_unknowns
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.stepper import step_count
from patchlaw.multiscale.progress import Pace


def scene(kind="concurrent", grid=64, cells=(4, 4, 4), **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 8], "rms_slope": 0.215, "seed": 1}
    return Scene.from_dict(
        {
            "surface": {"spectrum": spectrum, "grid": [grid, grid], "lengths": [1.0, 1.0]},
            "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": list(cells)},
            "micro": {"model": "half-space"},
            "coupling": {"kind": kind},
            "load": {"approach": 0.008, "steps": 4},
            "output": {"figures": False, "report": False, "check": "none"},
        }
        | sections
    )


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
    counted = run.coupling.work()
    assert solved == {counted.size: counted.solutions} == {64**2: 4}


@pytest.mark.parametrize("kind", [pytest.param("consistent", marks=pytest.mark.long), "isolated"])
def test_rows_of_laws_are_about_as_many_as_counted(solved, kind):
    run = Run(scene(kind, grid=32))
    solved.clear()
    sizes = [len(law.rows) for law in run.make_laws().laws if len(law.rows)]
    # the laws of a whole surface share its rows, and each takes some of them
    rows = solved[32**2] if kind == "consistent" else np.mean(sizes)
    # refinement takes 33 to 65 rows, and some solutions to find its ends
    assert SOLUTIONS_OF_LAWS / 1.7 <= rows <= 1.7 * SOLUTIONS_OF_LAWS
    assert run.coupling.work().rows == SOLUTIONS_OF_LAWS


@pytest.mark.parametrize("element", ["Q1", "Q2"])
def test_unknowns_of_a_mesh(element):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(3, 4, 5), element=element)
    degree = int(element[1])
    assert mesh_unknowns(shape) == 3 * math.prod(degree * n + 1 for n in (3, 4, 5))


@pytest.mark.parametrize("kind", ["analytic", "concurrent"])
@pytest.mark.parametrize("grid", [64, 128])
def test_products_of_load_steps_are_about_as_many_as_counted(grid, kind, monkeypatch):
    """By transforms, which it is at most: few cells that can touch take less."""
    monkeypatch.setattr(solver, "_MATRIX_WORK", 0.0)
    run = Run(scene(kind, grid=grid, micro={"model": "half-space", "finite_slopes": False}))
    counted = sum(step.newton_iterations for step in run.load_steps()) * grid**2
    assert run.coupling.work().products / 2.0 <= counted <= 2.0 * run.coupling.work().products


@pytest.mark.parametrize("way", ["reference", "full", "condensed"])
def test_cycles_on_meshes_are_about_as_many_as_counted(way, monkeypatch):
    """An order of magnitude is promised: a factor of 3, the set-up of multigrid aside."""
    if way == "reference":
        mesh = {"mesh": "hexahedra", "cells": [16, 16, 8], "meshes": 1}
        given = scene("reference", reference=mesh)
    else:
        if way == "full":
            lay_on_mesh(monkeypatch)
        coupling = {"kind": "isolated"}
        given = scene(cells=(8, 8, 5), coupling=coupling, micro={"model": "circular"})
    run = Run(given)
    list(run.load_steps())
    counted = run.coupling.work()
    assert counted.unknowns == (run.coupling.unknowns or counted.unknowns)
    cycles = counted.cycles / counted.unknowns - cost.SET_UP_CYCLES
    done = sum(step.linear_iterations for step in run.steps)
    if way == "condensed":  # whose cycles make the compliance, before the first load step
        assert cycles == patch_laws._CYCLES_WITHOUT_MESH * run.coupling.interfering_patches
    else:
        assert cycles / 3.0 <= done <= 3.0 * cycles
    run.close()


def test_work_grows_with_what_is_asked():
    def counted(**sections):
        return make_setup(scene(**sections)).work()

    few = counted()
    assert counted(load={"approach": 0.008, "steps": 40}).products == 10.0 * few.products
    assert counted(grid=128).products == 4.0 * few.products
    assert counted(micro={"finite_slopes": False}).products < few.products
    assert counted(output={"check": "last"}).solutions > few.solutions
    rubs = {"friction": {"coefficient": 0.3}, "output": {"check": "last"}}
    shear = {"approach": 0.008, "steps": 4, "shear": [[1e-3, 0.0]]}
    there = counted(load=shear, **rubs).solutions
    again = counted(load=shear | {"shear": [[1e-3, 0.0], [0.0, 0.0]]}, **rubs)
    unchecked = counted(load=shear, friction=rubs["friction"], output={"check": "none"}).solutions
    normal = counted(load={"approach": 0.008, "steps": 4}, output={"check": "last"}).solutions
    # a path of two points, then of three, which has four load steps more
    assert there - unchecked == normal - 4.0 + 2 * micro_coupling._CHECK_OF_CELLS
    assert again.solutions - there == 4.0 + micro_coupling._CHECK_OF_CELLS
    meshes = [{"mesh": "hexahedra", "cells": [n, n, n // 2]} for n in (16, 32)]
    coarse, fine = (counted(kind="reference", reference=mesh) for mesh in meshes)
    assert coarse.cycles < fine.cycles and coarse.products == 0.0
    two = make_setup(scene("reference", reference=meshes[0])).work(2)
    assert coarse.computing == pytest.approx(2.0 * two.computing, rel=1e-12)


def test_steps_that_may_be_halved_are_counted():
    plain = LoadHistory(approach=(0.008, 0.002), steps=3, tilt=(0.0, 0.0))
    assert step_count(plain) == 6
    fine = LoadHistory(approach=(0.008,), steps=3, tilt=(0.0, 0.0), force_change=0.05)
    assert step_count(fine) == 20


def test_the_plan_says_work_order_of_time_and_the_largest_part_of_the_memory():
    flat = {"model": "half-space", "finite_slopes": False}
    coupling = make_setup(scene(grid=512, cells=(4, 4, 4), micro=flat))
    said = dict(coupling.cost_statements(1e6, 1))
    # 4 load steps of 30 products each on 512² cells
    assert "about 4 contact problems, on 262144 cells each: 31 million cells" in said["work"]
    assert "of the order of 3 s" in said["cost"]
    assert "most of it for the" in said["cost"]
    meshed = make_setup(scene(coupling={"kind": "consistent", "interface": "pointwise"}))
    assert (
        memory_parts(meshed, meshed.work(), meshed.memory_requests(), 1e6)["meshes and laws"] > 0.0
    )
    assert f"{SOLUTIONS_OF_LAWS} of them rows of laws" in dict(meshed.work().statements())["work"]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "1 s"),
        (1.8, "3 s"),
        (50.0, "30 s"),
        (700.0, "15 min"),
        (6000.0, "1 h"),
        (1e9, "240 h"),
    ],
)
def test_orders_of_magnitude(seconds, text):
    assert magnitude(seconds) == text


def test_the_pace_of_a_run_tells_what_is_left_of_it():
    pace = Pace(4)
    assert [pace.left(spent) for spent in (30.0, 10.0, 5.0, 1.0)] == [
        "; about 1 min 30 s left", "; about 40 s left", "; about 15 s left", "",
    ]  # fmt: skip
    assert Pace(0).left(3.0) == ""  # of how many parts is not known


def test_memory_of_the_contact_problem_is_what_a_run_allocates():
    data = scene("analytic", grid=256, load={"approach": 0.008, "steps": 1},
                 micro={"model": "half-space", "finite_slopes": False},
                 output={"figures": False, "check": "none", "contact": "none"})  # fmt: skip
    run = Run(data)
    tracemalloc.start()
    list(run.load_steps())
    allocated = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    counted = run.coupling.work().memory
    assert counted / 2.0 < allocated < 2.0 * counted
