"""Counted unknowns, load steps and memory, and what is said of them."""

from __future__ import annotations

import tracemalloc

import pytest

from patchlaw.multiscale import LoadHistory, Run, Scene, make_setup


def scene(kind="concurrent", grid=64, cells=(4, 4, 4), **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 8], "rms_slope": 0.215, "seed": 1}
    return Scene.from_dict({
        "surface": {"spectrum": spectrum, "grid": [grid, grid], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": list(cells)},
        "micro": {"model": "half-space"}, "coupling": {"kind": kind},
        "load": {"approach": 0.008, "steps": 4},
        "output": {"figures": False, "report": False, "check": "none"},
    } | sections)  # fmt: skip


def test_steps_that_may_be_halved_are_counted():
    plain = LoadHistory(approach=(0.008, 0.002), steps=3, tilt=(0.0, 0.0))
    assert plain.expected_count == 6
    fine = LoadHistory(approach=(0.008,), steps=3, tilt=(0.0, 0.0), force_change=0.05)
    assert fine.expected_count == 20


@pytest.mark.parametrize(
    "elements", [{}, {"coupling": {"kind": "consistent", "interface": "pointwise"}}]
)
def test_the_plan_says_the_memory_and_its_largest_part(elements):
    flat = {"model": "half-space", "finite_slopes": False}
    large = {"cells": (64, 64, 64)} if elements else {"grid": 1024}
    said = make_setup(scene(**large, micro=flat, **elements)).about.memory_statement(1e6, 1)
    assert said.endswith(f"for the {'meshes and laws' if elements else 'contact problem'}")
    # 5 kB for a hexahedron; 165 B for a cell, with 87 B for a height of the surface
    least = 64**3 * 5e3 if elements else 1024**2 * (165 + 87)
    assert least < 1e6 * float(said.split()[1]) < 1.3 * least + 71e6


@pytest.mark.long
def test_the_plan_says_what_a_leak_takes():
    """170 B for each cell of large maps, and 5.2 MB more."""
    said, leak = {}, {"leak": {"viscosity": 1e-3, "pressures": [0.2, 0.1]}}
    for cells in (1024, 128):
        for given in ({}, leak):
            setup = make_setup(
                scene("concurrent", grid=cells, micro={"model": "half-space"}, **given)
            )
            said[bool(given)] = float(setup.about.memory_statement(1e6, 1).split()[1])
        taken = said[True] - said[False] - 1.7e-4 * cells**2
        assert abs(taken - 5.2) <= 1.0  # rounded to MB


def test_memory_of_the_contact_problem_is_what_a_run_allocates():
    data = scene("analytic", grid=256, load={"approach": 0.008, "steps": 1},
                 micro={"model": "half-space", "finite_slopes": False},
                 output={"figures": False, "check": "none", "contact": "none"})  # fmt: skip
    run = Run(data)
    tracemalloc.start()
    list(run.load_steps())
    allocated = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    counted = run.coupling.about.contact_memory
    assert counted / 2.0 < allocated < 2.0 * counted
